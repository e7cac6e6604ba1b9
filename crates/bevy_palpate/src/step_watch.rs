//! Detects persistent problems of a body's steps: cells that stay inverted, a solver that does not converge.

use crate::fault::HapticFaultKind;
use palpate_body::StepReport;

/// Time for which cells must be inverted to be reported, ticks.
const INVERTED_TICKS: u64 = 500;

/// Time without inverted cells after which they are reported again, ticks.
const UPRIGHT_TICKS: u64 = 1000;

/// Length of a window, ticks.
const WINDOW_TICKS: u64 = 1000;

/// Maximum share of unconverged solutions in a window that is not reported.
const MAX_UNCONVERGED_SHARE: f64 = 0.01;

/// Number of solutions of a contact solver in the present window, and of those without convergence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ConvergenceWindow {
    ticks: u64,
    of: u64,
    unconverged: u64,
    is_reported: bool,
}

impl ConvergenceWindow {
    /// Adds `ticks` ticks with `of` solutions, `unconverged` of them without convergence. Returns both numbers for a window to be reported:
    /// the first with more than 1 % without convergence since one with less.
    pub(crate) fn record(&mut self, ticks: u64, of: u64, unconverged: u64) -> Option<(u64, u64)> {
        self.ticks += ticks;
        self.of += of;
        self.unconverged += unconverged;
        if self.ticks < WINDOW_TICKS {
            return None;
        }
        // Some may be counted late, after the window to which they belong.
        let counts = (self.unconverged, self.of.max(self.unconverged));
        let is_bad = self.unconverged as f64 > MAX_UNCONVERGED_SHARE * counts.1 as f64;
        let was_reported = self.is_reported;
        *self = Self { is_reported: is_bad, ..Self::default() };
        Some(counts).filter(|_| is_bad && !was_reported)
    }
}

/// Time with and without inverted cells.
#[derive(Clone, Copy, Debug, Default)]
struct InversionWatch {
    /// Number of consecutive ticks with inverted cells.
    inverted: u64,
    /// Number of consecutive ticks without inverted cells.
    upright: u64,
    is_reported: bool,
}

impl InversionWatch {
    /// Adds `ticks` ticks with `cells` inverted cells at their end; returns whether to report them.
    fn record(&mut self, ticks: u64, cells: usize) -> bool {
        if cells == 0 {
            (self.inverted, self.upright) = (0, self.upright + ticks);
            self.is_reported &= self.upright < UPRIGHT_TICKS;
            return false;
        }
        (self.inverted, self.upright) = (self.inverted + ticks, 0);
        self.inverted >= INVERTED_TICKS && !std::mem::replace(&mut self.is_reported, true)
    }
}

/// Persistent problems of a body's steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StepWatch {
    convergence: ConvergenceWindow,
    inversion: InversionWatch,
}

impl StepWatch {
    /// Adds a model step; returns the faults to be reported.
    pub(crate) fn record(&mut self, report: &StepReport) -> impl Iterator<Item = HapticFaultKind> + use<> {
        let ticks = report.ticks as u64;
        // Without iterations of the solver there was no contact, obstacle or suture.
        let of = if report.iterations > 0 { (report.ticks * report.substeps) as u64 } else { 0 };
        // A step may be solved several times.
        let unconverged = (report.unconverged as u64).min(of);
        let cells = report.inverted_cells;
        let inverted =
            self.inversion.record(ticks, cells).then_some(HapticFaultKind::InvertedCells { cells });
        let unconverged = self.convergence.record(ticks, of, unconverged);
        let unconverged = unconverged.map(|(steps, of)| HapticFaultKind::UnconvergedSteps { steps, of });
        inverted.into_iter().chain(unconverged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unconverged steps and all steps of the faults reported in a second of model steps of 50 ticks with `report`.
    fn second(watch: &mut StepWatch, report: StepReport) -> Vec<(u64, u64)> {
        let report = StepReport { ticks: 50, substeps: 4, ..report };
        let counts = |kind| match kind {
            HapticFaultKind::UnconvergedSteps { steps, of } => (steps, of),
            other => panic!("{other}"),
        };
        (0..20).flat_map(|_| watch.record(&report).map(counts).collect::<Vec<_>>()).collect()
    }

    /// `unconverged` of 200 steps.
    fn solved(unconverged: usize) -> StepReport {
        StepReport { iterations: 10, unconverged, ..StepReport::default() }
    }

    fn inverted(cells: usize) -> StepReport {
        StepReport { inverted_cells: cells, ..StepReport::default() }
    }

    #[test]
    fn reports_more_than_one_percent_unconverged_once_until_a_better_second() {
        let mut watch = StepWatch::default();
        assert_eq!(second(&mut watch, solved(0)), []);
        assert_eq!(second(&mut watch, solved(2)), []);
        assert_eq!(second(&mut watch, solved(3)), [(60, 4000)]);
        assert_eq!(second(&mut watch, solved(200)), []);
        assert_eq!(second(&mut watch, solved(0)), []);
        // Steps that are solved several times count once.
        assert_eq!(second(&mut watch, solved(900)), [(4000, 4000)]);
        // A second without contact.
        assert_eq!(second(&mut watch, StepReport::default()), []);
        assert_eq!(second(&mut watch, solved(3)), [(60, 4000)]);
    }

    #[test]
    fn reports_cells_inverted_for_half_a_second_once_until_a_second_without() {
        let mut watch = StepWatch::default();
        let cells_of = |kind| match kind {
            HapticFaultKind::InvertedCells { cells } => cells,
            other => panic!("{other}"),
        };
        let mut steps = |cells: usize, ticks: usize| {
            let report = StepReport { ticks, ..inverted(cells) };
            watch.record(&report).map(cells_of).collect::<Vec<_>>()
        };
        // A short inversion does not count.
        assert_eq!((steps(3, 450), steps(0, 50), steps(3, 450)), (vec![], vec![], vec![]));
        assert_eq!(steps(4, 50), [4]);
        assert_eq!((steps(4, 5000), steps(0, 950), steps(4, 5000)), (vec![], vec![], vec![]));
        assert_eq!((steps(0, 950), steps(0, 50), steps(1, 450)), (vec![], vec![], vec![]));
        assert_eq!(steps(2, 50), [2]);
    }
}
