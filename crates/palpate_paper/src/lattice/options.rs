//! Options of `palpate-lab lattice` and their allowed ranges.

use crate::specimen::Specimen;
use clap::{Args, ValueEnum};
use palpate_lab::error::{LabError, check, number, whole};
use serde::Serialize;

/// Sections 4 and 5: a mesh and its reduced models (Figs. 4-11)
///
/// A mesh of CELLS cells along each of DIMENSION dimensions, fixed at all sides except its top, is driven at the node in the middle of
/// its top. It is a linear system from displacement to force, which a reduced model approximates.
///
/// `hinf_error_n_per_m` is the H-infinity norm of the error: the maximum over all frequencies of the largest singular value of the
/// response minus the reduced response. With more than 1200 states of both together it is the maximum over a grid of frequencies, a
/// lower bound, and `hinf_method` is `grid` instead of `hamiltonian`. `relative_to_proper_peak` divides it by the same norm of the
/// proper part of the response, without the damper term E s. `band_relative_error` is the maximum over the band of that singular
/// value divided by that of the response at the same frequency, and `dc_relative_error` the same ratio at zero. `off_diagonal_db`
/// compares the maximum force along one axis from displacement along another with the normal response, for the worse of the full
/// system and the reduced model. `response` is that of the full system, `reduced_response` that of the reduced model. Lists over axes
/// have the tangential axes first.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab lattice --json\n  palpate-lab lattice --method neighbourhood --rings 2 --out \
                  results\n  palpate-lab lattice --dimension 3 --cells 6 --method krylov --shifts-hz 5,20,80"
)]
pub(crate) struct Lattice {
    /// Dimension of the mesh: 1, 2 or 3
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 2)]
    pub(crate) dimension: usize,
    /// Cells along each dimension
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 12)]
    pub(crate) cells: usize,
    /// Stiffness of each spring, N/m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 200.0)]
    pub(crate) stiffness: f64,
    /// Damping of each damper, N s/m
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 2.1213203435596424)]
    pub(crate) damping: f64,
    /// Mass of each node, kg
    #[arg(value_parser = number, allow_hyphen_values = true, long, default_value_t = 0.01)]
    pub(crate) mass: f64,
    /// Method of reduction
    #[arg(long, value_enum, default_value_t = Method::Balanced)]
    pub(crate) method: Method,
    /// States of the reduced model (methods balanced and modal; a mode is two states, and a balanced model has at most as many states
    /// as the rank of the Gramians)
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 10)]
    pub(crate) order: usize,
    /// Rings of free nodes (methods neighbourhood and scaled)
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 1)]
    pub(crate) rings: usize,
    /// Real shifts over 2 pi, Hz (method krylov)
    #[arg(
        value_parser = number, allow_hyphen_values = true,
        long,
        value_delimiter = ',',
        value_name = "HZ,...",
        default_value = "5,20,80"
    )]
    pub(crate) shifts_hz: Vec<f64>,
    /// Band of the relative error, Hz
    #[arg(
        value_parser = number, allow_hyphen_values = true,
        long,
        value_delimiter = ',',
        value_name = "LOW,HIGH",
        default_value = "10,1000"
    )]
    pub(crate) band_hz: Vec<f64>,
}

/// Method of reduction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Method {
    /// The whole system
    Full,
    /// Balanced truncation to `--order` states (section 4)
    Balanced,
    /// Nodes within `--rings` of the tool are free, all others fixed (Fig. 8)
    Neighbourhood,
    /// Free nodes within `--rings`, with outer springs and masses scaled to represent the rest (Fig. 10)
    Scaled,
    /// Static response, high-frequency end and response at `--shifts-hz` (rational Krylov)
    Krylov,
    /// The slowest modes of vibration
    Modal,
}

/// Maximum order in 1, 2 and 3 dimensions: about a minute.
const MAX_ORDER: [usize; 3] = [60_000, 40_000, 9_000];
/// Maximum order of methods with dense matrices: balanced and modal truncation.
pub(super) const MAX_DENSE_ORDER: usize = 2_500;

impl Lattice {
    /// Specimen of the options.
    pub(crate) fn specimen(&self) -> Specimen {
        Specimen {
            dimension: self.dimension,
            cells: self.cells,
            stiffness_n_per_m: self.stiffness,
            damping_ns_per_m: self.damping,
            mass_kg: self.mass,
        }
    }

    /// Low and high end of the band, Hz.
    pub(crate) fn band(&self) -> (f64, f64) {
        match self.band_hz[..] {
            [low, high] => (low, high),
            _ => (f64::NAN, f64::NAN),
        }
    }

    /// Order of the full system: all free nodes except the driven one.
    pub(super) fn full_order(&self) -> usize {
        let free = (0..self.dimension - 1).fold(self.cells, |free, _| free.saturating_mul(self.cells - 1));
        (2 * self.dimension).saturating_mul(free - 1)
    }

    pub(super) fn validate(&self) -> Result<(), LabError> {
        let whole = |flag, value: usize, ok, allowed: String| check(flag, value as f64, ok, allowed);
        let Self { dimension, cells, method, order, rings, .. } = *self;
        whole("--dimension", dimension, (1..=3).contains(&dimension), "1, 2 or 3".into())?;
        whole("--cells", cells, cells >= 2, "at least 2".into())?;
        for (flag, value) in
            [("--stiffness", self.stiffness), ("--damping", self.damping), ("--mass", self.mass)]
        {
            check(flag, value, (1e-9..=1e9).contains(&value), "1e-9 to 1e9")?;
        }
        let full = self.full_order();
        let max = MAX_ORDER[dimension - 1];
        let allowed = format!("so few that the system's order, here {full}, is at most {max}");
        whole("--cells", cells, full <= max, allowed)?;
        if matches!(method, Method::Balanced | Method::Modal) {
            let allowed = format!("1 to {full}, the order of the system");
            whole("--order", order, (1..=full).contains(&order), allowed)?;
        }
        if method == Method::Modal {
            whole("--order", order, order % 2 == 0, "even for method modal: each mode is two states".into())?;
        }
        if matches!(method, Method::Neighbourhood | Method::Scaled) {
            let allowed = format!("1 to {cells}, the number of cells");
            whole("--rings", rings, (1..=cells).contains(&rings), allowed)?;
        }
        if self.shifts_hz.is_empty() || self.shifts_hz.len() > 50 {
            check("number of --shifts-hz", self.shifts_hz.len() as f64, false, "1 to 50")?;
        }
        for &shift in &self.shifts_hz {
            check("--shifts-hz", shift, (1e-6..=1e9).contains(&shift), "1e-6 to 1e9")?;
        }
        if self.band_hz.len() != 2 {
            check("number of frequencies of --band-hz", self.band_hz.len() as f64, false, "2, low and high")?;
        }
        let (low, high) = self.band();
        check("low end of --band-hz", low, low >= 1e-6, "at least 1e-6")?;
        let allowed = format!("above its low end, {low}, and at most 1e9");
        check("high end of --band-hz", high, high > low && high <= 1e9, allowed)?;
        if matches!(method, Method::Balanced | Method::Modal) {
            let allowed = format!(
                "so few that the system's order, here {full}, is at most {MAX_DENSE_ORDER} for this method; krylov, \
                 neighbourhood and scaled allow more"
            );
            whole("--cells", cells, full <= MAX_DENSE_ORDER, allowed)?;
        }
        Ok(())
    }
}
