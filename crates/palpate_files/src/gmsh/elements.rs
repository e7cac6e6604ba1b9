//! The section of elements.

use super::element_types::element_type;
use super::entities::Entities;
use super::header::{Layout, NAME, Version};
use super::nodes::count_line;
use crate::error::MeshFileError;
use crate::scanner::{Encoding, Scalar, Scanner};
use crate::volume::{NodeNumbers, RegionKey, Shape, VolumeBuilder};

/// Elements of one type.
#[derive(Clone, Copy)]
struct Block {
    shape: Shape,
    node_count: usize,
    /// The type of the numbers of nodes.
    number: Scalar,
}

impl Block {
    fn new(kind: i64, count: u64, number: Scalar) -> Result<Self, MeshFileError> {
        let Some((shape, node_count)) = element_type(kind) else {
            return Err(MeshFileError::ElementNotRead { format: NAME, element: kind.to_string(), count });
        };
        Ok(Self { shape, node_count, number })
    }

    /// Reads the nodes of an element, after its number and its tags.
    fn read(
        self,
        scanner: &mut Scanner,
        numbers: &NodeNumbers,
        region: RegionKey,
        builder: &mut VolumeBuilder,
    ) -> Result<(), MeshFileError> {
        if !self.shape.is_solid() {
            builder.leave_out(self.shape);
            return scanner.skip(self.number, self.node_count);
        }
        let corner_count = self.shape.corner_count();
        let mut corners = [0; 8];
        let corners = &mut corners[..corner_count];
        for corner in corners.iter_mut() {
            let number = scanner.count(self.number)?;
            *corner = numbers.index(number).ok_or_else(|| builder.node_missing(number))?;
        }
        scanner.skip(self.number, self.node_count - corner_count)?;
        builder.push(self.shape, corners, self.node_count > corner_count, region)
    }
}

/// Reads the section `$Elements`, and adds the elements to `builder`.
pub(super) fn read(
    scanner: &mut Scanner,
    layout: Layout,
    numbers: &NodeNumbers,
    entities: &Entities,
    builder: &mut VolumeBuilder,
) -> Result<(), MeshFileError> {
    match layout.version {
        Version::V2 => read_version_2(scanner, numbers, builder),
        Version::V40 | Version::V41 => read_blocks(scanner, layout, numbers, entities, builder),
    }
}

fn read_version_2(
    scanner: &mut Scanner,
    numbers: &NodeNumbers,
    builder: &mut VolumeBuilder,
) -> Result<(), MeshFileError> {
    let count = count_line(scanner)?;
    let mut held = 0;
    while held < count {
        // Binary files have a header for several elements, text files one for each.
        let is_text = scanner.encoding == Encoding::Text;
        if is_text {
            scanner.skip(Scalar::I32, 1)?;
        }
        let kind = scanner.integer(Scalar::I32)?;
        let in_block = if is_text { 1 } else { scanner.count(Scalar::I32)? };
        let tag_count = scanner.count(Scalar::I32)?;
        if in_block > count - held {
            return Err(scanner.not_valid(format!("the blocks of $Elements have more than {count} elements")));
        }
        held += in_block;
        let block = Block::new(kind, in_block, Scalar::I32)?;
        for _ in 0..in_block {
            if !is_text {
                scanner.skip(Scalar::I32, 1)?;
            }
            let mut region = [0; 2];
            for place in 0..tag_count {
                let tag = scanner.integer(Scalar::I32)?;
                match place {
                    // A negative number reverses the orientation of the group.
                    0 => region[0] = tag.saturating_abs(),
                    1 => region[1] = tag,
                    _ => {}
                }
            }
            block.read(scanner, numbers, region, builder)?;
        }
    }
    Ok(())
}

fn read_blocks(
    scanner: &mut Scanner,
    layout: Layout,
    numbers: &NodeNumbers,
    entities: &Entities,
    builder: &mut VolumeBuilder,
) -> Result<(), MeshFileError> {
    let block_count = scanner.count(layout.size)?;
    let count = scanner.count(layout.size)?;
    let number = if layout.version == Version::V40 { Scalar::I32 } else { layout.size };
    if layout.version == Version::V41 {
        // The smallest and the largest number.
        scanner.skip(layout.size, 2)?;
    }
    let mut held = 0;
    for _ in 0..block_count {
        let first = scanner.integer(Scalar::I32)?;
        let second = scanner.integer(Scalar::I32)?;
        // The entity comes first in version 4.0, its dimension in version 4.1.
        let entity = if layout.version == Version::V40 { first } else { second };
        let kind = scanner.integer(Scalar::I32)?;
        let in_block = scanner.count(layout.size)?;
        if in_block > count - held {
            return Err(scanner.not_valid(format!("the blocks of $Elements have more than {count} elements")));
        }
        held += in_block;
        let block = Block::new(kind, in_block, number)?;
        for _ in 0..in_block {
            scanner.skip(number, 1)?;
            block.read(scanner, numbers, entities.region(entity), builder)?;
        }
    }
    if held < count {
        return Err(scanner.not_valid(format!("$Elements states {count} elements and has {held}")));
    }
    Ok(())
}
