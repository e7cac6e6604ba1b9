//! Statistics of a device's reports.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Statistics of a device since its creation. Clones share the same counters.
#[derive(Clone, Debug, Default)]
pub struct HidCounters(Arc<Counters>);

#[derive(Debug, Default)]
struct Counters {
    read: AtomicU64,
    skipped: AtomicU64,
    malformed: AtomicU64,
    forces: AtomicU64,
    first_force_ns: AtomicU64,
    last_force_ns: AtomicU64,
}

impl HidCounters {
    /// Number of valid input reports read.
    #[must_use]
    pub fn read(&self) -> u64 {
        self.0.read.load(Ordering::Relaxed)
    }

    /// Number of valid input reports that a newer one superseded before they were used.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.0.skipped.load(Ordering::Relaxed)
    }

    /// Number of malformed input reports, which the driver discards.
    #[must_use]
    pub fn malformed(&self) -> u64 {
        self.0.malformed.load(Ordering::Relaxed)
    }

    /// Number of forces sent since the device was opened, each with all of its reports accepted. A joystick driver sends an unchanged
    /// force only every 25 ms; the ticks between are not counted.
    #[must_use]
    pub fn forces(&self) -> u64 {
        self.0.forces.load(Ordering::Relaxed)
    }

    /// Mean rate of sent forces, Hz, from the first to the latest since the device was opened; `None` before the second.
    ///
    /// The rate depends on the forces: a joystick driver sends a force that changes at every tick of 1 ms at 1000 Hz, and a constant
    /// force at 40 Hz. To find the highest rate of a device, measure while the force changes.
    #[must_use]
    pub fn force_rate_hz(&self) -> Option<f64> {
        let ns = |of: &AtomicU64| of.load(Ordering::Relaxed);
        let (first, last) = (ns(&self.0.first_force_ns), ns(&self.0.last_force_ns));
        let forces = self.forces();
        (forces > 1 && last > first).then(|| (forces - 1) as f64 * 1e9 / (last - first) as f64)
    }

    pub(crate) fn note_read(&self, read: u64, skipped: u64, malformed: u64) {
        self.0.read.fetch_add(read, Ordering::Relaxed);
        self.0.skipped.fetch_add(skipped, Ordering::Relaxed);
        self.0.malformed.fetch_add(malformed, Ordering::Relaxed);
    }

    pub(crate) fn note_force(&self, at: Duration) {
        let at_ns = u64::try_from(at.as_nanos()).unwrap_or(u64::MAX);
        if self.0.forces.fetch_add(1, Ordering::Relaxed) == 0 {
            self.0.first_force_ns.store(at_ns, Ordering::Relaxed);
        }
        self.0.last_force_ns.store(at_ns, Ordering::Relaxed);
    }

    /// Restarts the count and the rate of forces when the device is opened.
    pub(crate) fn opened(&self) {
        self.0.forces.store(0, Ordering::Relaxed);
    }
}
