//! `palpate-lab fidelity`: every scheme against the full body at 1 kHz.

mod cost;
mod plot;

use crate::block_scene::{BlockScene, builtin_offset_m, period_ticks};
use crate::error::{LabError, check, number, whole};
use crate::output::{Output, csv, write_files};
use crate::progress;
use clap::Args;
use glam::DVec3;
use palpate_body::{Body, SemiImplicitEuler, ToolContact};
use palpate_haptics::{Trajectory, VelocityEstimator, VelocityState};
use palpate_local::{Sample, Scheme};
use palpate_reduce::{BuilderOptions, Comparison, ComparisonOptions, LocalIntegrator, relative_rms_error};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// How far every scheme's force is from that of the full body at 1 kHz, on a block whose top is held
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab fidelity --json\n  palpate-lab fidelity --nodes 10,10,10 --delay-ms 40 --out results\n  \
                  palpate-lab fidelity --trajectory hand.csv --position-step-mm 0.03 --velocity two-pole:80"
)]
pub(crate) struct Fidelity {
    /// Nodes of the block along x, y and z
    #[arg(value_parser = three, allow_hyphen_values = true, long, default_value = "6,6,6", value_name = "X,Y,Z")]
    nodes: Nodes,
    /// Edge of the block, m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.1)]
    edge_m: f64,
    /// Mass of the block, shared equally by its nodes, kg
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 1.0)]
    mass_kg: f64,
    /// Stiffness of each spring, N/m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 100.0)]
    stiffness: f64,
    /// Damping of each damper over the root of stiffness times mass of a node
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.7)]
    damping_ratio: f64,
    /// Model steps a second
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 20.0)]
    model_rate_hz: f64,
    /// Time from a model step to the arrival of its local model, ms
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 0)]
    delay_ms: usize,
    /// Movement of the node: builtin, or CSV with the header t_s,x_m,y_m,z_m, offsets each millisecond
    #[arg(long, value_name = "builtin|FILE", default_value = "builtin")]
    trajectory: PathBuf,
    /// all, or names with commas: hold, low_pass, tangent, neighbourhood, krylov_linear, near_field_exact
    #[arg(long, default_value = "all", value_parser = schemes)]
    scheme: Schemes,
    /// Where the samples' velocity comes from: backward-difference, or two-pole:HZ
    #[arg(long, default_value = "backward-difference", value_parser = velocity)]
    velocity: VelocityEstimator,
    /// Positions are rounded to multiples of that, mm; the oracle has the exact ones
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.0)]
    position_step_mm: f64,
    /// Ticks of near_field_exact: oracle, with the full body's substeps, or implicit:SUBSTEPS
    #[arg(long, default_value = "oracle", value_parser = integrator)]
    integrator: LocalIntegrator,
}

/// Nodes along three axes.
#[derive(Clone, Copy, Debug)]
struct Nodes([usize; 3]);

fn three(text: &str) -> Result<Nodes, &'static str> {
    let list: Vec<usize> = text.split(',').map(whole).collect::<Result<_, _>>()?;
    list.try_into().map(Nodes).map_err(|_| "it must be three numbers, as in 6,6,6")
}

/// The schemes to be run.
#[derive(Clone, Debug)]
struct Schemes(Vec<Scheme>);

fn schemes(text: &str) -> Result<Schemes, String> {
    if text.trim() == "all" {
        return Ok(Schemes(Scheme::ALL.to_vec()));
    }
    let mut list = Vec::new();
    for name in text.split(',') {
        let scheme = name.parse().map_err(|error: palpate_local::LocalModelError| error.to_string())?;
        if !list.contains(&scheme) {
            list.push(scheme);
        }
    }
    Ok(Schemes(list))
}

fn velocity(text: &str) -> Result<VelocityEstimator, String> {
    match text.trim().split_once(':') {
        None if text.trim() == "backward-difference" => Ok(VelocityEstimator::BackwardDifference),
        Some(("two-pole", cutoff)) => {
            let cutoff_hz = cutoff.parse().map_err(|_| "two-pole:HZ needs a number, as in two-pole:80")?;
            let estimator = VelocityEstimator::TwoPole { cutoff_hz };
            estimator.validate().map_err(|error| error.to_string())?;
            Ok(estimator)
        }
        _ => Err("it must be backward-difference or two-pole:HZ".into()),
    }
}

fn integrator(text: &str) -> Result<LocalIntegrator, String> {
    match text.trim().split_once(':') {
        None if text.trim() == "oracle" => Ok(LocalIntegrator::Explicit),
        Some(("implicit", substeps)) => match substeps.parse() {
            Ok(substeps @ 1..=64) => Ok(LocalIntegrator::Implicit { substeps }),
            _ => Err("implicit:SUBSTEPS needs a whole number from 1 to 64".into()),
        },
        _ => Err("it must be oracle or implicit:SUBSTEPS".into()),
    }
}

/// What is said of each scheme.
#[derive(Clone, Debug, Serialize)]
struct Figures {
    /// RMS of the difference to the oracle over the RMS of the oracle, from 0.2 s on.
    relative_rms_error: f64,
    max_error_n: f64,
    /// Largest change from tick to tick.
    largest_jump_n: f64,
    /// Numbers in the state of the local model.
    states: usize,
    /// Median time of a tick, model, hand-over and all.
    tick_us_p50: f64,
    /// Median time of building a local model.
    build_ms_p50: f64,
}

#[derive(Serialize)]
struct Report {
    schemes: BTreeMap<&'static str, Figures>,
    oracle: Oracle,
}

#[derive(Serialize)]
struct Oracle {
    /// Largest absolute force along x, y and z.
    peak_abs_n: [f64; 3],
}

/// Samples before that do not count: there is no local model before the first model step.
const FROM: usize = 200;

/// A run: what the oracle and the schemes displayed.
struct Run {
    oracle_n: Vec<DVec3>,
    displayed_n: Vec<(Scheme, Vec<DVec3>)>,
}

impl Run {
    /// Of what was displayed, from sample `from` on.
    fn relative_rms_error(&self, displayed: &[DVec3], from: usize) -> Option<f64> {
        relative_rms_error(displayed.get(from..)?, self.oracle_n.get(from..)?)
    }
}

impl Fidelity {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        self.validate()?;
        let (body, contact, start) = self.scene()?;
        let offsets = self.offsets()?;
        let exact = samples(&offsets, start, VelocityEstimator::BackwardDifference);
        let felt = samples(&self.quantised(&offsets), start, self.velocity);
        let bar = progress::bar(1 + self.scheme.0.len());
        bar.set_message("every scheme against the full body");
        let run = self.compare(&body, &contact, &exact, &felt, self.period_ticks(), self.delay_ms)?;
        bar.inc(1);
        let mut schemes = BTreeMap::new();
        for (scheme, displayed) in &run.displayed_n {
            bar.set_message(scheme.name());
            let cost = cost::measure(*scheme, &body, &contact, &felt, self.builder())?;
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
            let over = plot::sweeps(self, &body, &contact, &exact, &felt)?;
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

    fn validate(&self) -> Result<(), LabError> {
        for nodes in self.nodes.0 {
            check("--nodes", nodes as f64, (2..=24).contains(&nodes), "2 to 24 along each axis")?;
        }
        let rate = self.model_rate_hz;
        check("--model-rate-hz", rate, (1.0..=1000.0).contains(&rate), "1 to 1000")?;
        check("--delay-ms", self.delay_ms as f64, self.delay_ms <= 1000, "at most 1000")?;
        check("--edge-m", self.edge_m, self.edge_m > 0.0, "finite and above 0")?;
        check("--mass-kg", self.mass_kg, self.mass_kg > 0.0, "finite and above 0")?;
        check("--stiffness", self.stiffness, self.stiffness > 0.0, "finite and above 0")?;
        check("--damping-ratio", self.damping_ratio, self.damping_ratio >= 0.0, "finite and at least 0")?;
        let step = self.position_step_mm;
        check("--position-step-mm", step, (0.0..=10.0).contains(&step), "0 to 10")
    }

    fn period_ticks(&self) -> usize {
        period_ticks(self.model_rate_hz)
    }

    fn builder(&self) -> BuilderOptions {
        BuilderOptions { integrator: self.integrator, ..BuilderOptions::default() }
    }

    /// The block at rest, and the tool that holds the middle of its top, and where.
    fn scene(&self) -> Result<(Body, ToolContact, DVec3), LabError> {
        let Self { edge_m, mass_kg, damping_ratio, .. } = *self;
        let (nodes, stiffness_n_per_m) = (self.nodes.0, self.stiffness);
        let block =
            BlockScene { nodes, edge_m, mass_kg, stiffness_n_per_m, damping_ratio, ..BlockScene::default() };
        block.build()
    }

    fn offsets(&self) -> Result<Vec<DVec3>, LabError> {
        let offsets = if self.trajectory.as_os_str() == "builtin" {
            (0..1500).map(|i| builtin_offset_m(f64::from(i) * 1e-3)).collect()
        } else {
            Trajectory::from_csv_file(&self.trajectory)?.positions_m().to_vec()
        };
        let least = FROM.max(self.period_ticks() + self.delay_ms) + 2;
        let rows = offsets.len();
        check("number of rows of the trajectory", rows as f64, rows >= least, format!("at least {least}"))?;
        Ok(offsets)
    }

    fn quantised(&self, offsets: &[DVec3]) -> Vec<DVec3> {
        let step = 1e-3 * self.position_step_mm;
        offsets.iter().map(|x| if step > 0.0 { (*x / step).round() * step } else { *x }).collect()
    }

    /// The oracle along the `exact` samples and every scheme along those that are `felt`.
    fn compare(
        &self,
        body: &Body,
        contact: &ToolContact,
        exact: &[Sample],
        felt: &[Sample],
        period_ticks: usize,
        delay_ticks: usize,
    ) -> Result<Run, LabError> {
        let integrator = SemiImplicitEuler::default().into();
        let builder = self.builder();
        let options = ComparisonOptions {
            period_ticks,
            delay_ticks,
            integrator,
            builder,
            ..ComparisonOptions::default()
        };
        let comparison = Comparison::run(body, contact, felt, &self.scheme.0, &options)?;
        let oracle_n = if exact == felt {
            comparison.oracle_n
        } else {
            Comparison::run(body, contact, exact, &[], &options)?.oracle_n
        };
        Ok(Run { oracle_n, displayed_n: comparison.displayed_n })
    }
}

/// Samples at `start` plus `offsets`, one each millisecond.
fn samples(offsets: &[DVec3], start: DVec3, estimator: VelocityEstimator) -> Vec<Sample> {
    let mut state = VelocityState::default();
    let sample = |(i, offset): (usize, &DVec3)| Sample {
        sequence: i as u64,
        time_s: i as f64 * 1e-3,
        position_m: start + *offset,
        velocity_m_per_s: state.step(estimator, start + *offset, None, 1e-3),
        ..Sample::default()
    };
    offsets.iter().enumerate().map(sample).collect()
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
