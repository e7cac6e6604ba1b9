//! Rows: points that have to obey laws, and the impulses that make them.

use crate::{Coulomb, SeriesCompliance};
use glam::{DMat3, DVec3};

/// What a row, a point Σ w_i x_i or the difference of two, has to obey.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConstraintLaw {
    /// A surface that pushes and rubs; the gap is along its normal.
    Unilateral {
        /// Its normal and friction.
        coulomb: Coulomb,
        /// What is in series with it along the normal, where under an impulse the gap that is left is −δ_s(λ_n/h), and across it, m/N, where what
        /// is left is minus that times λ_t/h.
        series: Option<(SeriesCompliance, f64)>,
    },
    /// No gap is left.
    Bilateral,
    /// No gap is left along a unit direction, by pulling against it only.
    Tension {
        /// The direction in which the row must not go farther.
        along: DVec3,
        /// How it stretches: 1/(k h²) of a spring of k N/m in a step of h s, 1/kg, so that what is left of the gap at the end of the
        /// step is the impulse over k h; 0 for one that does not.
        compliance_per_kg: f64,
    },
}

/// One row of the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstraintRow {
    /// What it has to obey.
    pub law: ConstraintLaw,
    /// How far it would be beyond the law, or short of it, if it did not move in the step, m.
    pub gap_m: DVec3,
    /// H A⁻¹ Hᵀ of the row with itself: what an impulse on it does to its own velocity, 1/kg.
    pub inv_effective_mass_per_kg: DMat3,
    /// λ, what the law gives it, N s.
    pub impulse_ns: DVec3,
}

/// How fast what is inside of what it should not be in is pushed out, and what is apart is drawn together.
pub const MAX_CORRECTION_SPEED_M_PER_S: f64 = 1.0;
/// Less than that of a gap is rounding and needs no care.
pub const GAP_TOLERANCE_M: f64 = 1e-6;

impl ConstraintLaw {
    /// The impulse of a row with answer `w` whose velocity without it, the gap over the length of the step added, is
    /// `free`.
    pub(crate) fn impulse(self, w: DMat3, free: DVec3, (before, h): (DVec3, f64)) -> DVec3 {
        match self {
            Self::Unilateral { coulomb, series: None } => coulomb.impulse(w, free),
            Self::Unilateral { coulomb, series: Some((series, tangential)) } => {
                in_series(coulomb, (&series, tangential), (w, free), (before, h))
            }
            Self::Bilateral => -(w.inverse() * free),
            Self::Tension { along, compliance_per_kg } => {
                -along * (free.dot(along).max(0.0) / (along.dot(w * along) + compliance_per_kg))
            }
        }
    }
}

/// Newton steps for the force of a contact in series with a compliance, and the relative change that ends them.
const NEWTON_STEPS: usize = 40;
const NEWTON_TOLERANCE: f64 = 1e-12;

/// The impulse of a contact that leaves the gap −δ_s(λ_n/h): by Newton's method on the force, held between 0 and what either the row or the
/// compliance alone would give.
fn in_series(
    coulomb: Coulomb,
    (series, tangential_m_per_n): (&SeriesCompliance, f64),
    (w, free): (DMat3, DVec3),
    (before, h): (DVec3, f64),
) -> DVec3 {
    let n = coulomb.normal();
    let approach = -free.dot(n);
    if approach.is_nan() || approach <= 0.0 {
        return coulomb.impulse(w, free);
    }
    if let Some(per_kg) = isotropic(w) {
        return in_series_with_a_mass(coulomb, (series, tangential_m_per_n), (per_kg, free, approach), h);
    }
    let (mut low, mut high) = (0.0, series.force_n(approach * h));
    let own = n.dot(w * n);
    if own > 0.0 {
        high = high.min(approach / own / h);
    }
    // Across the normal it is a spring whose stretch of the step before is in the gap.
    let across =
        (DMat3::IDENTITY - DMat3::from_cols(n * n.x, n * n.y, n * n.z)) * (tangential_m_per_n / (h * h));
    let guess = before.dot(n) / h;
    let mut force = if guess > 0.0 && guess <= high { guess } else { 0.5 * high };
    let mut impulse = DVec3::ZERO;
    for _ in 0..NEWTON_STEPS {
        let (delta, slope) = (series.approach_m(force), series.slope_m_per_n(force));
        let along = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        let w = w + across + along * (slope / (h * h));
        impulse = coulomb.impulse(w, free + n * ((delta - slope * force) / h));
        let next = impulse.dot(n) / h;
        if (next - force).abs() <= NEWTON_TOLERANCE * force {
            break;
        }
        // A compliance that stiffens with force is concave: the tangent falls short of the force, never beyond it.
        if next > force {
            low = force;
        } else {
            high = force;
        }
        let is_between = next > low && next < high;
        force = if is_between { next } else { 0.5 * (low + high) };
    }
    impulse
}

/// As [`in_series`], where an impulse does the same to the velocity in every direction, `per_kg`: then what is along the normal and what is
/// across it are apart.
fn in_series_with_a_mass(
    coulomb: Coulomb,
    (series, tangential_m_per_n): (&SeriesCompliance, f64),
    (per_kg, free, approach): (f64, DVec3, f64),
    h: f64,
) -> DVec3 {
    let n = coulomb.normal();
    let normal_ns = h * series.force_beside_n(approach * h, per_kg * h * h);
    let (slip, most) = (free + approach * n, coulomb.friction() * normal_ns);
    let across = per_kg + tangential_m_per_n / (h * h);
    let friction = if across > 0.0 { slip / across } else { most * slip.normalize_or_zero() };
    let length = friction.length();
    normal_ns * n - if length > most { most / length * friction } else { friction }
}

/// What an impulse does to the velocity in every direction, where that is the same.
fn isotropic(w: DMat3) -> Option<f64> {
    let own = w.x_axis.x;
    (w == DMat3::from_diagonal(DVec3::splat(own))).then_some(own)
}
