//! Reports to be filled in.

use crate::{Field, Report, Usage};

/// A report with its number and all of its data zero.
pub(super) fn blank(report: &Report) -> Vec<u8> {
    let mut bytes = vec![report.id];
    bytes.resize(1 + report.bytes(), 0);
    bytes
}

/// Puts `value` into `field` of a report with its number: the nearest that the field may have.
pub(super) fn put(report: &mut [u8], field: &Field, value: i64) {
    if let Some(data) = report.get_mut(1..) {
        field.set(data, value);
    }
}

/// Puts `value` into `field` as it is, whatever the field is said to mean: nothing and everything are told by values beyond its range.
pub(super) fn put_raw(report: &mut [u8], field: &Field, value: i64) {
    put(report, &raw(field), value.max(0));
}

/// `field` with all the values that its bits can have.
fn raw(field: &Field) -> Field {
    let mut raw = field.clone();
    raw.logical = [0, highest(field)];
    raw
}

/// The greatest number that the bits of `field` can have.
pub(super) fn highest(field: &Field) -> i64 {
    (1 << field.bits.min(32)) - 1
}

/// A word that is said by a usage: the number by which an array names it, or 1 in a field of its own.
#[derive(Clone, Debug)]
pub(super) struct Word {
    field: Field,
    value: i64,
}

impl Word {
    /// How `field` says `usage`; `None` where it cannot.
    pub(super) fn of(field: &Field, usage: Usage) -> Option<Self> {
        let value = if field.is_array { field.value_of(usage)? } else { 1 };
        let can_be_said = (1..=32).contains(&field.bits) && (0..=highest(field)).contains(&value);
        can_be_said.then(|| Self { field: field.clone(), value })
    }

    /// Says it.
    pub(super) fn say(&self, report: &mut [u8]) {
        put_raw(report, &self.field, self.value);
    }

    /// Whether a report's data, without its number, say it.
    pub(super) fn is_said(&self, data: &[u8]) -> bool {
        raw(&self.field).get(data) == Some(self.value)
    }
}

/// A report about one effect, complete but for the effect's index.
#[derive(Clone, Debug)]
pub(super) struct Template {
    pub(super) bytes: Vec<u8>,
    pub(super) index: Field,
}

impl Template {
    /// The report for the effect `index`.
    pub(super) fn about(&self, index: i64) -> Vec<u8> {
        let mut bytes = self.bytes.clone();
        put(&mut bytes, &self.index, index);
        bytes
    }
}

#[cfg(test)]
mod test {
    use super::*;
    use crate::{ReportDescriptor, ReportKind};

    /// A field of `bits` bits after `before` others, whose greatest value is said to be `high`.
    fn field(before: u8, bits: u8, low: u8, high: u16) -> Field {
        let [high_low, high_high] = high.to_le_bytes();
        let pad = [0x85, 9, 0x75, before, 0x95, 1, 0x91, 3];
        let own = [0x05, 0x0F, 0x09, 0x9A, 0x15, low, 0x26, high_low, high_high, 0x75, bits, 0x91, 2];
        let descriptor = ReportDescriptor::parse(&[&pad[..], &own[..]].concat()).unwrap();
        descriptor.report(ReportKind::Output, 9).unwrap().fields[0].clone()
    }

    #[test]
    fn what_is_beyond_the_range_is_put_raw() {
        let duration = field(8, 16, 0, 0x7FFF);
        let mut report = [9, 0, 0, 0, 0];
        put(&mut report, &duration, 0xFFFF);
        assert_eq!(report, [9, 0, 0xFF, 0x7F, 0]);
        put_raw(&mut report, &duration, highest(&duration));
        assert_eq!(report, [9, 0, 0xFF, 0xFF, 0]);
    }

    /// As OpenFFBoard has it: fields of one bit whose values are said to be 1 to 6.
    #[test]
    fn a_bit_is_said_whatever_its_range() {
        let word = Word::of(&field(3, 1, 1, 6), Usage::new(0x0F, 0x9A)).unwrap();
        let mut report = [9, 0];
        word.say(&mut report);
        assert_eq!(report, [9, 0x08]);
        assert!(word.is_said(&report[1..]) && !word.is_said(&[0xF7]) && !word.is_said(&[]));
    }
}
