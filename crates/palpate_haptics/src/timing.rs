//! What the loop measures of itself.

use crate::RealTimeReport;
use hdrhistogram::Histogram;
use palpate_local::ModelSwap;

/// Bounds of every histogram: 1 ns to 10 s, two significant digits. Longer times count as 10 s.
const LONGEST_NS: u64 = 10_000_000_000;

/// A histogram of times with fixed bounds: nothing is allocated when it is filled or copied.
#[derive(Clone, Debug)]
pub struct TimeHistogram(Histogram<u64>);

impl TimeHistogram {
    pub(crate) fn new() -> Self {
        let mut times =
            Histogram::new_with_bounds(1, LONGEST_NS, 2).expect("the bounds are those of the documentation");
        // All of its memory is touched now, or a rare time would do it within a tick: a page has room for four of these.
        (0..LONGEST_NS.ilog2() + 1).for_each(|power| times.saturating_record(1 << power));
        times.reset();
        Self(times)
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

    /// The times that were recorded, ascending, µs, to two significant digits, and how often each.
    pub fn recorded_us(&self) -> impl Iterator<Item = (f64, u64)> {
        self.0.iter_recorded().map(|step| (step.value_iterated_to() as f64 * 1e-3, step.count_at_value()))
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
    pub last_swap: Option<ModelSwap>,
    /// Local models that were refused or given up.
    pub models_rejected: u64,
    /// Ticks at which the impulses of the tool's contacts were not found as well as they should be.
    pub unconverged_ticks: u64,
    /// Ticks at which the safety chain changed the force.
    pub safety_acted: u64,
    /// Events that found their queue full.
    pub dropped_events: u64,
    /// Tick records that found their queue full.
    pub dropped_records: u64,
    /// Number of the settings in force.
    pub settings_number: u64,
    /// What the thread got of what it asked the operating system for.
    pub real_time: RealTimeReport,
    /// Of the newest periods, how many had a tick.
    pub success: SuccessRate,
    /// Ticks that took longer than a period.
    pub overruns: u64,
    /// How long after its deadline a tick began.
    pub lateness: TimeHistogram,
    /// Time from the beginning of a tick to that of the next.
    pub period: TimeHistogram,
    /// How long a tick took from its beginning to the end of the device's write.
    pub cost: TimeHistogram,
    /// How long the device took to be read.
    pub read: TimeHistogram,
    /// How long it took to be written.
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
            models_rejected: models_refused,
            unconverged_ticks: unsolved,
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
        *models_refused = other.models_rejected;
        *unsolved = other.unconverged_ticks;
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

/// What a runner measured of one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickTiming {
    /// Time from the deadline to the beginning of the tick, ns.
    pub lateness_ns: u64,
    /// Time since the beginning of the tick before, ns; 0 at the first.
    pub period_ns: u64,
    /// Time from the beginning of the tick to the end of the device's write, ns.
    pub cost_ns: u64,
    /// Of that, in the device's read, ns.
    pub read_ns: u64,
    /// Of that, in the device's write, ns.
    pub write_ns: u64,
}

/// Of the newest periods, how many had a tick. A period whose deadline passed without one is never made up for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuccessRate {
    /// Bit i of word w is set if the period 64 w + i, modulo their number, had a tick.
    had_tick: [u64; SuccessRate::WORDS],
    /// Periods so far.
    periods: u64,
    of_100: u16,
    of_1000: u16,
}

impl SuccessRate {
    const WORDS: usize = 16;
    const KEPT: u64 = 64 * Self::WORDS as u64;

    pub(crate) fn new() -> Self {
        Self { had_tick: [0; Self::WORDS], periods: 0, of_100: 0, of_1000: 0 }
    }

    /// Notes a tick, `elapsed` periods after the one before.
    pub(crate) fn note(&mut self, elapsed: u64) {
        let passed = elapsed.saturating_sub(1);
        for _ in 0..passed.min(Self::KEPT) {
            self.push(false);
        }
        self.periods = self.periods.saturating_add(passed.saturating_sub(Self::KEPT));
        self.push(true);
    }

    fn push(&mut self, had_tick: bool) {
        for (window, count) in [(100, &mut self.of_100), (1000, &mut self.of_1000)] {
            let leaves = self.periods.checked_sub(window).is_some_and(|old| bit(&self.had_tick, old));
            *count = *count + u16::from(had_tick) - u16::from(leaves);
        }
        let slot = self.periods % Self::KEPT;
        if let Some(word) = self.had_tick.get_mut((slot / 64) as usize) {
            *word = *word & !(1 << (slot % 64)) | u64::from(had_tick) << (slot % 64);
        }
        self.periods = self.periods.saturating_add(1);
    }

    /// Of the last 100 periods, or of all so far if there were fewer: the share that had a tick, 0 to 1; 1 before the first.
    #[must_use]
    pub fn on_time_ratio_100(&self) -> f64 {
        share(self.of_100, self.periods.min(100))
    }

    /// Of the last 1000 periods likewise.
    #[must_use]
    pub fn on_time_ratio_1000(&self) -> f64 {
        share(self.of_1000, self.periods.min(1000))
    }
}

fn bit(words: &[u64; SuccessRate::WORDS], period: u64) -> bool {
    let slot = period % SuccessRate::KEPT;
    words.get((slot / 64) as usize).is_some_and(|word| word >> (slot % 64) & 1 == 1)
}

fn share(count: u16, of: u64) -> f64 {
    if of > 0 { f64::from(count) / of as f64 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_recorded_is_told_again_with_its_count() {
        let mut histogram = TimeHistogram::new();
        [1, 900, 55_000, 55_000, 980_000, 3_000_000].into_iter().for_each(|ns| histogram.record(ns));
        let told: Vec<(f64, u64)> = histogram.recorded_us().collect();
        assert_eq!(told.len(), 5);
        for ((us, count), (expected, often)) in
            told.into_iter().zip([(1e-3, 1), (0.9, 1), (55.0, 2), (980.0, 1), (3000.0, 1)])
        {
            assert!((us / expected - 1.0).abs() < 0.01 && count == often, "{us} {count}");
        }
    }

    #[test]
    fn the_success_rate_is_that_of_counting() {
        let mut rate = SuccessRate::new();
        assert_eq!((rate.on_time_ratio_100(), rate.on_time_ratio_1000()), (1.0, 1.0));
        let mut all: Vec<bool> = Vec::new();
        let mut seed = 7u64;
        for _ in 0..3000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            // Mostly one, sometimes a few, once in a while very many.
            let elapsed = match seed >> 56 {
                0 => 3000,
                1..20 => 1 + (seed >> 40) % 7,
                _ => 1,
            };
            rate.note(elapsed);
            all.extend((1..elapsed).map(|_| false));
            all.push(true);
            for (window, found) in [(100, rate.on_time_ratio_100()), (1000, rate.on_time_ratio_1000())] {
                let newest = &all[all.len().saturating_sub(window)..];
                let share = newest.iter().filter(|had| **had).count() as f64 / newest.len() as f64;
                assert!((found - share).abs() < 1e-12, "{found} {share} of {window}");
            }
        }
    }
}
