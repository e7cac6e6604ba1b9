//! Forces displayed at the newest samples.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use glam::DVec3;

/// The force that the active local model displayed at each of the newest samples, before the safety chain. Samples of missed
/// deadlines, and those without an active model, have none.
#[derive(Clone, Debug)]
pub struct DisplayedForces {
    /// The force of sequence number s is at index s modulo the capacity.
    ring: Vec<Option<(u64, DVec3)>>,
    newest: Option<u64>,
}

impl DisplayedForces {
    /// An empty history of `capacity` samples.
    pub(crate) fn with_capacity(capacity: usize) -> Self {
        Self { ring: vec![None; capacity], newest: None }
    }

    /// Appends the force displayed at the sample `sequence`.
    pub(crate) fn push(&mut self, sequence: u64, force_n: DVec3) {
        let slot = self.slot(sequence);
        if let Some(entry) = self.ring.get_mut(slot) {
            *entry = Some((sequence, force_n));
        }
        self.newest = Some(sequence);
    }

    /// Force displayed at the sample `sequence`, N, scene frame; `None` if there was none or it has been overwritten.
    #[must_use]
    pub fn get(&self, sequence: u64) -> Option<DVec3> {
        let (found, force_n) = self.ring.get(self.slot(sequence)).copied().flatten()?;
        (found == sequence).then_some(force_n)
    }

    /// Copies the new entries of `source`. Both must have the same capacity.
    pub(crate) fn catch_up_with(&mut self, source: &Self) {
        let Some(newest) = source.newest else { return };
        let first = newest.saturating_sub(self.ring.len() as u64 - 1);
        let first = self.newest.map_or(first, |newest| first.max(newest.saturating_add(1)));
        for sequence in first..=newest {
            if let Some(force_n) = source.get(sequence) {
                self.push(sequence, force_n);
            }
        }
    }

    fn slot(&self, sequence: u64) -> usize {
        (sequence % self.ring.len().max(1) as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn returns_force_until_overwritten() {
        let mut forces = DisplayedForces::with_capacity(4);
        assert_eq!(forces.get(0), None);
        for sequence in [1, 2, 4, 5] {
            forces.push(sequence, DVec3::X * sequence as f64);
        }
        let kept: Vec<u64> = (0..9).filter(|&s| forces.get(s).is_some()).collect();
        assert_eq!(kept, [2, 4, 5]);
        assert_eq!(forces.get(4), Some(DVec3::X * 4.0));
    }

    #[test]
    fn late_copy_catches_up() {
        let (mut source, mut copy) = (DisplayedForces::with_capacity(4), DisplayedForces::with_capacity(4));
        copy.catch_up_with(&source);
        for sequence in 0..3 {
            source.push(sequence, DVec3::Y);
        }
        copy.catch_up_with(&source);
        assert_eq!(copy.get(1), Some(DVec3::Y));
        for sequence in 3..20 {
            source.push(sequence, DVec3::Z * sequence as f64);
        }
        copy.catch_up_with(&source);
        assert_eq!((16..20).filter(|&s| copy.get(s) == source.get(s)).count(), 4);
        assert_eq!(copy.get(2), None);
        source.push(u64::MAX, DVec3::X);
        copy.catch_up_with(&source);
        assert_eq!(copy.get(u64::MAX), Some(DVec3::X));
    }
}
