//! Section 5.1: a chain of four layers and the two local models that stand for it.

use crate::error::{LabError, check};
use crate::figure::{Curve, Frame, svg};
use crate::output::{Output, write_file};
use clap::Args;
use faer::c64;
use glam::DVec3;
use palpate_body::{Body, BodyError, Link, Network, Surface};
use palpate_laws::Spring;
use palpate_reduce::{SecondOrderSystem, StateSpace};
use serde::Serialize;
use std::fmt::Write;

/// A chain of four springs and three masses between the tool and a wall (`full`, eqs. 6-9); its first mass alone, the
/// others standing (`near`, eqs. 10-11); and two levels, the three inner layers joined to one and the masses to one
/// (`two_level`, eqs. 12-13). Each from the assembled system, with the paper's closed form beside it.
#[derive(Clone, Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  palpate-lab chain --json\n  palpate-lab chain --damping 0.2 --out results"
)]
pub(crate) struct Chain {
    /// Stiffness of each spring, N/m
    #[arg(long, default_value_t = 100.0)]
    stiffness: f64,
    /// Damping of each damper, N s/m
    #[arg(long, default_value_t = 1.0)]
    damping: f64,
    /// Each mass, kg
    #[arg(long, default_value_t = 0.01)]
    mass: f64,
}

#[derive(Serialize)]
struct Report {
    models: Models,
}

#[derive(Serialize)]
struct Models {
    full: Model,
    near: Model,
    two_level: Model,
}

#[derive(Serialize)]
struct Model {
    #[serde(flatten)]
    assembled: Figures,
    closed_form: Figures,
    #[serde(skip)]
    system: SecondOrderSystem,
}

#[derive(Serialize)]
struct Figures {
    /// 1/s, by ascending absolute value.
    poles: Vec<Complex>,
    /// N/m.
    dc_gain: f64,
    /// k of the asymptote k + b s, N/m.
    asymptote_stiffness: f64,
    /// b of the asymptote, N s/m.
    asymptote_damping: f64,
}

#[derive(Clone, Copy, Serialize)]
struct Complex {
    re: f64,
    im: f64,
}

/// A layer: the stiffness and damping of its spring as multiples of k and b, and the mass behind it as one of m.
type Layer = (f64, f64);

impl Chain {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        for (flag, value) in
            [("--stiffness", self.stiffness), ("--damping", self.damping), ("--mass", self.mass)]
        {
            check(flag, value, value > 0.0, "finite and above 0")?;
        }
        let two = std::f64::consts::SQRT_2;
        let modes = [2.0 - two, 2.0, 2.0 + two];
        let models = Models {
            full: self.model(&[(1.0, 1.0), (1.0, 1.0), (1.0, 1.0), (1.0, 0.0)], &modes, 1.0, 0.25)?,
            near: self.model(&[(1.0, 1.0), (1.0, 0.0)], &[2.0], 1.0, 0.5)?,
            two_level: self.model(&[(1.0, 2.0), (1.0 / 3.0, 0.0)], &[4.0 / 3.0], 2.0, 0.25)?,
        };
        if let Some(folder) = output.folder() {
            let responses = self.responses(&models)?;
            write_file(folder, "chain.csv", &csv(&responses))?;
            write_file(folder, "chain.svg", &figure(&responses)?)?;
        }
        let report = Report { models };
        output.print(&report, |out| {
            let Models { full, near, two_level } = &report.models;
            for (name, model) in [("full", full), ("near", near), ("two_level", two_level)] {
                writeln!(out, "{name}")?;
                for (origin, figures) in
                    [("assembled", &model.assembled), ("closed form", &model.closed_form)]
                {
                    let Figures { poles, dc_gain, asymptote_stiffness: k, asymptote_damping: b } = figures;
                    writeln!(
                        out,
                        "  {origin:12} DC gain {dc_gain:.6} N/m, asymptote {k:.6} + {b:.6} s, poles, 1/s:"
                    )?;
                    for Complex { re, im } in poles {
                        writeln!(out, "    {re:+.6} {im:+.6}i")?;
                    }
                }
            }
            Ok(())
        })
    }

    /// The assembled chain of `layers`, and its closed form: each of `modes` c gives the poles of
    /// μ m s² + c (b s + k), with masses μ m.
    fn model(&self, layers: &[Layer], modes: &[f64], mu: f64, dc: f64) -> Result<Model, LabError> {
        let (k, b, m) = (self.stiffness, self.damping, self.mass);
        let system = self.assemble(layers)?;
        let state_space = StateSpace::exact(&system);
        let assembled = Figures {
            poles: sorted(state_space.poles()?),
            dc_gain: state_space.dc_gain()?[(0, 0)],
            asymptote_stiffness: system.stiffness_cc[(0, 0)],
            asymptote_damping: system.damping_cc[(0, 0)],
        };
        let poles = modes.iter().flat_map(|c| {
            let (cb, root) =
                (c64::new(c * b, 0.0), c64::new((c * b).powi(2) - 4.0 * mu * m * c * k, 0.0).sqrt());
            [(root - cb) / (2.0 * mu * m), (-root - cb) / (2.0 * mu * m)]
        });
        let closed_form = Figures {
            poles: sorted(poles.collect()),
            dc_gain: dc * k,
            asymptote_stiffness: k,
            asymptote_damping: b,
        };
        Ok(Model { assembled, closed_form, system })
    }

    fn assemble(&self, layers: &[Layer]) -> Result<SecondOrderSystem, LabError> {
        let nodes = layers.len() + 1;
        let rest = (0..nodes).map(|i| DVec3::X * i as f64).collect();
        let mut links = Vec::with_capacity(layers.len());
        // The driven node and the wall have masses too, which nothing feels.
        let mut masses = vec![self.mass; nodes];
        for (i, &(share, mass)) in layers.iter().enumerate() {
            let spring = Spring::linear(share * self.stiffness, 1.0, share * self.damping)
                .map_err(|source| BodyError::Law { link: i, source })?;
            links.push(Link { a: i, b: i + 1, spring });
            if mass > 0.0 {
                masses[i + 1] = mass * self.mass;
            }
        }
        let fixed = (0..nodes).map(|i| i + 1 == nodes).collect();
        let body = Body::new(Network::new(rest, masses, fixed, links)?, Surface::default())?;
        Ok(SecondOrderSystem::of_body(&body, 0, 1)?)
    }

    /// (Hz, |G| of each model) from a hundredth of the slowest mode to a hundred times the fastest.
    fn responses(&self, models: &Models) -> Result<Vec<(f64, [f64; 3])>, LabError> {
        let natural_hz = (self.stiffness / self.mass).sqrt() / std::f64::consts::TAU;
        let hz: Vec<f64> = (0..=400).map(|i| natural_hz * 10f64.powf(f64::from(i) / 100.0 - 2.0)).collect();
        let s: Vec<c64> = hz.iter().map(|f| c64::new(0.0, std::f64::consts::TAU * f)).collect();
        let gains = |model: &Model| -> Result<Vec<f64>, LabError> {
            Ok(model.system.response(&s)?.iter().map(|g| g[(0, 0)].norm()).collect())
        };
        let (full, near, two_level) = (gains(&models.full)?, gains(&models.near)?, gains(&models.two_level)?);
        Ok(hz.iter().enumerate().map(|(i, &f)| (f, [full[i], near[i], two_level[i]])).collect())
    }
}

fn sorted(mut poles: Vec<c64>) -> Vec<Complex> {
    // Conjugates have equal absolute values up to rounding, so that is rounded before it is compared.
    let size = |p: &c64| (p.norm().ln() * 1e6).round();
    poles.sort_by(|a, b| size(a).total_cmp(&size(b)).then(a.re.total_cmp(&b.re)).then(a.im.total_cmp(&b.im)));
    poles.into_iter().map(|p| Complex { re: p.re, im: p.im }).collect()
}

fn csv(responses: &[(f64, [f64; 3])]) -> String {
    let mut text = String::from("frequency_hz,full_n_per_m,near_n_per_m,two_level_n_per_m\n");
    for (hz, [full, near, two_level]) in responses {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{hz},{full},{near},{two_level}");
    }
    text
}

/// Fig. 15.
fn figure(responses: &[(f64, [f64; 3])]) -> Result<String, LabError> {
    let curves = ["full", "near", "two_level"].into_iter().enumerate().map(|(i, name)| Curve {
        name,
        points: responses.iter().map(|(hz, gains)| (*hz, gains[i])).collect(),
    });
    let title = "Four layer chain and its local models";
    let frame = Frame { title, x: "frequency, Hz", y: "force over displacement, N/m", log: true };
    svg(&frame, &curves.collect::<Vec<_>>())
}
