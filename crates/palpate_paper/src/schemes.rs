//! Section 2: force between model steps on a nonlinear spring in one dimension.

use clap::Args;
use glam::DVec3;
use palpate_lab::error::{LabError, check, number};
use palpate_lab::figure::{Curve, Panel, Scale, svg};
use palpate_lab::output::{Output, csv, write_files};
use palpate_laws::{SkinLaw, Tension};
use palpate_local::LowPass;
use serde::Serialize;

/// Section 2: four schemes of force on a nonlinear spring in one dimension (Fig. 2)
///
/// A hand moves a spring of skin (eq. 5) up and down, x(t) = offset + amplitude · sin(2π · frequency · t). Position and
/// force are quantised by rounding. `full` is the spring at the haptic rate; `hold`, `low_pass` and `tangent` evaluate it
/// at the model rate only (eqs. 1-4).
///
/// The reference is the spring without quantisation. The lag is the shift, up to 0.2 s, with the highest correlation; the SNR is taken
/// after removing the lag, in decibels. The paper's four figures (89, 43, 53, 72 "dB") equal ten times the natural logarithm of the
/// power ratio, which the paper probably used; this is an inference.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab schemes --json\n  palpate-lab schemes --model-rate-hz 20 --out results"
)]
pub(crate) struct Schemes {
    /// Mean indentation, mm
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 10.0)]
    offset_mm: f64,
    /// Amplitude of the movement, mm
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 6.5)]
    amplitude_mm: f64,
    /// Frequency of the movement, Hz
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 1.2)]
    frequency_hz: f64,
    /// Length of the movement, s
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 10.0)]
    duration_s: f64,
    /// Rate at which the spring is evaluated, Hz; its period is rounded to whole haptic samples
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 10.0)]
    pub(crate) model_rate_hz: f64,
    /// Rate of the force, Hz
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 1000.0)]
    pub(crate) haptic_rate_hz: f64,
    /// Cut-off of the low-pass, Hz
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 10.0)]
    pub(crate) cutoff_hz: f64,
    /// Step of the position's quantisation, mm
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.3)]
    pub(crate) position_step_mm: f64,
    /// Step of the force's quantisation, N
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.07)]
    pub(crate) force_step_n: f64,
}

#[derive(Serialize)]
struct Report {
    /// Effective model rate, Hz; its period is whole haptic samples.
    model_rate_hz: f64,
    schemes: PerScheme<Quality>,
}

/// A value for each scheme.
#[derive(Serialize)]
pub(crate) struct PerScheme<T> {
    pub(crate) full: T,
    pub(crate) hold: T,
    pub(crate) low_pass: T,
    pub(crate) tangent: T,
}

/// Quality of a scheme.
#[derive(Clone, Copy, Serialize)]
pub(crate) struct Quality {
    pub(crate) lag_ms: f64,
    pub(crate) snr_db: f64,
    pub(crate) ten_ln_power_ratio: f64,
}

/// Figures of the paper: scheme, lag in ms, "SNR".
const PAPER: [(&str, &str, f64); 4] =
    [("full", "<1", 89.0), ("hold", "49", 43.0), ("low_pass", "65", 53.0), ("tangent", "<1", 72.0)];

/// Maximum lag, s.
const MAX_LAG_S: f64 = 0.2;

impl Schemes {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let (run, schemes) = self.experiment()?;
        if let Some(folder) = output.folder() {
            let rate = self.haptic_rate_hz;
            write_files(folder, &[("schemes.csv", run.csv(rate)), ("schemes.svg", run.figure(rate)?)])?;
        }
        let rows = [schemes.full, schemes.hold, schemes.low_pass, schemes.tangent];
        output.print(&Report { model_rate_hz: self.haptic_rate_hz / self.stride() as f64, schemes }, |out| {
            writeln!(
                out,
                "{:10}{:>10}{:>10}{:>18}{:>16}{:>12}",
                "scheme", "lag, ms", "SNR, dB", "10 ln(ratio)", "paper's lag", "paper's SNR"
            )?;
            for (row, (name, lag, snr)) in rows.iter().zip(PAPER) {
                let Quality { lag_ms, snr_db, ten_ln_power_ratio } = row;
                writeln!(
                    out,
                    "{name:10}{lag_ms:>10}{snr_db:>10.2}{ten_ln_power_ratio:>18.2}{lag:>16}{snr:>12}"
                )?;
            }
            writeln!(out, "\nThe paper's SNRs equal 10 ln of the power ratio, not decibels: an inference.")
        })
    }

    /// Forces and quality of each scheme.
    pub(crate) fn experiment(&self) -> Result<(Run, PerScheme<Quality>), LabError> {
        self.validate()?;
        let run = self.simulate()?;
        let max_lag = (MAX_LAG_S * self.haptic_rate_hz).round() as usize;
        let quality_of = |forces: &Vec<f64>| quality(&run.ideal, forces, max_lag, self.haptic_rate_hz);
        let PerScheme { full, hold, low_pass, tangent } = &run.schemes;
        let schemes = PerScheme {
            full: quality_of(full),
            hold: quality_of(hold),
            low_pass: quality_of(low_pass),
            tangent: quality_of(tangent),
        };
        Ok((run, schemes))
    }

    fn validate(&self) -> Result<(), LabError> {
        let positive = "finite and above 0";
        for (flag, value) in [("--model-rate-hz", self.model_rate_hz), ("--cutoff-hz", self.cutoff_hz)] {
            check(flag, value, value > 0.0, positive)?;
        }
        let limit = SkinLaw::THIGH.limit_m() * 1e3;
        for (flag, value, min) in [
            ("--position-step-mm", self.position_step_mm, 1e-6),
            ("--force-step-n", self.force_step_n, 1e-6),
            ("--amplitude-mm", self.amplitude_mm, 1e-3),
        ] {
            let allowed = format!("{min} to {limit:.2}");
            check(flag, value, (min..=limit).contains(&value), allowed)?;
        }
        let rate = self.haptic_rate_hz;
        check("--haptic-rate-hz", rate, (50.0..=100_000.0).contains(&rate), "50 to 100000")?;
        let model = self.model_rate_hz;
        check("--model-rate-hz", model, model <= rate, format!("at most the haptic rate, {rate}"))?;
        let duration = self.duration_s;
        check("--duration-s", duration, (1.0..=600.0).contains(&duration), "1 to 600")?;
        let (frequency, max) = (self.frequency_hz, 0.5 * rate);
        let allowed = format!("above 0 and at most half the haptic rate, {max}");
        check("--frequency-hz", frequency, frequency > 0.0 && frequency <= max, allowed)?;
        let (offset, max_offset) = (self.offset_mm, limit - self.amplitude_mm - self.position_step_mm);
        let allowed = format!(
            "such that offset + amplitude + step are below {limit:.2} mm, where the force of the skin is infinite"
        );
        check(
            "--offset-mm",
            offset,
            offset < max_offset && offset >= 0.0,
            format!("at least 0 and {allowed}"),
        )
    }

    /// Number of haptic samples in a model period.
    fn stride(&self) -> usize {
        ((self.haptic_rate_hz / self.model_rate_hz).round_ties_even() as usize).max(1)
    }

    fn simulate(&self) -> Result<Run, LabError> {
        let fs = self.haptic_rate_hz;
        let samples = (self.duration_s * fs) as usize;
        let stride = self.stride();
        let skin = |x_mm: f64| -> Result<Tension, LabError> {
            let limit = SkinLaw::THIGH.limit_m() * 1e3;
            let out_of_range = || LabError::Parameter {
                flag: "--offset-mm",
                value: x_mm,
                allowed: format!("such that the indentation is below {limit:.2} mm"),
            };
            SkinLaw::THIGH.at(x_mm * 1e-3).ok_or_else(out_of_range)
        };
        let quantise = |value: f64, step: f64| (value / step).round_ties_even() * step;
        let mut run = Run::default();
        let mut filter = LowPass::new(self.cutoff_hz, 1.0 / fs)?;
        let mut model = (0.0, Tension { force_n: 0.0, stiffness_n_per_m: 0.0 });
        for n in 0..samples {
            let t = n as f64 / fs;
            let x =
                self.offset_mm + self.amplitude_mm * (std::f64::consts::TAU * self.frequency_hz * t).sin();
            let measured = quantise(x, self.position_step_mm);
            if n % stride == 0 {
                model = (measured, skin(measured)?);
            }
            let (at, Tension { force_n, stiffness_n_per_m }) = model;
            if n == 0 {
                filter.reset(DVec3::X * force_n);
            }
            let tangent = force_n + stiffness_n_per_m * 1e-3 * (measured - at);
            let low_pass = filter.advance(DVec3::X * force_n, 1).x;
            run.ideal.push(skin(x)?.force_n);
            let shown = |force: f64| quantise(force, self.force_step_n);
            run.schemes.full.push(shown(skin(measured)?.force_n));
            run.schemes.hold.push(shown(force_n));
            run.schemes.low_pass.push(shown(low_pass));
            run.schemes.tangent.push(shown(tangent));
        }
        Ok(run)
    }
}

/// Forces at every haptic sample, N.
#[derive(Default)]
pub(crate) struct Run {
    ideal: Vec<f64>,
    schemes: PerScheme<Vec<f64>>,
}

impl<T: Default> Default for PerScheme<T> {
    fn default() -> Self {
        Self { full: T::default(), hold: T::default(), low_pass: T::default(), tangent: T::default() }
    }
}

impl Run {
    fn csv(&self, rate_hz: f64) -> String {
        let PerScheme { full, hold, low_pass, tangent } = &self.schemes;
        let t = (0..self.ideal.len()).map(|n| n as f64 / rate_hz).collect();
        let forces = [
            ("ideal_n", &self.ideal),
            ("full_n", full),
            ("hold_n", hold),
            ("low_pass_n", low_pass),
            ("tangent_n", tangent),
        ];
        let mut columns = vec![("t_s".to_owned(), t)];
        columns.extend(forces.map(|(name, forces)| (name.to_owned(), forces.clone())));
        csv(&columns)
    }

    /// Fig. 2: the first two seconds.
    pub(crate) fn figure(&self, rate_hz: f64) -> Result<String, LabError> {
        let shown = |forces: &Vec<f64>| -> Vec<(f64, f64)> {
            forces
                .iter()
                .enumerate()
                .map(|(n, &f)| (n as f64 / rate_hz, f))
                .take_while(|(t, _)| *t < 2.0)
                .collect()
        };
        let PerScheme { full, hold, low_pass, tangent } = &self.schemes;
        let curves = [("full", full), ("hold", hold), ("low_pass", low_pass), ("tangent", tangent)];
        let panel = Panel {
            title: "Interaction with a nonlinear spring in one dimension".into(),
            x: "time, s",
            y: "force, N",
            scale: Scale::Linear,
            curves: curves.map(|(name, forces)| Curve::new(name, shown(forces))).to_vec(),
        };
        svg(&[panel], 1)
    }
}

fn quality(ideal: &[f64], forces: &[f64], max_lag: usize, rate_hz: f64) -> Quality {
    let middle = &ideal[max_lag..ideal.len() - max_lag];
    let shifted = |lag: usize| &forces[max_lag + lag..max_lag + lag + middle.len()];
    // Of equal correlations, the shortest lag counts.
    let mut best = (0, f64::NEG_INFINITY);
    for lag in 0..max_lag {
        let r = correlation(middle, shifted(lag));
        if r > best.1 {
            best = (lag, r);
        }
    }
    let lag = best.0;
    let pairs = || ideal.iter().zip(&forces[lag..]);
    let power: f64 = pairs().map(|(i, _)| i * i).sum();
    let error: f64 = pairs().map(|(i, f)| (f - i) * (f - i)).sum();
    let ratio = power / error;
    Quality {
        lag_ms: lag as f64 * 1e3 / rate_hz,
        snr_db: 10.0 * ratio.log10(),
        ten_ln_power_ratio: 10.0 * ratio.ln(),
    }
}

/// Pearson correlation coefficient; zero where one of the series is constant.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let (mean_a, mean_b) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        ab += a * b;
        aa += a * a;
        bb += b * b;
    }
    let scale = (aa * bb).sqrt();
    if scale > 0.0 { ab / scale } else { 0.0 }
}
