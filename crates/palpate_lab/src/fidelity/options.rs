//! Options of `palpate-lab fidelity`, their allowed ranges, and the scene that they describe.

use super::comparison::{FROM, Run, Samples};
use crate::block_scene::{BlockScene, ContactKind, builtin_offset_m, period_ticks};
use crate::element_options::ElementOptions;
use crate::error::{LabError, check, number, whole};
use clap::Args;
use glam::DVec3;
use palpate_body::{Body, SemiImplicitEuler, ToolContact};
use palpate_haptics::{Trajectory, VelocityEstimator};
use palpate_local::Scheme;
use palpate_reduce::{BuilderOptions, ComparisonOptions, LocalIntegrator};
use std::path::PathBuf;

/// Error of every scheme's force relative to the full body at 1 kHz, on a block whose top is held
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab fidelity --json\n  palpate-lab fidelity --nodes 10,10,10 --delay-ms 40 --out results\n  \
                  palpate-lab fidelity --trajectory hand.csv --position-step-mm 0.03 --velocity two-pole:80"
)]
pub(crate) struct Fidelity {
    /// Nodes of the block along x, y and z
    #[arg(value_parser = three, allow_hyphen_values = true, long, default_value = "6,6,6", value_name = "X,Y,Z")]
    pub(super) nodes: Nodes,
    /// Edge of the block, m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.1)]
    pub(super) edge_m: f64,
    /// Mass of the block, shared equally by its nodes, kg
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 1.0)]
    pub(super) mass_kg: f64,
    /// Stiffness of each spring, N/m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 100.0)]
    pub(super) stiffness: f64,
    /// Damping of each damper over the root of stiffness times mass of a node
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.7)]
    pub(super) damping_ratio: f64,
    #[command(flatten)]
    pub(super) elements: ElementOptions,
    /// Contact between the tool and the block
    #[arg(long, value_enum, default_value = "held")]
    pub(super) contact: ContactKind,
    /// Model steps a second
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 20.0)]
    pub(super) model_rate_hz: f64,
    /// Time from a model step to the arrival of its local model, ms
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 0)]
    pub(super) delay_ms: usize,
    /// Movement of the node: builtin, or CSV with the header t_s,x_m,y_m,z_m, offsets each millisecond
    #[arg(long, value_name = "builtin|FILE", default_value = "builtin")]
    pub(super) trajectory: PathBuf,
    /// all, or names with commas: hold, low_pass, tangent, neighbourhood, krylov_linear, near_field_exact
    #[arg(long, default_value = "all", value_parser = schemes)]
    pub(super) scheme: Schemes,
    /// Velocity estimator of the samples: backward-difference, or two-pole:HZ
    #[arg(long, default_value = "backward-difference", value_parser = velocity)]
    pub(super) velocity: VelocityEstimator,
    /// Resolution of the measured positions, mm; the oracle uses exact positions
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.0)]
    pub(super) position_step_mm: f64,
    /// Integrator of near_field_exact: oracle, with the substeps of the full body, or implicit:SUBSTEPS
    #[arg(long, default_value = "oracle", value_parser = integrator)]
    pub(super) integrator: LocalIntegrator,
}

/// Number of nodes along x, y and z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nodes([usize; 3]);

fn three(text: &str) -> Result<Nodes, &'static str> {
    let list: Vec<usize> = text.split(',').map(whole).collect::<Result<_, _>>()?;
    list.try_into().map(Nodes).map_err(|_| "it must be three numbers, as in 6,6,6")
}

/// Schemes to compare.
#[derive(Clone, Debug)]
pub(super) struct Schemes(pub(super) Vec<Scheme>);

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

impl Fidelity {
    pub(super) fn validate(&self) -> Result<(), LabError> {
        for nodes in self.nodes.0 {
            check("--nodes", nodes as f64, (2..=24).contains(&nodes), "2 to 24 along each axis")?;
        }
        let rate = self.model_rate_hz;
        check("--model-rate-hz", rate, (1.0..=1000.0).contains(&rate), "1 to 1000")?;
        check("--delay-ms", self.delay_ms as f64, self.delay_ms <= 1000, "at most 1000")?;
        check("--edge-m", self.edge_m, self.edge_m > 0.0, "finite and above 0")?;
        check("--mass-kg", self.mass_kg, self.mass_kg > 0.0, "finite and above 0")?;
        check("--stiffness", self.stiffness, self.stiffness > 0.0, "finite and above 0")?;
        self.elements.validate()?;
        check("--damping-ratio", self.damping_ratio, self.damping_ratio >= 0.0, "finite and at least 0")?;
        let step = self.position_step_mm;
        check("--position-step-mm", step, (0.0..=10.0).contains(&step), "0 to 10")
    }

    pub(super) fn period_ticks(&self) -> usize {
        period_ticks(self.model_rate_hz)
    }

    pub(super) fn builder(&self) -> BuilderOptions {
        BuilderOptions { integrator: self.integrator, ..BuilderOptions::default() }
    }

    /// Block at rest, tool that holds the middle of its top, and position of the tool, m.
    pub(super) fn scene(&self) -> Result<(Body, ToolContact, DVec3), LabError> {
        let Self { edge_m, mass_kg, damping_ratio, contact, .. } = *self;
        let (nodes, stiffness_n_per_m) = (self.nodes.0, self.stiffness);
        let material = self.elements.material();
        let block =
            BlockScene { nodes, edge_m, mass_kg, stiffness_n_per_m, damping_ratio, material, contact };
        block.build()
    }

    pub(super) fn offsets(&self) -> Result<Vec<DVec3>, LabError> {
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

    pub(super) fn quantised(&self, offsets: &[DVec3]) -> Vec<DVec3> {
        let step = 1e-3 * self.position_step_mm;
        offsets.iter().map(|x| if step > 0.0 { (*x / step).round() * step } else { *x }).collect()
    }

    /// Compares the schemes with the oracle at a model period and a delay in ticks.
    pub(super) fn compare(
        &self,
        (body, contact): (&Body, &ToolContact),
        samples: &Samples,
        period_ticks: usize,
        delay_ticks: usize,
    ) -> Result<Run, LabError> {
        let options = ComparisonOptions {
            period_ticks,
            delay_ticks,
            integrator: SemiImplicitEuler::default().into(),
            builder: self.builder(),
            ..ComparisonOptions::default()
        };
        Run::new((body, contact), samples, &self.scheme.0, &options)
    }
}
