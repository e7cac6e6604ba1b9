//! Detection of a position that stays the same while the orientation changes: an encoder of the arm, or its cable, is lost.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::Reading;
use glam::{DQuat, DVec3};

/// Time for which the orientation must change, s.
const TURNING_S: f64 = 0.5;
/// Angle by which the orientation must have changed since the position last did, rad. Noise of an orientation sensor is smaller.
const MIN_ANGLE_RAD: f64 = 0.2;
/// Maximum time between two changes of the orientation that count as one turn, s: five reports of a device of 100 Hz.
const MAX_PAUSE_S: f64 = 0.05;

/// State of the detection.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FrozenPosition {
    /// Position since its last change, m.
    position_m: Option<DVec3>,
    /// Orientation when the position last changed, and the latest one.
    orientations: [DQuat; 2],
    /// Largest angle between them since then, rad.
    angle_rad: f64,
    /// Time for which the orientation has changed since then, s.
    turning_s: f64,
    /// Time since the orientation last changed, s.
    pause_s: f64,
    is_reported: bool,
}

impl FrozenPosition {
    /// Takes a reading, `elapsed_s` after the last one, s. Returns the time for which the position has been frozen, s, once for each
    /// time it freezes. The positions must be equal to the last bit: a hand never rests so while it turns.
    pub(crate) fn check(&mut self, reading: &Reading, elapsed_s: f64) -> Option<f64> {
        let orientation = reading.orientation;
        if self.position_m != Some(reading.position_m) {
            let position_m = Some(reading.position_m);
            *self = Self { position_m, orientations: [orientation; 2], ..Self::default() };
            return None;
        }
        let [first, last] = self.orientations;
        self.pause_s += elapsed_s;
        if last != orientation {
            self.turning_s += if self.pause_s <= MAX_PAUSE_S { self.pause_s } else { 0.0 };
            self.pause_s = 0.0;
            self.orientations = [first, orientation];
            self.angle_rad = self.angle_rad.max(first.angle_between(orientation));
        }
        let is_frozen = self.turning_s >= TURNING_S && self.angle_rad >= MIN_ANGLE_RAD;
        let is_new = is_frozen && !self.is_reported;
        self.is_reported |= is_frozen;
        is_new.then_some(self.turning_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_S: f64 = 1e-3;

    fn turned(position_m: DVec3, angle_rad: f64) -> Reading {
        Reading { orientation: DQuat::from_rotation_z(angle_rad), ..Reading::at(position_m) }
    }

    /// Ticks at which a freeze is reported; `reading` gives the position and the angle at a tick.
    fn reports(ticks: u32, reading: impl Fn(u32) -> (f64, f64)) -> Vec<u32> {
        let mut state = FrozenPosition::default();
        (0..ticks)
            .filter(|&tick| {
                let (x, angle_rad) = reading(tick);
                state.check(&turned(DVec3::X * x, angle_rad), TICK_S).is_some()
            })
            .collect()
    }

    #[test]
    fn freeze_is_reported_once_after_half_a_second() {
        let angle = |tick: u32| 1e-3 * f64::from(tick);
        let reported = reports(3000, |tick| (0.1, angle(tick)));
        assert_eq!(reported.len(), 1);
        assert!((500..=502).contains(&reported[0]), "{reported:?}");
        // Again after it has moved, and with reports at 100 Hz.
        let reported = reports(3000, |tick| (if tick < 1000 { 0.1 } else { 0.2 }, angle(tick)));
        assert_eq!(reported.len(), 2);
        assert!((1500..=1502).contains(&reported[1]), "{reported:?}");
        let reported = reports(3000, |tick| (0.1, angle(tick / 10 * 10)));
        assert!(reported.len() == 1 && (500..=520).contains(&reported[0]), "{reported:?}");
    }

    #[test]
    fn hand_that_rests_or_moves_is_not_frozen() {
        let angle = |tick: u32| 1e-3 * f64::from(tick);
        // It turns and moves by a count of an encoder now and then.
        assert_eq!(reports(3000, |tick| (1e-5 * f64::from(tick / 400), angle(tick))), []);
        // It rests for 2 s, then turns for 0.4 s, and rests.
        assert_eq!(reports(4000, |tick| (0.1, angle(tick.clamp(2000, 2400)))), []);
        // Noise of 0.05 rad.
        assert_eq!(reports(4000, |tick| (0.1, 0.05 * f64::from(tick % 2))), []);
        // Neither changes, or only the position does.
        assert_eq!(reports(4000, |_| (0.1, 0.3)), []);
        assert_eq!(reports(4000, |tick| (1e-5 * f64::from(tick), 0.3)), []);
    }

    #[test]
    fn missed_ticks_count_as_time() {
        let mut state = FrozenPosition::default();
        let reported: Vec<u32> = (0..60)
            .filter(|&i| state.check(&turned(DVec3::ZERO, 0.02 * f64::from(i)), 0.02).is_some())
            .collect();
        assert_eq!(reported, [25]);
    }
}
