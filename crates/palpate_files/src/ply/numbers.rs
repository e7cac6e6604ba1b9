//! The numbers of a PLY file, one after the other.

use super::header::{Encoding, Scalar, not_valid};
use crate::error::MeshFileError;

/// Reads the numbers after the header.
pub(super) struct Numbers<'a> {
    encoding: Encoding,
    rest: &'a [u8],
}

impl<'a> Numbers<'a> {
    pub fn new(encoding: Encoding, rest: &'a [u8]) -> Self {
        Self { encoding, rest }
    }

    /// The next number. Each type of PLY is exact in `f64`.
    pub fn next(&mut self, scalar: Scalar) -> Result<f64, MeshFileError> {
        if self.encoding == Encoding::Text {
            return self.next_word();
        }
        match scalar {
            Scalar::I8 => Ok(i8::from_le_bytes(self.take()?).into()),
            Scalar::U8 => Ok(u8::from_le_bytes(self.take()?).into()),
            Scalar::I16 => Ok(i16::from_le_bytes(self.take()?).into()),
            Scalar::U16 => Ok(u16::from_le_bytes(self.take()?).into()),
            Scalar::I32 => Ok(i32::from_le_bytes(self.take()?).into()),
            Scalar::U32 => Ok(u32::from_le_bytes(self.take()?).into()),
            Scalar::F32 => Ok(f32::from_le_bytes(self.take()?).into()),
            Scalar::F64 => Ok(f64::from_le_bytes(self.take()?)),
        }
    }

    /// The next bytes, with the lowest one first.
    fn take<const N: usize>(&mut self) -> Result<[u8; N], MeshFileError> {
        let Some((bytes, rest)) = self.rest.split_first_chunk::<N>() else {
            return Err(ends_early());
        };
        self.rest = rest;
        let mut bytes = *bytes;
        if self.encoding == Encoding::BigEndian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn next_word(&mut self) -> Result<f64, MeshFileError> {
        let rest = self.rest.trim_ascii_start();
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(length);
        self.rest = rest;
        if word.is_empty() {
            return Err(ends_early());
        }
        let word = String::from_utf8_lossy(word);
        word.parse().map_err(|_| not_valid(format!("a value is `{word}`; it must be a number")))
    }
}

fn ends_early() -> MeshFileError {
    not_valid("it ends before the last element".into())
}
