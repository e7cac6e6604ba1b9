//! The XML of a VTU file, and the data that are appended to it.

use crate::error::MeshFileError;
use roxmltree::{Document, ParsingOptions};

pub(super) const NAME: &str = "VTU";
/// Maximum number of elements, attributes and texts of the XML.
const MAX_XML_NODES: u32 = 1_000_000;

/// A file, divided at the data that are appended.
pub(super) struct Parts<'a> {
    /// The XML; without the appended data, which need not be text.
    xml: std::borrow::Cow<'a, str>,
    /// What follows the mark `_` of the appended data.
    pub appended: Option<&'a [u8]>,
    /// Whether the appended data are in base64.
    pub is_base64: bool,
}

impl<'a> Parts<'a> {
    pub fn new(bytes: &'a [u8]) -> Result<Self, MeshFileError> {
        const TAG: &[u8] = b"<AppendedData";
        let text =
            |bytes| std::str::from_utf8(bytes).map_err(|_| not_valid("its XML is not in UTF-8".into()));
        let Some(start) = bytes.windows(TAG.len()).position(|word| word == TAG) else {
            return Ok(Self { xml: text(bytes)?.into(), appended: None, is_base64: false });
        };
        let (before, rest) = bytes.split_at(start);
        let Some(end) = rest.iter().position(|byte| *byte == b'>') else {
            return Err(not_valid("it ends within <AppendedData".into()));
        };
        let (tag, data) = rest.split_at(end + 1);
        let data = data.trim_ascii_start();
        let appended = data.strip_prefix(b"_");
        let is_base64 = tag.windows(6).any(|word| word == b"base64");
        Ok(Self { xml: format!("{}</VTKFile>", text(before)?).into(), appended, is_base64 })
    }
}

/// The elements of the XML.
pub(super) fn parse<'a>(parts: &'a Parts) -> Result<Document<'a>, MeshFileError> {
    let options = ParsingOptions { nodes_limit: MAX_XML_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(&parts.xml, options)
        .map_err(|error| not_valid(format!("its XML is wrong ({error})")))
}

pub(super) fn not_valid(problem: String) -> MeshFileError {
    MeshFileError::VolumeNotValid { format: NAME, problem }
}
