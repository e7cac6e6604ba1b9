//! One field of a report: what it means, and its bits.

use std::fmt;
use std::sync::Arc;

/// What a field or a collection means: a page of the usage tables and a number on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Usage {
    /// The page.
    pub page: u16,
    /// The number on it.
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

/// Usages of one page, both ends among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UsageRange {
    /// The first.
    pub first: Usage,
    /// The number of the last.
    pub last: u16,
}

impl UsageRange {
    /// How many there are.
    #[must_use]
    pub fn count(self) -> usize {
        (usize::from(self.last) + 1).saturating_sub(usize::from(self.first.id))
    }

    /// The usage at `index`, from 0.
    #[must_use]
    pub fn at(self, index: usize) -> Option<Usage> {
        let id = u16::try_from(usize::from(self.first.id).checked_add(index)?).ok()?;
        (id <= self.last).then_some(Usage::new(self.first.page, id))
    }
}

/// One field of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// What it means. A variable has one usage; an array, which names one of several by its number, has all of them.
    pub usages: Arc<[UsageRange]>,
    /// Its first bit in the report's data, which begin after the report's number.
    pub bit: usize,
    /// How many bits it has.
    pub bits: usize,
    /// The least and the greatest value that mean something.
    pub logical: [i64; 2],
    /// What these stand for, in its unit; equal where nothing is said.
    pub physical: [i64; 2],
    /// Their unit, as the standard codes it; 0 for none.
    pub unit: u32,
    /// The power of ten by which that unit is multiplied, -8 to 7.
    pub unit_exponent: i8,
    /// Whether it names one of several usages by its number.
    pub is_array: bool,
    /// Whether it is only there to fill the report.
    pub is_constant: bool,
    /// Whether it tells a change and not a value.
    pub is_relative: bool,
    /// The innermost collection in which it lies, an index.
    pub(super) collection: Option<usize>,
}

impl Field {
    /// Whether it means `usage`, or can.
    #[must_use]
    pub fn has(&self, usage: Usage) -> bool {
        self.usages
            .iter()
            .any(|range| range.first.page == usage.page && (range.first.id..=range.last).contains(&usage.id))
    }

    /// The value by which an array names `usage`.
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

    /// The usage that an array names by `value`.
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

    /// Its value in a report's `data`, without the report's number; `None` where the data are too short or it has more than 32
    /// bits. Negative values are known by a negative least value.
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

    /// Puts the nearest allowed to `value` into a report's `data`, without the report's number, and says what that is; `None` where
    /// [`Field::get`] has none.
    pub fn set(&self, data: &mut [u8], value: i64) -> Option<i64> {
        if self.bits == 0 || self.bits > 32 {
            return None;
        }
        let [low, high] = self.logical;
        // What a field can hold, whatever is said of it.
        let (least, most) = if low < 0 {
            (-(1_i64 << (self.bits - 1)), (1_i64 << (self.bits - 1)) - 1)
        } else {
            (0, (1_i64 << self.bits) - 1)
        };
        let value = value.max(low.max(least)).min(high.min(most)).clamp(least, most);
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
