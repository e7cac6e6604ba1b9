//! Section 6: manipulation of a block, with its full model at a low rate and the force at the haptic rate.

use clap::Args;
use glam::DVec3;
use palpate_body::{Body, ToolContact};
use palpate_haptics::Trajectory;
use palpate_lab::block_scene::{BlockScene, ContactKind, builtin_offset_m, period_ticks};
use palpate_lab::error::{LabError, check, number, whole};
use palpate_lab::figure::{Curve, Panel, Scale, svg};
use palpate_lab::output::{Output, csv, write_files};
use palpate_lab::progress;
use palpate_local::{Sample, Scheme};
use palpate_reduce::{Comparison, ComparisonOptions};
use serde::Serialize;
use std::path::PathBuf;

/// Section 6: force during manipulation of a block (Fig. 17)
///
/// A tool moves the node in the middle of the top of a block of NODES x NODES x NODES nodes with a fixed bottom. The full nonlinear
/// model runs at the model rate, and between its steps the local model of SCHEME at 1 kHz. Its force is compared with that of the
/// full model at 1 kHz on the same movement.
///
/// All figures start at 0.2 s, when every scheme has a local model. `peak_force_n` is the maximum displayed force, `largest_jump_n` its
/// maximum change from one millisecond to the next, and `relative_rms_error` the RMS over all components of displayed minus exact
/// force, divided by that of the exact force. `low_rate` is the held force of the last model step.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab manipulate --json\n  palpate-lab manipulate --scheme tangent --model-rate-hz 50\n  \
                  palpate-lab manipulate --trajectory hand.csv --contact touch --out results"
)]
pub(crate) struct Manipulate {
    /// Nodes along each edge of the block
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 6)]
    pub(crate) nodes: usize,
    /// Rate of the full model, Hz; its period is cut to whole milliseconds
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 20.0)]
    pub(crate) model_rate_hz: f64,
    /// Scheme of the force between model steps
    #[arg(long, default_value_t = Scheme::Neighbourhood)]
    pub(crate) scheme: Scheme,
    /// Movement of the node: CSV with the header t_s,x_m,y_m,z_m, offsets each millisecond [default: 1.5 s of pressing
    /// and shearing]
    #[arg(long, value_name = "FILE")]
    pub(crate) trajectory: Option<PathBuf>,
    /// Contact of the tool: it holds the node, or touches the surface and only pushes
    #[arg(long, value_enum, default_value_t = ContactKind::Held)]
    pub(crate) contact: ContactKind,
    /// Time from a model step to the arrival of its local model, ms; a scheme with a state then catches up by 8 samples per tick
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 0)]
    pub(crate) delay_ms: usize,
    /// Edge of the block, m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.1)]
    pub(crate) edge_m: f64,
    /// Mass of the block, kg
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 1.0)]
    pub(crate) mass_kg: f64,
    /// Stiffness of each spring, N/m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 100.0)]
    pub(crate) stiffness: f64,
    /// Damping of each damper over the root of stiffness times mass of a node
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.7)]
    pub(crate) damping_ratio: f64,
}

#[derive(Serialize)]
pub(crate) struct Report {
    pub(crate) scheme: &'static str,
    pub(crate) model_rate_hz: f64,
    #[serde(flatten)]
    pub(crate) displayed: Figures,
    /// Held force of the last model step.
    pub(crate) low_rate: Figures,
    /// Force of the full model at 1 kHz.
    pub(crate) exact: Figures,
}

#[derive(Serialize)]
pub(crate) struct Figures {
    pub(crate) peak_force_n: f64,
    pub(crate) relative_rms_error: f64,
    pub(crate) largest_jump_n: f64,
}

/// First sample that counts: before the first model step there is no local model.
const FROM: usize = 200;

impl Manipulate {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let (comparison, report) = self.experiment()?;
        if let Some(folder) = output.folder() {
            let files =
                [("manipulate.csv", self.table(&comparison)), ("manipulate.svg", self.figure(&comparison)?)];
            write_files(folder, &files)?;
        }
        output.print(&report, |out| {
            writeln!(out, "{:22}{:>12}{:>18}{:>18}", "", "peak, N", "relative error", "largest jump, N")?;
            let name = self.scheme.name();
            for (name, figures) in [
                (name, &report.displayed),
                ("low rate, held", &report.low_rate),
                ("full at 1 kHz", &report.exact),
            ] {
                let Figures { peak_force_n, relative_rms_error, largest_jump_n } = figures;
                let error = format!("{:.2} %", 100.0 * relative_rms_error);
                writeln!(out, "{name:22}{peak_force_n:>12.4}{error:>18}{largest_jump_n:>18.4}")?;
            }
            Ok(())
        })
    }

    /// Forces of the comparison and their figures.
    pub(crate) fn experiment(&self) -> Result<(Comparison, Report), LabError> {
        self.validate()?;
        let _bar = progress::bar(1).with_message("stepping the body");
        let (body, contact, start) = self.scene()?;
        let samples = self.samples(start)?;
        let period_ticks = self.period_ticks();
        let options =
            ComparisonOptions { period_ticks, delay_ticks: self.delay_ms, ..ComparisonOptions::default() };
        let scheme = self.scheme;
        let mut schemes = vec![scheme];
        if scheme != Scheme::Hold {
            schemes.push(Scheme::Hold);
        }
        let comparison = Comparison::run(&body, &contact, &samples, &schemes, &options)?;
        let figures = |forces: &[DVec3], relative_rms_error| Figures {
            peak_force_n: forces.iter().skip(FROM).map(|f| f.length()).fold(0.0, f64::max),
            relative_rms_error,
            largest_jump_n: forces
                .windows(2)
                .skip(FROM)
                .map(|pair| (pair[1] - pair[0]).length())
                .fold(0.0, f64::max),
        };
        let of = |scheme| {
            let error = comparison.relative_rms_error(scheme, FROM);
            // An untouched body has no force to compare with.
            let error = error.ok_or(LabError::NoForce { from_s: FROM as f64 * 1e-3 })?;
            Ok::<_, LabError>(figures(comparison.displayed(scheme).unwrap_or_default(), error))
        };
        let report = Report {
            scheme: self.scheme.name(),
            model_rate_hz: 1e3 / period_ticks as f64,
            displayed: of(scheme)?,
            low_rate: of(Scheme::Hold)?,
            exact: figures(&comparison.oracle_n, 0.0),
        };
        Ok((comparison, report))
    }

    fn validate(&self) -> Result<(), LabError> {
        check("--nodes", self.nodes as f64, (2..=24).contains(&self.nodes), "2 to 24")?;
        let rate = self.model_rate_hz;
        check("--model-rate-hz", rate, (1.0..=1000.0).contains(&rate), "1 to 1000")?;
        check("--delay-ms", self.delay_ms as f64, self.delay_ms <= 1000, "at most 1000")?;
        let (edge, mass) = (self.edge_m, self.mass_kg);
        check("--edge-m", edge, edge > 0.0, "finite and above 0")?;
        check("--mass-kg", mass, mass > 0.0, "finite and above 0")?;
        check("--stiffness", self.stiffness, self.stiffness > 0.0, "finite and above 0")?;
        check("--damping-ratio", self.damping_ratio, self.damping_ratio >= 0.0, "finite and at least 0")
    }

    fn period_ticks(&self) -> usize {
        period_ticks(self.model_rate_hz)
    }

    /// Block at rest, tool, and start of its movement, m.
    pub(crate) fn scene(&self) -> Result<(Body, ToolContact, DVec3), LabError> {
        let Self { edge_m, mass_kg, damping_ratio, contact, .. } = *self;
        let (nodes, stiffness_n_per_m) = ([self.nodes; 3], self.stiffness);
        let block = BlockScene {
            nodes,
            edge_m,
            mass_kg,
            stiffness_n_per_m,
            damping_ratio,
            contact,
            ..BlockScene::default()
        };
        block.build()
    }

    /// Samples of the movement from `start`, with backward differences as velocities.
    fn samples(&self, start: DVec3) -> Result<Vec<Sample>, LabError> {
        let offsets = match &self.trajectory {
            Some(path) => Trajectory::from_csv_file(path)?.positions_m().to_vec(),
            None => (0..1500).map(|i| builtin_offset_m(f64::from(i) * 1e-3)).collect(),
        };
        let min_rows = FROM.max(self.period_ticks() + self.delay_ms) + 2;
        let rows = offsets.len();
        check(
            "number of rows of the trajectory",
            rows as f64,
            rows >= min_rows,
            format!("at least {min_rows}"),
        )?;
        Ok(offsets
            .iter()
            .enumerate()
            .map(|(i, &offset)| Sample {
                sequence: i as u64,
                time_s: i as f64 * 1e-3,
                position_m: start + offset,
                velocity_m_per_s: if i == 0 { DVec3::ZERO } else { (offset - offsets[i - 1]) / 1e-3 },
                ..Sample::default()
            })
            .collect())
    }

    fn table(&self, comparison: &Comparison) -> String {
        let scheme = self.scheme;
        let time = (0..comparison.oracle_n.len()).map(|i| i as f64 * 1e-3).collect();
        let mut columns = vec![("t_s".to_owned(), time)];
        let mut add = |name: &str, forces: &[DVec3]| {
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                columns.push((format!("{name}_{letter}_n"), forces.iter().map(|f| f[axis]).collect()));
            }
        };
        add("exact", &comparison.oracle_n);
        add(scheme.name(), comparison.displayed(scheme).unwrap_or_default());
        if scheme != Scheme::Hold {
            add("hold", comparison.displayed(Scheme::Hold).unwrap_or_default());
        }
        csv(&columns)
    }

    /// Fig. 17: force along z.
    pub(crate) fn figure(&self, comparison: &Comparison) -> Result<String, LabError> {
        let along_z = |forces: &[DVec3]| -> Vec<(f64, f64)> {
            forces.iter().enumerate().map(|(i, f)| (i as f64 * 1e-3, f.z)).collect()
        };
        let scheme = self.scheme;
        let shown = |scheme| along_z(comparison.displayed(scheme).unwrap_or_default());
        let mut curves = vec![
            Curve::new("full at 1 kHz", along_z(&comparison.oracle_n)).broad(),
            Curve::new(format!("{} at 1 kHz", scheme.name()), shown(scheme)),
        ];
        if scheme != Scheme::Hold {
            curves.push(Curve::new("full at the low rate", shown(Scheme::Hold)));
        }
        let panel = Panel {
            title: "Force during manipulation of a block".into(),
            x: "time, s",
            y: "normal force on the hand, N",
            scale: Scale::Linear,
            curves,
        };
        svg(&[panel], 1)
    }
}
