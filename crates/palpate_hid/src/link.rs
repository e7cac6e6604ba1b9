//! An open device as a driver sees it: the newest of what has come, and a count of the rest.

use crate::bus::MAX_INPUT_REPORT_BYTES;
use crate::{Clock, HidConnection, HidCounters};
use palpate_haptics::DeviceError;
use std::time::Duration;

/// So many reports are read at once at most: more than any operating system keeps, so that the newest is reached, and an end for a
/// device that sends faster than it can be read.
const MAX_REPORTS_PER_DRAIN: usize = 128;

/// What a driver makes of one input report.
pub(crate) enum Handled {
    /// It took something from it. Where it takes another of the same kind (a small number) at the same tick, this one was skipped.
    Used(u8),
    /// It is a report of such a device in which there is nothing for it.
    Ignored,
    /// It is none.
    Malformed,
}

/// An open device.
pub(crate) struct Link {
    connection: Box<dyn HidConnection>,
    /// Whether the connection has said that the device is gone: it is not asked again, as it may make a text for every answer. A
    /// device that comes back is a new link.
    is_gone: bool,
    pub(crate) clock: Box<dyn Clock>,
    pub(crate) counters: HidCounters,
    buffer: [u8; MAX_INPUT_REPORT_BYTES],
}

impl Link {
    pub(crate) fn new(
        connection: Box<dyn HidConnection>,
        clock: Box<dyn Clock>,
        counters: HidCounters,
    ) -> Self {
        Self { connection, is_gone: false, clock, counters, buffer: [0; MAX_INPUT_REPORT_BYTES] }
    }

    /// Gives its parts back, to be opened anew.
    pub(crate) fn into_clock(self) -> Box<dyn Clock> {
        self.clock
    }

    /// Asks the connection, unless the device is gone.
    fn ask<T>(
        &mut self,
        ask: impl FnOnce(&mut dyn HidConnection, &mut [u8]) -> Result<T, DeviceError>,
    ) -> Result<T, DeviceError> {
        if self.is_gone {
            return Err(DeviceError::Disconnected);
        }
        let answer = ask(&mut *self.connection, &mut self.buffer);
        self.is_gone = matches!(answer, Err(DeviceError::Disconnected));
        answer
    }

    /// Reads all that has come, oldest first, waiting `within` for the first at most. hidraw keeps the oldest reports and loses
    /// newer ones, so nothing may be left there. An error is told only where nothing was read before it: it comes again.
    pub(crate) fn drain(
        &mut self,
        within: Duration,
        mut take: impl FnMut(&[u8]) -> Handled,
    ) -> Result<(), DeviceError> {
        let (mut read, mut skipped, mut malformed) = (0, 0, 0);
        let mut kinds = 0_u64;
        let mut wait = within;
        let mut ended = Ok(());
        for _ in 0..MAX_REPORTS_PER_DRAIN {
            let length = match self.ask(|connection, buffer| connection.read(buffer, wait)) {
                Ok(0) => break,
                Ok(length) => length,
                Err(error) => {
                    ended = if read + malformed == 0 { Err(error) } else { Ok(()) };
                    break;
                }
            };
            wait = Duration::ZERO;
            match take(self.buffer.get(..length).unwrap_or_default()) {
                Handled::Used(kind) => {
                    let bit = 1 << (kind & 63);
                    skipped += u64::from(kinds & bit != 0);
                    kinds |= bit;
                    read += 1;
                }
                Handled::Ignored => read += 1,
                Handled::Malformed => malformed += 1,
            }
        }
        self.counters.note_read(read, skipped, malformed);
        ended
    }

    /// Sends an output report.
    pub(crate) fn write(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.ask(|connection, _| connection.write(report))
    }

    /// Asks for a feature report, whose number is the first byte of `report`.
    pub(crate) fn feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError> {
        self.ask(|connection, _| connection.feature(report))
    }

    /// Sends a feature report.
    pub(crate) fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.ask(|connection, _| connection.set_feature(report))
    }

    /// The device has taken a force with all its reports, of which there was one at least.
    pub(crate) fn note_force(&mut self) {
        let now = self.clock.now();
        self.counters.note_force(now);
    }
}

#[cfg(test)]
mod test {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Counts how often it is asked, and makes a text for each of its errors.
    struct Counted {
        asked: Arc<AtomicUsize>,
        answer: DeviceError,
    }

    impl Counted {
        fn answer(&self) -> DeviceError {
            self.asked.fetch_add(1, Ordering::SeqCst);
            drop(self.answer.to_string());
            self.answer
        }
    }

    impl HidConnection for Counted {
        fn read(&mut self, _: &mut [u8], _: Duration) -> Result<usize, DeviceError> {
            Err(self.answer())
        }
        fn write(&mut self, _: &[u8]) -> Result<(), DeviceError> {
            Err(self.answer())
        }
        fn feature(&mut self, _: &mut [u8]) -> Result<usize, DeviceError> {
            Err(self.answer())
        }
        fn set_feature(&mut self, _: &[u8]) -> Result<(), DeviceError> {
            Err(self.answer())
        }
    }

    fn link(answer: DeviceError) -> (Link, Arc<AtomicUsize>) {
        let asked = Arc::<AtomicUsize>::default();
        let connection = Box::new(Counted { asked: Arc::clone(&asked), answer });
        (Link::new(connection, crate::clock::monotonic(), HidCounters::default()), asked)
    }

    fn ask_all(link: &mut Link) -> [Result<(), DeviceError>; 4] {
        [
            link.drain(Duration::ZERO, |_| Handled::Ignored),
            link.write(&[1]),
            link.feature(&mut [1]).map(|_| ()),
            link.set_feature(&[1]),
        ]
    }

    #[test]
    fn a_connection_without_its_device_is_asked_once_and_nothing_is_allocated() {
        let (mut link, asked) = link(DeviceError::Disconnected);
        assert_eq!(link.write(&[1]), Err(DeviceError::Disconnected));
        let allocations = allocation_counter::measure(|| {
            for _ in 0..100 {
                assert_eq!(ask_all(&mut link), [Err(DeviceError::Disconnected); 4]);
            }
        });
        assert_eq!(asked.load(Ordering::SeqCst), 1);
        assert_eq!(allocations.count_total, 0, "{allocations:?}");
    }

    #[test]
    fn after_another_error_it_is_asked_again() {
        let (mut link, asked) = link(DeviceError::Os(5));
        assert_eq!(ask_all(&mut link), [Err(DeviceError::Os(5)); 4]);
        assert_eq!(asked.load(Ordering::SeqCst), 4);
    }
}
