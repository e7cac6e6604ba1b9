//! Plausibility of readings: sequence numbers must increase, and a hand does not jump.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{DeviceError, Reading};
use glam::DVec3;

/// Consecutive readings at one place after which a jump is accepted.
const JUMP_CONFIRMATIONS: u64 = 5;

/// Maximum number of ticks for which a numbered reading may repeat, as it does with a slow device.
const MAX_REPEATS: u64 = 10;

/// Consecutive readings with older sequence numbers after which the device is assumed to have restarted its count.
const COUNT_RESET_AFTER: u64 = 40;

/// State of the plausibility check.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Plausibility {
    order: ReadingOrder,
    /// Last accepted position, m, device frame.
    accepted_m: Option<DVec3>,
    /// Position of an unconfirmed jump, m, and number of readings there.
    suspect: Option<(DVec3, u64)>,
    /// Ticks without a reading since the last accepted one.
    unread_ticks: u64,
}

/// An accepted reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AcceptedReading {
    pub(crate) reading: Reading,
    /// Distance from the last accepted reading, m, if it is too large for one tick: the path in between was not observed.
    pub(crate) jumped_m: Option<f64>,
}

impl Plausibility {
    /// Accepts `reading` if a hand can have moved there since the last accepted one, in `elapsed` ticks of at most `step_m` each, m.
    /// A jump is accepted once it has persisted.
    pub(crate) fn validate(
        &mut self,
        reading: Result<Reading, DeviceError>,
        elapsed: u64,
        step_m: f64,
    ) -> Result<AcceptedReading, DeviceError> {
        match reading.and_then(|reading| self.order.check(reading, elapsed)) {
            Ok(reading) => self.accept(reading, elapsed, step_m * elapsed as f64),
            Err(error) => {
                self.unread_ticks = self.unread_ticks.saturating_add(elapsed);
                Err(error)
            }
        }
    }

    /// Accepts `reading` if it is near enough; `within_m` is the maximum distance within the elapsed ticks, m.
    fn accept(
        &mut self,
        reading: Reading,
        elapsed: u64,
        within_m: f64,
    ) -> Result<AcceptedReading, DeviceError> {
        let position_m = reading.position_m;
        let distance_m = self.accepted_m.map_or(0.0, |last| last.distance(position_m));
        // Ticks without a valid reading allow a longer path; readings rejected as jumps do not.
        let reach_m = within_m * (1.0 + self.unread_ticks as f64 / elapsed as f64);
        if distance_m > reach_m {
            let suspect = self.suspect.take().filter(|(there, _)| there.distance(position_m) <= within_m);
            let count = suspect.map_or(1, |(_, count)| count + 1);
            if count < JUMP_CONFIRMATIONS {
                self.suspect = Some((position_m, count));
                return Err(DeviceError::Jumped);
            }
        }
        (self.accepted_m, self.suspect, self.unread_ticks) = (Some(position_m), None, 0);
        Ok(AcceptedReading { reading, jumped_m: (distance_m > within_m).then_some(distance_m) })
    }
}

/// Check of the sequence numbers, for devices that count their reports.
#[derive(Clone, Copy, Debug, Default)]
struct ReadingOrder {
    newest: Option<u64>,
    /// Ticks for which the newest number has repeated.
    repeated: u64,
    /// Consecutive readings with an older number.
    older: u64,
}

impl ReadingOrder {
    /// Accepts `reading` if it is newer than the last, or repeats the last for a limited time.
    fn check(&mut self, reading: Reading, elapsed: u64) -> Result<Reading, DeviceError> {
        if let (Some(number), Some(newest)) = (reading.sequence, self.newest) {
            if number == newest {
                self.repeated = self.repeated.saturating_add(elapsed);
                return if self.repeated > MAX_REPEATS { Err(DeviceError::Repeated) } else { Ok(reading) };
            }
            self.older = if number < newest { self.older + 1 } else { 0 };
            if (1..COUNT_RESET_AFTER).contains(&self.older) {
                return Err(DeviceError::Reordered);
            }
        }
        *self = Self { newest: reading.sequence, ..Self::default() };
        Ok(reading)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_M: f64 = 0.02;

    fn at(x: f64) -> Result<Reading, DeviceError> {
        Ok(Reading::at(DVec3::X * x))
    }

    fn numbered(number: u64) -> Result<Reading, DeviceError> {
        Ok(Reading { sequence: Some(number), ..Reading::at(DVec3::ZERO) })
    }

    /// Validates a reading one tick after the previous one.
    fn validate(
        state: &mut Plausibility,
        reading: Result<Reading, DeviceError>,
    ) -> Result<Option<f64>, DeviceError> {
        state.validate(reading, 1, STEP_M).map(|accepted| accepted.jumped_m)
    }

    #[test]
    fn unread_ticks_allow_a_longer_path_and_mark_it_as_jump() {
        let mut state = Plausibility::default();
        assert_eq!(validate(&mut state, at(0.0)), Ok(None));
        for _ in 0..3 {
            assert_eq!(validate(&mut state, Err(DeviceError::TimedOut)), Err(DeviceError::TimedOut));
        }
        // In four ticks a hand can move by 80 mm, but the path is not observed.
        assert_eq!(validate(&mut state, at(0.05)), Ok(Some(0.05)));
        assert_eq!(validate(&mut state, at(0.05)), Ok(None));
        assert_eq!(validate(&mut state, Err(DeviceError::TimedOut)), Err(DeviceError::TimedOut));
        assert_eq!(validate(&mut state, at(0.06)), Ok(None));
        assert_eq!(validate(&mut state, Err(DeviceError::TimedOut)), Err(DeviceError::TimedOut));
        assert_eq!(validate(&mut state, at(0.2)), Err(DeviceError::Jumped));
    }

    #[test]
    fn unread_ticks_before_first_reading_do_not_extend_reach() {
        let mut state = Plausibility::default();
        for _ in 0..1000 {
            assert!(validate(&mut state, Err(DeviceError::TimedOut)).is_err());
        }
        assert_eq!(validate(&mut state, at(0.0)), Ok(None));
        assert_eq!(validate(&mut state, at(0.05)), Err(DeviceError::Jumped));
    }

    #[test]
    fn accepts_repeats_of_slow_device_and_rejects_those_of_hanging_one() {
        let mut state = Plausibility::default();
        for number in 0..10 {
            // A device of 100 Hz.
            assert!((0..10).all(|_| validate(&mut state, numbered(number)).is_ok()));
        }
        let repeats = (0..100).map(|_| validate(&mut state, numbered(9)));
        let rejected = repeats.filter(|result| *result == Err(DeviceError::Repeated)).count();
        assert_eq!(rejected, 99);
        assert!(validate(&mut state, numbered(10)).is_ok());
    }

    #[test]
    fn rejects_older_numbers_until_count_restart_is_certain() {
        let mut state = Plausibility::default();
        for (number, is_newer) in [(7, true), (9, true), (8, false), (11, true), (10, false)] {
            let expected = if is_newer { Ok(None) } else { Err(DeviceError::Reordered) };
            assert_eq!(validate(&mut state, numbered(number)), expected, "{number}");
        }
        // The last reading before these was one already.
        let accepted: Vec<bool> =
            (0..45).map(|number| validate(&mut state, numbered(number)).is_ok()).collect();
        assert_eq!(
            accepted.iter().position(|is_accepted| *is_accepted),
            Some(11),
            "the count has reached the old one"
        );
        let mut state = Plausibility::default();
        validate(&mut state, numbered(1_000_000)).unwrap();
        let accepted: Vec<bool> =
            (0..45).map(|number| validate(&mut state, numbered(number)).is_ok()).collect();
        assert_eq!(accepted.iter().position(|is_accepted| *is_accepted), Some(39));
        assert!(accepted[39..].iter().all(|is_accepted| *is_accepted));
    }
}
