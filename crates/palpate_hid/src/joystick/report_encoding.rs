//! Encoding of output reports.

use super::array_base::{PidArrayBase, offset};
use crate::{Field, Report, Usage};

/// Report with its ID and data of zeros.
pub(super) fn blank(report: &Report) -> Vec<u8> {
    let mut bytes = vec![report.id];
    bytes.resize(1 + report.bytes(), 0);
    bytes
}

/// Writes `value` to `field` of a report with its ID, clamped to the range of the field.
pub(super) fn put(report: &mut [u8], field: &Field, value: i64) {
    if let Some(data) = report.get_mut(1..) {
        field.set(data, value);
    }
}

/// Writes `value` to `field`, ignoring the declared range: "none" and "endless" are values outside of it.
pub(super) fn put_raw(report: &mut [u8], field: &Field, value: i64) {
    put(report, &raw(field), value.max(0));
}

/// `field` with the range of its bits.
fn raw(field: &Field) -> Field {
    let mut raw = field.clone();
    raw.logical = [0, max_value(field)];
    raw
}

/// Largest number that the bits of `field` hold.
pub(super) fn max_value(field: &Field) -> i64 {
    (1 << field.bits.min(32)) - 1
}

/// A usage as a value of a field: its number in an array, or 1 in a field of its own.
#[derive(Clone, Debug)]
pub(super) struct UsageValue {
    field: Field,
    value: i64,
}

impl UsageValue {
    /// Value of `usage` in `field`, an array with the base `base` or a field of its own; `None` where the field cannot represent it.
    pub(super) fn of(field: &Field, usage: Usage, base: Option<PidArrayBase>) -> Option<Self> {
        let value = if field.is_array { field.value_of(usage)? + offset(field, base) } else { 1 };
        let is_representable = (1..=32).contains(&field.bits) && (0..=max_value(field)).contains(&value);
        is_representable.then(|| Self { field: field.clone(), value })
    }

    /// Writes the value to a report with its ID.
    pub(super) fn write(&self, report: &mut [u8]) {
        put_raw(report, &self.field, self.value);
    }

    /// Whether a report's data, without the ID, contain the value.
    pub(super) fn is_set(&self, data: &[u8]) -> bool {
        raw(&self.field).get(data) == Some(self.value)
    }
}

/// A report for one effect, complete except for the effect index.
#[derive(Clone, Debug)]
pub(super) struct ReportTemplate {
    pub(super) bytes: Vec<u8>,
    pub(super) index: Field,
}

impl ReportTemplate {
    /// Report for the effect `index`.
    pub(super) fn for_effect(&self, index: i64) -> Vec<u8> {
        let mut bytes = self.bytes.clone();
        put(&mut bytes, &self.index, index);
        bytes
    }
}

#[cfg(test)]
mod test {
    use super::*;
    use crate::{ReportDescriptor, ReportKind};

    /// A field of `bits` bits after `before` others, with the declared maximum `high`.
    fn field(before: u8, bits: u8, low: u8, high: u16) -> Field {
        let [high_low, high_high] = high.to_le_bytes();
        let pad = [0x85, 9, 0x75, before, 0x95, 1, 0x91, 3];
        let own = [0x05, 0x0F, 0x09, 0x9A, 0x15, low, 0x26, high_low, high_high, 0x75, bits, 0x91, 2];
        let descriptor = ReportDescriptor::parse(&[&pad[..], &own[..]].concat()).unwrap();
        descriptor.report(ReportKind::Output, 9).unwrap().fields[0].clone()
    }

    #[test]
    fn put_raw_ignores_the_declared_range() {
        let duration = field(8, 16, 0, 0x7FFF);
        let mut report = [9, 0, 0, 0, 0];
        put(&mut report, &duration, 0xFFFF);
        assert_eq!(report, [9, 0, 0xFF, 0x7F, 0]);
        put_raw(&mut report, &duration, max_value(&duration));
        assert_eq!(report, [9, 0, 0xFF, 0xFF, 0]);
    }

    /// As in OpenFFBoard: fields of one bit with the declared range 1 to 6.
    #[test]
    fn one_bit_field_ignores_its_declared_range() {
        let value = UsageValue::of(&field(3, 1, 1, 6), Usage::new(0x0F, 0x9A), None).unwrap();
        let mut report = [9, 0];
        value.write(&mut report);
        assert_eq!(report, [9, 0x08]);
        assert!(value.is_set(&report[1..]) && !value.is_set(&[0xF7]) && !value.is_set(&[]));
    }
}
