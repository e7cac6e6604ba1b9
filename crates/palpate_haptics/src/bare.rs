//! A thread that wakes as the loop's does and does nothing: what of the loop's lateness is the machine's.
//!
//! It asks for the same ([`crate::RealTime`]), sleeps until absolute deadlines of the same period on the same clock, and
//! measures its lateness in the same way. What it is late, nothing in a tick can help; what the loop is later, a tick
//! costs.
//!
//! Both run at the same time, the bare thread's deadlines half a period after the loop's. One after the other, in turns,
//! they would meet different load, and a core that just had nothing to do sleeps deeper and wakes later. At the same
//! deadlines one of the two would wait for the other on a core that both use: threads of equal priority do not interrupt
//! each other. Half a period is as far apart as they can be. A tick that takes longer than that may still make the bare
//! thread late where both are on one core; so deadlines that passed during a tick are counted and their lateness left out.
//! That leaves out those too at which the whole machine stood still during a tick, which makes the bare thread look better and
//! not the loop.

use crate::clock::MonotonicClock;
use crate::{HapticsError, LoopConfig, RealTimeReport, TimeHistogram};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// A running bare thread. It waits for the loop beside it ([`crate::run_beside`]) to begin. Dropping it stops it.
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
    /// On the thread's clock, ns; 0 before the loop begins.
    first_deadline_ns: AtomicU64,
    /// The newest of its deadlines that passed during a tick of the loop, likewise.
    during_tick_ns: AtomicU64,
}

/// What a bare thread measured.
#[derive(Clone, Debug)]
pub struct BaselineReport {
    /// What it got of what it asked the operating system for.
    pub real_time: RealTimeReport,
    /// Times that it woke.
    pub ticks: u64,
    /// Of them, those for a deadline that passed during a tick of the loop, which may have held it up.
    pub during_ticks: u64,
    /// Deadlines that passed while it slept; as in the loop, they are left out and not made up for.
    pub missed_deadlines: u64,
    /// How long after its deadline it woke, where no tick can have held it up.
    pub lateness: TimeHistogram,
}

impl BaselineThread {
    /// Starts a bare thread beside a loop made with `config`: the same requests and the same period.
    ///
    /// # Errors
    /// [`HapticsError::Thread`] when the operating system gives no thread, others when `config` makes no sense.
    pub fn spawn(config: &LoopConfig) -> Result<Self, HapticsError> {
        config.validate()?;
        let (clock, shared) = (MonotonicClock::start(), Arc::new(Shared::default()));
        let (other, real_time) = (Arc::clone(&shared), config.real_time);
        let period_ns = Duration::from_secs_f64(config.hand_over.tick_s).as_nanos() as u64;
        // The histogram is made here: as the loop's, the thread only fills it.
        let lateness = TimeHistogram::new();
        let thread = std::thread::Builder::new()
            .name("bare".into())
            .spawn(move || {
                let real_time = real_time.apply_to_current_thread();
                let mut report =
                    BaselineReport { real_time, ticks: 0, during_ticks: 0, missed_deadlines: 0, lateness };
                if let Some(first_ns) = wait_for_first(clock, &other, period_ns) {
                    wake(clock, &other, first_ns, period_ns, &mut report);
                }
                report
            })
            .map_err(HapticsError::Thread)?;
        Ok(Self { clock, period_ns, shared, thread: Some(thread) })
    }

    /// Its first deadline is in `wait_ns`.
    pub(crate) fn begin_in(&self, wait_ns: u64) {
        // Release, with the acquire of the thread, is no more than tidy: the number stands for itself.
        self.shared.first_deadline_ns.store(self.clock.now_ns() + wait_ns, Ordering::Release);
    }

    /// The loop has just ended a tick that took `took_ns`.
    pub(crate) fn note_tick(&self, took_ns: u64) {
        let (now_ns, first_ns) = (self.clock.now_ns(), self.shared.first_deadline_ns.load(Ordering::Acquire));
        if let Some(deadline_ns) = passed_within(first_ns, self.period_ns, now_ns, took_ns) {
            self.shared.during_tick_ns.store(deadline_ns, Ordering::Release);
        }
    }

    /// The loop has ended, and it with the loop.
    pub(crate) fn end_with_loop(&self) {
        self.shared.stop.store(true, Ordering::Release);
    }

    /// Stops it and waits for it, a period at most; `None` if it panicked.
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

/// The first deadline that is still to come once the loop has begun; `None` after a stop.
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

/// The newest deadline before `now_ns`, if it was less than `took_ns` ago.
fn passed_within(first_ns: u64, period_ns: u64, now_ns: u64, took_ns: u64) -> Option<u64> {
    let since_ns = now_ns.checked_sub(first_ns)? % period_ns;
    (since_ns < took_ns).then_some(now_ns - since_ns)
}

/// The loop's waiting and its accounts, without a tick.
fn wake(
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
        // A tick that still goes on, on another core, has held up nothing.
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
    use crate::{Reading, RealTimeRequest, ScriptedDevice, haptic_loop, run_with_baseline};
    use glam::DVec3;

    #[test]
    fn it_waits_for_the_loop_and_then_accounts_for_every_deadline() {
        let config = LoopConfig { real_time: RealTimeRequest::NONE, ..LoopConfig::default() };
        let (_handle, haptic_loop) = haptic_loop(config, crate::LoopSettings::default()).unwrap();
        let bare = BaselineThread::spawn(&config).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let mut device = ScriptedDevice::new(move |n, _| {
            flag.store(n >= 100, Ordering::Release);
            Ok(Reading::at(DVec3::ZERO))
        });
        let (clock, begun_ns) = (bare.clock, bare.clock.now_ns());
        assert_eq!(bare.shared.first_deadline_ns.load(Ordering::Acquire), 0, "it waits");
        run_with_baseline(haptic_loop, &mut device, &stop, &bare);
        let report = bare.stop().unwrap();
        let took_ms = (clock.now_ns() - begun_ns) / 1_000_000;
        let deadlines = report.ticks + report.missed_deadlines;
        assert!((10..=took_ms).contains(&deadlines), "{deadlines} in {took_ms} ms");
        assert_eq!(report.lateness.count() + report.during_ticks, report.ticks);
        assert_eq!(report.real_time, RealTimeReport::default());
    }

    #[test]
    fn a_deadline_counts_as_during_a_tick_if_the_tick_had_begun_before_it() {
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
    fn it_ends_without_a_loop_and_refuses_what_a_loop_does() {
        let config = LoopConfig { real_time: RealTimeRequest::NONE, ..LoopConfig::default() };
        let report = BaselineThread::spawn(&config).unwrap().stop().unwrap();
        assert_eq!((report.ticks, report.missed_deadlines), (0, 0));
        let config = LoopConfig { event_capacity: 0, ..config };
        assert!(matches!(BaselineThread::spawn(&config), Err(HapticsError::Setting { .. })));
    }
}
