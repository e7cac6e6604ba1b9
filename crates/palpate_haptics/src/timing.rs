//! Times of ticks: histograms, and the ratio of ticks on time.

use hdrhistogram::Histogram;

/// Upper bound of every histogram, ns: 10 s. Longer times count as 10 s.
const MAX_NS: u64 = 10_000_000_000;

/// Histogram of times from 1 ns to 10 s with two significant digits. Recording and copying do not allocate.
#[derive(Clone, Debug)]
pub struct TimeHistogram(Histogram<u64>);

impl TimeHistogram {
    pub(crate) fn new() -> Self {
        let mut times =
            Histogram::new_with_bounds(1, MAX_NS, 2).expect("the bounds are those of the documentation");
        // Touches all memory now; otherwise the first record of a rare time would fault in a page within a tick.
        (0..MAX_NS.ilog2() + 1).for_each(|power| times.saturating_record(1 << power));
        times.reset();
        Self(times)
    }

    pub(crate) fn record(&mut self, ns: u64) {
        self.0.saturating_record(ns);
    }

    /// Copies `other`.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.0.reset();
        // Both have the same bounds, so the addition cannot fail.
        let _ = self.0.add(&other.0);
    }

    /// Quantile of the times, µs; `quantile` is 0 to 1.
    #[must_use]
    pub fn quantile_us(&self, quantile: f64) -> f64 {
        self.0.value_at_quantile(quantile) as f64 * 1e-3
    }

    /// Maximum time, µs, to two significant digits.
    #[must_use]
    pub fn max_us(&self) -> f64 {
        self.0.max() as f64 * 1e-3
    }

    /// Recorded times, µs, to two significant digits, ascending, each with its count.
    pub fn recorded_us(&self) -> impl Iterator<Item = (f64, u64)> {
        self.0.iter_recorded().map(|step| (step.value_iterated_to() as f64 * 1e-3, step.count_at_value()))
    }

    /// Number of recorded times.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.0.len()
    }
}

/// Times of one tick, measured by the runner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickTiming {
    /// Time from the deadline to the start of the tick, ns.
    pub lateness_ns: u64,
    /// Time since the start of the previous tick, ns; 0 at the first.
    pub period_ns: u64,
    /// Time from the start of the tick to the end of the device's write, ns.
    pub cost_ns: u64,
    /// Duration of the device's read, ns.
    pub read_ns: u64,
    /// Duration of the device's write, ns.
    pub write_ns: u64,
}

/// Ratio of the newest periods that had a tick. A missed deadline is never made up for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuccessRate {
    /// Bit i of word w is set if the period 64 w + i, modulo the number of bits, had a tick.
    had_tick: [u64; SuccessRate::WORDS],
    /// Number of periods so far.
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

    /// Records a tick, `elapsed` periods after the previous one.
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

    /// Ratio of the last 100 periods, or of all if fewer, that had a tick, 0 to 1; 1 before the first.
    #[must_use]
    pub fn on_time_ratio_100(&self) -> f64 {
        ratio(self.of_100, self.periods.min(100))
    }

    /// Ratio of the last 1000 periods, or of all if fewer, that had a tick, 0 to 1; 1 before the first.
    #[must_use]
    pub fn on_time_ratio_1000(&self) -> f64 {
        ratio(self.of_1000, self.periods.min(1000))
    }
}

fn bit(words: &[u64; SuccessRate::WORDS], period: u64) -> bool {
    let slot = period % SuccessRate::KEPT;
    words.get((slot / 64) as usize).is_some_and(|word| word >> (slot % 64) & 1 == 1)
}

fn ratio(count: u16, of: u64) -> f64 {
    if of > 0 { f64::from(count) / of as f64 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histogram_returns_recorded_times_with_counts() {
        let mut histogram = TimeHistogram::new();
        [1, 900, 55_000, 55_000, 980_000, 3_000_000].into_iter().for_each(|ns| histogram.record(ns));
        let recorded: Vec<(f64, u64)> = histogram.recorded_us().collect();
        assert_eq!(recorded.len(), 5);
        for ((us, count), (expected, often)) in
            recorded.into_iter().zip([(1e-3, 1), (0.9, 1), (55.0, 2), (980.0, 1), (3000.0, 1)])
        {
            assert!((us / expected - 1.0).abs() < 0.01 && count == often, "{us} {count}");
        }
    }

    #[test]
    fn success_rate_equals_direct_count() {
        let mut rate = SuccessRate::new();
        assert_eq!((rate.on_time_ratio_100(), rate.on_time_ratio_1000()), (1.0, 1.0));
        let mut all: Vec<bool> = Vec::new();
        let mut seed = 7u64;
        for _ in 0..3000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            // Mostly one period, sometimes a few, rarely very many.
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
                let ratio = newest.iter().filter(|had| **had).count() as f64 / newest.len() as f64;
                assert!((found - ratio).abs() < 1e-12, "{found} {ratio} of {window}");
            }
        }
    }
}
