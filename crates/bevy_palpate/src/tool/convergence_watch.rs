//! Counts the ticks in contact at which the contact solver of a loop did not converge.

use crate::step_watch::ConvergenceWindow;

/// Ticks of a loop in contact, and those at which its solver did not converge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ConvergenceWatch {
    window: ConvergenceWindow,
    /// The loop's counter at the last call.
    counter: u64,
}

impl ConvergenceWatch {
    /// Adds `ticks` ticks, `touching` of them in contact. `counter` is [`palpate_haptics::LoopReport::unconverged_ticks`], updated every 64
    /// ticks. Returns the ticks without convergence and the ticks in contact of a window to be reported.
    pub(super) fn record(&mut self, ticks: u64, touching: u64, counter: u64) -> Option<(u64, u64)> {
        let unconverged = counter.saturating_sub(std::mem::replace(&mut self.counter, counter));
        self.window.record(ticks, touching, unconverged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Records 20 model steps of 50 ticks, `touching` ticks in contact and `unconverged` ticks without convergence.
    fn second(watch: &mut ConvergenceWatch, touching: u64, unconverged: u64) -> Vec<(u64, u64)> {
        let counter = watch.counter;
        let record = |i: u64| watch.record(50, touching / 20, counter + unconverged * i / 20);
        (1..=20).filter_map(record).collect()
    }

    #[test]
    fn reports_more_than_one_percent_once_until_a_better_second() {
        let mut watch = ConvergenceWatch::default();
        assert_eq!(second(&mut watch, 1000, 0), []);
        assert_eq!(second(&mut watch, 1000, 10), []);
        assert_eq!(second(&mut watch, 1000, 20), [(20, 1000)]);
        assert_eq!(second(&mut watch, 1000, 1000), []);
        assert_eq!(second(&mut watch, 1000, 0), []);
        // The share counts, also of few ticks in contact.
        assert_eq!(second(&mut watch, 100, 8), [(8, 100)]);
        assert_eq!(second(&mut watch, 0, 0), []);
        // Ticks of the previous window that are counted late.
        assert_eq!(second(&mut watch, 0, 5), [(5, 5)]);
    }
}
