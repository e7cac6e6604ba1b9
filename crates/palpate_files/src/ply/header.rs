//! Headers of PLY files: the elements and their properties.

use crate::error::MeshFileError;

pub(crate) const NAME: &str = "PLY";

/// The order of the bytes of a number, or text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }
}

/// One property of an element: a number, or a list of numbers after their count.
#[derive(Debug)]
pub(super) struct Property {
    pub name: String,
    /// Type of the count of a list.
    pub count: Option<Scalar>,
    pub scalar: Scalar,
}

/// A table of the file: `count` rows of `properties`.
#[derive(Debug)]
pub(super) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

/// The header of a PLY file.
#[derive(Debug)]
pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
}

/// Reads the header, and returns it with the bytes after it.
pub(super) fn read(bytes: &[u8]) -> Result<(Header, &[u8]), MeshFileError> {
    let mut rest = bytes;
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut line_count = 0;
    loop {
        let Some(end) = rest.iter().position(|byte| *byte == b'\n' || *byte == b'\r') else {
            return Err(not_valid("the header has no `end_header`".into()));
        };
        let (line, after) = rest.split_at(end);
        rest = after.strip_prefix(b"\r\n").or(after.get(1..)).unwrap_or_default();
        line_count += 1;
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        let wrong = || not_valid(format!("line {line_count} of the header is `{}`", line.trim()));
        match *words.as_slice() {
            ["ply"] if line_count == 1 => {}
            _ if line_count == 1 => return Err(not_valid("the first line is not `ply`".into())),
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Text,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => return Err(wrong()),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| wrong())?;
                elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", "list", count, scalar, name] => {
                let count = Some(Scalar::parse(count).ok_or_else(wrong)?);
                let scalar = Scalar::parse(scalar).ok_or_else(wrong)?;
                let element = elements.last_mut().ok_or_else(wrong)?;
                element.properties.push(Property { name: name.to_owned(), count, scalar });
            }
            ["property", scalar, name] => {
                let scalar = Scalar::parse(scalar).ok_or_else(wrong)?;
                let element = elements.last_mut().ok_or_else(wrong)?;
                element.properties.push(Property { name: name.to_owned(), count: None, scalar });
            }
            ["end_header"] => break,
            ["comment" | "obj_info", ..] | [] => {}
            _ => return Err(wrong()),
        }
    }
    let Some(encoding) = encoding else {
        return Err(not_valid("the header has no line `format`".into()));
    };
    Ok((Header { encoding, elements }, rest))
}

pub(super) fn not_valid(problem: String) -> MeshFileError {
    MeshFileError::NotValid { format: NAME, problem }
}
