//! A thread that wakes like the loop's and does no work: it measures the part of the loop's lateness that the machine causes.
//!
//! The baseline thread makes the same requests ([`crate::RealTimeRequest`]), sleeps until absolute deadlines of the same period on
//! the same clock, and measures its lateness in the same way. Its lateness is the machine's; any additional lateness of the loop
//! comes from the ticks.
//!
//! Both threads run at the same time, and the baseline's deadlines are half a period after the loop's. Run in turns, the two would
//! meet different load, and an idle core sleeps deeper and wakes later. With equal deadlines on one core, one would wait for the
//! other, because threads of equal priority do not preempt each other. A tick longer than half a period may still delay the baseline
//! on a shared core. Deadlines that pass during a tick are therefore counted, and their lateness is left out. This also leaves out
//! stalls of the whole machine during a tick, which favours the baseline over the loop.

use crate::clock::MonotonicClock;
use crate::{HapticsError, LoopConfig, RealTimeReport, TimeHistogram};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// A running baseline thread. It waits for the loop ([`crate::run_with_baseline`]) to start. Drop stops it.
#[doc(hidden)]
#[derive(Debug)]
pub struct BaselineThread {
    clock: MonotonicClock,
    period_ns: u64,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<BaselineReport>>,
}

#[derive(Debug, Default)]
struct Shared {
    stop: AtomicBool,
    /// First deadline on the thread's clock, ns; 0 before the loop starts.
    first_deadline_ns: AtomicU64,
    /// Newest deadline that passed during a tick of the loop, ns.
    during_tick_ns: AtomicU64,
}

/// Measurements of a baseline thread.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct BaselineReport {
    /// Results of the real-time requests.
    pub real_time: RealTimeReport,
    /// Number of wake-ups.
    pub ticks: u64,
    /// Wake-ups whose deadline passed during a tick of the loop, which may have delayed them.
    pub during_ticks: u64,
    /// Deadlines that passed while it slept; they are skipped, as in the loop.
    pub missed_deadlines: u64,
    /// Time from the deadline to the wake-up, without those that a tick may have delayed.
    pub lateness: TimeHistogram,
}

impl BaselineThread {
    /// Starts a baseline thread for a loop with `config`: the same requests and the same period.
    ///
    /// # Errors
    /// [`HapticsError::Thread`] if the operating system cannot create a thread; other errors for a value of `config` out of range.
    pub fn spawn(config: &LoopConfig) -> Result<Self, HapticsError> {
        config.validate()?;
        let (clock, shared) = (MonotonicClock::start(), Arc::new(Shared::default()));
        let (of_thread, real_time) = (Arc::clone(&shared), config.real_time);
        let period_ns = Duration::from_secs_f64(config.hand_over.tick_s).as_nanos() as u64;
        // Allocated here: like the loop's thread, the thread only fills it.
        let lateness = TimeHistogram::new();
        let thread = std::thread::Builder::new()
            .name("bare".into())
            .spawn(move || {
                let real_time = real_time.apply_to_current_thread();
                let mut report =
                    BaselineReport { real_time, ticks: 0, during_ticks: 0, missed_deadlines: 0, lateness };
                if let Some(first_ns) = wait_for_first(clock, &of_thread, period_ns) {
                    run_periods(clock, &of_thread, first_ns, period_ns, &mut report);
                }
                report
            })
            .map_err(HapticsError::Thread)?;
        Ok(Self { clock, period_ns, shared, thread: Some(thread) })
    }

    /// Sets the first deadline `wait_ns` from now.
    pub(crate) fn begin_in(&self, wait_ns: u64) {
        // Relaxed would suffice: the value carries no other data.
        self.shared.first_deadline_ns.store(self.clock.now_ns() + wait_ns, Ordering::Release);
    }

    /// Notes that the loop has just ended a tick of duration `took_ns`.
    pub(crate) fn note_tick(&self, took_ns: u64) {
        let (now_ns, first_ns) = (self.clock.now_ns(), self.shared.first_deadline_ns.load(Ordering::Acquire));
        if let Some(deadline_ns) = passed_within(first_ns, self.period_ns, now_ns, took_ns) {
            self.shared.during_tick_ns.store(deadline_ns, Ordering::Release);
        }
    }

    /// Ends the thread together with the loop.
    pub(crate) fn end_with_loop(&self) {
        self.shared.stop.store(true, Ordering::Release);
    }

    /// Whether the loop has started.
    #[cfg(test)]
    pub(crate) fn has_started(&self) -> bool {
        self.shared.first_deadline_ns.load(Ordering::Acquire) > 0
    }

    /// Stops the thread and waits for it, at most one period; `None` if it panicked.
    #[must_use]
    pub fn stop(mut self) -> Option<BaselineReport> {
        self.end()
    }

    fn end(&mut self) -> Option<BaselineReport> {
        self.shared.stop.store(true, Ordering::Release);
        self.thread.take()?.join().ok()
    }
}

impl Drop for BaselineThread {
    fn drop(&mut self) {
        self.end();
    }
}

/// Waits for the start of the loop and returns the next deadline; `None` after a stop.
fn wait_for_first(clock: MonotonicClock, shared: &Shared, period_ns: u64) -> Option<u64> {
    while !shared.stop.load(Ordering::Acquire) {
        let first_ns = shared.first_deadline_ns.load(Ordering::Acquire);
        if first_ns > 0 {
            let passed = clock.now_ns().saturating_sub(first_ns).div_ceil(period_ns);
            return Some(first_ns + passed * period_ns);
        }
        clock.sleep_until(clock.now_ns() + period_ns);
    }
    None
}

/// The newest deadline before `now_ns`, if it lies less than `took_ns` back.
fn passed_within(first_ns: u64, period_ns: u64, now_ns: u64, took_ns: u64) -> Option<u64> {
    let since_ns = now_ns.checked_sub(first_ns)? % period_ns;
    (since_ns < took_ns).then_some(now_ns - since_ns)
}

/// Waits and measures like the loop, without ticks.
fn run_periods(
    clock: MonotonicClock,
    shared: &Shared,
    mut deadline_ns: u64,
    period_ns: u64,
    report: &mut BaselineReport,
) {
    while !shared.stop.load(Ordering::Acquire) {
        clock.sleep_until(deadline_ns);
        let lateness_ns = clock.now_ns() - deadline_ns;
        let missed = lateness_ns / period_ns;
        // A tick that is still running, on another core, has delayed nothing.
        if shared.during_tick_ns.load(Ordering::Acquire) == deadline_ns {
            report.during_ticks += 1;
        } else {
            report.lateness.record(lateness_ns);
        }
        report.ticks += 1;
        report.missed_deadlines += missed;
        deadline_ns += period_ns * (1 + missed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RealTimeRequest;

    #[test]
    fn deadline_within_tick_duration_counts_as_during_tick() {
        for (now_ns, took_ns, deadline_ns) in [
            (1400, 300, None),
            (1500, 0, None),
            (1600, 100, None),
            (1600, 101, Some(1500)),
            (2600, 700, Some(2500)),
            (2600, 2000, Some(2500)),
            (2400, 300, None),
        ] {
            assert_eq!(passed_within(1500, 1000, now_ns, took_ns), deadline_ns, "{now_ns} {took_ns}");
        }
    }

    #[test]
    fn stops_without_loop_and_rejects_invalid_config() {
        let config = LoopConfig { real_time: RealTimeRequest::NONE, ..LoopConfig::default() };
        let report = BaselineThread::spawn(&config).unwrap().stop().unwrap();
        assert_eq!((report.ticks, report.missed_deadlines), (0, 0));
        let config = LoopConfig { event_capacity: 0, ..config };
        assert!(matches!(BaselineThread::spawn(&config), Err(HapticsError::Setting { .. })));
    }
}
