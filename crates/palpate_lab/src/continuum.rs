//! `palpate-lab continuum`: standard cases of elasticity on bodies of elements or springs, to compare with converged solutions.

mod cases;
mod grid;
mod options;
mod statics;

pub(crate) use options::Continuum;

use crate::error::LabError;
use crate::output::Output;
use cases::Solution;
use serde::Serialize;

/// The result on one grid.
#[derive(Clone, Copy, Debug, Serialize)]
struct Coarser {
    /// Cells along the longest edge.
    cells: usize,
    value: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    case: &'static str,
    element: &'static str,
    law: &'static str,
    poissons_ratio: f64,
    youngs_pa: f64,
    size_m: [f64; 3],
    /// Load in the unit of the case: m, N or degrees; none for natural frequencies.
    load: Option<f64>,
    value: f64,
    unit: &'static str,
    /// Number of elements, or of springs.
    elements: usize,
    nodes: usize,
    /// Natural frequencies by name, Hz.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    modes_hz: Vec<(&'static str, f64)>,
    /// Values on coarser grids, the coarsest first.
    converged_from: Vec<Coarser>,
}

impl Continuum {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        self.validate()?;
        let coarser: Vec<usize> =
            [self.cells / 4, self.cells / 2].into_iter().filter(|cells| *cells >= 2).collect();
        let converged_from = coarser
            .into_iter()
            .map(|cells| Ok(Coarser { cells, value: cases::solve(self, cells)?.value }))
            .collect::<Result<_, LabError>>()?;
        let Solution { value, elements, nodes, modes_hz } = cases::solve(self, self.cells)?;
        let report = Report {
            case: self.case.name(),
            element: self.element.name(),
            law: self.law.name(),
            poissons_ratio: self.poisson,
            youngs_pa: self.youngs_pa,
            size_m: self.size_m().to_array(),
            load: self.load_or_default(),
            value,
            unit: self.case.unit(),
            elements,
            nodes,
            modes_hz,
            converged_from,
        };
        output.print(&report, |out| {
            let [x, y, z] = report.size_m;
            writeln!(
                out,
                "{}, {} m x {} m x {} m, E {} Pa, Poisson's ratio {}, {}",
                report.case, x, y, z, report.youngs_pa, report.poissons_ratio, report.law
            )?;
            for Coarser { cells, value } in &report.converged_from {
                writeln!(out, "{cells:6} cells {value:>16.6e} {}", report.unit)?;
            }
            writeln!(
                out,
                "{:6} cells {:>16.6e} {}   {} {}, {} nodes",
                self.cells,
                report.value,
                report.unit,
                report.elements,
                self.element.plural(),
                report.nodes
            )?;
            report.modes_hz.iter().try_for_each(|(name, hz)| writeln!(out, "{name:>12} {hz:>16.6e} Hz"))
        })
    }
}
