//! Section 6, stability: motion of a device in a loose grip.

use clap::Args;
use glam::DVec3;
use palpate_body::{Body, BodyError, SemiImplicitEuler, ToolContact, ToolPoint};
use palpate_lab::block_scene::{BlockScene, period_ticks};
use palpate_lab::error::{LabError, check, number};
use palpate_lab::figure::{Curve, Panel, Scale, svg};
use palpate_lab::output::{Output, csv, write_files};
use palpate_lab::progress;
use palpate_local::{HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme, SubmitResult};
use palpate_reduce::{BuilderOptions, LocalModelBuilder, ReduceError};
use serde::Serialize;
use std::collections::BTreeMap;

/// Section 6, stability: a device in a loose grip (Fig. 18)
///
/// A device with a mass holds the node in the middle of the top of the block of `palpate-lab manipulate` and rests on it with a load. A
/// loose grip is a small damping. Each scheme computes the force on the device; `full` is the full model at 1 kHz.
///
/// `outcome` is `settles` when the movement of the device in the last half second is below 0.1 mm from peak to peak or monotonic,
/// `diverges` when the device moved more than the edge of the block from its start, and `oscillates` otherwise.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab grip --json\n  palpate-lab grip --damping 2 --model-rate-hz 50 --out results"
)]
pub(crate) struct Grip {
    /// Mass of the device, kg
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.075)]
    device_mass_kg: f64,
    /// Load that presses the device into the block, N
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 1.0)]
    load_n: f64,
    /// Damping of the grip, N s/m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.3)]
    damping: f64,
    /// Rate of the full model, Hz; its period is cut to whole milliseconds
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 20.0)]
    model_rate_hz: f64,
    /// Length of the run, s
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 4.0)]
    duration_s: f64,
}

#[derive(Serialize)]
pub(crate) struct Report {
    pub(crate) schemes: BTreeMap<&'static str, Outcome>,
}

#[derive(Serialize)]
pub(crate) struct Outcome {
    pub(crate) outcome: &'static str,
    /// Movement from peak to peak in the last half second, m.
    pub(crate) peak_to_peak_m: f64,
}

/// Height of the device over its start at every tick, m, for each scheme.
pub(crate) type Paths = Vec<(&'static str, Vec<f64>)>;

/// Number of ticks at the end that decide the outcome.
const FINAL_TICKS: usize = 500;

impl Grip {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let (paths, report) = self.experiment()?;
        if let Some(folder) = output.folder() {
            let longest = paths.iter().map(|(_, path)| path.len()).max().unwrap_or(0);
            let mut columns = vec![("t_s".to_owned(), (0..longest).map(|i| i as f64 * 1e-3).collect())];
            // A device that has left has no further positions.
            let padded =
                |path: &Vec<f64>| (0..longest).map(|i| path.get(i).copied().unwrap_or(f64::NAN)).collect();
            columns.extend(paths.iter().map(|(name, path)| (format!("{name}_m"), padded(path))));
            write_files(folder, &[("grip.csv", csv(&columns)), ("grip.svg", figure(&paths)?)])?;
        }
        output.print(&report, |out| {
            for (name, _) in &paths {
                let Outcome { outcome, peak_to_peak_m } = &report.schemes[name];
                writeln!(out, "{name:18}{outcome:12}{:.3} mm from peak to peak", 1e3 * peak_to_peak_m)?;
            }
            Ok(())
        })
    }

    pub(crate) fn experiment(&self) -> Result<(Paths, Report), LabError> {
        for (flag, value, max, allowed) in
            [("--load-n", self.load_n, 100.0, "0 to 100"), ("--damping", self.damping, 1e4, "0 to 10000")]
        {
            check(flag, value, (0.0..=max).contains(&value), allowed)?;
        }
        let mass = self.device_mass_kg;
        check("--device-mass-kg", mass, (1e-3..=100.0).contains(&mass), "0.001 to 100")?;
        let rate = self.model_rate_hz;
        check("--model-rate-hz", rate, (1.0..=1000.0).contains(&rate), "1 to 1000")?;
        let duration = self.duration_s;
        check("--duration-s", duration, (1.0..=60.0).contains(&duration), "1 to 60")?;
        let bar = progress::bar(1 + Scheme::ALL.len());
        let mut paths = Vec::new();
        for scheme in [None].into_iter().chain(Scheme::ALL.map(Some)) {
            let name = scheme.map_or("full", Scheme::name);
            bar.set_message(name);
            paths.push((name, self.simulate(scheme)?));
            bar.inc(1);
        }
        let schemes = paths.iter().map(|(name, path)| (*name, self.outcome(path))).collect();
        Ok((paths, Report { schemes }))
    }

    fn ticks(&self) -> usize {
        (self.duration_s * 1e3) as usize
    }

    /// Outcome of a path.
    fn outcome(&self, path: &[f64]) -> Outcome {
        let last = &path[path.len().saturating_sub(FINAL_TICKS)..];
        let (low, high) =
            last.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(*z), h.max(*z)));
        let peak_to_peak_m = high - low;
        // A monotonic movement is creep towards rest.
        let turns = last.windows(3).any(|z| (z[1] - z[0]) * (z[2] - z[1]) < 0.0);
        let outcome = match () {
            () if path.len() < self.ticks() => "diverges",
            () if peak_to_peak_m < 1e-4 || !turns => "settles",
            () => "oscillates",
        };
        Outcome { outcome, peak_to_peak_m }
    }

    /// Height of the device at every tick until it leaves or the time ends, m. `None` is the full model at every tick.
    fn simulate(&self, scheme: Option<Scheme>) -> Result<Vec<f64>, LabError> {
        let block = BlockScene::default();
        let (body, contact, start) = block.build()?;
        let mut model_side = ModelSide::new(body, contact, start)?;
        let mut hand_over = HandOver::new(HandOverSettings {
            capacity: model_side.builder.capacity(),
            ..HandOverSettings::default()
        })?;
        let period = scheme.map_or(1, |_| period_ticks(self.model_rate_hz));
        let dt = 1e-3;
        let (mut position_m, mut velocity_m_per_s) = (start, DVec3::ZERO);
        let mut heights = Vec::with_capacity(self.ticks());
        for i in 0..self.ticks() {
            let sample = Sample {
                sequence: i as u64,
                time_s: i as f64 * dt,
                position_m,
                velocity_m_per_s,
                ..Sample::default()
            };
            let tool = ToolPoint { position_m, velocity_m_per_s };
            let stepped = if i % period == 0 { model_side.step(tool) } else { model_side.follow(tool) };
            match stepped {
                // A tool that moves away fast makes the body diverge.
                Err(LabError::Body(BodyError::Diverged { .. })) => break,
                other => other?,
            }
            let force_n = match scheme {
                None => model_side.contact.displayed_force_n(&model_side.body),
                Some(scheme) => {
                    hand_over.push(sample);
                    if i % period == 0
                        && let SubmitResult::Rejected(error) =
                            hand_over.submit(model_side.build(scheme, tool, i as u64)?)
                    {
                        return Err(ReduceError::from(error).into());
                    }
                    hand_over.render().force_n
                }
            };
            heights.push(position_m.z - start.z);
            if (position_m - start).length() > block.edge_m {
                break;
            }
            // Implicit damping keeps a firm grip stable.
            let per_mass = dt / self.device_mass_kg;
            velocity_m_per_s += per_mass * (force_n - self.load_n * DVec3::Z);
            velocity_m_per_s /= 1.0 + per_mass * self.damping;
            position_m += dt * velocity_m_per_s;
        }
        Ok(heights)
    }
}

/// Full body and the path of the tool since its last step.
struct ModelSide {
    body: Body,
    contact: ToolContact,
    path: Vec<ToolPoint>,
    builder: LocalModelBuilder,
    model: LocalModel,
}

impl ModelSide {
    fn new(body: Body, contact: ToolContact, start: DVec3) -> Result<Self, LabError> {
        let builder = LocalModelBuilder::new(&body, BuilderOptions::default())?;
        let model = LocalModel::empty(builder.capacity());
        Ok(Self { body, contact, path: vec![ToolPoint::at_rest(start)], builder, model })
    }

    fn follow(&mut self, tool: ToolPoint) -> Result<(), LabError> {
        self.path.push(tool);
        Ok(())
    }

    /// Steps the body up to `tool`.
    fn step(&mut self, tool: ToolPoint) -> Result<(), LabError> {
        self.path.push(tool);
        let ticks = self.path.len() - 1;
        self.body.advance(Some((&mut self.contact, &self.path)), ticks, SemiImplicitEuler::default())?;
        self.path = vec![tool];
        Ok(())
    }

    fn build(&mut self, scheme: Scheme, tool: ToolPoint, sequence: u64) -> Result<&LocalModel, LabError> {
        let id = ModelId { body: 1, epoch: 0, sequence };
        self.builder.build(scheme, &self.body, &self.contact, tool, id, &mut self.model)?;
        Ok(&self.model)
    }
}

/// Maximum height, mm, and time, s, in the figure.
const SHOWN: (f64, f64) = (20.0, 1.0);

/// Fig. 18: the first second, as long as the device stays near.
pub(crate) fn figure(paths: &Paths) -> Result<String, LabError> {
    let curves = paths.iter().map(|(name, path)| {
        let points = path.iter().enumerate().map(|(i, z)| (i as f64 * 1e-3, 1e3 * z));
        let curve = Curve::new(*name, points.take_while(|(t, z)| *t <= SHOWN.1 && z.abs() <= SHOWN.0));
        if *name == "full" { curve.broad() } else { curve }
    });
    let panel = Panel {
        title: "A device on a block in a loose grip".into(),
        x: "time, s",
        y: "height over the start, mm",
        scale: Scale::Linear,
        curves: curves.collect(),
    };
    svg(&[panel], 1)
}
