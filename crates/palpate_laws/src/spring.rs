//! A spring with a parallel damper.

use crate::{ForceLaw, LawError, Tension};
use glam::{DMat3, DVec3};

/// A spring of rest length ℓ₀ and law φ with a parallel damper b, between two points `a` and `b`.
///
/// With d = x_b − x_a, ℓ = |d|, u = d/ℓ and ḋ = v_b − v_a, the force on `a` is
///
/// ```text
/// f = (φ(ℓ − ℓ₀) + b u·ḋ) u
/// ```
///
/// and the force on `b` is −f. Where the two points coincide the axis is undefined and the force is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    law: ForceLaw,
    rest_length_m: f64,
    damping_ns_per_m: f64,
}

/// Derivatives of a spring's force on `a`: ∂f/∂x_b = −∂f/∂x_a = `stiffness`, ∂f/∂v_b = −∂f/∂v_a = `damping`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringTangent {
    /// φ' u uᵀ + (φ/ℓ)(I − u uᵀ), N/m. The second term is the geometric stiffness.
    pub stiffness: DMat3,
    /// b u uᵀ, N s/m.
    pub damping: DMat3,
}

impl Default for Spring {
    /// 1 N/m, 1 m long, without a damper.
    fn default() -> Self {
        let law = ForceLaw::Linear { stiffness_n_per_m: 1.0 };
        Self { law, rest_length_m: 1.0, damping_ns_per_m: 0.0 }
    }
}

impl Spring {
    /// Creates a spring of law `law` and rest length `rest_length_m` with a parallel damper of `damping_ns_per_m`.
    ///
    /// # Errors
    /// [`LawError`] when a parameter is not finite, the rest length or the stiffness is not above zero, or the
    /// damping is negative.
    pub fn new(law: ForceLaw, rest_length_m: f64, damping_ns_per_m: f64) -> Result<Self, LawError> {
        law.validate()?;
        if !(rest_length_m.is_finite() && rest_length_m > 0.0) {
            return Err(LawError::RestLength(rest_length_m));
        }
        if !(damping_ns_per_m.is_finite() && damping_ns_per_m >= 0.0) {
            return Err(LawError::Damping(damping_ns_per_m));
        }
        Ok(Self { law, rest_length_m, damping_ns_per_m })
    }

    /// Creates a linear spring of `stiffness_n_per_m`.
    ///
    /// # Errors
    /// As [`Spring::new`].
    pub fn linear(
        stiffness_n_per_m: f64,
        rest_length_m: f64,
        damping_ns_per_m: f64,
    ) -> Result<Self, LawError> {
        Self::new(ForceLaw::Linear { stiffness_n_per_m }, rest_length_m, damping_ns_per_m)
    }

    /// Force law φ.
    #[must_use]
    pub fn law(&self) -> ForceLaw {
        self.law
    }

    /// Rest length ℓ₀, m.
    #[must_use]
    pub fn rest_length_m(&self) -> f64 {
        self.rest_length_m
    }

    /// Damping b, N s/m.
    #[must_use]
    pub fn damping_ns_per_m(&self) -> f64 {
        self.damping_ns_per_m
    }

    /// Force on `a`, N, for d = x_b − x_a (m) and ḋ = v_b − v_a (m/s).
    #[must_use]
    #[inline]
    pub fn force_on_a(&self, d: DVec3, d_dot: DVec3) -> DVec3 {
        let length = d.length();
        // One division instead of three: springs dominate the cost of a step.
        self.force_on_a_along(d, length, length.recip(), d_dot)
    }

    /// The same as [`Spring::force_on_a`], for callers that compute |d|, m, and 1/|d|, 1/m, of many springs together.
    #[must_use]
    #[inline]
    pub fn force_on_a_along(&self, d: DVec3, length_m: f64, per_length: f64, d_dot: DVec3) -> DVec3 {
        if length_m == 0.0 {
            return DVec3::ZERO;
        }
        let u = d * per_length;
        let tension =
            self.law.at(length_m - self.rest_length_m).force_n + self.damping_ns_per_m * u.dot(d_dot);
        tension * u
    }

    /// Stored energy at d = x_b − x_a, J.
    #[must_use]
    pub fn energy_j(&self, d: DVec3) -> f64 {
        self.law.energy_j(d.length() - self.rest_length_m)
    }

    /// Power that the damper dissipates at d and ḋ, W; never negative.
    #[must_use]
    pub fn dissipated_w(&self, d: DVec3, d_dot: DVec3) -> f64 {
        let length = d.length();
        if length == 0.0 { 0.0 } else { self.damping_ns_per_m * (d.dot(d_dot) / length).powi(2) }
    }

    /// The same spring with `stiffness` times the force of its law, and `damping` times its damping.
    ///
    /// # Errors
    /// As [`Spring::new`].
    pub fn scaled(&self, stiffness: f64, damping: f64) -> Result<Self, LawError> {
        Self::new(self.law.scaled(stiffness), self.rest_length_m, self.damping_ns_per_m * damping)
    }

    /// The exact tangent at d = x_b − x_a.
    ///
    /// With `clamped`, the negative geometric stiffness of a compressed spring (φ < 0) and a negative φ' are set to
    /// zero. The result is then positive semidefinite.
    #[must_use]
    pub fn tangent(&self, d: DVec3, clamped: bool) -> SpringTangent {
        let length = d.length();
        if length == 0.0 {
            return SpringTangent { stiffness: DMat3::ZERO, damping: DMat3::ZERO };
        }
        let u = d / length;
        let uu = DMat3::from_cols(u * u.x, u * u.y, u * u.z);
        let Tension { force_n, stiffness_n_per_m } = self.law.at(length - self.rest_length_m);
        let (mut axial, mut transverse) = (stiffness_n_per_m, force_n / length);
        if clamped {
            (axial, transverse) = (axial.max(0.0), transverse.max(0.0));
        }
        SpringTangent {
            stiffness: axial * uu + transverse * (DMat3::IDENTITY - uu),
            damping: self.damping_ns_per_m * uu,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SkinLaw;

    fn spring() -> Spring {
        Spring::linear(120.0, 0.02, 0.7).unwrap()
    }

    #[test]
    fn a_stretched_spring_pulls_its_ends_together() {
        let f = spring().force_on_a(DVec3::new(0.03, 0.0, 0.0), DVec3::ZERO);
        assert!((f - DVec3::new(1.2, 0.0, 0.0)).length() < 1e-15);
    }

    #[test]
    fn the_damper_resists_along_the_axis_only() {
        let d = DVec3::new(0.0, 0.02, 0.0);
        let f = spring().force_on_a(d, DVec3::new(5.0, 0.1, -3.0));
        assert!((f - DVec3::new(0.0, 0.07, 0.0)).length() < 1e-15);
    }

    #[test]
    fn coincident_ends_give_no_force_and_no_tangent() {
        assert_eq!(spring().force_on_a(DVec3::ZERO, DVec3::X), DVec3::ZERO);
        assert_eq!(spring().tangent(DVec3::ZERO, false).stiffness, DMat3::ZERO);
    }

    #[test]
    fn the_tangent_is_the_derivative_of_the_force_and_the_force_that_of_the_energy() {
        let h = 1e-7;
        let laws = [
            ForceLaw::Linear { stiffness_n_per_m: 120.0 },
            ForceLaw::Skin(SkinLaw { compliance_m_per_n: 1.0 / 120.0, hardening_per_n: 0.4 }),
            ForceLaw::Exponential { stiffness_n_per_m: 120.0, rate_per_m: 60.0 },
        ];
        // Stretched by a half, compressed to a half, and rotated.
        let places =
            [DVec3::new(0.03, 0.01, -0.02), DVec3::new(-0.004, 0.009, 0.002), DVec3::new(0.0, 0.0, 0.021)];
        for (s, d) in laws.iter().flat_map(|&law| places.map(|d| (Spring::new(law, 0.02, 0.7).unwrap(), d))) {
            let tangent = s.tangent(d, false);
            let gradient = DVec3::AXES.map(|e| (s.energy_j(d + h * e) - s.energy_j(d - h * e)) / (2.0 * h));
            let force = s.force_on_a(d, DVec3::ZERO);
            assert!((DVec3::from_array(gradient) - force).length() < 1e-6 * (1.0 + force.length()));
            for axis in 0..3 {
                let e = DVec3::AXES[axis] * h;
                let dx = (s.force_on_a(d + e, DVec3::ZERO) - s.force_on_a(d - e, DVec3::ZERO)) / (2.0 * h);
                // The force is linear in the velocity, so a unit step is exact.
                let v = DVec3::AXES[axis];
                let dv = (s.force_on_a(d, v) - s.force_on_a(d, -v)) / 2.0;
                let column = tangent.stiffness.col(axis);
                assert!((dx - column).length() < 1e-6 * 120.0 * (1.0 + column.length() / 120.0));
                assert!((dv - tangent.damping.col(axis)).length() < 1e-12);
            }
        }
    }

    #[test]
    fn a_clamped_tangent_is_positive_semidefinite_under_compression() {
        let d = DVec3::new(0.0, 0.0, 0.005);
        let across = |clamped| spring().tangent(d, clamped).stiffness.col(0).x;
        assert!(across(false) < 0.0);
        assert_eq!(across(true), 0.0);
    }

    #[test]
    fn rejects_invalid_parameters_and_reports_the_value() {
        assert_eq!(Spring::linear(0.0, 0.1, 0.0), Err(LawError::Stiffness(0.0)));
        assert_eq!(Spring::linear(-1.0, 0.1, 0.0), Err(LawError::Stiffness(-1.0)));
        assert!(matches!(Spring::linear(f64::NAN, 0.1, 0.0), Err(LawError::Stiffness(_))));
        assert_eq!(Spring::linear(1.0, 0.0, 0.0), Err(LawError::RestLength(0.0)));
        assert_eq!(Spring::linear(1.0, 0.1, -0.1), Err(LawError::Damping(-0.1)));
        assert_eq!(Spring::linear(1.0, 0.1, f64::INFINITY), Err(LawError::Damping(f64::INFINITY)));
        let message = LawError::Damping(-0.1).to_string();
        assert_eq!(message, "damping is -0.1 N s/m; it must be finite and at least 0");
    }
}
