//! Figures of fidelity: force over time, and error over model rate and delay.

use super::comparison::{FROM, Run, Samples};
use super::options::Fidelity;
use crate::block_scene::period_ticks;
use crate::error::LabError;
use crate::figure::{Curve, Panel, Scale, svg};
use crate::output::csv;
use crate::progress;
use palpate_body::{Body, ToolContact};
use palpate_local::Scheme;

/// Model rates and delays of the sweeps, Hz and ms.
const RATES_HZ: [f64; 8] = [2.0, 4.0, 5.0, 10.0, 20.0, 25.0, 50.0, 100.0];
const DELAYS_MS: [usize; 6] = [0, 10, 20, 40, 60, 80];

/// Normal force of the full body and of every scheme over time.
pub(super) fn force(run: &Run) -> Result<String, LabError> {
    let along_z = |forces: &[glam::DVec3]| -> Vec<(f64, f64)> {
        forces.iter().enumerate().map(|(i, f)| (i as f64 * 1e-3, f.z)).collect()
    };
    let oracle = Curve::new("full body at 1 kHz", along_z(&run.oracle_n)).broad();
    let schemes = run.displayed_n.iter().map(|(scheme, forces)| Curve::new(scheme.name(), along_z(forces)));
    let panel = Panel {
        title: "Force on the hand".into(),
        x: "time, s",
        y: "normal force, N",
        scale: Scale::Linear,
        curves: std::iter::once(oracle).chain(schemes).collect(),
    };
    svg(&[panel], 1)
}

/// Errors over model rates and over delays.
pub(super) struct Sweeps {
    schemes: Vec<Scheme>,
    /// Model rate, Hz, and the error of each scheme.
    over_rate: Vec<(f64, Vec<f64>)>,
    /// Delay, ms, and the error of each scheme.
    over_delay: Vec<(f64, Vec<f64>)>,
}

/// Repeats the comparison over model rates and delays.
pub(super) fn sweeps(
    fidelity: &Fidelity,
    body: &Body,
    contact: &ToolContact,
    samples: &Samples,
) -> Result<Sweeps, LabError> {
    let bar = progress::bar(RATES_HZ.len() + DELAYS_MS.len());
    bar.set_message("over model rate and delay");
    let errors = |period: usize, delay: usize| -> Result<Vec<f64>, LabError> {
        let run = fidelity.compare((body, contact), samples, period, delay)?;
        bar.inc(1);
        // The first local model arrives then.
        let from = FROM.max(period + delay);
        let error = |(_, forces): &(Scheme, Vec<_>)| run.relative_rms_error(forces, from);
        Ok(run.displayed_n.iter().map(|one| error(one).unwrap_or(f64::NAN)).collect())
    };
    let mut over_rate = Vec::new();
    for rate in RATES_HZ {
        over_rate.push((rate, errors(period_ticks(rate), fidelity.delay_ms)?));
    }
    let mut over_delay = Vec::new();
    for delay in DELAYS_MS {
        over_delay.push((delay as f64, errors(fidelity.period_ticks(), delay)?));
    }
    Ok(Sweeps { schemes: fidelity.scheme.0.clone(), over_rate, over_delay })
}

impl Sweeps {
    pub(super) fn figure(&self) -> Result<String, LabError> {
        let panel = |title: &str, x, scale, rows: &[(f64, Vec<f64>)]| Panel {
            title: title.into(),
            x,
            y: "force error, %",
            scale,
            curves: self
                .schemes
                .iter()
                .enumerate()
                .map(|(i, scheme)| {
                    Curve::new(scheme.name(), rows.iter().map(|(at, errors)| (*at, 100.0 * errors[i])))
                })
                .collect(),
        };
        let rate = panel("Error over model rate", "model steps a second, Hz", Scale::Log, &self.over_rate);
        let delay =
            panel("Error over delay", "delay of the local model, ms", Scale::Linear, &self.over_delay);
        svg(&[rate, delay], 2)
    }

    pub(super) fn table(&self) -> String {
        let rows: Vec<(f64, f64, &Vec<f64>)> = self
            .over_rate
            .iter()
            .map(|(rate, errors)| (*rate, f64::NAN, errors))
            .chain(self.over_delay.iter().map(|(delay, errors)| (f64::NAN, *delay, errors)))
            .collect();
        let mut columns = vec![
            ("model_rate_hz".to_owned(), rows.iter().map(|row| row.0).collect()),
            ("delay_ms".to_owned(), rows.iter().map(|row| row.1).collect()),
        ];
        for (i, scheme) in self.schemes.iter().enumerate() {
            columns.push((scheme.name().to_owned(), rows.iter().map(|row| row.2[i]).collect()));
        }
        csv(&columns)
    }
}
