//! The black box: what went through the newest 4,096 ticks, kept without allocation.
//!
//! The loop keeps the box itself and brings a copy in the exchange up to it at every tick, so the app finds the newest ticks
//! whenever it looks, also after the loop has ended or its thread has panicked. Of a tick that panicked there is
//! nothing: a tick is in the box once its force has been written.
//!
//! [`BlackBox::write_csv`] writes it, [`Recording`] reads it again, [`BlackBoxKeeper`] keeps a few files in a folder,
//! [`crate::Recorder`] writes the same rows of a whole run.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod error;
mod keeper;
mod recording;
mod stages;
pub(crate) mod table;
mod tick;

pub use error::BlackBoxError;
pub use keeper::BlackBoxWriter;
pub use recording::Recording;
pub use stages::{SafetyAction, SafetyActions};
pub use tick::{BlackBoxTick, RecordedDeviceError};

use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::Path;

/// Ticks that a copy takes over at once. So many are little work within a tick, and more than an app leaves behind that
/// looks four times a second.
const AT_ONCE: u64 = 256;

/// The newest ticks of a loop, 4,096 at most.
#[derive(Clone, Debug)]
pub struct BlackBox {
    /// Tick number n, counted from 1, is at n modulo the capacity, beside its number; number 0 is none.
    ring: Vec<(u64, BlackBoxTick)>,
    /// Number of the newest tick.
    newest: u64,
    /// Numbers of the ticks that a copy has yet to take over.
    behind: Range<u64>,
}

impl BlackBox {
    /// How many ticks it holds at most.
    pub const CAPACITY: usize = 4096;

    /// An empty box with room for [`BlackBox::CAPACITY`] ticks.
    pub(crate) fn new() -> Self {
        Self { ring: vec![(0, BlackBoxTick::default()); Self::CAPACITY], newest: 0, behind: 0..0 }
    }

    /// Adds the newest tick, in the place of the oldest where the box is full.
    pub(crate) fn push(&mut self, tick: BlackBoxTick) {
        self.newest = self.newest.saturating_add(1);
        self.put(self.newest, tick);
    }

    /// Brings a copy up to `source` by copying what is new, 256 ticks at once and the newest first. After a long absence
    /// the older ones follow at the next calls; until then they are missing, the newest never are.
    pub(crate) fn catch_up_with(&mut self, source: &Self) {
        let next = self.newest.saturating_add(1);
        let end = source.newest.saturating_add(1);
        let fresh = next.max(end.saturating_sub(AT_ONCE));
        if fresh > next {
            let start = if self.behind.is_empty() { next } else { self.behind.start };
            self.behind = start..fresh;
        }
        self.copy(source, fresh..end);
        // What the source has lost meanwhile is not to be had.
        let kept = source.ring.len() as u64;
        let oldest = self.behind.start.max(end.saturating_sub(kept));
        let room = AT_ONCE.saturating_sub(end.saturating_sub(fresh));
        let from = self.behind.end.saturating_sub(room).max(oldest);
        self.copy(source, from..self.behind.end);
        self.behind = oldest..from;
        self.newest = source.newest;
    }

    /// The ticks, oldest first.
    pub fn ticks(&self) -> impl DoubleEndedIterator<Item = &BlackBoxTick> {
        let oldest = self.newest.saturating_sub(self.ring.len() as u64).saturating_add(1);
        (oldest..=self.newest).filter_map(|number| self.get(number))
    }

    /// The newest tick.
    #[must_use]
    pub fn newest(&self) -> Option<&BlackBoxTick> {
        self.get(self.newest)
    }

    /// Writes the ticks as CSV, oldest first: the columns of [`Recording`].
    ///
    /// # Errors
    /// What `writer` returns.
    pub fn to_csv(&self, mut writer: impl Write) -> std::io::Result<()> {
        table::write_header(&mut writer)?;
        self.ticks().try_for_each(|tick| table::write_row(&mut writer, tick))
    }

    /// Writes the file `path`, in the place of one that is there: 1 to 2 MB of a full box.
    ///
    /// # Errors
    /// [`BlackBoxError::File`].
    pub fn write_csv(&self, path: impl AsRef<Path>) -> Result<(), BlackBoxError> {
        let path = path.as_ref();
        std::fs::File::create(path)
            .and_then(|file| self.write_to(file))
            .map_err(|source| BlackBoxError::File { path: path.to_owned(), source })
    }

    fn write_to(&self, file: std::fs::File) -> std::io::Result<()> {
        let mut writer = BufWriter::new(file);
        self.to_csv(&mut writer)?;
        writer.flush()
    }

    fn copy(&mut self, source: &Self, numbers: Range<u64>) {
        for number in numbers {
            if let Some(&tick) = source.get(number) {
                self.put(number, tick);
            }
        }
    }

    fn put(&mut self, number: u64, tick: BlackBoxTick) {
        let slot = self.slot(number);
        if let Some(place) = self.ring.get_mut(slot) {
            *place = (number, tick);
        }
    }

    fn get(&self, number: u64) -> Option<&BlackBoxTick> {
        let (found, tick) = self.ring.get(self.slot(number))?;
        (number > 0 && *found == number).then_some(tick)
    }

    fn slot(&self, number: u64) -> usize {
        (number % self.ring.len().max(1) as u64) as usize
    }
}

#[cfg(test)]
mod tests;
