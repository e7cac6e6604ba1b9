//! Items of a report descriptor.

use super::DescriptorError;

/// A short item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Item {
    /// Offset of the item, bytes.
    pub(super) at: usize,
    /// Tag and type: the first byte without its two bits of length.
    pub(super) tag: u8,
    /// Data, little-endian.
    pub(super) data: u32,
    /// Number of data bytes.
    pub(super) bytes: usize,
}

impl Item {
    /// Data as a signed number.
    pub(super) fn signed(self) -> i64 {
        match self.bytes {
            1 => i64::from(self.data as u8 as i8),
            2 => i64::from(self.data as u16 as i16),
            _ => i64::from(self.data.cast_signed()),
        }
    }
}

/// Iterator over the short items of a descriptor. Long items, which have no defined tags, are skipped.
pub(super) struct Items<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Items<'a> {
    pub(super) fn of(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn item(&mut self, at: usize) -> Option<Option<Item>> {
        const LONG: u8 = 0xFE;
        let &[prefix] = self.take(1)? else { return None };
        if prefix == LONG {
            let &[length, _tag] = self.take(2)? else { return None };
            self.take(usize::from(length))?;
            return Some(None);
        }
        let length = [0, 1, 2, 4][usize::from(prefix & 3)];
        let mut data = 0;
        for (index, byte) in self.take(length)?.iter().enumerate() {
            data |= u32::from(*byte) << (8 * index);
        }
        Some(Some(Item { at, tag: prefix & 0xFC, data, bytes: length }))
    }
}

impl Iterator for Items<'_> {
    type Item = Result<Item, DescriptorError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.at < self.bytes.len() {
            let at = self.at;
            match self.item(at) {
                Some(Some(item)) => return Some(Ok(item)),
                Some(None) => {}
                None => {
                    self.at = self.bytes.len();
                    return Some(Err(DescriptorError::Truncated { at }));
                }
            }
        }
        None
    }
}
