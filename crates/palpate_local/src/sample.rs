//! Samples of the device, and their history for replay.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::LocalModelError;
use glam::{DQuat, DVec3};

/// A reading of the device in the frame of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Number of the tick since the start of the loop, one per period.
    pub sequence: u64,
    /// Time of the tick since the start of the loop, s: `sequence` times the period.
    pub time_s: f64,
    /// Position of the tool, m.
    pub position_m: DVec3,
    /// Velocity of the tool from the loop's estimator, m/s.
    pub velocity_m_per_s: DVec3,
    /// Orientation of the tool.
    pub orientation: DQuat,
    /// Pressed buttons: bit i for button i.
    pub buttons: u32,
    /// Origin of the sample.
    pub origin: SampleOrigin,
    /// Newest force of another tool at this tick, if the loop follows one.
    pub other: Option<OtherToolForce>,
}

/// Force of another tool on a body, as the loop of that tool displays it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OtherToolForce {
    /// Identity of the tool.
    pub tool: u64,
    /// Identity of the body: see [`crate::ModelId`].
    pub body: u64,
    /// Force of that tool on the body, N: the mean of its contact impulses over a tick.
    pub force_n: DVec3,
}

/// Origin of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleOrigin {
    /// The device was read at this tick.
    #[default]
    Measured,
    /// The deadline of the tick was missed; the sample is interpolated linearly between its neighbours.
    Interpolated,
    /// There is no valid reading for this tick, or the deadline was missed and the tool's position has jumped. The sample repeats the
    /// previous position with zero velocity.
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
            other: None,
        }
    }
}

/// The newest samples, with consecutive sequence numbers.
#[derive(Clone, Debug)]
pub struct SampleHistory {
    /// Ring buffer: the sample with sequence number s is at s modulo the capacity.
    buffer: Vec<Sample>,
    len: usize,
    newest: u64,
}

impl SampleHistory {
    /// An empty history with capacity for `capacity` samples.
    ///
    /// # Errors
    /// [`LocalModelError::Setting`] for a capacity outside 1 to 1000000.
    pub fn with_capacity(capacity: usize) -> Result<Self, LocalModelError> {
        if !(1..=1_000_000).contains(&capacity) {
            let (what, allowed) = ("samples kept", "1 to 1000000");
            return Err(LocalModelError::Setting { what, value: capacity as f64, allowed });
        }
        Ok(Self { buffer: vec![Sample::default(); capacity], len: 0, newest: 0 })
    }

    /// Adds the newest sample. The history is cleared first if the sequence number does not follow the newest one.
    pub fn push(&mut self, sample: Sample) {
        if self.len > 0 && self.newest.checked_add(1) != Some(sample.sequence) {
            self.len = 0;
        }
        let slot = self.slot(sample.sequence);
        if let Some(place) = self.buffer.get_mut(slot) {
            *place = sample;
        }
        self.newest = sample.sequence;
        self.len = (self.len + 1).min(self.buffer.len());
    }

    /// The sample with number `sequence`; `None` if it is not in the history.
    #[must_use]
    pub fn get(&self, sequence: u64) -> Option<&Sample> {
        let kept = self.oldest_sequence().is_some_and(|oldest| (oldest..=self.newest).contains(&sequence));
        if kept { self.buffer.get(self.slot(sequence)) } else { None }
    }

    /// The newest sample; `None` if the history is empty.
    #[must_use]
    pub fn newest(&self) -> Option<&Sample> {
        self.get(self.newest)
    }

    /// Sequence number of the oldest sample; `None` if the history is empty.
    #[must_use]
    pub fn oldest_sequence(&self) -> Option<u64> {
        (self.len > 0).then(|| self.newest.saturating_sub(self.len as u64 - 1))
    }

    /// Number of samples in the history.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the history is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Makes `self` equal to `source`, and copies only the samples that `self` lacks. Both must have the same capacity.
    pub fn catch_up_with(&mut self, source: &Self) {
        let Some(oldest) = source.oldest_sequence() else {
            self.len = 0;
            return;
        };
        let is_continued =
            self.len > 0 && self.newest <= source.newest && self.newest.saturating_add(1) >= oldest;
        if !is_continued {
            self.len = 0;
        }
        let first = if is_continued { self.newest.saturating_add(1) } else { oldest };
        for sequence in first..=source.newest {
            if let Some(&sample) = source.get(sequence) {
                self.push(sample);
            }
        }
        // A source that was cleared since the last copy holds fewer samples.
        self.len = self.len.min(source.len);
    }

    fn slot(&self, sequence: u64) -> usize {
        (sequence % self.buffer.len() as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepts_the_maximum_sequence_number() {
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
    fn keeps_the_newest_samples_only() {
        let history = filled(3..20);
        assert_eq!((history.len(), history.oldest_sequence()), (8, Some(12)));
        assert_eq!(history.get(11), None);
        assert_eq!(history.get(12), Some(&sample(12)));
        assert_eq!(history.newest(), Some(&sample(19)));
        assert_eq!(history.get(20), None);
    }

    #[test]
    fn gap_in_sequence_numbers_clears_the_history() {
        let history = filled([1, 2, 3, 5, 6]);
        assert_eq!((history.len(), history.oldest_sequence()), (2, Some(5)));
        assert_eq!(history.get(3), None);
    }

    #[test]
    fn catch_up_equals_source_for_any_previous_content() {
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
    fn rejects_capacity_zero_and_above_a_million() {
        assert!(SampleHistory::with_capacity(0).is_err());
        assert!(SampleHistory::with_capacity(usize::MAX).is_err());
    }
}
