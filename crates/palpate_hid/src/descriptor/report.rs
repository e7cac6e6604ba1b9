//! A parsed report descriptor: its reports, their fields and collections.

use super::{Field, Usage};

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
    pub(super) reports: Vec<Report>,
    pub(super) collections: Vec<Collection>,
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
    pub(super) bits: usize,
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
