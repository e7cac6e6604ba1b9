//! What the loop measures of itself.

use hdrhistogram::Histogram;
use palpate_local::Swap;

/// Bounds of every histogram: 1 ns to 10 s, two significant digits. Longer times count as 10 s.
const LONGEST_NS: u64 = 10_000_000_000;

/// A histogram of times with fixed bounds: nothing is allocated when it is filled or copied.
#[derive(Clone, Debug)]
pub struct TimeHistogram(Histogram<u64>);

impl TimeHistogram {
    pub(crate) fn new() -> Self {
        Self(Histogram::new_with_bounds(1, LONGEST_NS, 2).expect("the bounds are those of the documentation"))
    }

    pub(crate) fn record(&mut self, ns: u64) {
        self.0.saturating_record(ns);
    }

    /// Becomes `other`.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.0.reset();
        // Both have the same fixed bounds, so the sum cannot fail.
        let _ = self.0.add(&other.0);
    }

    /// The time that a share `quantile` (0 to 1) of all does not exceed, µs.
    #[must_use]
    pub fn quantile_us(&self, quantile: f64) -> f64 {
        self.0.value_at_quantile(quantile) as f64 * 1e-3
    }

    /// The longest time, µs, to two significant digits.
    #[must_use]
    pub fn max_us(&self) -> f64 {
        self.0.max() as f64 * 1e-3
    }

    /// How many times were recorded.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.0.len()
    }
}

/// The loop's account of itself since its start, published every 64 ticks and at the end.
#[derive(Clone, Debug)]
pub struct LoopReport {
    /// Ticks done.
    pub ticks: u64,
    /// Deadlines that passed without a tick: `ticks + missed_deadlines` is the number of periods since the
    /// start.
    pub missed_deadlines: u64,
    /// Times that so many deadlines were missed in a row that the samples began anew.
    pub gaps: u64,
    /// Readings that could not be used.
    pub rejected_readings: u64,
    /// Device errors, on reading and on writing.
    pub device_errors: u64,
    /// Local models that began to speak.
    pub models_adopted: u64,
    /// The last change of local model.
    pub last_swap: Option<Swap>,
    /// Local models that were refused or given up.
    pub models_refused: u64,
    /// Ticks at which the impulses of the tool's contacts were not found as well as they should be.
    pub unsolved: u64,
    /// Ticks at which the safety chain changed the force.
    pub safety_acted: u64,
    /// Events that found their queue full.
    pub dropped_events: u64,
    /// Tick records that found their queue full.
    pub dropped_records: u64,
    /// Number of the settings in force.
    pub settings_number: u64,
    /// How long after its deadline a tick began.
    pub lateness: TimeHistogram,
    /// How long a tick took from its beginning to the end of the device's write.
    pub cost: TimeHistogram,
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
            models_refused: 0,
            unsolved: 0,
            safety_acted: 0,
            dropped_events: 0,
            dropped_records: 0,
            settings_number: 0,
            lateness: TimeHistogram::new(),
            cost: TimeHistogram::new(),
            ended: false,
        }
    }

    /// Becomes `other` without allocating.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        let Self {
            ticks,
            missed_deadlines,
            gaps,
            rejected_readings,
            device_errors,
            models_adopted,
            last_swap,
            models_refused,
            unsolved,
            safety_acted,
            dropped_events,
            dropped_records,
            settings_number,
            lateness,
            cost,
            ended,
        } = self;
        *ticks = other.ticks;
        *missed_deadlines = other.missed_deadlines;
        *gaps = other.gaps;
        *rejected_readings = other.rejected_readings;
        *device_errors = other.device_errors;
        *models_adopted = other.models_adopted;
        *last_swap = other.last_swap;
        *models_refused = other.models_refused;
        *unsolved = other.unsolved;
        *safety_acted = other.safety_acted;
        *dropped_events = other.dropped_events;
        *dropped_records = other.dropped_records;
        *settings_number = other.settings_number;
        lateness.copy_from(&other.lateness);
        cost.copy_from(&other.cost);
        *ended = other.ended;
    }
}

/// What a runner measured of one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickTiming {
    /// Time from the deadline to the beginning of the tick, ns.
    pub lateness_ns: u64,
    /// Time from the beginning of the tick to the end of the device's write, ns.
    pub cost_ns: u64,
}
