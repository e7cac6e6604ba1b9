//! Data of nodes and cells: the regions of cells are read, everything else is skipped.

use super::data_types::DataType;
use super::region_array::rank;
use crate::error::MeshFileError;
use crate::scanner::{Encoding, Scalar, Scanner, shorten};

/// What the data belong to.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
enum Owner {
    /// The whole grid, before any other data.
    #[default]
    Grid,
    Nodes,
    Cells,
}

/// An array of data.
struct Array<'a> {
    name: &'a str,
    components: usize,
    rows: usize,
    data_type: DataType,
}

/// The data of a grid.
#[derive(Default)]
pub(super) struct Attributes {
    owner: Owner,
    /// Nodes or cells that the data belong to.
    count: usize,
    /// Rank of the name of the array of regions, and its values.
    regions: Option<(usize, Vec<i64>)>,
}

impl Attributes {
    /// The region of each cell.
    pub fn into_regions(self) -> Option<Vec<i64>> {
        self.regions.map(|(_, values)| values)
    }

    /// Reads the section that begins with `keyword`, which is in upper case.
    pub fn read(&mut self, keyword: &str, scanner: &mut Scanner) -> Result<(), MeshFileError> {
        if keyword == "METADATA" {
            return skip_metadata(scanner);
        }
        let line = scanner.line()?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let name = words.first().copied().unwrap_or_default();
        let wrong = |scanner: &Scanner| {
            scanner.not_valid(format!("`{}` is not valid", shorten(&format!("{keyword} {}", line.trim()))))
        };
        let number = |place: usize| words.get(place).and_then(|word| word.parse::<usize>().ok());
        let data_type = |place: usize| words.get(place).and_then(|word| DataType::parse(word));
        let mut rows = self.count;
        let (components, data_type) = match keyword {
            "POINT_DATA" | "CELL_DATA" => {
                self.owner = if keyword == "CELL_DATA" { Owner::Cells } else { Owner::Nodes };
                self.count = number(0).ok_or_else(|| wrong(scanner))?;
                return Ok(());
            }
            "FIELD" => {
                let count = number(1).ok_or_else(|| wrong(scanner))?;
                return self.read_field(count, scanner);
            }
            "SCALARS" => (if words.len() > 2 { number(2) } else { Some(1) }, data_type(1)),
            // Four bytes, or four numbers of a text.
            "LOOKUP_TABLE" => {
                rows = number(1).ok_or_else(|| wrong(scanner))?;
                (Some(4), Some(DataType::Number(Scalar::U8)))
            }
            "COLOR_SCALARS" => (number(1), Some(DataType::Number(Scalar::U8))),
            "VECTORS" | "NORMALS" => (Some(3), data_type(1)),
            "TEXTURE_COORDINATES" => (number(1), data_type(2)),
            "TENSORS" => (Some(9), data_type(1)),
            "TENSORS6" => (Some(6), data_type(1)),
            "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => (Some(1), data_type(1)),
            _ => {
                let word = shorten(keyword);
                return Err(scanner.not_valid(format!("`{word}` is no keyword of an unstructured grid")));
            }
        };
        let (Some(components), Some(data_type)) = (components, data_type) else { return Err(wrong(scanner)) };
        if keyword == "SCALARS" && scanner.peek().eq_ignore_ascii_case(b"LOOKUP_TABLE") {
            scanner.skip_space();
            scanner.line()?;
        }
        self.read_array(&Array { name, components, rows, data_type }, scanner)
    }

    fn read_field(&mut self, count: usize, scanner: &mut Scanner) -> Result<(), MeshFileError> {
        for _ in 0..count {
            while scanner.peek() == b"METADATA" {
                scanner.word()?;
                skip_metadata(scanner)?;
            }
            scanner.skip_space();
            let line = scanner.line()?;
            let words: Vec<&str> = line.split_whitespace().collect();
            let number = |place: usize| words.get(place).and_then(|word| word.parse::<usize>().ok());
            let data_type = words.get(3).and_then(|word| DataType::parse(word));
            let (Some(components), Some(rows), Some(data_type)) = (number(1), number(2), data_type) else {
                let problem =
                    format!("an array of a field is `{}`; it must have a type and sizes", shorten(line));
                return Err(scanner.not_valid(problem));
            };
            let name = words.first().copied().unwrap_or_default();
            self.read_array(&Array { name, components, rows, data_type }, scanner)?;
        }
        Ok(())
    }

    /// Reads the array if it contains the regions of cells, and skips it otherwise.
    fn read_array(&mut self, array: &Array, scanner: &mut Scanner) -> Result<(), MeshFileError> {
        let Array { components, rows, data_type, .. } = *array;
        let count = components.saturating_mul(rows);
        let scalar = match data_type {
            DataType::Text => return skip_texts(count, scanner),
            DataType::Bit if scanner.encoding != Encoding::Text => {
                return scanner.skip(Scalar::U8, count.div_ceil(8));
            }
            DataType::Bit => Scalar::U8,
            DataType::Number(scalar) => scalar,
        };
        let is_of_cells = self.owner == Owner::Cells && components == 1 && rows == self.count;
        let best = self.regions.as_ref().map_or(usize::MAX, |(rank, _)| *rank);
        if let Some(rank) = rank(array.name).filter(|rank| is_of_cells && *rank < best) {
            let mut values = scanner.clone();
            // An array of fractions contains no regions.
            if let Ok(regions) = values.integers(scalar, count) {
                *scanner = values;
                self.regions = Some((rank, regions));
                return Ok(());
            }
        }
        scanner.skip(scalar, count)
    }
}

/// Skips information about an array, which ends with an empty line.
fn skip_metadata(scanner: &mut Scanner) -> Result<(), MeshFileError> {
    let mut is_first = true;
    while !scanner.rest().is_empty() {
        let is_empty = scanner.line()?.trim().is_empty();
        if is_empty && !is_first {
            break;
        }
        is_first = false;
    }
    Ok(())
}

/// Skips an array of text: a line for each value, or its length in one, two, four or eight bytes and then its bytes.
fn skip_texts(count: usize, scanner: &mut Scanner) -> Result<(), MeshFileError> {
    for _ in 0..count {
        if scanner.encoding == Encoding::Text {
            scanner.line()?;
            continue;
        }
        // The first two bits state how many bytes the length has.
        let first = scanner.rest().first().copied().unwrap_or_default();
        let bytes = [8, 4, 2, 1][usize::from(first >> 6)];
        let mut length =
            scanner.take(bytes)?.iter().fold(0_u64, |length, byte| length << 8 | u64::from(*byte));
        length &= u64::MAX >> (64 - 8 * bytes + 2);
        scanner.take(usize::try_from(length).unwrap_or(usize::MAX))?;
    }
    Ok(())
}
