//! An open device as a driver sees it: the newest of what has come, and a count of the rest.

use crate::bus::LONGEST_INPUT;
use crate::{Clock, HidConnection, HidCounters};
use palpate_haptics::DeviceError;
use std::time::Duration;

/// So many reports are read at once at most: more than any operating system keeps, so that the newest is reached, and an end for a
/// device that sends faster than it can be read.
const MOST_AT_ONCE: usize = 128;

/// What a driver makes of one input report.
pub(crate) enum Understood {
    /// It took something from it. Where it takes another of the same kind (a small number) at the same tick, this one was skipped.
    As(u8),
    /// It is a report of such a device in which there is nothing for it.
    Nothing,
    /// It is none.
    Malformed,
}

/// An open device.
pub(crate) struct Link {
    connection: Box<dyn HidConnection>,
    pub(crate) clock: Box<dyn Clock>,
    pub(crate) counters: HidCounters,
    buffer: [u8; LONGEST_INPUT],
}

impl Link {
    pub(crate) fn new(
        connection: Box<dyn HidConnection>,
        clock: Box<dyn Clock>,
        counters: HidCounters,
    ) -> Self {
        Self { connection, clock, counters, buffer: [0; LONGEST_INPUT] }
    }

    /// Gives its parts back, to be opened anew.
    pub(crate) fn into_clock(self) -> Box<dyn Clock> {
        self.clock
    }

    /// Reads all that has come, oldest first, waiting `within` for the first at most. hidraw keeps the oldest reports and loses
    /// newer ones, so nothing may be left there. An error is told only where nothing was read before it: it comes again.
    pub(crate) fn drain(
        &mut self,
        within: Duration,
        mut take: impl FnMut(&[u8]) -> Understood,
    ) -> Result<(), DeviceError> {
        let (mut read, mut skipped, mut malformed) = (0, 0, 0);
        let mut kinds = 0_u64;
        let mut wait = within;
        let mut ended = Ok(());
        for _ in 0..MOST_AT_ONCE {
            let length = match self.connection.read(&mut self.buffer, wait) {
                Ok(0) => break,
                Ok(length) => length,
                Err(error) => {
                    ended = if read + malformed == 0 { Err(error) } else { Ok(()) };
                    break;
                }
            };
            wait = Duration::ZERO;
            match take(self.buffer.get(..length).unwrap_or_default()) {
                Understood::As(kind) => {
                    let bit = 1 << (kind & 63);
                    skipped += u64::from(kinds & bit != 0);
                    kinds |= bit;
                    read += 1;
                }
                Understood::Nothing => read += 1,
                Understood::Malformed => malformed += 1,
            }
        }
        self.counters.note_read(read, skipped, malformed);
        ended
    }

    /// Sends an output report.
    pub(crate) fn write(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.connection.write(report)
    }

    /// Asks for a feature report, whose number is the first byte of `report`.
    pub(crate) fn feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError> {
        self.connection.feature(report)
    }

    /// Sends a feature report.
    pub(crate) fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.connection.set_feature(report)
    }

    /// The device has taken a force with all its reports, of which there was one at least.
    pub(crate) fn note_force(&mut self) {
        let now = self.clock.now();
        self.counters.note_force(now);
    }
}
