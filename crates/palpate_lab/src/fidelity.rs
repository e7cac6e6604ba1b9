//! `palpate-lab fidelity`: error of every scheme relative to the full body at 1 kHz.

mod comparison;
mod cost;
mod options;
mod plot;

pub(crate) use options::Fidelity;

use crate::error::LabError;
use crate::output::{Output, csv, write_files};
use crate::progress;
use comparison::{FROM, Run, Samples, samples};
use glam::DVec3;
use palpate_haptics::VelocityEstimator;
use serde::Serialize;
use std::collections::BTreeMap;

/// Error and cost of a scheme.
#[derive(Clone, Debug, Serialize)]
struct Figures {
    /// RMS of the difference to the oracle over the RMS of the oracle, from 0.2 s on.
    relative_rms_error: f64,
    /// Maximum difference to the oracle, N.
    max_error_n: f64,
    /// Maximum change from tick to tick, N.
    largest_jump_n: f64,
    /// Number of state variables of the local model.
    states: usize,
    /// Median time of a tick including the hand-over, µs.
    tick_us_p50: f64,
    /// Median time of building a local model, ms.
    build_ms_p50: f64,
}

#[derive(Serialize)]
struct Report {
    schemes: BTreeMap<&'static str, Figures>,
    oracle: Oracle,
}

#[derive(Serialize)]
struct Oracle {
    /// Maximum absolute force along x, y and z, N.
    peak_abs_n: [f64; 3],
}

impl Fidelity {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        self.validate()?;
        let (body, contact, start) = self.scene()?;
        let offsets = self.offsets()?;
        let samples = Samples {
            exact: samples(&offsets, start, VelocityEstimator::BackwardDifference),
            measured: samples(&self.quantised(&offsets), start, self.velocity),
        };
        let bar = progress::bar(1 + self.scheme.0.len());
        bar.set_message("every scheme against the full body");
        let run = self.compare((&body, &contact), &samples, self.period_ticks(), self.delay_ms)?;
        bar.inc(1);
        let mut schemes = BTreeMap::new();
        for (scheme, displayed) in &run.displayed_n {
            bar.set_message(scheme.name());
            let cost = cost::measure(*scheme, &body, &contact, &samples.measured, self.builder())?;
            let error = run.relative_rms_error(displayed, FROM);
            let relative_rms_error = error.ok_or(LabError::NoForce { from_s: FROM as f64 * 1e-3 })?;
            let apart = displayed.iter().zip(&run.oracle_n).skip(FROM).map(|(d, o)| (*d - *o).length());
            let jumps = displayed.windows(2).skip(FROM).map(|pair| (pair[1] - pair[0]).length());
            let figures = Figures {
                relative_rms_error,
                max_error_n: apart.fold(0.0, f64::max),
                largest_jump_n: jumps.fold(0.0, f64::max),
                states: cost.states,
                tick_us_p50: cost.tick_us,
                build_ms_p50: cost.build_ms,
            };
            schemes.insert(scheme.name(), figures);
            bar.inc(1);
        }
        let peak = run.oracle_n.iter().fold(DVec3::ZERO, |peak, f| peak.max(f.abs()));
        let report = Report { schemes, oracle: Oracle { peak_abs_n: peak.to_array() } };
        if let Some(folder) = output.folder() {
            let over = plot::sweeps(self, &body, &contact, &samples)?;
            let files = [
                ("fidelity.csv", table(&run)),
                ("fidelity_force.svg", plot::force(&run)?),
                ("fidelity_error.svg", over.figure()?),
                ("fidelity_error.csv", over.table()),
            ];
            write_files(folder, &files)?;
        }
        output.print(&report, |out| {
            writeln!(
                out,
                "{:18}{:>11}{:>13}{:>17}{:>8}{:>11}{:>11}",
                "", "error", "largest, N", "largest jump, N", "states", "tick, us", "build, ms"
            )?;
            for scheme in &self.scheme.0 {
                let Some(f) = report.schemes.get(scheme.name()) else { continue };
                let error = format!("{:.2} %", 100.0 * f.relative_rms_error);
                writeln!(
                    out,
                    "{:18}{error:>11}{:>13.4}{:>17.4}{:>8}{:>11.2}{:>11.3}",
                    scheme.name(),
                    f.max_error_n,
                    f.largest_jump_n,
                    f.states,
                    f.tick_us_p50,
                    f.build_ms_p50
                )?;
            }
            let [x, y, z] = report.oracle.peak_abs_n;
            writeln!(out, "largest force of the full body, N: {x:.3} {y:.3} {z:.3}")
        })
    }
}

fn table(run: &Run) -> String {
    let mut columns = vec![("t_s".to_owned(), (0..run.oracle_n.len()).map(|i| i as f64 * 1e-3).collect())];
    let mut add = |name: &str, forces: &[DVec3]| {
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            columns.push((format!("{name}_{letter}_n"), forces.iter().map(|f| f[axis]).collect()));
        }
    };
    add("oracle", &run.oracle_n);
    run.displayed_n.iter().for_each(|(scheme, forces)| add(scheme.name(), forces));
    csv(&columns)
}
