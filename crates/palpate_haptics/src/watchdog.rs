//! Zero force for a device in which the loop hangs.

use crate::clock::MonotonicClock;
use crate::{DeviceError, HapticDevice, RealTimeRequest};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A way to a device's actuators beside [`HapticDevice`], for a thread of its own.
pub trait EmergencyStop: Send {
    /// Zero force, now: the loop's thread hangs in the device, has not been run for too long, or cannot write to the device.
    ///
    /// # Errors
    /// [`DeviceError`] when even that is not possible; it is tried again. After a panic it is not, until the loop has gone on.
    fn stop(&mut self) -> Result<(), DeviceError>;
}

/// So long the loop may be silent before the watchdog stops the device: a device whose loop has not looked for that long has
/// shown fifty old forces.
const SILENCE_NS: u64 = 50_000_000;
/// How often it looks.
const LOOK_NS: u64 = 5_000_000;

/// What loop, watchdog and app share.
pub(crate) struct Watchdog {
    /// That of both: clocks that were started at different times need not agree.
    clock: MonotonicClock,
    /// When the loop last began a tick after one whose force the device took, on that clock, ns; 0 before the first and while
    /// the device is opened anew.
    beat_ns: AtomicU64,
    /// How often the device was stopped.
    stops: AtomicU64,
    /// There is a thread that watches.
    is_watching: AtomicBool,
    /// The loop has ended.
    has_ended: AtomicBool,
    /// Locked by the loop only when the device is opened, never at a tick.
    stop: Mutex<Option<Box<dyn EmergencyStop>>>,
}

impl fmt::Debug for Watchdog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watched")
            .field("beat_ns", &self.beat_ns)
            .field("stops", &self.stops)
            .finish_non_exhaustive()
    }
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            clock: MonotonicClock::start(),
            beat_ns: AtomicU64::new(0),
            stops: AtomicU64::new(0),
            is_watching: AtomicBool::new(false),
            has_ended: AtomicBool::new(false),
            stop: Mutex::new(None),
        }
    }
}

impl Watchdog {
    /// Takes what an open device offers, and begins to watch it with the first that does. Whether it is watched. `real_time` is
    /// what the loop's thread asked for: the watchdog goes before it, or a driver that waits busily on the same core would keep
    /// it from running.
    pub(crate) fn begin(self: &Arc<Self>, device: &mut dyn HapticDevice, real_time: RealTimeRequest) -> bool {
        let offered = device.emergency_stop();
        let is_offered = offered.is_some();
        // What a device offered before it was opened anew leads nowhere now.
        *self.stop.lock().unwrap_or_else(PoisonError::into_inner) = offered;
        if !is_offered || self.is_watching.swap(true, Ordering::AcqRel) {
            return is_offered;
        }
        let watched = Arc::clone(self);
        let priority = real_time.priority.map(|priority| priority.saturating_add(1).min(99));
        let thread = std::thread::Builder::new().name("haptic-watchdog".into());
        let spawned = thread.spawn(move || {
            // If it is refused, the loop's own was too.
            let _ = RealTimeRequest { priority, ..RealTimeRequest::NONE }.apply_to_current_thread();
            watched.watch();
        });
        self.is_watching.store(spawned.is_ok(), Ordering::Release);
        spawned.is_ok()
    }

    /// The device is about to be opened anew, which takes the time that it takes.
    pub(crate) fn suspend(&self) {
        self.beat_ns.store(0, Ordering::Release);
    }

    /// The loop begins a tick.
    pub(crate) fn heartbeat(&self) {
        // Never 0, which is before the first.
        self.beat_ns.store(self.clock.now_ns().max(1), Ordering::Release);
    }

    /// The loop has ended.
    pub(crate) fn end(&self) {
        self.has_ended.store(true, Ordering::Release);
    }

    /// How often the device was stopped.
    pub(crate) fn stops(&self) -> u64 {
        self.stops.load(Ordering::Acquire)
    }

    fn watch(&self) {
        let (clock, mut stopped_at) = (self.clock, 0);
        while !self.has_ended.load(Ordering::Acquire) {
            clock.sleep_until(clock.now_ns() + LOOK_NS);
            let beat = self.beat_ns.load(Ordering::Acquire);
            let is_silent = beat > 0 && clock.now_ns().saturating_sub(beat) > SILENCE_NS;
            // Once for every silence; again if it did not work.
            if !is_silent || stopped_at == beat {
                continue;
            }
            let mut stop = self.stop.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(stop) = stop.as_mut() else { continue };
            match catch_unwind(AssertUnwindSafe(|| stop.stop())) {
                Ok(Ok(())) => {
                    stopped_at = beat;
                    self.stops.fetch_add(1, Ordering::AcqRel);
                }
                Ok(Err(_)) => {}
                // What panicked once need not be asked two hundred times a second.
                Err(_) => stopped_at = beat,
            }
        }
    }
}
