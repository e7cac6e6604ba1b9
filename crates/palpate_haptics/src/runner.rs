//! The thread that owns a device and turns its loop, the only place that reads a clock
//! beside the bare thread it is compared with ([`crate::BareThread`]).
//!
//! # Life of a loop's thread
//!
//! 1. (app) [`HapticLoop::spawn`] moves loop and device into a new thread named `haptic-loop`.
//! 2. (thread) Priority, locked memory and core are asked for ([`crate::RealTime`]); what came of it is told. The device is
//!    opened. If that fails the app is told ([`crate::LoopEventKind::DeviceFailed`]), nothing
//!    is written, and the thread goes on with 5.
//!    If it offers an [`crate::EmergencyStop`] a watchdog on another thread, of a higher priority, calls it when the loop has
//!    not begun a tick, or the device has taken no force, for 50 ms; if not that is told.
//! 3. (thread) At every deadline, a whole number of periods after the start on the monotonic clock: read, tick,
//!    write. Deadlines that passed meanwhile are counted and left out, never made up by a burst.
//!    A device that is disconnected is closed and opened again, tried twice a second; why that fails is told once for each reason
//!    ([`crate::LoopEventKind::ReopenFailed`]).
//! 4. (app) [`LoopThread::stop`], or dropping it, sets the stop flag. (thread) The flag is seen within a
//!    period; zero force is written and the device closed. If the tick or the device panics, both are still
//!    done while the thread unwinds.
//! 5. (thread) The last report is published and the thread returns. After a panic the last event says so
//!    ([`crate::LoopEventKind::Panicked`]).
//! 6. (app) The thread is joined; if it has not returned within 200 ms (a device that blocks) it is left to
//!    itself, and [`Stop::Detached`] says so.

use crate::clock::MonotonicClock;
use crate::watchdog::Watchdog;
use crate::{BaselineThread, DeviceError, HapticDevice, HapticLoop, HapticsError, TickTiming};
use glam::DVec3;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long [`LoopThread::stop`] waits for the thread.
const JOIN_WITHIN: Duration = Duration::from_millis(200);

/// Ticks between two attempts to open a device that is disconnected.
const RECONNECT_TICKS: u64 = 500;

/// A running loop. Dropping it stops the loop with zero force and joins its thread.
#[derive(Debug)]
pub struct LoopThread {
    stop: Arc<AtomicBool>,
    watched: Arc<Watchdog>,
    thread: Option<JoinHandle<StoppedLoop>>,
}

/// How a thread ended.
#[derive(Debug)]
pub enum StopOutcome {
    /// It returned; the device has zero force, is closed, and gone.
    Joined,
    /// The device or the loop panicked; zero force was written while it unwound.
    Panicked,
    /// It did not return in time and is left to itself; the device blocks.
    Detached,
    /// It had been stopped before.
    AlreadyStopped,
}

impl HapticLoop {
    /// Runs the loop with `device` on a thread of its own.
    ///
    /// # Errors
    /// [`HapticsError::Thread`] when the operating system gives no thread.
    pub fn spawn(self, device: Box<dyn HapticDevice>) -> Result<LoopThread, HapticsError> {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let watched = Arc::<Watchdog>::default();
        let of_thread = Arc::clone(&watched);
        let thread = std::thread::Builder::new()
            .name("haptic-loop".into())
            .spawn(move || {
                let mut device = device;
                open_and_run(
                    self,
                    device.as_mut(),
                    &flag,
                    Companions { watched: Some(&of_thread), bare: None },
                )
            })
            .map_err(HapticsError::Thread)?;
        Ok(LoopThread { stop, watched, thread: Some(thread) })
    }
}

impl LoopThread {
    /// Whether the thread still runs.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// How often the watchdog has stopped the device because the loop hung in it. The loop itself can tell only when the device
    /// lets it go on.
    #[must_use]
    pub fn emergency_stops(&self) -> u64 {
        self.watched.stops()
    }

    /// Stops the loop with zero force and waits for its thread, 200 ms at most.
    pub fn stop(&mut self) -> StopOutcome {
        // Relaxed would do: the flag carries no other data. Release keeps what the app did before visible.
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

/// Opens `device` and turns `haptic_loop` on the calling thread until `stop` is set; then writes zero force and
/// closes the device. This is what the thread of [`HapticLoop::spawn`] runs, with a watchdog besides.
pub fn run(haptic_loop: HapticLoop, device: &mut dyn HapticDevice, stop: &AtomicBool) -> StoppedLoop {
    open_and_run(haptic_loop, device, stop, Companions::default())
}

/// As [`run`], with a bare thread beside it to compare with, which begins half a period after the
/// loop and ends with it.
pub fn run_with_baseline(
    haptic_loop: HapticLoop,
    device: &mut dyn HapticDevice,
    stop: &AtomicBool,
    bare: &BaselineThread,
) -> StoppedLoop {
    open_and_run(haptic_loop, device, stop, Companions { bare: Some(bare), watched: None })
}

/// Threads beside the loop's.
#[derive(Clone, Copy, Default)]
struct Companions<'a> {
    watched: Option<&'a Arc<Watchdog>>,
    bare: Option<&'a BaselineThread>,
}

impl Drop for StopCompanions<'_> {
    fn drop(&mut self) {
        if let Some(watched) = self.0.watched {
            watched.end();
        }
        if let Some(bare) = self.0.bare {
            bare.end_with_loop();
        }
    }
}

/// Ends what is beside the loop when it is dropped.
struct StopCompanions<'a>(Companions<'a>);

fn open_and_run(
    mut haptic_loop: HapticLoop,
    device: &mut dyn HapticDevice,
    stop: &AtomicBool,
    beside: Companions<'_>,
) -> StoppedLoop {
    haptic_loop.set_up_thread();
    // Whatever happens, they do not outlive the loop.
    let end = StopCompanions(beside);
    if let Err(error) = device.open() {
        haptic_loop.end(Err(error));
        return StoppedLoop { _memory: haptic_loop };
    }
    let real_time = haptic_loop.config().real_time;
    let is_watched = beside.watched.is_some_and(|watched| watched.begin(device, real_time));
    haptic_loop.start(is_watched);
    let mut open = OpenDevice { device, closed: false };
    let turned = catch_unwind(AssertUnwindSafe(|| {
        run_ticks(&mut haptic_loop, open.device, stop, beside);
        open.close(|| drop(end))
    }));
    match turned {
        Ok(closed) => haptic_loop.end(closed),
        Err(panic) => {
            // Zero force first, then the last word.
            drop(open);
            haptic_loop.panicked();
            resume_unwind(panic);
        }
    }
    StoppedLoop { _memory: haptic_loop }
}

/// What is left of a loop that has ended: its memory, to be freed elsewhere than on the loop's thread.
#[derive(Debug)]
pub struct StoppedLoop {
    _memory: HapticLoop,
}

fn run_ticks(
    haptic_loop: &mut HapticLoop,
    device: &mut dyn HapticDevice,
    stop: &AtomicBool,
    Companions { watched, bare }: Companions<'_>,
) {
    let period = Duration::from_secs_f64(haptic_loop.config().hand_over.tick_s);
    let period_ns = period.as_nanos() as u64;
    let clock = MonotonicClock::start();
    let mut deadline_ns = clock.now_ns() + period_ns;
    if let Some(bare) = bare {
        bare.begin_in(period_ns + period_ns / 2);
    }
    let (mut elapsed, mut last_begun_ns) = (1, None);
    let (mut stops, mut lost_ticks, mut was_taken) = (0, 0, true);
    // That it is disconnected has been told by then.
    let mut told = DeviceError::Disconnected;
    while !stop.load(Ordering::Acquire) {
        clock.sleep_until(deadline_ns);
        if stop.load(Ordering::Acquire) {
            return;
        }
        let begun_ns = clock.now_ns();
        if let Some(watched) = watched.filter(|_| was_taken) {
            watched.heartbeat();
        }
        let lateness_ns = begun_ns - deadline_ns;
        // Deadlines after this one that have passed too: this tick stands for the newest of them.
        let missed = lateness_ns / period_ns;
        elapsed += missed;
        let reading = device.read(period);
        let read_ns = clock.now_ns() - begun_ns;
        // The read may have blocked; after a stop no force may follow.
        if stop.load(Ordering::Acquire) {
            return;
        }
        let stops_now = watched.map_or(0, |watched| watched.stops());
        if std::mem::replace(&mut stops, stops_now) != stops_now {
            haptic_loop.was_stopped();
        }
        let ticked = haptic_loop.tick(elapsed, reading);
        let ticked_ns = clock.now_ns();
        let written = device.write(ticked.device_force_n);
        let done_ns = clock.now_ns();
        let timing = TickTiming {
            lateness_ns,
            period_ns: last_begun_ns.map_or(0, |last| begun_ns - last),
            cost_ns: done_ns - begun_ns,
            read_ns,
            write_ns: done_ns - ticked_ns,
        };
        last_begun_ns = Some(begun_ns);
        haptic_loop.finish_tick(&ticked, Some(timing), written);
        was_taken = written.is_ok();
        let is_lost = [reading.err(), written.err()]
            .into_iter()
            .flatten()
            .any(|error| matches!(error, DeviceError::Disconnected | DeviceError::NotOpen));
        (lost_ticks, told) = if is_lost { (lost_ticks + 1, told) } else { (0, DeviceError::Disconnected) };
        if lost_ticks == RECONNECT_TICKS {
            lost_ticks = 0;
            let opened = reopen(haptic_loop, device, watched);
            was_taken = opened.is_ok();
            if let Err(error) = opened
                && std::mem::replace(&mut told, error) != error
            {
                haptic_loop.not_reopened(error);
            }
        }
        if let Some(bare) = bare {
            bare.note_tick(clock.now_ns() - begun_ns);
        }
        deadline_ns += period_ns * (1 + missed);
        elapsed = 1;
    }
}

/// Closes a device that is gone and tries to open it again, with zero force.
fn reopen(
    haptic_loop: &mut HapticLoop,
    device: &mut dyn HapticDevice,
    watched: Option<&Arc<Watchdog>>,
) -> Result<(), DeviceError> {
    if let Some(watched) = watched {
        watched.suspend();
    }
    // Nothing is left of what it was.
    let _ = device.close();
    device.open()?;
    if let Some(watched) = watched {
        watched.begin(device, haptic_loop.config().real_time);
    }
    haptic_loop.reconnected();
    Ok(())
}

/// An open device that is left with zero force and closed, whatever happens.
struct OpenDevice<'a> {
    device: &'a mut dyn HapticDevice,
    closed: bool,
}

impl OpenDevice<'_> {
    /// `is_zeroed` is called once zero force has been written.
    fn close(&mut self, is_zeroed: impl FnOnce()) -> Result<(), DeviceError> {
        let zeroed = self.device.write(DVec3::ZERO);
        is_zeroed();
        let closed = self.device.close();
        // Only now: if either panics, dropping tries once more.
        self.closed = true;
        closed.and(zeroed)
    }
}

impl Drop for OpenDevice<'_> {
    fn drop(&mut self) {
        if !self.closed {
            // Nobody is left to be told: the thread unwinds. A device that panics once more while it is zeroed
            // must be closed all the same, and must not abort the app.
            let device = AssertUnwindSafe(&mut *self.device);
            let _ = catch_unwind(move || { device }.0.write(DVec3::ZERO));
            let device = AssertUnwindSafe(&mut *self.device);
            let _ = catch_unwind(move || { device }.0.close());
        }
    }
}
