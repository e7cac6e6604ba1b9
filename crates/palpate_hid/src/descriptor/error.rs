//! Limits of report descriptors, and parse errors.

use thiserror::Error;

/// The longest descriptor taken, bytes: as Linux has it.
pub const MAX_DESCRIPTOR_BYTES: usize = 4096;
/// The longest report taken, bytes: as Linux has it.
pub const MAX_REPORT_BYTES: usize = 16_384;
/// The most fields taken of one descriptor.
pub const MAX_FIELDS: usize = 4096;

/// Why a report descriptor is not taken. Offsets count bytes from its beginning.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum DescriptorError {
    /// It is longer than any device may have.
    #[error("the report descriptor has {0} bytes; {MAX_DESCRIPTOR_BYTES} are allowed")]
    TooLong(usize),
    /// It ends within an item.
    #[error("the report descriptor ends within the item at byte {at}")]
    Truncated {
        /// Where the item begins.
        at: usize,
    },
    /// A collection ends that has not begun, or one does not end.
    #[error("collections begin and end in pairs; the one at byte {at} does not")]
    UnpairedCollection {
        /// Where the item begins; the descriptor's length where an end is missing.
        at: usize,
    },
    /// A pop without a push.
    #[error("a pop needs a push before it; the one at byte {at} has none")]
    UnpairedPop {
        /// Where the item begins.
        at: usize,
    },
    /// More is pushed, or nested deeper, than any device needs.
    #[error("the item at byte {at} is nested deeper than {allowed}")]
    TooDeep {
        /// Where the item begins.
        at: usize,
        /// How deep it may be.
        allowed: usize,
    },
    /// A report has the number 0, which is kept for devices without numbers, or one above 255.
    #[error("report numbers are 1 to 255; that at byte {at} is {id}")]
    ReportNumber {
        /// Where the item begins.
        at: usize,
        /// The number.
        id: u32,
    },
    /// Some reports have numbers and some have none.
    #[error("either all reports have numbers or none; the field at byte {at} comes before the first number")]
    Unnumbered {
        /// Where the field's item begins.
        at: usize,
    },
    /// A report is longer than any device may have.
    #[error("the report of the field at byte {at} is longer than {MAX_REPORT_BYTES} bytes")]
    ReportTooLong {
        /// Where the item begins.
        at: usize,
    },
    /// There are more fields than any device has.
    #[error("the field at byte {at} is one too many; {MAX_FIELDS} are allowed")]
    TooManyFields {
        /// Where the item begins.
        at: usize,
    },
}
