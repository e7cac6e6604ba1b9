//! The black box: a record of the newest 4,096 ticks, kept without allocation.
//!
//! The loop owns the black box and updates a copy in the exchange at every tick. The app can read the newest ticks at any time, also
//! after the loop has ended or its thread has panicked. A tick enters the black box after its force was written; a tick that
//! panicked is missing.
//!
//! [`BlackBox::write_csv`] writes a file, [`Recording`] reads it, [`BlackBoxWriter`] writes numbered files in a folder, and
//! [`crate::Recorder`] writes the same rows for a whole run.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

pub(crate) mod csv_rows;
mod error;
mod recording;
mod safety_actions;
mod tick;
mod writer;

pub use error::BlackBoxError;
pub use recording::Recording;
pub use safety_actions::{SafetyAction, SafetyActions};
pub use tick::{BlackBoxTick, RecordedDeviceError};
pub use writer::BlackBoxWriter;

use crate::CsvError;
use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::Path;

/// Maximum number of ticks per copy operation: cheap within a tick, and more than accumulates between two reads of an app that
/// reads four times a second.
const MAX_COPIED: u64 = 256;

/// The newest ticks of a loop, 4,096 at most.
#[derive(Clone, Debug)]
pub struct BlackBox {
    /// Tick number n, from 1, is at index n modulo the capacity, with its number; number 0 marks an empty slot.
    ring: Vec<(u64, BlackBoxTick)>,
    /// Number of the newest tick.
    newest: u64,
    /// In a copy: numbers of older ticks that are still to be copied.
    pending: Range<u64>,
}

impl BlackBox {
    /// Maximum number of ticks.
    pub const CAPACITY: usize = 4096;

    /// An empty black box with a capacity of [`BlackBox::CAPACITY`] ticks.
    pub(crate) fn new() -> Self {
        Self { ring: vec![(0, BlackBoxTick::default()); Self::CAPACITY], newest: 0, pending: 0..0 }
    }

    /// Appends a tick; a full black box drops its oldest.
    pub(crate) fn push(&mut self, tick: BlackBoxTick) {
        self.newest = self.newest.saturating_add(1);
        self.put(self.newest, tick);
    }

    /// Updates a copy from `source`: copies at most 256 ticks, the newest first. If more are new, the next calls copy the older ones,
    /// which are missing until then.
    pub(crate) fn catch_up_with(&mut self, source: &Self) {
        let next = self.newest.saturating_add(1);
        let end = source.newest.saturating_add(1);
        let fresh = next.max(end.saturating_sub(MAX_COPIED));
        if fresh > next {
            let start = if self.pending.is_empty() { next } else { self.pending.start };
            self.pending = start..fresh;
        }
        self.copy(source, fresh..end);
        // Older ticks have been overwritten in the source.
        let kept = source.ring.len() as u64;
        let oldest = self.pending.start.max(end.saturating_sub(kept));
        let budget = MAX_COPIED.saturating_sub(end.saturating_sub(fresh));
        let from = self.pending.end.saturating_sub(budget).max(oldest);
        self.copy(source, from..self.pending.end);
        self.pending = oldest..from;
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

    /// Writes the ticks as CSV with the columns of [`Recording`], oldest first.
    ///
    /// # Errors
    /// Errors of `writer`.
    pub fn to_csv(&self, mut writer: impl Write) -> std::io::Result<()> {
        csv_rows::write_header(&mut writer)?;
        self.ticks().try_for_each(|tick| csv_rows::write_row(&mut writer, tick))
    }

    /// Writes the file `path` and overwrites an existing one. A full black box has 1 to 2 MB.
    ///
    /// # Errors
    /// [`CsvError::File`].
    pub fn write_csv(&self, path: impl AsRef<Path>) -> Result<(), BlackBoxError> {
        let path = path.as_ref();
        let written = std::fs::File::create(path).and_then(|file| self.write_to(file));
        Ok(written.map_err(CsvError::file(path))?)
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
        if let Some(entry) = self.ring.get_mut(slot) {
            *entry = (number, tick);
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
