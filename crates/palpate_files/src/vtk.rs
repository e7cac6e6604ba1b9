//! Legacy VTK files with an unstructured grid, in text and in bytes, versions 1 to 5.

mod attributes;
mod cell_types;
mod cells;
mod data_types;
mod header;
mod region_array;

use crate::error::MeshFileError;
use crate::scanner::{Encoding, Scalar, Scanner};
use crate::volume::{TetrahedralRegion, Volume, VolumeBuilder};
use attributes::Attributes;
use data_types::DataType;
use header::NAME;

#[cfg(feature = "vtu")]
pub(crate) use cells::MAX_CORNERS;
pub(crate) use cells::{Cells, push_cells};
#[cfg(feature = "vtu")]
pub(crate) use region_array::rank;

/// Reads the cells of a VTK file.
pub(crate) fn read(bytes: &[u8]) -> Result<Volume, MeshFileError> {
    let mut scanner = Scanner::new(NAME, bytes, Encoding::Text);
    let encoding = header::read(&mut scanner)?;
    scanner.encoding = encoding;
    let mut builder = VolumeBuilder::new(NAME);
    let mut cells = None;
    let mut types = None;
    let mut attributes = Attributes::default();
    while !scanner.peek().is_empty() {
        match scanner.word()?.to_ascii_uppercase().as_str() {
            "POINTS" => {
                let line = scanner.line()?;
                let mut words = line.split_whitespace();
                let count = count_word(&scanner, "number of nodes", words.next())?;
                let count = VolumeBuilder::check_count("number of nodes", count)?;
                let scalar = match words.next().and_then(DataType::parse) {
                    Some(DataType::Number(scalar)) => scalar,
                    _ => return Err(scanner.not_valid("POINTS must have a type of numbers".into())),
                };
                if !builder.nodes().is_empty() {
                    return Err(scanner.not_valid("it has two sections POINTS".into()));
                }
                let positions = scanner.floats(scalar, 3 * count)?;
                positions.as_chunks::<3>().0.iter().for_each(|position| builder.push_node(*position));
            }
            "CELLS" => cells = Some(read_cells(&mut scanner)?),
            "CELL_TYPES" => {
                let line = scanner.line()?;
                let count = count_word(&scanner, "number of cells", line.split_whitespace().next())?;
                let count = VolumeBuilder::check_count("number of cells", count)?;
                types = Some(scanner.integers(Scalar::I32, count)?);
            }
            keyword => attributes.read(keyword, &mut scanner)?,
        }
    }
    let (Some(cells), Some(types)) = (cells, types) else {
        let problem = "it must have the sections CELLS and CELL_TYPES".into();
        return Err(MeshFileError::VolumeNotValid { format: NAME, problem });
    };
    push_cells(&mut builder, NAME, 0, &cells, &types, attributes.into_regions().as_deref())?;
    builder.finish(|[number, _]| TetrahedralRegion { number, name: None })
}

/// Reads the section `CELLS`: lists after their lengths, or offsets and nodes since version 5.
fn read_cells(scanner: &mut Scanner) -> Result<Cells, MeshFileError> {
    let line = scanner.line()?;
    let mut words = line.split_whitespace();
    let count = count_word(scanner, "number of cells", words.next())?;
    let size = count_word(scanner, "size of CELLS", words.next())?;
    let size = usize::try_from(size).unwrap_or(usize::MAX);
    if scanner.peek() == b"OFFSETS" {
        let count = VolumeBuilder::check_count("number of offsets", count)?;
        let offsets = read_numbers(scanner, "OFFSETS", count)?;
        let nodes = read_numbers(scanner, "CONNECTIVITY", size)?;
        return Cells::new(NAME, offsets, nodes);
    }
    let count = VolumeBuilder::check_count("number of cells", count)?;
    let numbers = scanner.integers(Scalar::I32, size)?;
    let mut offsets = vec![0];
    let mut nodes = Vec::new();
    let mut rest = numbers.as_slice();
    for _ in 0..count {
        let cell = rest.split_first().and_then(|(length, others)| {
            let length = usize::try_from(*length).ok()?;
            Some((others.get(..length)?, others.get(length..)?))
        });
        let Some((cell, others)) = cell else {
            return Err(
                scanner.not_valid(format!("the {count} cells do not fit into the {size} numbers of CELLS"))
            );
        };
        nodes.extend_from_slice(cell);
        offsets.push(nodes.len() as i64);
        rest = others;
    }
    Cells::new(NAME, offsets, nodes)
}

/// Reads an array of whole numbers with a keyword and a type.
fn read_numbers(scanner: &mut Scanner, keyword: &str, count: usize) -> Result<Vec<i64>, MeshFileError> {
    scanner.skip_space();
    let line = scanner.line()?;
    let mut words = line.split_whitespace();
    match (words.next(), words.next().and_then(DataType::parse)) {
        (Some(word), Some(DataType::Number(scalar))) if word == keyword => scanner.integers(scalar, count),
        _ => Err(scanner.not_valid(format!("CELLS must have the array {keyword} with a type of numbers"))),
    }
}

/// A count in a line of keywords.
fn count_word(scanner: &Scanner, of: &str, word: Option<&str>) -> Result<u64, MeshFileError> {
    let word = word.unwrap_or_default();
    word.parse().map_err(|_| {
        let word = crate::scanner::shorten(word);
        scanner.not_valid(format!("the {of} is `{word}`; it must be a whole number from 0"))
    })
}
