//! Audit of the deadlines: records, events and clock of the loop must agree on every one.

use super::limits::{Limits, MAX_GROWTH_TICKS};
use glam::DVec3;
use palpate_haptics::{LoopEvent, LoopEventKind, LoopReport, TickRecord};

/// Sums over the records and events of a run.
#[derive(Clone, Debug)]
pub(super) struct DeadlineAudit {
    period_ns: u64,
    limits: Limits,
    /// Number of recorded ticks.
    ticks: u64,
    /// Number of periods that the recorded ticks stand for.
    periods: u64,
    /// Number of missed deadlines in events.
    missed_in_events: u64,
    /// Start of the newest tick on the loop's clock, ns after the first tick.
    start_ns: u64,
    /// Periods of the first tick, and its delay after the newest of their deadlines, ns.
    first: Option<(u64, u64)>,
    /// Number of ticks whose start does not match their periods.
    off_the_clock: u64,
    last_n: DVec3,
    /// Number of forces that grew more than the elapsed ticks allow and that the device, which cannot count ticks, did not
    /// detect.
    pub(super) grown_too_fast: u64,
    /// Maximum age of an active local model, ticks since the sample of its build.
    pub(super) oldest_model_ticks: u64,
}

impl DeadlineAudit {
    pub(super) fn new(period_ns: u64, limits: Limits) -> Self {
        Self {
            period_ns,
            limits,
            ticks: 0,
            periods: 0,
            missed_in_events: 0,
            start_ns: 0,
            first: None,
            off_the_clock: 0,
            last_n: DVec3::ZERO,
            grown_too_fast: 0,
            oldest_model_ticks: 0,
        }
    }

    /// Adds the next tick.
    pub(super) fn tick(&mut self, record: &TickRecord) {
        self.ticks += 1;
        self.periods += record.elapsed;
        self.start_ns += record.timing.period_ns;
        // The tick stands for the newest deadline before its start.
        let after_ns = record.timing.lateness_ns % self.period_ns;
        let (first, first_after_ns) = *self.first.get_or_insert((self.periods, after_ns));
        let by_periods_ns = (self.periods - first) * self.period_ns + after_ns;
        self.off_the_clock += u64::from(self.start_ns + first_after_ns != by_periods_ns);

        let is_allowed = |ticks| self.limits.allow(self.last_n, record.force_n, ticks);
        self.grown_too_fast += u64::from(!is_allowed(record.elapsed) && is_allowed(MAX_GROWTH_TICKS));
        self.last_n = record.force_n;
        if let (Some(sample), Some(model)) = (record.sample, record.rendered.model) {
            let age = sample.sequence.saturating_sub(model.sequence);
            self.oldest_model_ticks = self.oldest_model_ticks.max(age);
        }
    }

    /// Adds the next event.
    pub(super) fn event(&mut self, event: &LoopEvent) {
        if let LoopEventKind::DeadlinesMissed(missed) | LoopEventKind::Gap(missed) = event.kind {
            self.missed_in_events += missed;
        }
    }

    /// Whether every period up to the sample `newest` was a tick or a missed deadline, according to `report`, the records, the
    /// events and the loop's clock. A dropped record or event makes the audit incomplete.
    pub(super) fn is_complete(&self, report: &LoopReport, newest: u64) -> bool {
        let (ticks, missed) = (report.ticks, report.missed_deadlines);
        ticks + missed == newest
            && (self.ticks, self.periods, self.missed_in_events) == (ticks, newest, missed)
            && report.dropped_records + report.dropped_events + self.off_the_clock == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_haptics::{
        Lockstep, LoopConfig, LoopSettings, Reading, ScriptedDevice, TickTiming, haptic_loop,
    };

    const LIMITS: Limits = Limits { magnitude_n: 20.0, growth_n: 0.5 };

    /// Audit of ticks with the given (lateness, µs, elapsed periods) and forces.
    fn audit(late: &[(u64, u64)], forces_n: &[f64]) -> DeadlineAudit {
        let (mut handle, haptic_loop) =
            haptic_loop(LoopConfig::default(), LoopSettings { record: true, ..LoopSettings::default() })
                .unwrap();
        let device = ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::ZERO)));
        Lockstep::new(haptic_loop, Box::new(device)).unwrap().run(1);
        let record = handle.next_record().unwrap();
        let mut audit = DeadlineAudit::new(1_000_000, LIMITS);
        let (mut deadline_us, mut last_us) = (1000, None);
        for (i, &(lateness_us, elapsed)) in late.iter().enumerate() {
            let start_us = deadline_us + lateness_us;
            let period_ns = last_us.map_or(0, |last| 1000 * (start_us - last));
            let timing = TickTiming { lateness_ns: 1000 * lateness_us, period_ns, ..TickTiming::default() };
            let force_n = DVec3::X * forces_n.get(i).copied().unwrap_or(0.0);
            audit.tick(&TickRecord { elapsed, timing, force_n, ..record });
            last_us = Some(start_us);
            deadline_us += 1000 * (1 + lateness_us / 1000);
        }
        audit
    }

    #[test]
    fn detects_ticks_that_disagree_with_the_clock() {
        let good = audit(&[(100, 1), (50, 1), (3200, 4), (0, 1), (999, 1)], &[]);
        assert_eq!((good.off_the_clock, good.ticks, good.periods), (0, 5, 8));
        let first_late = audit(&[(2100, 3), (10, 1)], &[]);
        assert_eq!((first_late.off_the_clock, first_late.periods), (0, 4));
        // One missed deadline too few, one too many.
        assert_eq!(audit(&[(100, 1), (3200, 3), (0, 1)], &[]).off_the_clock, 2);
        assert_eq!(audit(&[(100, 1), (200, 2)], &[]).off_the_clock, 1);
    }

    #[test]
    fn allowed_growth_follows_the_elapsed_ticks() {
        let late = [(0, 1), (1000, 2), (0, 1), (0, 1)];
        assert_eq!(audit(&late, &[0.5, 1.5, 2.0, 1.0]).grown_too_fast, 0);
        assert_eq!(audit(&late, &[0.5, 1.5, 2.6, 1.0]).grown_too_fast, 1);
        // The device itself detects this one.
        assert_eq!(audit(&late, &[0.5, 1.5, 9.0, 1.0]).grown_too_fast, 0);
    }
}
