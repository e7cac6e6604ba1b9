//! Sections 4 and 5: a mesh driven in the middle of its top, and its reduced models.

mod analysis;
mod options;
mod plot;
mod table;

pub(crate) use analysis::Analysis;
pub(crate) use options::{Lattice, Method};
pub(crate) use plot::{mesh, response_panels, states};

use palpate_lab::error::LabError;
use palpate_lab::figure::svg;
use palpate_lab::output::{Output, write_files};

impl Lattice {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let analysis = self.analyse(output.folder().is_some())?;
        if let Some(folder) = output.folder() {
            let mut files = vec![
                ("lattice_response.csv", analysis.response_csv()),
                ("lattice_response.svg", svg(&response_panels(&analysis), 2)?),
                ("lattice_mesh.svg", mesh(&analysis)?),
            ];
            if let Some(hankel) = analysis.hankel_csv() {
                files.push(("lattice_hankel.csv", hankel));
                files.push(("lattice_hankel.svg", svg(&[plot::hankel_panel(&analysis)], 1)?));
            }
            if let Some(csv) = analysis.states_csv() {
                files.push(("lattice_states.csv", csv));
                files.push(("lattice_states.svg", states(&analysis)?));
            }
            write_files(folder, &files)?;
        }
        output.print(&analysis.report, |out| {
            let report = &analysis.report;
            let list =
                |values: &[f64]| values.iter().map(|v| format!("{v:.4}")).collect::<Vec<_>>().join(", ");
            writeln!(out, "order                     {}, reduced to {}", report.order, report.reduced_order)?;
            writeln!(out, "built in                  {:.2} ms", report.build_ms)?;
            writeln!(out, "static stiffness, N/m     {}", list(&report.static_stiffness_n_per_m))?;
            writeln!(out, "  of the reduced model    {}", list(&report.reduced_static_stiffness_n_per_m))?;
            let relative = 100.0 * report.relative_to_proper_peak;
            writeln!(
                out,
                "H-infinity error, N/m     {:.6} ({relative:.4} % of the peak, {:.4} N/m){}",
                report.hinf_error_n_per_m,
                report.proper_peak_n_per_m,
                if report.hinf_method == "grid" { ", a lower bound: the maximum on a grid" } else { "" }
            )?;
            if report.method == Method::Balanced && report.reduced_order < self.order {
                let (requested, rank) = (self.order, report.reduced_order);
                writeln!(out, "  {requested} states were requested; the rank of the Gramians is {rank}")?;
            }
            if let Some(bound) = report.error_bound_n_per_m {
                writeln!(out, "  its bound, N/m          {bound:.6}")?;
            }
            let (low, high) = self.band();
            let band = 100.0 * report.band_relative_error;
            writeln!(out, "error, {low} to {high} Hz     {band:.4} %")?;
            writeln!(out, "error at zero             {:.4} %", 100.0 * report.dc_relative_error)?;
            if let Some(db) = report.off_diagonal_db {
                writeln!(out, "normal to tangential, dB  {db:.1}")?;
            }
            if let Some(hankel) = &report.hankel_singular_values {
                let shown = &hankel[..hankel.len().min(12)];
                writeln!(
                    out,
                    "Hankel singular values    {}{}",
                    list(shown),
                    if hankel.len() > 12 { ", ..." } else { "" }
                )?;
            }
            Ok(())
        })
    }
}
