//! What a driver has seen of its device.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// What a driver has seen of its device since it was made; shared with whoever wants to know.
#[derive(Clone, Debug, Default)]
pub struct HidCounters(Arc<Counted>);

#[derive(Debug, Default)]
struct Counted {
    read: AtomicU64,
    skipped: AtomicU64,
    malformed: AtomicU64,
    forces: AtomicU64,
    first_force_ns: AtomicU64,
    last_force_ns: AtomicU64,
}

impl HidCounters {
    /// Input reports that were read and understood.
    #[must_use]
    pub fn read(&self) -> u64 {
        self.0.read.load(Ordering::Relaxed)
    }

    /// Those of them that were passed over for newer ones that had come by then.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.0.skipped.load(Ordering::Relaxed)
    }

    /// Input reports that were no reports of such a device; they are passed over.
    #[must_use]
    pub fn malformed(&self) -> u64 {
        self.0.malformed.load(Ordering::Relaxed)
    }

    /// Forces that went out to the device and that it took, each with all its reports since it was opened. A joystick is told a force
    /// that has not changed every 25 ms only; the ticks in between are not counted.
    #[must_use]
    pub fn forces(&self) -> u64 {
        self.0.forces.load(Ordering::Relaxed)
    }

    /// How often a force went out and the device took it, Hz, from the first to the newest since it was opened; `None` before the
    /// second. It is what was needed and not what could be: a joystick that is told a changed force at every tick of 1 ms has 1000,
    /// and one whose force rests 40. For the highest rate of a device measure while its force changes.
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

    /// The device is opened anew: the rate of its forces is counted from then.
    pub(crate) fn opened(&self) {
        self.0.forces.store(0, Ordering::Relaxed);
    }
}
