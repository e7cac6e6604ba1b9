//! Reports what is wrong with a body's steps for some time: cells that stay inverted, a solver that does not converge.

use crate::fault::HapticFaultKind;
use palpate_body::StepReport;

/// Time for which cells must be inverted to be reported, ticks.
const INVERTED_TICKS: u64 = 500;

/// Time without inverted cells after which they are reported again, ticks.
const UPRIGHT_TICKS: u64 = 1000;

/// Length of a window, ticks.
const WINDOW_TICKS: u64 = 1000;

/// Share of the solutions of a window that may stop at the solver's limit.
const TOLERATED: f64 = 0.01;

/// How often a contact solver was used in the present window, and how often it did not converge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ConvergenceWindow {
    ticks: u64,
    of: u64,
    unconverged: u64,
    is_reported: bool,
}

impl ConvergenceWindow {
    /// Adds `ticks` ticks with `of` solutions, `unconverged` of which did not converge. Returns both numbers for a window that has
    /// to be reported: the first with more than 1 % without convergence since one with less.
    pub(crate) fn note(&mut self, ticks: u64, of: u64, unconverged: u64) -> Option<(u64, u64)> {
        self.ticks += ticks;
        self.of += of;
        self.unconverged += unconverged;
        if self.ticks < WINDOW_TICKS {
            return None;
        }
        // Some may be counted late, after the window to which they belong.
        let found = (self.unconverged, self.of.max(self.unconverged));
        let is_bad = self.unconverged as f64 > TOLERATED * found.1 as f64;
        let was_reported = self.is_reported;
        *self = Self { is_reported: is_bad, ..Self::default() };
        Some(found).filter(|_| is_bad && !was_reported)
    }
}

/// Inverted cells, as long as they last.
#[derive(Clone, Copy, Debug, Default)]
struct InversionWatch {
    /// Ticks for which there have been such cells without a break.
    inverted: u64,
    /// Ticks for which there have been none.
    upright: u64,
    is_reported: bool,
}

impl InversionWatch {
    /// Adds `ticks` ticks at whose end `cells` cells are inverted; whether that has to be reported.
    fn note(&mut self, ticks: u64, cells: usize) -> bool {
        if cells == 0 {
            (self.inverted, self.upright) = (0, self.upright + ticks);
            self.is_reported &= self.upright < UPRIGHT_TICKS;
            return false;
        }
        (self.inverted, self.upright) = (self.inverted + ticks, 0);
        self.inverted >= INVERTED_TICKS && !std::mem::replace(&mut self.is_reported, true)
    }
}

/// What is wrong with a body's steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StepWatch {
    convergence: ConvergenceWindow,
    inversion: InversionWatch,
}

impl StepWatch {
    /// Adds a model step; returns what has to be reported.
    pub(crate) fn note(&mut self, report: &StepReport) -> impl Iterator<Item = HapticFaultKind> + use<> {
        let ticks = report.ticks as u64;
        // Without a sweep nothing touched the body and nothing held it.
        let of = if report.sweeps > 0 { (report.ticks * report.substeps) as u64 } else { 0 };
        // A step may be solved several times.
        let unconverged = (report.unconverged as u64).min(of);
        let cells = report.inverted_cells;
        let inverted = self.inversion.note(ticks, cells).then_some(HapticFaultKind::InvertedCells { cells });
        let unconverged = self.convergence.note(ticks, of, unconverged);
        let unconverged = unconverged.map(|(steps, of)| HapticFaultKind::UnconvergedSteps { steps, of });
        inverted.into_iter().chain(unconverged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second of model steps of 50 ticks that are all like `report`: what is reported.
    fn second(watch: &mut StepWatch, report: StepReport) -> Vec<String> {
        let report = StepReport { ticks: 50, substeps: 4, ..report };
        (0..20).flat_map(|_| watch.note(&report).map(|kind| kind.to_string()).collect::<Vec<_>>()).collect()
    }

    /// `unsolved` of 200 steps.
    fn solved(unsolved: usize) -> StepReport {
        StepReport { sweeps: 10, unconverged: unsolved, ..StepReport::default() }
    }

    fn inverted(cells: usize) -> StepReport {
        StepReport { inverted_cells: cells, ..StepReport::default() }
    }

    #[test]
    fn more_than_one_percent_of_a_second_s_steps_is_reported_once_until_a_second_is_better() {
        let mut watch = StepWatch::default();
        let told = |steps: u64| {
            let text = "the contact solver of the body did not converge in";
            format!("{text} {steps} of 4000 steps")
        };
        let is = |said: Vec<String>, steps: u64| said.len() == 1 && said[0].starts_with(&told(steps));
        assert_eq!(second(&mut watch, solved(0)), [""; 0]);
        assert_eq!(second(&mut watch, solved(2)), [""; 0]);
        assert!(is(second(&mut watch, solved(3)), 60));
        assert_eq!(second(&mut watch, solved(200)), [""; 0]);
        assert_eq!(second(&mut watch, solved(0)), [""; 0]);
        // Solved several times in a step: no more than all steps.
        assert!(is(second(&mut watch, solved(900)), 4000));
        // Nothing touches it.
        assert_eq!(second(&mut watch, StepReport::default()), [""; 0]);
        assert!(is(second(&mut watch, solved(3)), 60));
    }

    #[test]
    fn cells_inverted_for_half_a_second_are_reported_once_until_none_was_for_a_second() {
        let mut watch = StepWatch::default();
        let mut steps = |cells: usize, ticks: usize| {
            let report = StepReport { ticks, ..inverted(cells) };
            watch.note(&report).map(|kind| kind.to_string()).collect::<Vec<_>>()
        };
        let is = |said: Vec<String>, cells: usize| {
            said.len() == 1 && said[0].starts_with(&format!("{cells} cells of the body have been inverted"))
        };
        // A short inversion does not count.
        assert_eq!((steps(3, 450), steps(0, 50), steps(3, 450)), (vec![], vec![], vec![]));
        assert!(is(steps(4, 50), 4));
        assert_eq!((steps(4, 5000), steps(0, 950), steps(4, 5000)), (vec![], vec![], vec![]));
        assert_eq!((steps(0, 950), steps(0, 50), steps(1, 450)), (vec![], vec![], vec![]));
        assert!(is(steps(2, 50), 2));
    }
}
