//! Samples of the device and their history.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::LocalModelError;
use glam::{DQuat, DVec3};

/// One reading of the device in the scene's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Number of the tick since the loop's start: one more for each period of the loop.
    pub sequence: u64,
    /// Time of that tick since the loop's start, s: `sequence` times the period, on the loop's own clock.
    pub time_s: f64,
    /// Position of the tool, m.
    pub position_m: DVec3,
    /// Velocity of the tool by the loop's estimator, m/s.
    pub velocity_m_per_s: DVec3,
    /// Orientation of the tool.
    pub orientation: DQuat,
    /// Bit i is set while button i is pressed.
    pub buttons: u32,
    /// How it came about.
    pub origin: SampleOrigin,
}

/// How a sample came about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleOrigin {
    /// The device was read at this tick.
    #[default]
    Measured,
    /// The tick's deadline was missed; the sample lies on the line between its neighbours.
    Interpolated,
    /// The device gave nothing usable at this tick, or the tool has been put elsewhere since; the sample repeats
    /// the one before, at rest.
    Repeated,
}

impl Default for Sample {
    fn default() -> Self {
        Self {
            sequence: 0,
            time_s: 0.0,
            position_m: DVec3::ZERO,
            velocity_m_per_s: DVec3::ZERO,
            orientation: DQuat::IDENTITY,
            buttons: 0,
            origin: SampleOrigin::Measured,
        }
    }
}

/// The newest samples, without holes: sequence numbers ascend by one.
#[derive(Clone, Debug)]
pub struct SampleHistory {
    /// The sample of sequence s is at s modulo the capacity.
    ring: Vec<Sample>,
    len: usize,
    newest: u64,
}

impl SampleHistory {
    /// Room for `capacity` samples.
    ///
    /// # Errors
    /// [`LocalModelError::Setting`] unless 1 to a million.
    pub fn with_capacity(capacity: usize) -> Result<Self, LocalModelError> {
        if !(1..=1_000_000).contains(&capacity) {
            let (what, allowed) = ("samples kept", "1 to 1000000");
            return Err(LocalModelError::Setting { what, value: capacity as f64, allowed });
        }
        Ok(Self { ring: vec![Sample::default(); capacity], len: 0, newest: 0 })
    }

    /// Adds the newest sample. One that does not follow the newest by exactly one starts the history anew.
    pub fn push(&mut self, sample: Sample) {
        if self.len > 0 && self.newest.checked_add(1) != Some(sample.sequence) {
            self.len = 0;
        }
        let slot = self.slot(sample.sequence);
        if let Some(place) = self.ring.get_mut(slot) {
            *place = sample;
        }
        self.newest = sample.sequence;
        self.len = (self.len + 1).min(self.ring.len());
    }

    /// The sample of `sequence`, if it is still there.
    #[must_use]
    pub fn get(&self, sequence: u64) -> Option<&Sample> {
        let kept = self.oldest_sequence().is_some_and(|oldest| (oldest..=self.newest).contains(&sequence));
        if kept { self.ring.get(self.slot(sequence)) } else { None }
    }

    /// The newest sample.
    #[must_use]
    pub fn newest(&self) -> Option<&Sample> {
        self.get(self.newest)
    }

    /// Sequence number of the oldest sample kept.
    #[must_use]
    pub fn oldest_sequence(&self) -> Option<u64> {
        (self.len > 0).then(|| self.newest.saturating_sub(self.len as u64 - 1))
    }

    /// How many samples are kept.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Brings `self` up to `source` by copying only what is new. Both must have the same capacity.
    pub fn catch_up_with(&mut self, source: &Self) {
        let Some(oldest) = source.oldest_sequence() else {
            self.len = 0;
            return;
        };
        let joined = self.len > 0 && self.newest <= source.newest && self.newest.saturating_add(1) >= oldest;
        if !joined {
            self.len = 0;
        }
        let first = if joined { self.newest.saturating_add(1) } else { oldest };
        for sequence in first..=source.newest {
            if let Some(&sample) = source.get(sequence) {
                self.push(sample);
            }
        }
        // A source that was started anew within reach of the old one holds fewer samples than we would keep.
        self.len = self.len.min(source.len);
    }

    fn slot(&self, sequence: u64) -> usize {
        (sequence % self.ring.len() as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_sequence_number_there_is_does_no_harm() {
        let mut history = filled([u64::MAX - 1, u64::MAX]);
        assert_eq!((history.len(), history.oldest_sequence()), (2, Some(u64::MAX - 1)));
        history.push(sample(u64::MAX));
        let mut copy = filled(0..3);
        copy.catch_up_with(&history);
        assert_eq!(copy.newest(), history.newest());
    }

    fn sample(sequence: u64) -> Sample {
        Sample { sequence, position_m: DVec3::splat(sequence as f64), ..Sample::default() }
    }

    fn filled(sequences: impl IntoIterator<Item = u64>) -> SampleHistory {
        let mut history = SampleHistory::with_capacity(8).unwrap();
        sequences.into_iter().for_each(|s| history.push(sample(s)));
        history
    }

    #[test]
    fn the_newest_samples_are_kept_and_older_ones_forgotten() {
        let history = filled(3..20);
        assert_eq!((history.len(), history.oldest_sequence()), (8, Some(12)));
        assert_eq!(history.get(11), None);
        assert_eq!(history.get(12), Some(&sample(12)));
        assert_eq!(history.newest(), Some(&sample(19)));
        assert_eq!(history.get(20), None);
    }

    #[test]
    fn a_hole_starts_the_history_anew() {
        let history = filled([1, 2, 3, 5, 6]);
        assert_eq!((history.len(), history.oldest_sequence()), (2, Some(5)));
        assert_eq!(history.get(3), None);
    }

    #[test]
    fn catching_up_gives_the_source_whatever_came_before() {
        for behind in [0..0, 0..1, 0..5, 0..12, 0..40, 30..40, 100..120] {
            for source in [filled(10..13), filled(5..40), filled([1, 2, 9]), filled([])] {
                let mut copy = filled(behind.clone());
                copy.catch_up_with(&source);
                assert_eq!(copy.len(), source.len());
                for sequence in 0..130 {
                    assert_eq!(copy.get(sequence), source.get(sequence), "{behind:?}, {sequence}");
                }
            }
        }
    }

    #[test]
    fn a_history_without_room_is_refused() {
        assert!(SampleHistory::with_capacity(0).is_err());
        assert!(SampleHistory::with_capacity(usize::MAX).is_err());
    }
}
