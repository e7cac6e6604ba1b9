//! Section 5.1: a chain of four layers and its two local models.

use crate::specimen::Specimen;
use clap::Args;
use faer::c64;
use palpate_lab::error::{LabError, check, number};
use palpate_lab::figure::{Curve, Panel, Scale, svg};
use palpate_lab::output::{Output, csv, write_files};
use palpate_reduce::SecondOrderSystem;
use serde::Serialize;

/// Section 5.1: a chain of four layers and its two local models (eqs. 6-13, Figs. 12-15)
///
/// A chain of four springs and three masses between the tool and a wall (`full`, eqs. 6-9); its first mass alone, with the others
/// fixed (`near`, eqs. 10-11); and two levels, with the three inner layers and their masses lumped into one (`two_level`,
/// eqs. 12-13). Each is computed from the assembled system and from the closed form of the paper.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab chain --json\n  palpate-lab chain --damping 0.2 --out results"
)]
pub(crate) struct Chain {
    /// Stiffness of each spring, N/m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 100.0)]
    pub(crate) stiffness: f64,
    /// Damping of each damper, N s/m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 1.0)]
    pub(crate) damping: f64,
    /// Each mass, kg
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.01)]
    pub(crate) mass: f64,
}

#[derive(Serialize)]
struct Report {
    models: Models,
}

#[derive(Serialize)]
pub(crate) struct Models {
    pub(crate) full: Model,
    pub(crate) near: Model,
    pub(crate) two_level: Model,
}

#[derive(Serialize)]
pub(crate) struct Model {
    #[serde(flatten)]
    pub(crate) assembled: Figures,
    pub(crate) closed_form: Figures,
    #[serde(skip)]
    pub(crate) system: SecondOrderSystem,
}

#[derive(Serialize)]
pub(crate) struct Figures {
    /// Poles, 1/s, by ascending absolute value.
    pub(crate) poles: Vec<Complex>,
    /// Static stiffness, N/m.
    pub(crate) dc_gain: f64,
    /// k of the high-frequency asymptote k + b s, N/m.
    pub(crate) asymptote_stiffness: f64,
    /// b of the high-frequency asymptote k + b s, N s/m.
    pub(crate) asymptote_damping: f64,
}

#[derive(Clone, Copy, Serialize)]
pub(crate) struct Complex {
    pub(crate) re: f64,
    pub(crate) im: f64,
}

/// Frequency, Hz, and |G| of each model, N/m.
pub(crate) type Response = (f64, [f64; 3]);

impl Chain {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let models = self.models()?;
        if let Some(folder) = output.folder() {
            let responses = self.responses(&models)?;
            write_files(folder, &[("chain.csv", table(&responses)), ("chain.svg", figure(&responses)?)])?;
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

    /// Chain and its two local models.
    pub(crate) fn models(&self) -> Result<Models, LabError> {
        for (flag, value) in
            [("--stiffness", self.stiffness), ("--damping", self.damping), ("--mass", self.mass)]
        {
            check(flag, value, (1e-9..=1e9).contains(&value), "1e-9 to 1e9")?;
        }
        let chain = Specimen {
            dimension: 1,
            cells: 4,
            stiffness_n_per_m: self.stiffness,
            damping_ns_per_m: self.damping,
            mass_kg: self.mass,
        };
        let two = std::f64::consts::SQRT_2;
        Ok(Models {
            full: self.model(chain.system()?, &[2.0 - two, 2.0, 2.0 + two], 1.0, 0.25)?,
            near: self.model(chain.neighbourhood(1)?, &[2.0], 1.0, 0.5)?,
            two_level: self.model(chain.scaled(1)?, &[4.0 / 3.0], 2.0, 0.25)?,
        })
    }

    /// Figures of `system` and its closed form. Each c of `modes` gives the poles of μ m s² + c (b s + k), with masses μ m.
    fn model(&self, system: SecondOrderSystem, modes: &[f64], mu: f64, dc: f64) -> Result<Model, LabError> {
        let (k, b, m) = (self.stiffness, self.damping, self.mass);
        let assembled = Figures {
            poles: sorted(system.to_dense().poles()?),
            dc_gain: system.static_stiffness()?[(0, 0)],
            asymptote_stiffness: system.stiffness_cc[(0, 0)],
            asymptote_damping: system.damping_cc[(0, 0)],
        };
        let poles = modes.iter().flat_map(|c| {
            // The larger pole has no cancellation; the other follows from their product c k/(mu m) (Vieta).
            let half = 0.5 * c * b / (mu * m);
            let product = c * k / (mu * m);
            let fast = -half - c64::new(half * half - product, 0.0).sqrt();
            [fast, product / fast]
        });
        let closed_form = Figures {
            poles: sorted(poles.collect()),
            dc_gain: dc * k,
            asymptote_stiffness: k,
            asymptote_damping: b,
        };
        Ok(Model { assembled, closed_form, system })
    }

    /// Responses from a hundredth of the slowest mode to a hundred times the fastest.
    pub(crate) fn responses(&self, models: &Models) -> Result<Vec<Response>, LabError> {
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
    // Conjugates are equal only up to rounding, which the comparison removes.
    let size = |p: &c64| (p.norm().ln() * 1e11).round();
    let along = |p: &c64| (p.re / p.norm() * 1e9).round();
    poles.sort_by(|a, b| {
        let by_re = || along(a).total_cmp(&along(b));
        size(a).total_cmp(&size(b)).then_with(by_re).then(a.im.total_cmp(&b.im))
    });
    poles.into_iter().map(|p| Complex { re: p.re, im: p.im }).collect()
}

fn table(responses: &[Response]) -> String {
    let of = |i: usize| responses.iter().map(|r| r.1[i]).collect();
    csv(&[
        ("frequency_hz".into(), responses.iter().map(|r| r.0).collect()),
        ("full_n_per_m".into(), of(0)),
        ("near_n_per_m".into(), of(1)),
        ("two_level_n_per_m".into(), of(2)),
    ])
}

/// Fig. 15: responses of the chain and its local models.
pub(crate) fn figure(responses: &[Response]) -> Result<String, LabError> {
    let curves = ["full", "near", "two_level"].into_iter().enumerate();
    let panel = Panel {
        title: "Four layer chain and its local models".into(),
        x: "frequency, Hz",
        y: "force over displacement, N/m",
        scale: Scale::Log,
        curves: curves.map(|(i, name)| Curve::new(name, responses.iter().map(|r| (r.0, r.1[i])))).collect(),
    };
    svg(&[panel], 1)
}
