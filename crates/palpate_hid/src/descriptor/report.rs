//! A parsed report descriptor: its reports, their fields and collections.

use super::{Field, Usage};

/// Type of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ReportKind {
    /// From the device, unsolicited.
    Input,
    /// To the device.
    Output,
    /// In either direction, on request.
    Feature,
}

/// A parsed report descriptor.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct ReportDescriptor {
    pub(super) reports: Vec<Report>,
    pub(super) collections: Vec<Collection>,
}

/// A report, with its fields in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Type of the report.
    pub kind: ReportKind,
    /// Report ID, which precedes the data; 0 for a device without report IDs.
    pub id: u8,
    /// Fields of the report.
    pub fields: Vec<Field>,
    pub(super) bits: usize,
}

/// A collection of fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collection {
    /// Usage of the collection.
    pub usage: Usage,
    /// Index of the enclosing collection; `None` at the top level.
    pub parent: Option<usize>,
}

impl Report {
    /// Length of the data, bytes, without the report ID.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bits.div_ceil(8)
    }

    /// First field with `usage`. Constant fields, which only pad the report, are skipped.
    #[must_use]
    pub fn field(&self, usage: Usage) -> Option<&Field> {
        self.fields.iter().find(|field| !field.is_constant && field.has(usage))
    }
}

impl ReportDescriptor {
    /// Reports in the order of their first occurrence.
    #[must_use]
    pub fn reports(&self) -> &[Report] {
        &self.reports
    }

    /// Whether the reports have IDs.
    #[must_use]
    pub fn is_numbered(&self) -> bool {
        self.reports.iter().any(|report| report.id != 0)
    }

    /// Report of the type `kind` with the ID `id`.
    #[must_use]
    pub fn report(&self, kind: ReportKind, id: u8) -> Option<&Report> {
        self.reports.iter().find(|report| report.kind == kind && report.id == id)
    }

    /// Usages of the top-level collections, which name the function of the device.
    pub fn applications(&self) -> impl Iterator<Item = Usage> {
        self.collections.iter().filter(|collection| collection.parent.is_none()).map(|top| top.usage)
    }

    /// Usages of the collections that enclose `field`, innermost first.
    pub fn around(&self, field: &Field) -> impl Iterator<Item = Usage> {
        let next = |at: &usize| self.collections.get(*at).and_then(|collection| collection.parent);
        std::iter::successors(field.collection, next)
            .filter_map(|at| self.collections.get(at))
            .map(|collection| collection.usage)
    }

    /// First report of the type `kind` with a non-constant field with `usage` in a collection with the usage `within`.
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
