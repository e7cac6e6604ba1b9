//! Arrays of a VTU file: in text, in base64 or appended, and compressed or not.

use super::base64_stream::Base64Stream;
use super::document::{NAME, Parts, not_valid};
use crate::error::MeshFileError;
use crate::scanner::{Encoding, Scalar, Scanner};
use roxmltree::Node;
use std::borrow::Cow;

/// Compression of arrays in bytes.
#[derive(Debug, Eq, PartialEq)]
enum Compressor {
    None,
    Zlib,
    Lz4,
    /// The name of one that is not read. Arrays in text are not compressed.
    Other(String),
}

/// Bytes of an array, before and after which others may lie.
enum Source<'a> {
    Raw(&'a [u8]),
    Base64(Base64Stream<'a>),
}

impl<'a> Source<'a> {
    fn take(&mut self, count: usize) -> Result<Cow<'a, [u8]>, MeshFileError> {
        match self {
            Self::Base64(stream) => stream.take(count).map(Cow::Owned),
            Self::Raw(bytes) => match bytes.split_at_checked(count) {
                Some((taken, rest)) => {
                    *bytes = rest;
                    Ok(Cow::Borrowed(taken))
                }
                None => Err(not_valid("appended data end early".into())),
            },
        }
    }
}

/// Reads the arrays of a file.
pub(super) struct DataReader<'a> {
    parts: &'a Parts<'a>,
    encoding: Encoding,
    /// The type of the numbers before the bytes of an array.
    header: Scalar,
    compressor: Compressor,
}

impl<'a> DataReader<'a> {
    /// Reads the attributes of `<VTKFile>`.
    pub fn new(root: Node, parts: &'a Parts<'a>) -> Result<Self, MeshFileError> {
        let attribute = |name, default| root.attribute(name).unwrap_or(default);
        let encoding = match attribute("byte_order", "LittleEndian") {
            "LittleEndian" => Encoding::LittleEndian,
            "BigEndian" => Encoding::BigEndian,
            other => return Err(wrong("byte_order", other, "LittleEndian or BigEndian")),
        };
        let header = match attribute("header_type", "UInt32") {
            "UInt32" => Scalar::U32,
            "UInt64" => Scalar::U64,
            other => return Err(wrong("header_type", other, "UInt32 or UInt64")),
        };
        let compressor = match attribute("compressor", "") {
            "" => Compressor::None,
            "vtkZLibDataCompressor" => Compressor::Zlib,
            "vtkLZ4DataCompressor" => Compressor::Lz4,
            other => Compressor::Other(crate::scanner::shorten(other)),
        };
        Ok(Self { parts, encoding, header, compressor })
    }

    /// The `count` numbers of `array`.
    pub fn floats(&self, array: Node, count: usize) -> Result<Vec<f64>, MeshFileError> {
        let scalar = scalar(array)?;
        self.read(array, scalar, count, |scanner| scanner.floats(scalar, count))
    }

    /// The `count` whole numbers of `array`.
    pub fn integers(&self, array: Node, count: usize) -> Result<Vec<i64>, MeshFileError> {
        let scalar = scalar(array)?;
        self.read(array, scalar, count, |scanner| scanner.integers(scalar, count))
    }

    fn read<T>(
        &self,
        array: Node,
        scalar: Scalar,
        count: usize,
        read: impl Fn(&mut Scanner) -> Result<Vec<T>, MeshFileError>,
    ) -> Result<Vec<T>, MeshFileError> {
        let text = array.text().unwrap_or_default();
        let byte_count = count * scalar.size();
        let source = match array.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let mut scanner = Scanner::new(NAME, text.as_bytes(), Encoding::Text);
                let values = read(&mut scanner).map_err(|error| of_array(array, error))?;
                if !scanner.peek().is_empty() {
                    return Err(wrong_count(array, count));
                }
                return Ok(values);
            }
            "binary" => Source::Base64(Base64Stream::new(text.as_bytes())),
            "appended" => self.appended(array)?,
            other => return Err(wrong("format", other, "ascii, binary or appended")),
        };
        let bytes = self.decode(source, byte_count).map_err(|error| of_array(array, error))?;
        if bytes.len() != byte_count {
            return Err(wrong_count(array, count));
        }
        read(&mut Scanner::new(NAME, &bytes, self.encoding)).map_err(|error| of_array(array, error))
    }

    fn appended(&self, array: Node) -> Result<Source<'a>, MeshFileError> {
        let offset = array.attribute("offset").and_then(|text| text.trim().parse::<usize>().ok());
        let (Some(offset), Some(appended)) = (offset, self.parts.appended) else {
            let name = name(array);
            return Err(not_valid(format!(
                "array {name} is appended; it must have an offset into <AppendedData>"
            )));
        };
        let Some(bytes) = appended.get(offset..) else {
            let (name, held) = (name(array), appended.len());
            return Err(not_valid(format!("offset of array {name} is {offset}; it must be at most {held}")));
        };
        Ok(if self.parts.is_base64 { Source::Base64(Base64Stream::new(bytes)) } else { Source::Raw(bytes) })
    }

    /// The bytes of an array, of which there should be `byte_count`. It returns other bytes if their number is another one.
    fn decode(&self, mut source: Source<'a>, byte_count: usize) -> Result<Cow<'a, [u8]>, MeshFileError> {
        if let Compressor::Other(compressor) = &self.compressor {
            return Err(MeshFileError::CompressorNotRead { compressor: compressor.clone() });
        }
        let first = self.header_numbers(&mut source, 1)?[0];
        if self.compressor == Compressor::None {
            return if first == byte_count { source.take(first) } else { Ok(Cow::Borrowed(&[])) };
        }
        let sizes = self.header_numbers(&mut source, 2)?;
        let (block_count, block_size, last_size) = (first, sizes[0], sizes[1]);
        let compressed_sizes = self.header_numbers(&mut source, block_count)?;
        let full_count = if last_size == 0 { block_count } else { block_count.saturating_sub(1) };
        let total =
            full_count.saturating_mul(block_size).saturating_add(if block_count > 0 { last_size } else { 0 });
        if total != byte_count {
            return Ok(Cow::Borrowed(&[]));
        }
        let mut bytes = Vec::new();
        for (block, compressed_size) in compressed_sizes.into_iter().enumerate() {
            let size = if block < full_count { block_size } else { last_size };
            bytes.extend(self.decompress(&source.take(compressed_size)?, size)?);
        }
        Ok(Cow::Owned(bytes))
    }

    /// The next `count` numbers before the bytes of an array.
    fn header_numbers(&self, source: &mut Source, count: usize) -> Result<Vec<usize>, MeshFileError> {
        let byte_count = count.saturating_mul(self.header.size());
        let bytes = source.take(byte_count)?;
        let mut scanner = Scanner::new(NAME, &bytes, self.encoding);
        let size = |number| usize::try_from(number).unwrap_or(usize::MAX);
        (0..count).map(|_| scanner.count(self.header).map(size)).collect()
    }

    /// A block of `size` bytes.
    fn decompress(&self, block: &[u8], size: usize) -> Result<Vec<u8>, MeshFileError> {
        let broken = |problem: String| not_valid(format!("a block of compressed data is broken ({problem})"));
        let bytes = if self.compressor == Compressor::Lz4 {
            // A byte of LZ4 is at most 255 bytes of content.
            if size > block.len().saturating_mul(255).saturating_add(64) {
                return Err(broken(format!("{} bytes cannot contain {size}", block.len())));
            }
            lz4_flex::block::decompress(block, size).map_err(|error| broken(error.to_string()))?
        } else {
            miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(block, size)
                .map_err(|error| broken(error.to_string()))?
        };
        if bytes.len() != size {
            return Err(broken(format!("it has {} bytes; it must have {size}", bytes.len())));
        }
        Ok(bytes)
    }
}

fn scalar(array: Node) -> Result<Scalar, MeshFileError> {
    Ok(match array.attribute("type").unwrap_or_default() {
        "Int8" => Scalar::I8,
        "UInt8" => Scalar::U8,
        "Int16" => Scalar::I16,
        "UInt16" => Scalar::U16,
        "Int32" => Scalar::I32,
        "UInt32" => Scalar::U32,
        "Int64" => Scalar::I64,
        "UInt64" => Scalar::U64,
        "Float32" => Scalar::F32,
        "Float64" => Scalar::F64,
        other => return Err(wrong("type", other, "a type of numbers, such as Float64")),
    })
}

fn name(array: Node) -> String {
    crate::scanner::shorten(array.attribute("Name").unwrap_or("Points"))
}

/// `error`, with the name of the array.
fn of_array(array: Node, error: MeshFileError) -> MeshFileError {
    match error {
        MeshFileError::VolumeNotValid { format, problem } => {
            MeshFileError::VolumeNotValid { format, problem: format!("array {}: {problem}", name(array)) }
        }
        other => other,
    }
}

fn wrong_count(array: Node, count: usize) -> MeshFileError {
    not_valid(format!("array {} must have {count} numbers", name(array)))
}

fn wrong(attribute: &str, value: &str, allowed: &str) -> MeshFileError {
    let value = crate::scanner::shorten(value);
    not_valid(format!("an attribute {attribute} is `{value}`; it must be {allowed}"))
}
