//! Buffers of a glTF file and the views of them. A buffer is read when a mesh needs it.

use super::document::{Buffer, BufferView, Document, Meshopt};
use super::invalid::not_valid;
use super::meshopt;
use crate::error::MeshFileError;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;
use std::cell::{Cell, OnceCell};
use std::io::{Error, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Maximum size of all decoded views of a file, in bytes.
const MAX_DECODED_BYTES: usize = 1 << 30;

/// How buffers are read that are files of their own.
#[derive(Clone, Copy)]
pub(crate) enum BufferFiles<'a> {
    /// They are rejected.
    Rejected,
    /// From a folder, to which their paths are relative.
    Folder(&'a Path),
    /// By a function of their path relative to the glTF file.
    Function(&'a dyn Fn(&Path) -> Result<Vec<u8>, Error>),
}

/// The buffers and views of a document.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    /// The buffer that a GLB file contains.
    binary: Option<&'a [u8]>,
    files: BufferFiles<'a>,
    loaded: Vec<OnceCell<Cow<'a, [u8]>>>,
    /// Contents of compressed views.
    decoded: Vec<OnceCell<Vec<u8>>>,
    decoded_bytes: Cell<usize>,
}

impl<'a> Buffers<'a> {
    pub fn new(document: &'a Document, binary: Option<&'a [u8]>, files: BufferFiles<'a>) -> Self {
        Self {
            document,
            binary,
            files,
            loaded: document.buffers.iter().map(|_| OnceCell::new()).collect(),
            decoded: document.buffer_views.iter().map(|_| OnceCell::new()).collect(),
            decoded_bytes: Cell::new(0),
        }
    }

    /// Bytes of the view `index`, decoded, and the distance between its elements, if the view states it.
    pub fn view(&self, index: usize) -> Result<(&[u8], Option<usize>), MeshFileError> {
        let (Some(view), Some(decoded)) = (self.document.buffer_views.get(index), self.decoded.get(index))
        else {
            return Err(not_valid(format!("buffer view {index} does not exist")));
        };
        let stride = view.byte_stride.filter(|stride| *stride > 0);
        let extensions = &view.extensions;
        let compressed = match (&extensions.ext_meshopt, &extensions.khr_meshopt) {
            (Some(compressed), _) => Some((compressed, meshopt::EXT_NAME)),
            (None, Some(compressed)) => Some((compressed, meshopt::KHR_NAME)),
            (None, None) => None,
        };
        let Some((compressed, extension)) = compressed else {
            return Ok((self.slice(view.buffer, view.byte_offset, view.byte_length)?, stride));
        };
        if !meshopt::IS_BUILT && self.has_fallback(view) {
            return Ok((self.slice(view.buffer, view.byte_offset, view.byte_length)?, stride));
        }
        if decoded.get().is_none() {
            let content = self.decode(view, compressed, extension)?;
            // Another value cannot be there: it was absent above.
            let _ = decoded.set(content);
        }
        Ok((decoded.get().map(Vec::as_slice).unwrap_or_default(), stride))
    }

    /// True where the content of a compressed view is present without compression as well.
    fn has_fallback(&self, view: &BufferView) -> bool {
        let buffer = self.document.buffers.get(view.buffer);
        buffer.is_some_and(|buffer| buffer.uri.is_some())
            || (view.buffer == 0 && self.binary.is_some_and(|binary| !binary.is_empty()))
    }

    fn decode(
        &self,
        view: &BufferView,
        compressed: &Meshopt,
        extension: &'static str,
    ) -> Result<Vec<u8>, MeshFileError> {
        let source = self.slice(compressed.buffer, compressed.byte_offset, compressed.byte_length)?;
        let size = compressed.count.saturating_mul(compressed.byte_stride);
        let total = self.decoded_bytes.get().saturating_add(size);
        if total > MAX_DECODED_BYTES {
            let (value, max) = (total as u64, MAX_DECODED_BYTES as u64);
            return Err(MeshFileError::TooLarge { what: "number of decoded bytes", value, max });
        }
        self.decoded_bytes.set(total);
        let content = meshopt::decode(compressed, source, extension)?;
        if content.len() < view.byte_length {
            let problem =
                format!("it has {} bytes decoded and must have {}", content.len(), view.byte_length);
            return Err(MeshFileError::CannotBeDecoded { extension, problem });
        }
        Ok(content)
    }

    /// `length` bytes of a buffer from `offset`.
    fn slice(&self, buffer: usize, offset: usize, length: usize) -> Result<&[u8], MeshFileError> {
        let bytes = self.buffer(buffer)?;
        let end = offset.checked_add(length);
        end.and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
            let held = bytes.len();
            not_valid(format!(
                "a view has {length} bytes from {offset} of buffer {buffer}, which has {held} bytes"
            ))
        })
    }

    fn buffer(&self, index: usize) -> Result<&[u8], MeshFileError> {
        let (Some(buffer), Some(loaded)) = (self.document.buffers.get(index), self.loaded.get(index)) else {
            return Err(not_valid(format!("buffer {index} does not exist")));
        };
        if loaded.get().is_none() {
            let content = self.load(index, buffer)?;
            // Another value cannot be there: it was absent above.
            let _ = loaded.set(content);
        }
        Ok(loaded.get().map(Cow::as_ref).unwrap_or_default())
    }

    fn load(&self, index: usize, buffer: &Buffer) -> Result<Cow<'a, [u8]>, MeshFileError> {
        let Some(uri) = &buffer.uri else {
            let binary = self.binary.filter(|_| index == 0);
            return binary.map(Cow::Borrowed).ok_or_else(|| {
                not_valid(format!(
                    "buffer {index} has no `uri`, and the file does not contain a buffer for it"
                ))
            });
        };
        if let Some(data) = uri.strip_prefix("data:") {
            let Some((_, text)) = data.split_once(";base64,") else {
                return Err(not_valid(format!("the data URI of buffer {index} is not in base64")));
            };
            let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
            let content = GeneralPurpose::new(&STANDARD, config).decode(text.trim());
            let content = content
                .map_err(|cause| not_valid(format!("the data URI of buffer {index} is broken: {cause}")))?;
            return Ok(Cow::Owned(content));
        }
        let not_reachable =
            || MeshFileError::BufferNotReachable { buffer: index, uri: uri.chars().take(80).collect() };
        let relative = relative_path(uri).ok_or_else(not_reachable)?;
        let (path, content) = match self.files {
            BufferFiles::Rejected => return Err(not_reachable()),
            BufferFiles::Folder(folder) => {
                let path = folder.join(relative);
                let content = read_start(&path, buffer.byte_length);
                (path, content)
            }
            BufferFiles::Function(read) => {
                let content = read(&relative);
                (relative, content)
            }
        };
        content.map(Cow::Owned).map_err(|cause| MeshFileError::MissingBuffer { buffer: index, path, cause })
    }
}

/// Path of a buffer that is a file of its own, relative to the glTF file. `None` for data and for an address elsewhere.
pub(super) fn relative_path(uri: &str) -> Option<PathBuf> {
    if uri.starts_with("data:") || uri.contains("://") {
        return None;
    }
    let path = PathBuf::from(without_escapes(uri));
    path.is_relative().then_some(path)
}

/// At most the first `length` bytes of a file.
fn read_start(path: &Path, length: usize) -> Result<Vec<u8>, Error> {
    let file = std::fs::File::open(path)?;
    if !file.metadata()?.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is not a file"));
    }
    let mut content = Vec::new();
    file.take(length as u64).read_to_end(&mut content)?;
    Ok(content)
}

/// A URI with its escapes, such as `%20`, replaced by the characters.
fn without_escapes(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        let code = after.get(..2).filter(|_| *first == b'%');
        let code = code.and_then(|code| u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok());
        bytes.push(code.unwrap_or(*first));
        rest = if code.is_some() { after.get(2..).unwrap_or_default() } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
