//! Counts and times of a loop since its start.

use crate::{RealTimeReport, SuccessRate, TickTiming, TimeHistogram};
use palpate_local::ModelSwap;

/// Counts and times of a loop since its start, published every 64 ticks and at the end.
#[derive(Clone, Debug)]
pub struct LoopReport {
    /// Number of ticks.
    pub ticks: u64,
    /// Deadlines that passed without a tick: `ticks + missed_deadlines` is the number of periods since the start.
    pub missed_deadlines: u64,
    /// Number of gaps of missed deadlines after which the sample history restarted.
    pub gaps: u64,
    /// Readings rejected as unusable or implausible.
    pub rejected_readings: u64,
    /// Errors of the device's read and write.
    pub device_errors: u64,
    /// Local models that became active.
    pub models_adopted: u64,
    /// Last change of the active local model.
    pub last_swap: Option<ModelSwap>,
    /// Local models that were rejected or abandoned.
    pub models_rejected: u64,
    /// Ticks at which the contact solver did not converge.
    pub unconverged_ticks: u64,
    /// Ticks at which the safety chain changed the force.
    pub safety_acted: u64,
    /// Events dropped because their queue was full.
    pub dropped_events: u64,
    /// Tick records dropped because their queue was full.
    pub dropped_records: u64,
    /// Number of the settings in force.
    pub settings_number: u64,
    /// Results of the thread's real-time requests.
    pub real_time: RealTimeReport,
    /// Ratio of the newest periods that had a tick.
    pub success: SuccessRate,
    /// Ticks that took longer than a period.
    pub overruns: u64,
    /// Time from the deadline to the start of the tick.
    pub lateness: TimeHistogram,
    /// Time between the starts of two ticks.
    pub period: TimeHistogram,
    /// Time from the start of the tick to the end of the device's write.
    pub cost: TimeHistogram,
    /// Duration of the device's read.
    pub read: TimeHistogram,
    /// Duration of the device's write.
    pub write: TimeHistogram,
    /// Whether the loop has ended.
    pub ended: bool,
}

impl LoopReport {
    pub(crate) fn new() -> Self {
        Self {
            ticks: 0,
            missed_deadlines: 0,
            gaps: 0,
            rejected_readings: 0,
            device_errors: 0,
            models_adopted: 0,
            last_swap: None,
            models_rejected: 0,
            unconverged_ticks: 0,
            safety_acted: 0,
            dropped_events: 0,
            dropped_records: 0,
            settings_number: 0,
            real_time: RealTimeReport::default(),
            success: SuccessRate::new(),
            overruns: 0,
            lateness: TimeHistogram::new(),
            period: TimeHistogram::new(),
            cost: TimeHistogram::new(),
            read: TimeHistogram::new(),
            write: TimeHistogram::new(),
            ended: false,
        }
    }

    /// Records the times of a tick in a loop with ticks of `tick_s`, s.
    pub(crate) fn record_timing(&mut self, timing: TickTiming, tick_s: f64) {
        self.lateness.record(timing.lateness_ns);
        self.cost.record(timing.cost_ns);
        self.read.record(timing.read_ns);
        self.write.record(timing.write_ns);
        if timing.period_ns > 0 {
            self.period.record(timing.period_ns);
        }
        let period_ns = 1e9 * tick_s;
        self.overruns += u64::from(timing.cost_ns as f64 > period_ns);
    }

    /// Copies `other` without allocating.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        let Self {
            ticks,
            missed_deadlines,
            gaps,
            rejected_readings,
            device_errors,
            models_adopted,
            last_swap,
            models_rejected,
            unconverged_ticks,
            safety_acted,
            dropped_events,
            dropped_records,
            settings_number,
            real_time,
            success,
            overruns,
            lateness,
            period,
            cost,
            read,
            write,
            ended,
        } = self;
        *ticks = other.ticks;
        *missed_deadlines = other.missed_deadlines;
        *gaps = other.gaps;
        *rejected_readings = other.rejected_readings;
        *device_errors = other.device_errors;
        *models_adopted = other.models_adopted;
        *last_swap = other.last_swap;
        *models_rejected = other.models_rejected;
        *unconverged_ticks = other.unconverged_ticks;
        *safety_acted = other.safety_acted;
        *dropped_events = other.dropped_events;
        *dropped_records = other.dropped_records;
        *settings_number = other.settings_number;
        *real_time = other.real_time;
        *success = other.success;
        *overruns = other.overruns;
        for (to, from) in [
            (lateness, &other.lateness),
            (period, &other.period),
            (cost, &other.cost),
            (read, &other.read),
            (write, &other.write),
        ] {
            to.copy_from(from);
        }
        *ended = other.ended;
    }
}
