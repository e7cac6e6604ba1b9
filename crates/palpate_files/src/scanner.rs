//! Words and numbers of a volume file, one after the other, in text or in bytes.

use crate::error::MeshFileError;

/// The order of the bytes of a number, or text.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// The type of a number in bytes. Text has no types.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes of a number.
    pub const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// Reads a file from its beginning. Errors have the line of a text and the byte of a binary file.
#[derive(Clone)]
pub(crate) struct Scanner<'a> {
    format: &'static str,
    bytes: &'a [u8],
    at: usize,
    /// Beginning of the latest word, line or number.
    latest: usize,
    /// The encoding of numbers. Words and lines are text in each encoding.
    pub encoding: Encoding,
}

impl<'a> Scanner<'a> {
    /// Reads `bytes`, which are a file of the format `format` or a part of it.
    pub fn new(format: &'static str, bytes: &'a [u8], encoding: Encoding) -> Self {
        Self { format, bytes, at: 0, latest: 0, encoding }
    }

    /// The bytes that are not read.
    pub fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// Goes `count` bytes on, at most to the end.
    pub fn advance(&mut self, count: usize) {
        self.at = self.at.saturating_add(count).min(self.bytes.len());
    }

    /// Goes to the next byte that is not white space.
    pub fn skip_space(&mut self) {
        let space = self.rest().iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        self.advance(space);
    }

    /// The next word, without going on. It is empty at the end.
    pub fn peek(&self) -> &'a [u8] {
        let rest = self.rest().trim_ascii_start();
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        &rest[..length]
    }

    /// The next word.
    pub fn word(&mut self) -> Result<&'a str, MeshFileError> {
        self.skip_space();
        self.latest = self.at;
        let word = self.peek();
        if word.is_empty() {
            return Err(self.ends_early());
        }
        let text = std::str::from_utf8(word).map_err(|_| self.not_valid("a word is not text".into()))?;
        self.advance(word.len());
        Ok(text)
    }

    /// The rest of the line, without its end.
    pub fn line(&mut self) -> Result<&'a str, MeshFileError> {
        self.latest = self.at;
        let rest = self.rest();
        if rest.is_empty() {
            return Err(self.ends_early());
        }
        let length = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        let line = std::str::from_utf8(&rest[..length])
            .map_err(|_| self.not_valid("a line is not text in UTF-8".into()))?;
        self.advance(length + 1);
        Ok(line.strip_suffix('\r').unwrap_or(line))
    }

    /// The next `count` bytes.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], MeshFileError> {
        let Some(taken) = self.rest().get(..count) else { return Err(self.ends_early()) };
        self.advance(count);
        Ok(taken)
    }

    /// The next number, of the type `scalar` in bytes. Each type but the 64-bit integers is exact.
    pub fn float(&mut self, scalar: Scalar) -> Result<f64, MeshFileError> {
        if self.encoding == Encoding::Text {
            let word = self.word()?;
            return word
                .parse()
                .map_err(|_| self.not_valid(format!("a value is `{}`; it must be a number", shorten(word))));
        }
        Ok(match scalar {
            Scalar::F32 => f32::from_le_bytes(self.number()?).into(),
            Scalar::F64 => f64::from_le_bytes(self.number()?),
            _ => self.integer(scalar)? as f64,
        })
    }

    /// The next whole number, of the type `scalar` in bytes. A floating-point number must have a whole value.
    pub fn integer(&mut self, scalar: Scalar) -> Result<i64, MeshFileError> {
        if self.encoding == Encoding::Text {
            let word = self.word()?;
            return word.parse().or_else(|_| match word.parse() {
                Ok(value) => self.whole(value),
                Err(_) => {
                    Err(self.not_valid(format!("a value is `{}`; it must be a whole number", shorten(word))))
                }
            });
        }
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.number()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.number()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.number()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.number()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.number()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.number()?).into(),
            Scalar::I64 => i64::from_le_bytes(self.number()?),
            Scalar::U64 => {
                let value = u64::from_le_bytes(self.number()?);
                i64::try_from(value).map_err(|_| {
                    self.not_valid(format!("a value is {value}; it must be at most {}", i64::MAX))
                })?
            }
            Scalar::F32 | Scalar::F64 => {
                let value = self.float(scalar)?;
                self.whole(value)?
            }
        })
    }

    /// The next number, which must not be negative.
    pub fn count(&mut self, scalar: Scalar) -> Result<u64, MeshFileError> {
        let value = self.integer(scalar)?;
        u64::try_from(value)
            .map_err(|_| self.not_valid(format!("a number is {value}; it must not be negative")))
    }

    /// The next `count` floating-point numbers.
    pub fn floats(&mut self, scalar: Scalar, count: usize) -> Result<Vec<f64>, MeshFileError> {
        self.require(scalar, count)?;
        (0..count).map(|_| self.float(scalar)).collect()
    }

    /// The next `count` whole numbers.
    pub fn integers(&mut self, scalar: Scalar, count: usize) -> Result<Vec<i64>, MeshFileError> {
        self.require(scalar, count)?;
        (0..count).map(|_| self.integer(scalar)).collect()
    }

    /// Skips `count` numbers.
    pub fn skip(&mut self, scalar: Scalar, count: usize) -> Result<(), MeshFileError> {
        self.require(scalar, count)?;
        if self.encoding != Encoding::Text {
            return self.take(count.saturating_mul(scalar.size())).map(|_| ());
        }
        (0..count).try_for_each(|_| self.word().map(|_| ()))
    }

    /// Rejects a count that the rest of the file cannot have.
    fn require(&self, scalar: Scalar, count: usize) -> Result<(), MeshFileError> {
        let size = if self.encoding == Encoding::Text { 1 } else { scalar.size() };
        if count.saturating_mul(size) > self.rest().len() {
            return Err(self.ends_early());
        }
        Ok(())
    }

    /// The next bytes, with the lowest one first.
    fn number<const N: usize>(&mut self) -> Result<[u8; N], MeshFileError> {
        self.latest = self.at;
        let Some(bytes) = self.rest().first_chunk::<N>() else { return Err(self.ends_early()) };
        self.advance(N);
        let mut bytes = *bytes;
        if self.encoding == Encoding::BigEndian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn whole(&self, value: f64) -> Result<i64, MeshFileError> {
        // Beyond 2^53 not every whole number is a floating-point number.
        if value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0 {
            Ok(value as i64)
        } else {
            Err(self.not_valid(format!("a value is {value}; it must be a whole number")))
        }
    }

    fn ends_early(&self) -> MeshFileError {
        MeshFileError::VolumeNotValid {
            format: self.format,
            problem: "it ends before the last of the elements that it states".into(),
        }
    }

    /// The error `problem` of the latest word, line or number.
    pub fn not_valid(&self, problem: String) -> MeshFileError {
        let place = if self.encoding == Encoding::Text {
            let before = self.bytes.get(..self.latest).unwrap_or_default();
            format!("line {}", before.iter().filter(|byte| **byte == b'\n').count() + 1)
        } else {
            format!("byte {}", self.latest)
        };
        MeshFileError::VolumeNotValid { format: self.format, problem: format!("{place}: {problem}") }
    }
}

/// The first 40 characters of `word`, for an error.
pub(crate) fn shorten(word: &str) -> String {
    word.chars().take(40).collect()
}
