//! Watchdog of a loop: sets zero force when the loop is blocked in its device.

use crate::clock::MonotonicClock;
use crate::{EmergencyStop, HapticDevice, RealTimeRequest};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Time without a heartbeat after which the watchdog stops the device: 50 ticks with an old force.
const TIMEOUT_NS: u64 = 50_000_000;
/// Time between two checks.
const CHECK_NS: u64 = 5_000_000;

/// State shared by loop, watchdog and app.
pub(crate) struct Watchdog {
    /// Clock of loop and watchdog: clocks started at different times need not agree.
    clock: MonotonicClock,
    /// Time of the last heartbeat, ns; 0 before the first and while the device is being reopened.
    heartbeat_ns: AtomicU64,
    /// Number of times the device was stopped.
    stops: AtomicU64,
    /// Whether the watchdog's thread runs.
    is_watching: AtomicBool,
    /// Whether the loop has ended.
    has_ended: AtomicBool,
    /// The loop locks it only while opening the device, never in a tick.
    stop: Mutex<Option<Box<dyn EmergencyStop>>>,
}

impl fmt::Debug for Watchdog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watchdog")
            .field("heartbeat_ns", &self.heartbeat_ns)
            .field("stops", &self.stops)
            .finish_non_exhaustive()
    }
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            clock: MonotonicClock::start(),
            heartbeat_ns: AtomicU64::new(0),
            stops: AtomicU64::new(0),
            is_watching: AtomicBool::new(false),
            has_ended: AtomicBool::new(false),
            stop: Mutex::new(None),
        }
    }
}

impl Watchdog {
    /// Takes the emergency stop of an open device, and starts the watchdog's thread with the first one. Returns whether the device is
    /// watched. The watchdog's priority is one above that of the loop's thread (`real_time`): otherwise a driver that spins on the
    /// same core would prevent it from running.
    pub(crate) fn begin(self: &Arc<Self>, device: &mut dyn HapticDevice, real_time: RealTimeRequest) -> bool {
        let offered = device.emergency_stop();
        let is_offered = offered.is_some();
        // The emergency stop of an earlier opening is invalid.
        *self.stop.lock().unwrap_or_else(PoisonError::into_inner) = offered;
        if !is_offered || self.is_watching.swap(true, Ordering::AcqRel) {
            return is_offered;
        }
        let watchdog = Arc::clone(self);
        let priority = real_time.priority.map(|priority| priority.saturating_add(1).min(99));
        let thread = std::thread::Builder::new().name("haptic-watchdog".into());
        let spawned = thread.spawn(move || {
            // If this request is denied, so was the loop's.
            let _ = RealTimeRequest { priority, ..RealTimeRequest::NONE }.apply_to_current_thread();
            watchdog.watch();
        });
        self.is_watching.store(spawned.is_ok(), Ordering::Release);
        spawned.is_ok()
    }

    /// Suspends the timeout while the device is reopened, which may take long.
    pub(crate) fn suspend(&self) {
        self.heartbeat_ns.store(0, Ordering::Release);
    }

    /// Notes that the loop starts a tick and that the device accepted the last force.
    pub(crate) fn heartbeat(&self) {
        // 0 marks the time before the first heartbeat.
        self.heartbeat_ns.store(self.clock.now_ns().max(1), Ordering::Release);
    }

    /// Ends the watchdog together with the loop.
    pub(crate) fn end(&self) {
        self.has_ended.store(true, Ordering::Release);
    }

    /// Number of times the device was stopped.
    pub(crate) fn stops(&self) -> u64 {
        self.stops.load(Ordering::Acquire)
    }

    fn watch(&self) {
        let (clock, mut stopped_at) = (self.clock, 0);
        while !self.has_ended.load(Ordering::Acquire) {
            clock.sleep_until(clock.now_ns() + CHECK_NS);
            let heartbeat = self.heartbeat_ns.load(Ordering::Acquire);
            let is_late = heartbeat > 0 && clock.now_ns().saturating_sub(heartbeat) > TIMEOUT_NS;
            // Once for every timeout; again if the stop failed.
            if !is_late || stopped_at == heartbeat {
                continue;
            }
            let mut stop = self.stop.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(stop) = stop.as_mut() else { continue };
            match catch_unwind(AssertUnwindSafe(|| stop.stop())) {
                Ok(Ok(())) => {
                    stopped_at = heartbeat;
                    self.stops.fetch_add(1, Ordering::AcqRel);
                }
                Ok(Err(_)) => {}
                // A stop that panicked is not called again.
                Err(_) => stopped_at = heartbeat,
            }
        }
    }
}
