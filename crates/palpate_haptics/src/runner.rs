//! The thread that owns a device and runs its loop. Only this file, the watchdog and [`crate::BaselineThread`] read a clock for a
//! loop.
//!
//! # Life of a loop's thread
//!
//! 1. (app) [`HapticLoop::spawn`] moves loop and device into a new thread named `haptic-loop`.
//! 2. (thread) The thread requests priority, locked memory and core ([`crate::RealTimeRequest`]), reports the results, and opens the
//!    device. If opening fails, the thread reports [`crate::LoopEventKind::DeviceFailed`], writes nothing and continues with 5.
//!    If the device offers an [`crate::EmergencyStop`], a watchdog thread of higher priority calls it when for 50 ms the loop has
//!    started no tick or the device has accepted no force. Otherwise the thread reports
//!    [`crate::LoopEventKind::NoEmergencyStop`].
//! 3. (thread) At every deadline, a whole number of periods after the start on the monotonic clock: read, tick, write. Missed
//!    deadlines are counted and skipped, never made up by a burst of ticks.
//!    A disconnected device is closed and opened again, twice a second; each new reason of a failure is reported once
//!    ([`crate::LoopEventKind::ReopenFailed`]).
//! 4. (app) [`LoopThread::stop`], or dropping it, sets the stop flag. (thread) The thread reads the flag within a period, writes zero
//!    force and closes the device. If the tick or the device panics, it does both while unwinding.
//! 5. (thread) The thread publishes the last report and returns. After a panic the last event is
//!    [`crate::LoopEventKind::Panicked`].
//! 6. (app) The app joins the thread. If the thread has not returned within 200 ms, because the device blocks, it is detached
//!    ([`StopOutcome::Detached`]).

use crate::clock::MonotonicClock;
use crate::watchdog::Watchdog;
use crate::{BaselineThread, DeviceError, HapticDevice, HapticLoop, HapticsError, TickTiming};
use glam::DVec3;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Maximum time for which [`LoopThread::stop`] waits for the thread.
const JOIN_WITHIN: Duration = Duration::from_millis(200);

/// Ticks between two attempts to open a disconnected device.
const RECONNECT_TICKS: u64 = 500;

/// A running loop. Dropping it stops the loop with zero force and joins its thread.
#[derive(Debug)]
pub struct LoopThread {
    stop: Arc<AtomicBool>,
    watchdog: Arc<Watchdog>,
    thread: Option<JoinHandle<StoppedLoop>>,
}

/// Result of stopping a loop's thread.
#[derive(Debug)]
pub enum StopOutcome {
    /// The thread returned; the device is at zero force, closed and dropped.
    Joined,
    /// The device or the loop panicked; zero force was written during unwinding.
    Panicked,
    /// The thread did not return in time, because the device blocks, and was detached.
    Detached,
    /// The thread had been stopped before.
    AlreadyStopped,
}

impl HapticLoop {
    /// Runs the loop with `device` on a thread of its own.
    ///
    /// # Errors
    /// [`HapticsError::Thread`] if the operating system cannot create a thread.
    pub fn spawn(self, device: Box<dyn HapticDevice>) -> Result<LoopThread, HapticsError> {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let watchdog = Arc::<Watchdog>::default();
        let shared = Arc::clone(&watchdog);
        let thread = std::thread::Builder::new()
            .name("haptic-loop".into())
            .spawn(move || {
                let mut device = device;
                open_and_run(
                    self,
                    device.as_mut(),
                    &flag,
                    Companions { watchdog: Some(&shared), baseline: None },
                )
            })
            .map_err(HapticsError::Thread)?;
        Ok(LoopThread { stop, watchdog, thread: Some(thread) })
    }
}

impl LoopThread {
    /// Whether the thread still runs.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Number of times the watchdog has stopped the device. The loop itself reports a stop only after it has resumed.
    #[must_use]
    pub fn emergency_stops(&self) -> u64 {
        self.watchdog.stops()
    }

    /// Stops the loop with zero force and waits at most 200 ms for its thread.
    pub fn stop(&mut self) -> StopOutcome {
        // Relaxed would suffice, because the flag carries no other data; Release makes earlier writes of the app visible.
        self.stop.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else {
            return StopOutcome::AlreadyStopped;
        };
        let clock = MonotonicClock::start();
        let give_up = clock.now_ns() + JOIN_WITHIN.as_nanos() as u64;
        while !thread.is_finished() {
            if clock.now_ns() >= give_up {
                return StopOutcome::Detached;
            }
            clock.sleep_until((clock.now_ns() + 200_000).min(give_up));
        }
        thread.join().map_or(StopOutcome::Panicked, |_| StopOutcome::Joined)
    }
}

impl Drop for LoopThread {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Opens `device` and runs `haptic_loop` on the calling thread until `stop` is set; then writes zero force and closes the device. A device
/// that cannot be opened is tried again twice a second.
/// [`HapticLoop::spawn`] does the same on a new thread, with a watchdog.
pub fn run(haptic_loop: HapticLoop, device: &mut dyn HapticDevice, stop: &AtomicBool) -> StoppedLoop {
    open_and_run(haptic_loop, device, stop, Companions::default())
}

/// As [`run`], with a [`BaselineThread`] that starts half a period after the loop and ends with it.
#[doc(hidden)]
pub fn run_with_baseline(
    haptic_loop: HapticLoop,
    device: &mut dyn HapticDevice,
    stop: &AtomicBool,
    baseline: &BaselineThread,
) -> StoppedLoop {
    open_and_run(haptic_loop, device, stop, Companions { baseline: Some(baseline), watchdog: None })
}

/// Threads that run next to the loop's.
#[derive(Clone, Copy, Default)]
struct Companions<'a> {
    watchdog: Option<&'a Arc<Watchdog>>,
    baseline: Option<&'a BaselineThread>,
}

impl Drop for StopCompanions<'_> {
    fn drop(&mut self) {
        if let Some(watchdog) = self.0.watchdog {
            watchdog.end();
        }
        if let Some(baseline) = self.0.baseline {
            baseline.end_with_loop();
        }
    }
}

/// Stops the companions on drop.
struct StopCompanions<'a>(Companions<'a>);

fn open_and_run(
    mut haptic_loop: HapticLoop,
    device: &mut dyn HapticDevice,
    stop: &AtomicBool,
    companions: Companions<'_>,
) -> StoppedLoop {
    haptic_loop.set_up_thread();
    // The companions never outlive the loop.
    let stop_companions = StopCompanions(companions);
    if !open_first(&mut haptic_loop, device, stop) {
        haptic_loop.end(Ok(()));
        return StoppedLoop { _memory: haptic_loop };
    }
    let real_time = haptic_loop.config().real_time;
    let is_watched = companions.watchdog.is_some_and(|watchdog| watchdog.begin(device, real_time));
    haptic_loop.start(device.notice());
    if !is_watched {
        haptic_loop.no_emergency_stop();
    }
    let mut open = OpenDevice { device, closed: false };
    let result = catch_unwind(AssertUnwindSafe(|| {
        run_ticks(&mut haptic_loop, open.device, stop, companions);
        open.close(|| drop(stop_companions))
    }));
    match result {
        Ok(closed) => haptic_loop.end(closed),
        Err(panic) => {
            // Zero force first, then the last event.
            drop(open);
            haptic_loop.panicked();
            resume_unwind(panic);
        }
    }
    StoppedLoop { _memory: haptic_loop }
}

/// Opens the device, and tries again twice a second until it succeeds. Returns false if `stop` was set before.
fn open_first(haptic_loop: &mut HapticLoop, device: &mut dyn HapticDevice, stop: &AtomicBool) -> bool {
    let period = Duration::from_secs_f64(haptic_loop.config().hand_over.tick_s);
    let clock = MonotonicClock::start();
    let mut last_reason = None;
    loop {
        let Err(error) = device.open() else { return true };
        if last_reason.replace(error) != Some(error) {
            haptic_loop.open_failed(error);
        }
        for _ in 0..RECONNECT_TICKS {
            if stop.load(Ordering::Acquire) {
                return false;
            }
            clock.sleep_until(clock.now_ns() + period.as_nanos() as u64);
        }
    }
}

/// Memory of a loop that has ended, to be freed on another thread than the loop's.
#[derive(Debug)]
pub struct StoppedLoop {
    _memory: HapticLoop,
}

fn run_ticks(
    haptic_loop: &mut HapticLoop,
    device: &mut dyn HapticDevice,
    stop: &AtomicBool,
    Companions { watchdog, baseline }: Companions<'_>,
) {
    let period = Duration::from_secs_f64(haptic_loop.config().hand_over.tick_s);
    let period_ns = period.as_nanos() as u64;
    let clock = MonotonicClock::start();
    let mut deadline_ns = clock.now_ns() + period_ns;
    if let Some(baseline) = baseline {
        baseline.begin_in(period_ns + period_ns / 2);
    }
    let (mut elapsed, mut last_start_ns) = (1, None);
    let (mut stops, mut lost_ticks, mut was_written) = (0, 0, true);
    // `tick` has already reported the disconnection.
    let mut last_reason = DeviceError::Disconnected;
    while !stop.load(Ordering::Acquire) {
        clock.sleep_until(deadline_ns);
        if stop.load(Ordering::Acquire) {
            return;
        }
        let start_ns = clock.now_ns();
        if let Some(watchdog) = watchdog.filter(|_| was_written) {
            watchdog.heartbeat();
        }
        let lateness_ns = start_ns - deadline_ns;
        // Later deadlines that have also passed; this tick counts for the newest of them.
        let missed = lateness_ns / period_ns;
        elapsed += missed;
        let reading = device.read(period);
        let read_ns = clock.now_ns() - start_ns;
        // The read may have blocked; no force may follow a stop.
        if stop.load(Ordering::Acquire) {
            return;
        }
        let stops_now = watchdog.map_or(0, |watchdog| watchdog.stops());
        if std::mem::replace(&mut stops, stops_now) != stops_now {
            haptic_loop.emergency_stopped();
        }
        let output = haptic_loop.tick(elapsed, reading);
        let computed_ns = clock.now_ns();
        let written = device.write(output.device_force_n);
        let end_ns = clock.now_ns();
        let timing = TickTiming {
            lateness_ns,
            period_ns: last_start_ns.map_or(0, |last| start_ns - last),
            cost_ns: end_ns - start_ns,
            read_ns,
            write_ns: end_ns - computed_ns,
        };
        last_start_ns = Some(start_ns);
        haptic_loop.finish_tick(output, Some(timing), written);
        was_written = written.is_ok();
        let is_lost = [reading.err(), written.err()]
            .into_iter()
            .flatten()
            .any(|error| matches!(error, DeviceError::Disconnected | DeviceError::NotOpen));
        (lost_ticks, last_reason) =
            if is_lost { (lost_ticks + 1, last_reason) } else { (0, DeviceError::Disconnected) };
        if lost_ticks == RECONNECT_TICKS {
            lost_ticks = 0;
            let opened = reopen(haptic_loop, device, watchdog);
            was_written = opened.is_ok();
            if let Err(error) = opened
                && std::mem::replace(&mut last_reason, error) != error
            {
                haptic_loop.reopen_failed(error);
            }
        }
        if let Some(baseline) = baseline {
            baseline.note_tick(clock.now_ns() - start_ns);
        }
        deadline_ns += period_ns * (1 + missed);
        elapsed = 1;
    }
}

/// Closes a disconnected device and tries to open it again.
fn reopen(
    haptic_loop: &mut HapticLoop,
    device: &mut dyn HapticDevice,
    watchdog: Option<&Arc<Watchdog>>,
) -> Result<(), DeviceError> {
    if let Some(watchdog) = watchdog {
        watchdog.suspend();
    }
    // The device is lost; an error of closing gives no further information.
    let _ = device.close();
    device.open()?;
    if let Some(watchdog) = watchdog {
        watchdog.begin(device, haptic_loop.config().real_time);
    }
    haptic_loop.reconnected();
    Ok(())
}

/// An open device; drop sets zero force and closes it.
struct OpenDevice<'a> {
    device: &'a mut dyn HapticDevice,
    closed: bool,
}

impl OpenDevice<'_> {
    /// Writes zero force, calls `on_zeroed`, and closes the device.
    fn close(&mut self, on_zeroed: impl FnOnce()) -> Result<(), DeviceError> {
        let zeroed = self.device.write(DVec3::ZERO);
        on_zeroed();
        let closed = self.device.close();
        // Only now: if either call panics, drop tries once more.
        self.closed = true;
        closed.and(zeroed)
    }
}

impl Drop for OpenDevice<'_> {
    fn drop(&mut self) {
        if !self.closed {
            // The thread unwinds, so errors have no receiver. If writing zero force panics again, the device must still be closed,
            // and the app must not abort.
            let device = AssertUnwindSafe(&mut *self.device);
            let _ = catch_unwind(move || { device }.0.write(DVec3::ZERO));
            let device = AssertUnwindSafe(&mut *self.device);
            let _ = catch_unwind(move || { device }.0.close());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        LoopConfig, LoopSettings, Reading, RealTimeReport, RealTimeRequest, ScriptedDevice, haptic_loop,
    };

    /// The baseline thread waits for the loop, then each of its deadlines is either a wake-up or counted as missed.
    #[test]
    fn baseline_waits_for_loop_and_counts_every_deadline() {
        let config = LoopConfig { real_time: RealTimeRequest::NONE, ..LoopConfig::default() };
        let (_handle, haptic_loop) = haptic_loop(config, LoopSettings::default()).unwrap();
        let baseline = BaselineThread::spawn(&config).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let mut device = ScriptedDevice::new(move |n, _| {
            flag.store(n >= 100, Ordering::Release);
            Ok(Reading::at(DVec3::ZERO))
        });
        let clock = MonotonicClock::start();
        let start_ns = clock.now_ns();
        assert!(!baseline.has_started());
        run_with_baseline(haptic_loop, &mut device, &stop, &baseline);
        let report = baseline.stop().unwrap();
        let took_ms = (clock.now_ns() - start_ns) / 1_000_000;
        let deadlines = report.ticks + report.missed_deadlines;
        assert!((10..=took_ms).contains(&deadlines), "{deadlines} in {took_ms} ms");
        assert_eq!(report.lateness.count() + report.during_ticks, report.ticks);
        assert_eq!(report.real_time, RealTimeReport::default());
    }
}
