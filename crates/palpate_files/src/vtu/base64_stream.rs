//! Bytes in base64, one after the other.

use super::document::not_valid;
use crate::error::MeshFileError;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Characters that are decoded at a time, a multiple of 4.
const RUN: usize = 4096;

/// Decodes as many characters as are needed. A part may end with padding, and another follow: VTK encodes a header separately.
pub(super) struct Base64Stream<'a> {
    text: &'a [u8],
    /// Bytes that are decoded and not taken.
    decoded: Vec<u8>,
}

impl<'a> Base64Stream<'a> {
    pub fn new(text: &'a [u8]) -> Self {
        Self { text, decoded: Vec::new() }
    }

    /// The next `count` bytes.
    pub fn take(&mut self, count: usize) -> Result<Vec<u8>, MeshFileError> {
        while self.decoded.len() < count {
            let missing = (count - self.decoded.len()).div_ceil(3).saturating_mul(4);
            let mut run = [0; RUN];
            let mut length = 0;
            while length < missing.min(RUN) {
                let Some((character, rest)) = self.text.split_first() else { break };
                self.text = rest;
                if character.is_ascii_whitespace() {
                    continue;
                }
                run[length] = *character;
                length += 1;
                if *character == b'=' && length % 4 == 0 {
                    break;
                }
            }
            if length == 0 {
                return Err(not_valid("data in base64 end early".into()));
            }
            STANDARD
                .decode_vec(&run[..length], &mut self.decoded)
                .map_err(|error| not_valid(format!("data in base64 are broken ({error})")))?;
        }
        let rest = self.decoded.split_off(count);
        Ok(std::mem::replace(&mut self.decoded, rest))
    }
}
