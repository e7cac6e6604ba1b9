//! Whether a reading can be that of a hand: its number is newer than the last, and no hand jumps.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{DeviceError, Reading};
use glam::DVec3;

/// Readings in a row at one place after which a hand that seems to have jumped there is believed.
const BELIEVED_AFTER: u64 = 5;

/// Ticks for which a numbered reading may come again: a slow device has nothing newer.
const MOST_REPEATS: u64 = 10;

/// Readings in a row whose numbers go back after which the device is believed to have begun to count anew.
const COUNTED_ANEW_AFTER: u64 = 40;

/// What is known of the readings so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Plausibility {
    numbers: Numbers,
    /// Where the device was last read, m, its own frame.
    read_m: Option<DVec3>,
    /// Where it seems to have jumped, and for how many readings.
    suspect: Option<(DVec3, u64)>,
    /// Ticks since it was last read in which nothing could be.
    unread_ticks: u64,
}

/// A reading that is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AcceptedReading {
    pub(crate) reading: Reading,
    /// How far it is from the last, m, where a hand cannot have come there within a tick: nobody saw its way.
    pub(crate) jumped_m: Option<f64>,
}

impl Plausibility {
    /// `reading` if a hand can have come there since the last one, within `elapsed` ticks of `step_m` each at most. What stays
    /// where it cannot is believed after a while.
    pub(crate) fn validate(
        &mut self,
        reading: Result<Reading, DeviceError>,
        elapsed: u64,
        step_m: f64,
    ) -> Result<AcceptedReading, DeviceError> {
        match reading.and_then(|reading| self.numbers.take(reading, elapsed)) {
            Ok(reading) => self.accept(reading, elapsed, step_m * elapsed as f64),
            Err(error) => {
                self.unread_ticks = self.unread_ticks.saturating_add(elapsed);
                Err(error)
            }
        }
    }

    /// As [`Plausibility::judge`], with the farthest way within these ticks.
    fn accept(
        &mut self,
        reading: Reading,
        elapsed: u64,
        within_m: f64,
    ) -> Result<AcceptedReading, DeviceError> {
        let at = reading.position_m;
        let distance_m = self.read_m.map_or(0.0, |last| last.distance(at));
        // What was not read for longer may have gone farther; what was read and not believed not.
        let may_come_m = within_m * (1.0 + self.unread_ticks as f64 / elapsed as f64);
        if distance_m > may_come_m {
            let known = self.suspect.take().filter(|(there, _)| there.distance(at) <= within_m);
            let times = known.map_or(1, |(_, times)| times + 1);
            if times < BELIEVED_AFTER {
                self.suspect = Some((at, times));
                return Err(DeviceError::Jumped);
            }
        }
        (self.read_m, self.suspect, self.unread_ticks) = (Some(at), None, 0);
        Ok(AcceptedReading { reading, jumped_m: (distance_m > within_m).then_some(distance_m) })
    }
}

/// The numbers of a device's readings, where it counts them.
#[derive(Clone, Copy, Debug, Default)]
struct Numbers {
    newest: Option<u64>,
    /// Ticks for which the newest has come again.
    repeated: u64,
    /// Readings in a row that were older.
    older: u64,
}

impl Numbers {
    /// `reading` if it is newer than the last, or the last again and not for too long.
    fn take(&mut self, reading: Reading, elapsed: u64) -> Result<Reading, DeviceError> {
        if let (Some(number), Some(newest)) = (reading.sequence, self.newest) {
            if number == newest {
                self.repeated = self.repeated.saturating_add(elapsed);
                return if self.repeated > MOST_REPEATS { Err(DeviceError::Repeated) } else { Ok(reading) };
            }
            self.older = if number < newest { self.older + 1 } else { 0 };
            if (1..COUNTED_ANEW_AFTER).contains(&self.older) {
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

    /// Judges what came after one tick each.
    fn judged(
        known: &mut Plausibility,
        reading: Result<Reading, DeviceError>,
    ) -> Result<Option<f64>, DeviceError> {
        known.validate(reading, 1, STEP_M).map(|believed| believed.jumped_m)
    }

    #[test]
    fn after_a_silence_what_is_far_is_elsewhere() {
        let mut known = Plausibility::default();
        assert_eq!(judged(&mut known, at(0.0)), Ok(None));
        for _ in 0..3 {
            assert_eq!(judged(&mut known, Err(DeviceError::TimedOut)), Err(DeviceError::TimedOut));
        }
        // In four ticks a hand comes 80 mm far, but not unseen.
        assert_eq!(judged(&mut known, at(0.05)), Ok(Some(0.05)));
        assert_eq!(judged(&mut known, at(0.05)), Ok(None));
        assert_eq!(judged(&mut known, Err(DeviceError::TimedOut)), Err(DeviceError::TimedOut));
        assert_eq!(judged(&mut known, at(0.06)), Ok(None));
        assert_eq!(judged(&mut known, Err(DeviceError::TimedOut)), Err(DeviceError::TimedOut));
        assert_eq!(judged(&mut known, at(0.2)), Err(DeviceError::Jumped));
    }

    #[test]
    fn a_silence_before_the_first_reading_is_no_licence() {
        let mut known = Plausibility::default();
        for _ in 0..1000 {
            assert!(judged(&mut known, Err(DeviceError::TimedOut)).is_err());
        }
        assert_eq!(judged(&mut known, at(0.0)), Ok(None));
        assert_eq!(judged(&mut known, at(0.05)), Err(DeviceError::Jumped));
    }

    #[test]
    fn a_slow_device_may_repeat_itself_and_one_that_hangs_may_not() {
        let mut known = Plausibility::default();
        for number in 0..10 {
            // One of 100 Hz.
            assert!((0..10).all(|_| judged(&mut known, numbered(number)).is_ok()));
        }
        let repeats = (0..100).map(|_| judged(&mut known, numbered(9)));
        let refused = repeats.filter(|judged| *judged == Err(DeviceError::Repeated)).count();
        assert_eq!(refused, 99);
        assert!(judged(&mut known, numbered(10)).is_ok());
    }

    #[test]
    fn what_is_older_is_refused_until_it_is_clear_that_the_device_counts_anew() {
        let mut known = Plausibility::default();
        for (number, is_newer) in [(7, true), (9, true), (8, false), (11, true), (10, false)] {
            let expected = if is_newer { Ok(None) } else { Err(DeviceError::Reordered) };
            assert_eq!(judged(&mut known, numbered(number)), expected, "{number}");
        }
        // The last of those before was one already.
        let anew: Vec<bool> = (0..45).map(|number| judged(&mut known, numbered(number)).is_ok()).collect();
        assert_eq!(anew.iter().position(|is_taken| *is_taken), Some(11), "it has come up to the old one");
        let mut known = Plausibility::default();
        judged(&mut known, numbered(1_000_000)).unwrap();
        let anew: Vec<bool> = (0..45).map(|number| judged(&mut known, numbered(number)).is_ok()).collect();
        assert_eq!(anew.iter().position(|is_taken| *is_taken), Some(39));
        assert!(anew[39..].iter().all(|is_taken| *is_taken));
    }
}
