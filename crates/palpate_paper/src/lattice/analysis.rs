//! Accuracy of a reduced model of a mesh.

use super::options::{Lattice, MAX_DENSE_ORDER, Method};
use crate::specimen::Specimen;
use faer::{Mat, c64};
use palpate_body::Network;
use palpate_lab::error::LabError;
use palpate_lab::progress;
use palpate_reduce::{Balancing, DenseSystem, HInf, SecondOrderSystem, StateSpace};
use serde::Serialize;
use std::f64::consts::TAU;
use std::time::Instant;

/// Maximum order of an error system whose norm is computed by Hamiltonian bisection; larger ones use the maximum on a grid.
const MAX_HAMILTONIAN_ORDER: usize = 1_200;
/// Number of frequencies in the band; a quarter of them for large systems.
const BAND_POINTS: usize = 200;

/// A mesh, its reduced model and the accuracy of that model.
pub(crate) struct Analysis {
    pub(crate) report: Report,
    pub(crate) specimen: Specimen,
    pub(crate) full: SecondOrderSystem,
    /// Node and axis of each unknown that is free in the reduced model.
    pub(crate) moving: Vec<(usize, usize)>,
    /// Displacements of the full system's unknowns for each reduced state; `None` where the states are those of nodes.
    pub(crate) states: Option<Mat<f64>>,
    /// Response of a balanced truncation with as many states, for comparison.
    pub(crate) balanced: Option<Response>,
}

#[derive(Serialize)]
pub(crate) struct Report {
    pub(crate) dimension: usize,
    pub(crate) cells: usize,
    pub(crate) method: Method,
    pub(crate) order: usize,
    pub(crate) reduced_order: usize,
    /// Hankel singular values, N/m; null where the system is too large or too lightly damped for its Gramians.
    pub(crate) hankel_singular_values: Option<Vec<f64>>,
    pub(crate) static_stiffness_n_per_m: Vec<f64>,
    pub(crate) reduced_static_stiffness_n_per_m: Vec<f64>,
    pub(crate) hinf_error_n_per_m: f64,
    /// Method of the norm: `hamiltonian` or `grid`.
    pub(crate) hinf_method: &'static str,
    /// Twice the sum of the omitted Hankel singular values; balanced truncation only.
    pub(crate) error_bound_n_per_m: Option<f64>,
    pub(crate) proper_peak_n_per_m: f64,
    pub(crate) relative_to_proper_peak: f64,
    pub(crate) band_relative_error: f64,
    pub(crate) dc_relative_error: f64,
    /// Off-diagonal response relative to the normal one, dB; null in one dimension.
    pub(crate) off_diagonal_db: Option<f64>,
    pub(crate) build_ms: f64,
    pub(crate) response: Response,
    pub(crate) reduced_response: Response,
}

/// Response along the normal and along the first tangential axis, which is null in one dimension.
#[derive(Serialize)]
pub(crate) struct Response {
    pub(crate) frequency_hz: Vec<f64>,
    pub(crate) normal_abs_n_per_m: Vec<f64>,
    pub(crate) normal_phase_rad: Vec<f64>,
    pub(crate) tangential_abs_n_per_m: Option<Vec<f64>>,
    pub(crate) tangential_phase_rad: Option<Vec<f64>>,
}

/// Reduced model in the form of its method.
enum Model {
    Nodes(SecondOrderSystem),
    Projected(DenseSystem),
    Truncated(StateSpace),
}

impl Model {
    fn order(&self) -> usize {
        match self {
            Self::Nodes(system) => 2 * system.unknowns(),
            Self::Projected(system) => 2 * system.unknowns(),
            Self::Truncated(system) => system.order(),
        }
    }

    fn response(&self, s: &[c64]) -> Result<Vec<Mat<c64>>, LabError> {
        Ok(match self {
            Self::Nodes(system) => system.response(s)?,
            Self::Projected(system) => system.response(s),
            Self::Truncated(system) => system.response(s),
        })
    }

    fn state_space(&self) -> Result<StateSpace, LabError> {
        Ok(match self {
            Self::Nodes(system) => system.state_space()?,
            Self::Projected(system) => system.state_space()?,
            Self::Truncated(system) => system.clone(),
        })
    }
}

impl Lattice {
    /// Reduced model and its accuracy; with `compare` also a balanced truncation with as many states.
    pub(crate) fn analyse(&self, compare: bool) -> Result<Analysis, LabError> {
        self.validate()?;
        let bar = progress::bar(6);
        let step = |message: &'static str| {
            bar.inc(1);
            bar.set_message(message);
        };
        step("assembling the mesh");
        let specimen = self.specimen();
        let full = specimen.system()?;
        let order = 2 * full.unknowns();
        step("balancing the whole system");
        let balance = || -> Result<_, LabError> { Ok(Balancing::new(full.state_space()?)?) };
        let (balancing, balancing_ms) = timed(|| (order <= MAX_DENSE_ORDER).then(balance).transpose());
        // With very light damping there are no Gramians; only the balanced method needs them.
        let balancing = match balancing {
            Err(error) if self.method == Method::Balanced => return Err(error),
            balancing => balancing.unwrap_or(None),
        };
        step("reducing");
        let network = specimen.network()?;
        let (reduced, mut build_ms) = timed(|| self.reduce(&specimen, &network, &full, balancing.as_ref()));
        let (model, states) = reduced?;
        let mut error_bound_n_per_m = None;
        if let (Method::Balanced, Some(balancing)) = (self.method, &balancing) {
            build_ms += balancing_ms;
            error_bound_n_per_m = Some(balancing.error_bound(model.order()));
        }
        step("computing responses");
        let frequency_hz = self.frequencies();
        let s: Vec<c64> = frequency_hz.iter().map(|hz| c64::new(0.0, TAU * hz)).collect();
        let (exact, reduced) = (full.response(&s)?, model.response(&s)?);
        let off_diagonal_db = (self.dimension > 1).then(|| {
            let ratio = exact.iter().chain(&reduced).map(off_diagonal).fold(f64::MIN_POSITIVE, f64::max);
            20.0 * ratio.log10()
        });
        step("computing the error in the band");
        let band = self.band_frequencies();
        let band_relative_error = relative_errors(&full.response(&band)?, &model.response(&band)?);
        let (gain, reduced_gain) =
            (full.static_stiffness()?, real(&model.response(&[c64::new(0.0, 0.0)])?[0]));
        let complex = |m: &Mat<f64>| Mat::from_fn(m.nrows(), m.ncols(), |i, j| c64::new(m[(i, j)], 0.0));
        let dc_relative_error = norm(&complex(&(&gain - &reduced_gain))) / norm(&complex(&gain));
        step("computing the norm of the error");
        let worst = self.worst(&full, &model, balancing.as_ref())?;
        let compare = compare && !matches!(self.method, Method::Balanced | Method::Full);
        let balanced = match &balancing {
            Some(balancing) if compare => balancing.truncate(model.order().min(balancing.rank())).ok(),
            _ => None,
        };
        let moving = match &model {
            Model::Nodes(system) => system.place.clone(),
            _ => full.place.clone(),
        };
        let respond = |responses: &[Mat<c64>]| Response::new(&frequency_hz, responses, self.dimension);
        let report = Report {
            dimension: self.dimension,
            cells: self.cells,
            method: self.method,
            order,
            reduced_order: model.order(),
            hankel_singular_values: balancing.as_ref().map(|b| b.hankel_singular_values().to_vec()),
            static_stiffness_n_per_m: diagonal(&gain),
            reduced_static_stiffness_n_per_m: diagonal(&reduced_gain),
            hinf_error_n_per_m: worst.error,
            hinf_method: worst.method,
            error_bound_n_per_m,
            proper_peak_n_per_m: worst.peak,
            relative_to_proper_peak: worst.error / worst.peak,
            band_relative_error,
            dc_relative_error,
            off_diagonal_db,
            build_ms,
            response: respond(&exact),
            reduced_response: respond(&reduced),
        };
        let balanced = balanced.map(|truncated| respond(&truncated.system.response(&s)));
        Ok(Analysis { report, specimen, full, moving, states, balanced })
    }

    /// Reduced model and the displacements of its states.
    fn reduce(
        &self,
        specimen: &Specimen,
        network: &Network,
        full: &SecondOrderSystem,
        balancing: Option<&Balancing>,
    ) -> Result<(Model, Option<Mat<f64>>), LabError> {
        let projected = |v: Mat<f64>| -> Result<_, LabError> {
            Ok((Model::Projected(full.project(v.as_ref())?), Some(v)))
        };
        Ok(match (self.method, balancing) {
            (Method::Balanced, Some(balancing)) => {
                // States beyond the rank are rounding.
                let truncated = balancing.truncate(self.order.min(balancing.rank()))?;
                let positions = truncated.states.subrows(0, full.unknowns()).to_owned();
                (Model::Truncated(truncated.system), Some(positions))
            }
            // Without a balancing the balanced method has returned its error before.
            (Method::Full | Method::Balanced, _) => (Model::Nodes(full.clone()), None),
            (Method::Neighbourhood, _) => (Model::Nodes(full.neighbourhood(network, self.rings)?), None),
            (Method::Scaled, _) => (Model::Nodes(specimen.scaled(self.rings)?), None),
            (Method::Krylov, _) => {
                let shifts: Vec<f64> = self.shifts_hz.iter().map(|hz| TAU * hz).collect();
                projected(full.krylov_basis(&shifts)?)?
            }
            (Method::Modal, _) => projected(full.modal_basis(self.order / 2)?)?,
        })
    }

    /// Maximum error and maximum gain over all frequencies.
    fn worst(
        &self,
        full: &SecondOrderSystem,
        model: &Model,
        balancing: Option<&Balancing>,
    ) -> Result<Worst, LabError> {
        let whole = balancing.filter(|b| b.system().order() + model.order() <= MAX_HAMILTONIAN_ORDER);
        let Some(whole) = whole.map(Balancing::system) else {
            return self.worst_on_grid(full, model);
        };
        let norms = || -> Result<Worst, LabError> {
            let peak = HInf::new(whole, 1e-6)?.norm;
            let error = match self.method {
                // The systems are equal; the norm of their difference would be rounding.
                Method::Full => 0.0,
                _ => HInf::new(&whole.minus(&model.state_space()?)?, 1e-6)?.norm,
            };
            Ok(Worst { error, peak, method: "hamiltonian" })
        };
        // Ill-conditioned eigenvalues leave a grid as the fallback.
        norms().or_else(|_| self.worst_on_grid(full, model))
    }

    /// Lower bounds of both: the maximum on a grid, refined around it. The grid contains the natural frequencies of a mesh that is small
    /// enough to compute them.
    fn worst_on_grid(&self, full: &SecondOrderSystem, model: &Model) -> Result<Worst, LabError> {
        let proper = |g: &Mat<c64>, s: c64| {
            Mat::from_fn(g.nrows(), g.ncols(), |i, j| g[(i, j)] - s * full.damping_cc[(i, j)])
        };
        // Error and gain at each of `omegas`, 1/s.
        let evaluate = |omegas: &[f64]| -> Result<Vec<[f64; 2]>, LabError> {
            let s: Vec<c64> = omegas.iter().map(|&omega| c64::new(0.0, omega)).collect();
            let both = full.response(&s)?.into_iter().zip(model.response(&s)?);
            Ok(both.zip(&s).map(|((g, r), &s)| [norm(&(&g - r)), norm(&proper(&g, s))]).collect())
        };
        let fastest = 10.0 * (self.stiffness / self.mass).sqrt();
        let mut omegas: Vec<f64> =
            (0..=120).map(|i| fastest * 10f64.powf(f64::from(i) / 24.0 - 4.0)).collect();
        omegas.push(0.0);
        if 2 * full.unknowns() <= MAX_DENSE_ORDER {
            omegas.extend(full.natural_frequencies_rad_per_s()?);
        }
        omegas.sort_by(f64::total_cmp);
        let found = evaluate(&omegas)?;
        let mut worst = [0.0; 2];
        for (which, worst) in worst.iter_mut().enumerate() {
            let at =
                (0..found.len()).max_by(|&a, &b| found[a][which].total_cmp(&found[b][which])).unwrap_or(0);
            *worst = found[at][which];
            let (mut low, mut high) = (omegas[at.saturating_sub(1)], omegas[(at + 1).min(omegas.len() - 1)]);
            for _ in 0..4 {
                let step = (high - low) / 8.0;
                let inner: Vec<f64> = (0..=8).map(|i| low + step * f64::from(i)).collect();
                let found = evaluate(&inner)?;
                let at = (0..=8).max_by(|&a, &b| found[a][which].total_cmp(&found[b][which])).unwrap_or(0);
                *worst = worst.max(found[at][which]);
                (low, high) = (inner[at.saturating_sub(1)], inner[(at + 1).min(8)]);
            }
        }
        let [error, peak] = worst;
        Ok(Worst { error, peak, method: "grid" })
    }

    /// Frequencies from a tenth of the band's low end to its high end, Hz: 1, 2 and 5 of every decade, and 20 more per decade.
    fn frequencies(&self) -> Vec<f64> {
        let (low, high) = (0.1 * self.band().0, self.band().1);
        let round = |decade: i32| {
            // Positive powers of ten are exact; dividing by them rounds once.
            let ten = 10f64.powi(decade.abs());
            [1.0, 2.0, 5.0].map(|n| if decade < 0 { n / ten } else { n * ten })
        };
        let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let mut all: Vec<f64> = decades.flat_map(round).filter(|hz| (low..=high).contains(hz)).collect();
        let points = (20.0 * (high / low).log10()).ceil();
        for i in 0..=points as usize {
            let hz = low * (high / low).powf(i as f64 / points);
            if !all.iter().any(|other| (hz / other - 1.0).abs() < 1e-6) {
                all.push(hz);
            }
        }
        all.sort_by(f64::total_cmp);
        all
    }

    fn band_frequencies(&self) -> Vec<c64> {
        let (low, high) = self.band();
        let points = if self.full_order() <= MAX_DENSE_ORDER { BAND_POINTS } else { BAND_POINTS / 4 };
        let at = |i: usize| low * (high / low).powf(i as f64 / (points - 1) as f64);
        (0..points).map(|i| c64::new(0.0, TAU * at(i))).collect()
    }
}

/// Maximum error and gain over frequency, N/m.
struct Worst {
    error: f64,
    peak: f64,
    method: &'static str,
}

impl Response {
    fn new(frequency_hz: &[f64], responses: &[Mat<c64>], dimension: usize) -> Self {
        let normal = dimension - 1;
        let along = |axis: usize, pick: fn(c64) -> f64| -> Vec<f64> {
            responses.iter().map(|g| pick(g[(axis, axis)])).collect()
        };
        let tangential = |pick| (dimension > 1).then(|| along(0, pick));
        Self {
            frequency_hz: frequency_hz.to_vec(),
            normal_abs_n_per_m: along(normal, c64::norm),
            normal_phase_rad: along(normal, c64::arg),
            tangential_abs_n_per_m: tangential(c64::norm),
            tangential_phase_rad: tangential(c64::arg),
        }
    }
}

/// Result of `work` and its time, ms.
#[expect(clippy::disallowed_methods, reason = "the time of a reduction is a result")]
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64() * 1e3)
}

fn real(m: &Mat<c64>) -> Mat<f64> {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)].re)
}

fn diagonal(m: &Mat<f64>) -> Vec<f64> {
    (0..m.nrows()).map(|i| m[(i, i)]).collect()
}

/// Largest singular value; infinite where the decomposition fails.
fn norm(m: &Mat<c64>) -> f64 {
    m.singular_values().ok().and_then(|s| s.first().copied()).unwrap_or(f64::INFINITY)
}

/// Maximum of ‖full − reduced‖ / ‖full‖ over all frequencies.
fn relative_errors(full: &[Mat<c64>], reduced: &[Mat<c64>]) -> f64 {
    full.iter().zip(reduced).map(|(f, r)| norm(&(f - r)) / norm(f)).fold(0.0, f64::max)
}

/// Maximum off-diagonal entry over the last diagonal entry, the normal response.
fn off_diagonal(g: &Mat<c64>) -> f64 {
    let last = g.nrows() - 1;
    let off = (0..=last).flat_map(|i| (0..=last).map(move |j| (i, j))).filter(|(i, j)| i != j);
    off.map(|at| g[at].norm()).fold(0.0, f64::max) / g[(last, last)].norm()
}
