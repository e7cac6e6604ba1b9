//! A field of a report: its usages and its bits.

use std::fmt;
use std::sync::Arc;

/// Usage of a field or a collection: a page of the usage tables and an ID on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Usage {
    /// Usage page.
    pub page: u16,
    /// Usage ID on the page.
    pub id: u16,
}

impl Usage {
    /// The usage `id` of `page`.
    #[must_use]
    pub const fn new(page: u16, id: u16) -> Self {
        Self { page, id }
    }
}

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}:{:04X}", self.page, self.id)
    }
}

/// Inclusive range of usages of one page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UsageRange {
    /// First usage.
    pub first: Usage,
    /// ID of the last usage.
    pub last: u16,
}

impl UsageRange {
    /// Number of usages.
    #[must_use]
    pub fn count(self) -> usize {
        (usize::from(self.last) + 1).saturating_sub(usize::from(self.first.id))
    }

    /// Usage at `index`, from 0.
    #[must_use]
    pub fn at(self, index: usize) -> Option<Usage> {
        let id = u16::try_from(usize::from(self.first.id).checked_add(index)?).ok()?;
        (id <= self.last).then_some(Usage::new(self.first.page, id))
    }
}

/// A field of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Usages: one for a variable; for an array, which contains the number of one of several usages, all of them.
    pub usages: Arc<[UsageRange]>,
    /// Position of the first bit in the report's data, which exclude the report ID.
    pub bit: usize,
    /// Number of bits.
    pub bits: usize,
    /// Minimum and maximum logical value.
    pub logical: [i64; 2],
    /// Minimum and maximum physical value, in `unit`; equal if not declared.
    pub physical: [i64; 2],
    /// Code of the physical unit in the HID standard; 0 for none.
    pub unit: u32,
    /// Decimal exponent of the unit, -8 to 7.
    pub unit_exponent: i8,
    /// Whether the field is an array.
    pub is_array: bool,
    /// Whether the field is constant, as for padding.
    pub is_constant: bool,
    /// Whether the value is relative to the last one.
    pub is_relative: bool,
    /// Index of the innermost enclosing collection.
    pub(super) collection: Option<usize>,
}

impl Field {
    /// Whether `usage` is one of the field's usages.
    #[must_use]
    pub fn has(&self, usage: Usage) -> bool {
        self.usages
            .iter()
            .any(|range| range.first.page == usage.page && (range.first.id..=range.last).contains(&usage.id))
    }

    /// Value of `usage` in an array.
    #[must_use]
    pub fn value_of(&self, usage: Usage) -> Option<i64> {
        let mut before = 0_i64;
        for range in self.usages.iter() {
            if range.first.page == usage.page && (range.first.id..=range.last).contains(&usage.id) {
                let within = i64::from(usage.id) - i64::from(range.first.id);
                return Some(self.logical[0].saturating_add(before).saturating_add(within));
            }
            before = before.saturating_add(i64::try_from(range.count()).unwrap_or(i64::MAX));
        }
        None
    }

    /// Usage of `value` in an array.
    #[must_use]
    pub fn usage_of(&self, value: i64) -> Option<Usage> {
        let mut index = usize::try_from(value.checked_sub(self.logical[0])?).ok()?;
        for range in self.usages.iter() {
            if index < range.count() {
                return range.at(index);
            }
            index -= range.count();
        }
        None
    }

    /// Reads the field from a report's `data`, without the report ID; `None` for data that are too short or a field above 32 bits. The
    /// value is signed if the logical minimum is negative.
    #[must_use]
    pub fn get(&self, data: &[u8]) -> Option<i64> {
        if self.bits == 0 || self.bits > 32 {
            return None;
        }
        let (first, shift) = (self.bit / 8, self.bit % 8);
        let last = (self.bit + self.bits).div_ceil(8);
        let mut raw = 0_u64;
        for (index, byte) in data.get(first..last)?.iter().enumerate() {
            raw |= u64::from(*byte) << (8 * index);
        }
        let value = ((raw >> shift) & ((1 << self.bits) - 1)).cast_signed();
        let is_negative = self.logical[0] < 0 && value >> (self.bits - 1) == 1;
        Some(if is_negative { value - (1 << self.bits) } else { value })
    }

    /// Writes `value`, clamped to the range of the field, to a report's `data`, without the report ID. Returns the written value; `None`
    /// where [`Field::get`] returns it.
    pub fn set(&self, data: &mut [u8], value: i64) -> Option<i64> {
        if self.bits == 0 || self.bits > 32 {
            return None;
        }
        let [low, high] = self.logical;
        // Range of the bits, which the declared range may exceed.
        let (min, max) = if low < 0 {
            (-(1_i64 << (self.bits - 1)), (1_i64 << (self.bits - 1)) - 1)
        } else {
            (0, (1_i64 << self.bits) - 1)
        };
        let value = value.max(low.max(min)).min(high.min(max)).clamp(min, max);
        let (first, shift) = (self.bit / 8, self.bit % 8);
        let last = (self.bit + self.bits).div_ceil(8);
        let mask = ((1_u64 << self.bits) - 1) << shift;
        let raw = (value.cast_unsigned() << shift) & mask;
        for (index, byte) in data.get_mut(first..last)?.iter_mut().enumerate() {
            let (mask, raw) = (mask >> (8 * index), raw >> (8 * index));
            *byte = (*byte & !(mask as u8)) | (raw as u8);
        }
        Some(value)
    }
}
