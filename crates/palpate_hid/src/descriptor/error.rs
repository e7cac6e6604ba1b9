//! Limits and errors of report descriptors.

use thiserror::Error;

/// Maximum length of a descriptor, bytes, as on Linux.
pub const MAX_DESCRIPTOR_BYTES: usize = 4096;
/// Maximum length of a report, bytes, as on Linux.
pub const MAX_REPORT_BYTES: usize = 16_384;
/// Maximum number of fields of a descriptor.
pub const MAX_FIELDS: usize = 4096;

/// Error while parsing a report descriptor. Offsets count bytes from its beginning.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum DescriptorError {
    /// The descriptor is too long.
    #[error("the report descriptor has {0} bytes; it must have at most {MAX_DESCRIPTOR_BYTES}")]
    TooLong(usize),
    /// The descriptor ends within an item.
    #[error("the report descriptor ends within the item at byte {at}")]
    Truncated {
        /// Offset of the item.
        at: usize,
    },
    /// A collection ends without a begin, or has no end.
    #[error("the begin or end of a collection at byte {at} has no counterpart")]
    UnpairedCollection {
        /// Offset of the item; the descriptor's length for a missing end.
        at: usize,
    },
    /// A pop has no matching push.
    #[error("the pop at byte {at} has no matching push")]
    UnpairedPop {
        /// Offset of the item.
        at: usize,
    },
    /// The push stack or the collections are nested too deeply.
    #[error("the item at byte {at} is nested too deeply; at most {allowed} levels are allowed")]
    TooDeep {
        /// Offset of the item.
        at: usize,
        /// Maximum depth.
        allowed: usize,
    },
    /// A report has the ID 0, which is reserved for devices without report IDs, or one above 255.
    #[error("the report ID at byte {at} is {id}; it must be 1 to 255")]
    ReportNumber {
        /// Offset of the item.
        at: usize,
        /// Rejected ID.
        id: u32,
    },
    /// Some reports have IDs and some do not.
    #[error("the field at byte {at} has no report ID; either all reports or none must have one")]
    Unnumbered {
        /// Offset of the field's item.
        at: usize,
    },
    /// A report is too long.
    #[error("the field at byte {at} extends its report beyond the maximum of {MAX_REPORT_BYTES} bytes")]
    ReportTooLong {
        /// Offset of the item.
        at: usize,
    },
    /// The descriptor has too many fields.
    #[error("the field at byte {at} exceeds the maximum of {MAX_FIELDS} fields")]
    TooManyFields {
        /// Offset of the item.
        at: usize,
    },
}
