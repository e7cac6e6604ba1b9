//! Connection to an open device: reads all pending reports and counts them.

use crate::bus::MAX_INPUT_REPORT_BYTES;
use crate::{Clock, HidConnection, HidCounters};
use palpate_haptics::DeviceError;
use std::time::Duration;

/// Maximum number of reports read in one tick. It exceeds the queue of every operating system, so the latest report is reached, and
/// bounds the loop for a device that sends faster than it can be read.
const MAX_REPORTS_PER_DRAIN: usize = 128;

/// Number of unread reports that hidraw keeps: one place in its ring of 64 (`HIDRAW_BUFFER_SIZE`) stays free. It drops newer ones.
const QUEUE_CAPACITY: u64 = 63;

/// Result of reading all pending reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Drained {
    /// Whether the queue was full, so that newer reports may be lost.
    pub(crate) was_full: bool,
}

/// Result of processing one input report.
pub(crate) enum Handled {
    /// The driver used the report. A later report of the same kind (a small number) in the same tick makes it count as skipped.
    Used(u8),
    /// The report is valid and contains nothing for the driver.
    Ignored,
    /// The report is malformed.
    Malformed,
}

/// An open device.
pub(crate) struct Link {
    connection: Box<dyn HidConnection>,
    /// Whether the connection has reported that the device is gone. No further call is made then, as `hidapi` allocates a message for
    /// each error. A device that returns gets a new link.
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

    /// Returns the clock for reuse by the next link.
    pub(crate) fn into_clock(self) -> Box<dyn Clock> {
        self.clock
    }

    /// Calls `operation` on the connection, unless the device is gone.
    fn with_connection<T>(
        &mut self,
        operation: impl FnOnce(&mut dyn HidConnection, &mut [u8]) -> Result<T, DeviceError>,
    ) -> Result<T, DeviceError> {
        if self.is_gone {
            return Err(DeviceError::Disconnected);
        }
        let result = operation(&mut *self.connection, &mut self.buffer);
        self.is_gone = matches!(result, Err(DeviceError::Disconnected));
        result
    }

    /// Reads all pending reports, oldest first, and waits at most `within` for the first. hidraw keeps the oldest reports and drops newer
    /// ones, so the queue must be emptied. An error is returned only if no report was read before it: the next call meets it again.
    pub(crate) fn drain(
        &mut self,
        within: Duration,
        mut take: impl FnMut(&[u8]) -> Handled,
    ) -> Result<Drained, DeviceError> {
        let (mut read, mut skipped, mut malformed) = (0, 0, 0);
        let mut kinds = 0_u64;
        let mut wait = within;
        let mut ended = Ok(());
        for _ in 0..MAX_REPORTS_PER_DRAIN {
            let length = match self.with_connection(|connection, buffer| connection.read(buffer, wait)) {
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
        ended.map(|()| Drained { was_full: read + malformed >= QUEUE_CAPACITY })
    }

    /// Sends an output report.
    pub(crate) fn write(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.with_connection(|connection, _| connection.write(report))
    }

    /// Reads the feature report with the ID `report[0]`.
    pub(crate) fn feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError> {
        self.with_connection(|connection, _| connection.feature(report))
    }

    /// Sends a feature report.
    pub(crate) fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.with_connection(|connection, _| connection.set_feature(report))
    }

    /// Counts a force whose reports, at least one, were all sent.
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

    /// Counts the calls and allocates a message for each error.
    struct FailingConnection {
        calls: Arc<AtomicUsize>,
        error: DeviceError,
    }

    impl FailingConnection {
        fn count_call(&self) -> DeviceError {
            self.calls.fetch_add(1, Ordering::SeqCst);
            drop(self.error.to_string());
            self.error
        }
    }

    impl HidConnection for FailingConnection {
        fn read(&mut self, _: &mut [u8], _: Duration) -> Result<usize, DeviceError> {
            Err(self.count_call())
        }
        fn write(&mut self, _: &[u8]) -> Result<(), DeviceError> {
            Err(self.count_call())
        }
        fn feature(&mut self, _: &mut [u8]) -> Result<usize, DeviceError> {
            Err(self.count_call())
        }
        fn set_feature(&mut self, _: &[u8]) -> Result<(), DeviceError> {
            Err(self.count_call())
        }
    }

    fn link(error: DeviceError) -> (Link, Arc<AtomicUsize>) {
        let calls = Arc::<AtomicUsize>::default();
        let connection = Box::new(FailingConnection { calls: Arc::clone(&calls), error });
        (Link::new(connection, crate::clock::monotonic(), HidCounters::default()), calls)
    }

    fn call_all(link: &mut Link) -> [Result<(), DeviceError>; 4] {
        [
            link.drain(Duration::ZERO, |_| Handled::Ignored).map(|_| ()),
            link.write(&[1]),
            link.feature(&mut [1]).map(|_| ()),
            link.set_feature(&[1]),
        ]
    }

    #[test]
    fn disconnected_link_makes_no_further_calls_and_allocates_nothing() {
        let (mut link, calls) = link(DeviceError::Disconnected);
        assert_eq!(link.write(&[1]), Err(DeviceError::Disconnected));
        let allocations = allocation_counter::measure(|| {
            for _ in 0..100 {
                assert_eq!(call_all(&mut link), [Err(DeviceError::Disconnected); 4]);
            }
        });
        assert_eq!(calls.load(Ordering::SeqCst), 1);
        assert_eq!(allocations.count_total, 0, "{allocations:?}");
    }

    #[test]
    fn link_stays_open_after_other_errors() {
        let (mut link, calls) = link(DeviceError::Os(5));
        assert_eq!(call_all(&mut link), [Err(DeviceError::Os(5)); 4]);
        assert_eq!(calls.load(Ordering::SeqCst), 4);
    }
}
