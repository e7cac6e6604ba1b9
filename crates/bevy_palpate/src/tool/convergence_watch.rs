//! Counts the touching ticks of a loop at which its contact solver did not converge.

use crate::step_watch::ConvergenceWindow;

/// Touching ticks of a loop, and those at which its solver did not converge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ConvergenceWatch {
    window: ConvergenceWindow,
    /// The loop's counter at the last look.
    counter: u64,
}

impl ConvergenceWatch {
    /// Adds `ticks` ticks of which `touching` touched; `counter` is [`palpate_haptics::LoopReport::unconverged_ticks`], which grows in blocks
    /// of 64 ticks. Returns the ticks without convergence and the touching ticks of a window that has to be reported.
    pub(super) fn record(&mut self, ticks: u64, touching: u64, counter: u64) -> Option<(u64, u64)> {
        let unconverged = counter.saturating_sub(std::mem::replace(&mut self.counter, counter));
        self.window.note(ticks, touching, unconverged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Notes 20 model steps of 50 ticks, `touching` of them in touch and `unconverged` without convergence.
    fn second(watch: &mut ConvergenceWatch, touching: u64, unconverged: u64) -> Vec<(u64, u64)> {
        let counter = watch.counter;
        let note = |i: u64| watch.record(50, touching / 20, counter + unconverged * i / 20);
        (1..=20).filter_map(note).collect()
    }

    #[test]
    fn more_than_one_percent_of_the_touching_ticks_is_reported_once_until_a_second_is_better() {
        let mut watch = ConvergenceWatch::default();
        assert_eq!(second(&mut watch, 1000, 0), []);
        assert_eq!(second(&mut watch, 1000, 10), []);
        assert_eq!(second(&mut watch, 1000, 20), [(20, 1000)]);
        assert_eq!(second(&mut watch, 1000, 1000), []);
        assert_eq!(second(&mut watch, 1000, 0), []);
        // Of few touching ticks it is the share that counts.
        assert_eq!(second(&mut watch, 100, 8), [(8, 100)]);
        assert_eq!(second(&mut watch, 0, 0), []);
        // Counted late: ticks of the window before.
        assert_eq!(second(&mut watch, 0, 5), [(5, 5)]);
    }
}
