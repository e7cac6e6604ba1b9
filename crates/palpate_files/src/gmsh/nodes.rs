//! The section of nodes.

use super::header::{Layout, NAME, Version};
use crate::error::MeshFileError;
use crate::scanner::{Scalar, Scanner};
use crate::volume::{NodeNumbers, VolumeBuilder};

/// The count of a section of version 2: a line of text in each encoding.
pub(super) fn count_line(scanner: &mut Scanner) -> Result<u64, MeshFileError> {
    scanner.skip_space();
    let line = scanner.line()?.trim();
    line.parse().map_err(|_| {
        let word = crate::scanner::shorten(line);
        scanner.not_valid(format!("a count is `{word}`; it must be a whole number from 0"))
    })
}

/// Reads the section `$Nodes`: adds the nodes to `builder`, and returns their numbers.
pub(super) fn read(
    scanner: &mut Scanner,
    layout: Layout,
    builder: &mut VolumeBuilder,
) -> Result<NodeNumbers, MeshFileError> {
    let mut numbers = Vec::new();
    match layout.version {
        Version::V2 => {
            let count = VolumeBuilder::check_count("number of nodes", count_line(scanner)?)?;
            for _ in 0..count {
                numbers.push(scanner.count(Scalar::I32)?);
                builder.push_node(position(scanner)?);
            }
        }
        Version::V40 | Version::V41 => read_blocks(scanner, layout, builder, &mut numbers)?,
    }
    NodeNumbers::new(NAME, &numbers, builder.nodes())
}

fn read_blocks(
    scanner: &mut Scanner,
    layout: Layout,
    builder: &mut VolumeBuilder,
    numbers: &mut Vec<u64>,
) -> Result<(), MeshFileError> {
    let block_count = scanner.count(layout.size)?;
    let count = VolumeBuilder::check_count("number of nodes", scanner.count(layout.size)?)?;
    if layout.version == Version::V41 {
        // The smallest and the largest number.
        scanner.skip(layout.size, 2)?;
    }
    for _ in 0..block_count {
        let first = scanner.integer(Scalar::I32)?;
        let second = scanner.integer(Scalar::I32)?;
        // The entity comes first in version 4.0, its dimension in version 4.1.
        let dimension = if layout.version == Version::V40 { second } else { first };
        if !(0..=3).contains(&dimension) {
            return Err(scanner.not_valid(format!("a dimension is {dimension}; it must be 0 to 3")));
        }
        let is_parametric = scanner.integer(Scalar::I32)? != 0;
        let parameters = if is_parametric { dimension as usize } else { 0 };
        let in_block = scanner.count(layout.size)?;
        if in_block > (count - numbers.len()) as u64 {
            return Err(scanner.not_valid(format!("the blocks of $Nodes have more than {count} nodes")));
        }
        if layout.version == Version::V41 {
            for _ in 0..in_block {
                numbers.push(scanner.count(layout.size)?);
            }
        }
        for _ in 0..in_block {
            if layout.version == Version::V40 {
                numbers.push(scanner.count(Scalar::I32)?);
            }
            builder.push_node(position(scanner)?);
            scanner.skip(Scalar::F64, parameters)?;
        }
    }
    if numbers.len() < count {
        let held = numbers.len();
        return Err(scanner.not_valid(format!("$Nodes states {count} nodes and has {held}")));
    }
    Ok(())
}

fn position(scanner: &mut Scanner) -> Result<[f64; 3], MeshFileError> {
    Ok([scanner.float(Scalar::F64)?, scanner.float(Scalar::F64)?, scanner.float(Scalar::F64)?])
}
