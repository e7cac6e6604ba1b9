//! Constraint rows and the impulse that satisfies a single row.

use crate::{Coulomb, SeriesCompliance};
use glam::{DMat3, DVec3};

/// Constraint law of a row. A row is a point Σ w_i x_i or the difference of two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConstraintLaw {
    /// Unilateral contact with Coulomb friction. The gap is measured along the normal.
    Unilateral {
        /// Normal and coefficient of friction.
        coulomb: Coulomb,
        /// Compliance in series with the contact, and its compliance across the normal, m/N. Under the impulse λ the
        /// remaining gap is −δ_s(λ_n/h) along the normal and −(compliance) λ_t/h across it.
        series: Option<(SeriesCompliance, f64)>,
    },
    /// Bilateral constraint: the gap is closed in all directions.
    Bilateral,
    /// Constraint along one direction that only pulls.
    Tension {
        /// Unit direction in which the row must not move further.
        along: DVec3,
        /// Regularisation 1/(k h²) of a spring of stiffness k (N/m) in a step of length h (s), 1/kg; 0 for an
        /// inextensible thread. The gap at the end of the step is then the impulse over k h.
        compliance_per_kg: f64,
    },
}

/// One constraint row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstraintRow {
    /// Constraint law.
    pub law: ConstraintLaw,
    /// Constraint violation if the row did not move during the step, m.
    pub gap_m: DVec3,
    /// Inverse effective mass H A⁻¹ Hᵀ, 1/kg: the velocity of the row per impulse on it.
    pub inv_effective_mass_per_kg: DMat3,
    /// Impulse λ of the constraint, N s.
    pub impulse_ns: DVec3,
}

/// Maximum speed at which existing penetration or separation is corrected, m/s.
pub const MAX_CORRECTION_SPEED_M_PER_S: f64 = 1.0;
/// Gaps below this tolerance are treated as rounding errors, m.
pub const GAP_TOLERANCE_M: f64 = 1e-6;

impl ConstraintLaw {
    /// Impulse of a row with the inverse effective mass `w`. `free` is its velocity without the impulse, plus the gap
    /// divided by the step length.
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

/// Maximum number of Newton iterations for a contact in series with a compliance, and the relative change at which
/// they end.
const NEWTON_STEPS: usize = 40;
const NEWTON_TOLERANCE: f64 = 1e-12;

/// Impulse of a contact that leaves the gap −δ_s(λ_n/h), by Newton's method on the normal force. The force is
/// bracketed by 0 and the smaller of the forces that the row or the compliance alone would give.
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
    // Across the normal the compliance is a spring. Its deflection in the previous step is part of the gap.
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
        // δ_s(F) is concave: a Newton step underestimates the force and never exceeds it.
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

/// [`in_series`] for an isotropic response `per_kg`, for which the normal and the tangential problem decouple.
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

/// The response of an isotropic inverse mass; `None` if `w` is not isotropic.
fn isotropic(w: DMat3) -> Option<f64> {
    let own = w.x_axis.x;
    (w == DMat3::from_diagonal(DVec3::splat(own))).then_some(own)
}
