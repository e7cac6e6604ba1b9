//! The two forms of a glTF file: JSON alone, or GLB, which contains JSON and a buffer.

use super::invalid::not_valid;
use crate::error::MeshFileError;

/// First bytes of a GLB file.
const MAGIC: &[u8] = b"glTF";
const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
const BINARY_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

/// Splits a file into its JSON and the buffer that a GLB file contains.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), MeshFileError> {
    let Some(rest) = bytes.strip_prefix(MAGIC) else {
        // A mark of the order of bytes may stand before JSON.
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None));
    };
    let (version, rest) = number(rest)?;
    if version != 2 {
        return Err(not_valid(format!("its version is {version}; it must be 2")));
    }
    let (_length, mut rest) = number(rest)?;
    let (mut json, mut binary) = (None, None);
    while !rest.is_empty() && (json.is_none() || binary.is_none()) {
        let (length, after) = number(rest)?;
        let (kind, after) = number(after)?;
        let Some((content, after)) = after.split_at_checked(length as usize) else {
            let held = after.len();
            return Err(not_valid(format!(
                "a chunk of {length} bytes ends after {held}, so a part of it is missing"
            )));
        };
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(content),
            BINARY_CHUNK if binary.is_none() => binary = Some(content),
            _ => {}
        }
        rest = after;
    }
    let json = json.ok_or_else(|| not_valid("it has no JSON chunk".into()))?;
    Ok((json, binary))
}

fn number(bytes: &[u8]) -> Result<(u32, &[u8]), MeshFileError> {
    let (number, rest) =
        bytes.split_first_chunk().ok_or_else(|| not_valid("it ends within the header of a chunk".into()))?;
    Ok((u32::from_le_bytes(*number), rest))
}
