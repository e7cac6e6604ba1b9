//! Report descriptors: which reports a device has, and where in them each usage lies.
//!
//! Source: *Device Class Definition for Human Interface Devices (HID)*, version 1.11, USB Implementers' Forum, chapters 5.4 to 6.2.2.

mod field;
mod items;
mod parse;

pub use field::{Field, Usage, UsageRange};

use thiserror::Error;

/// The longest descriptor taken, bytes: as Linux has it.
pub const LONGEST_DESCRIPTOR: usize = 4096;
/// The longest report taken, bytes: as Linux has it.
pub const LONGEST_REPORT: usize = 16_384;
/// The most fields taken of one descriptor.
pub const MOST_FIELDS: usize = 4096;

/// Which way a report goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ReportKind {
    /// From the device, by itself.
    Input,
    /// To the device.
    Output,
    /// Either way, when asked for.
    Feature,
}

/// What a device says of its reports.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct ReportDescriptor {
    reports: Vec<Report>,
    collections: Vec<Collection>,
}

/// One report: its fields in the order in which they lie.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Which way it goes.
    pub kind: ReportKind,
    /// Its number, which comes before its data; 0 for a device whose reports have none.
    pub id: u8,
    /// What is in it.
    pub fields: Vec<Field>,
    bits: usize,
}

/// Fields that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collection {
    /// What it is.
    pub usage: Usage,
    /// The collection in which it lies; `None` at the top.
    pub parent: Option<usize>,
}

impl Report {
    /// Length of its data, bytes, without its number.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bits.div_ceil(8)
    }

    /// The field with `usage`, the first if there are several. Fields that only fill the report are none: nothing is read from them, and
    /// nothing put there.
    #[must_use]
    pub fn field(&self, usage: Usage) -> Option<&Field> {
        self.fields.iter().find(|field| !field.is_constant && field.has(usage))
    }
}

impl ReportDescriptor {
    /// Reads a descriptor as the device gives it.
    ///
    /// # Errors
    /// [`DescriptorError`]. Whatever the bytes are, it neither panics nor asks for more than a few MB.
    pub fn parse(bytes: &[u8]) -> Result<Self, DescriptorError> {
        parse::parse(bytes)
    }

    /// Its reports, in the order in which they are first named.
    #[must_use]
    pub fn reports(&self) -> &[Report] {
        &self.reports
    }

    /// Whether each report is led by its number.
    #[must_use]
    pub fn is_numbered(&self) -> bool {
        self.reports.iter().any(|report| report.id != 0)
    }

    /// The report of `kind` with the number `id`.
    #[must_use]
    pub fn report(&self, kind: ReportKind, id: u8) -> Option<&Report> {
        self.reports.iter().find(|report| report.kind == kind && report.id == id)
    }

    /// The usages of the collections at the top: what the device is.
    pub fn applications(&self) -> impl Iterator<Item = Usage> {
        self.collections.iter().filter(|collection| collection.parent.is_none()).map(|top| top.usage)
    }

    /// The collections in which `field` lies, innermost first.
    pub fn around(&self, field: &Field) -> impl Iterator<Item = Usage> {
        let next = |at: &usize| self.collections.get(*at).and_then(|collection| collection.parent);
        std::iter::successors(field.collection, next)
            .filter_map(|at| self.collections.get(at))
            .map(|collection| collection.usage)
    }

    /// The first report of `kind` that has a field with `usage` in a collection with `within`, other than one that only fills the report.
    #[must_use]
    pub fn find(&self, kind: ReportKind, within: Usage, usage: Usage) -> Option<(&Report, &Field)> {
        self.reports.iter().filter(|report| report.kind == kind).find_map(|report| {
            let of = |field: &&Field| {
                !field.is_constant && field.has(usage) && self.around(field).any(|around| around == within)
            };
            report.fields.iter().find(of).map(|field| (report, field))
        })
    }
}

/// Why a report descriptor is not taken. Offsets count bytes from its beginning.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum DescriptorError {
    /// It is longer than any device may have.
    #[error("the report descriptor has {0} bytes; {LONGEST_DESCRIPTOR} are allowed")]
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
    #[error("the report of the field at byte {at} is longer than {LONGEST_REPORT} bytes")]
    ReportTooLong {
        /// Where the item begins.
        at: usize,
    },
    /// There are more fields than any device has.
    #[error("the field at byte {at} is one too many; {MOST_FIELDS} are allowed")]
    TooManyFields {
        /// Where the item begins.
        at: usize,
    },
}
