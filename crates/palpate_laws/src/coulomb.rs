//! Unilateral contact with Coulomb friction at one point, formulated in impulses.

use crate::LawError;
use glam::{DMat2, DMat3, DVec2, DVec3};

/// A unilateral contact with Coulomb friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coulomb {
    /// Unit normal along which the surface pushes.
    normal: DVec3,
    /// Coefficient of friction μ.
    friction: f64,
}

/// Numbers of directions at which the slip direction is bracketed. Finer subdivisions follow when two solutions lie
/// between neighbours.
const DIRECTIONS: [u32; 3] = [16, 256, 4096];
/// Maximum number of regula falsi iterations (about six are common), and the change of the angle, rad, that ends
/// them.
const MAX_NARROWINGS: u32 = 60;
const ANGLE_TOLERANCE: f64 = 1e-13;

impl Coulomb {
    /// Creates a contact with unit normal `normal` and coefficient of friction `friction`.
    ///
    /// # Errors
    /// [`LawError::Friction`] when the coefficient is negative or not finite, [`LawError::Normal`] when the normal is not
    /// of unit length.
    pub fn new(normal: DVec3, friction: f64) -> Result<Self, LawError> {
        let length = normal.length();
        if length.is_nan() || (length - 1.0).abs() > 1e-6 {
            return Err(LawError::Normal(length));
        }
        if friction.is_finite() && friction >= 0.0 {
            Ok(Self { normal, friction })
        } else {
            Err(LawError::Friction(friction))
        }
    }

    /// Unit normal.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Coefficient of friction μ.
    #[must_use]
    pub fn friction(&self) -> f64 {
        self.friction
    }

    /// Projects `r` into the friction cone: zero for a pulling force, otherwise the tangential component is limited
    /// to μ times the normal component.
    #[must_use]
    pub fn in_cone(&self, r: DVec3) -> DVec3 {
        let along = r.dot(self.normal);
        if along.is_nan() || along <= 0.0 {
            return DVec3::ZERO;
        }
        along * self.normal + (r - along * self.normal).clamp_length_max(self.friction * along)
    }

    /// Contact impulse r, N s.
    ///
    /// The velocity of the point relative to the surface is u = W r + `free`, m/s. `w` is the inverse effective mass
    /// W (1/kg, symmetric positive definite). `free` is the velocity without an impulse; a gap that may still be
    /// closed is added to it along the normal, divided by the step length.
    ///
    /// With r_n, u_n the normal components and r_t, u_t the tangential components, the conditions of Signorini and
    /// Coulomb are:
    ///
    /// ```text
    /// 0 ≤ r_n ⟂ u_n ≥ 0,    ‖r_t‖ ≤ μ r_n,    u_t = 0  or  r_t = −μ r_n u_t/‖u_t‖
    /// ```
    ///
    /// Separation, stick and slip are tried in this order. In slip the direction of r_t is the only unknown; regula
    /// falsi finds it.
    ///
    /// With large μ, friction can press the point into the surface (Painlevé's paradox), and slip may have no
    /// solution. Then r_n is the frictionless impulse, r_t lies on the cone in the direction of stick, and u_n may be
    /// negative.
    #[must_use]
    pub fn impulse(&self, w: DMat3, free: DVec3) -> DVec3 {
        let (n, mu) = (self.normal, self.friction);
        let approach = free.dot(n);
        // Also returns zero for NaN.
        if approach.is_nan() || approach >= 0.0 {
            return DVec3::ZERO;
        }
        let sticking = -(w.inverse() * free);
        let normal = sticking.dot(n);
        let tangential = sticking - normal * n;
        if normal >= 0.0 && tangential.length() <= mu * normal {
            return sticking;
        }
        let frictionless = -approach / n.dot(w * n);
        if mu == 0.0 {
            return frictionless * n;
        }
        // A point mass keeps its direction of motion.
        if w == DMat3::from_diagonal(DVec3::splat(w.x_axis.x)) {
            return frictionless * n + mu * frictionless * tangential.normalize_or_zero();
        }
        self.slip(w, free, tangential)
            .unwrap_or_else(|| frictionless * (n + mu * tangential.normalize_or_zero()))
    }

    /// Impulse in slip. The direction nearest to `hint` is tried first.
    fn slip(&self, w: DMat3, free: DVec3, hint: DVec3) -> Option<DVec3> {
        let first = hint.try_normalize().unwrap_or_else(|| self.normal.any_orthonormal_vector());
        let slip = Slip::new(self, w, free, first);
        for directions in DIRECTIONS {
            let step = std::f64::consts::TAU / f64::from(directions);
            // 0, 1, -1, 2, -2, ...: outward from the hint.
            for i in 0..directions {
                let k = f64::from(i.div_ceil(2)) * if i % 2 == 0 { -1.0 } else { 1.0 };
                let ends = ((k - 0.5) * step, (k + 0.5) * step);
                let Some(angle) = slip.straight_between(ends) else { continue };
                // Friction opposes the slip.
                if slip.along(angle) <= 0.0 {
                    return slip.impulse(angle);
                }
            }
        }
        None
    }
}

/// Search for the slip direction t, by its angle in the contact plane.
struct Slip {
    normal: DVec3,
    /// Axes of the contact plane; the first is at angle 0.
    axes: [DVec3; 2],
    friction: f64,
    /// −u_n without an impulse, m/s.
    approach: f64,
    /// Tangential velocity without an impulse, m/s.
    free: DVec2,
    /// Blocks of W: normal, normal-tangential, tangential.
    w_n: f64,
    w_nt: DVec2,
    w_t: DMat2,
}

impl Slip {
    fn new(contact: &Coulomb, w: DMat3, free: DVec3, first: DVec3) -> Self {
        let n = contact.normal;
        let axes = [first, n.cross(first)];
        let in_plane = |v: DVec3| DVec2::new(v.dot(axes[0]), v.dot(axes[1]));
        let w_t = DMat2::from_cols(in_plane(w * axes[0]), in_plane(w * axes[1]));
        Self {
            normal: n,
            axes,
            friction: contact.friction,
            approach: -free.dot(n),
            free: in_plane(free),
            w_n: n.dot(w * n),
            w_nt: in_plane(w * n),
            w_t,
        }
    }

    /// r_n with friction along t; `None` if it would pull.
    fn size(&self, t: DVec2) -> Option<f64> {
        let size = self.approach / (self.w_n + self.friction * self.w_nt.dot(t));
        (size > 0.0).then_some(size)
    }

    /// Tangential velocity with friction along t.
    fn velocity(&self, t: DVec2) -> Option<DVec2> {
        Some(self.size(t)? * (self.w_nt + self.friction * (self.w_t * t)) + self.free)
    }

    /// Component of the slip velocity perpendicular to the friction; zero at a solution.
    fn miss(&self, angle: f64) -> Option<f64> {
        let t = DVec2::from_angle(angle);
        Some(t.perp_dot(self.velocity(t)?))
    }

    /// Component of the slip velocity along the friction.
    fn along(&self, angle: f64) -> f64 {
        let t = DVec2::from_angle(angle);
        self.velocity(t).map_or(f64::INFINITY, |u| u.dot(t))
    }

    fn impulse(&self, angle: f64) -> Option<DVec3> {
        let t = DVec2::from_angle(angle);
        let across = t.x * self.axes[0] + t.y * self.axes[1];
        Some(self.size(t)? * (self.normal + self.friction * across))
    }

    /// Angle between the given two at which slip velocity and friction are collinear, by the Illinois variant of
    /// regula falsi.
    fn straight_between(&self, (mut low, mut high): (f64, f64)) -> Option<f64> {
        let (mut at_low, mut at_high) = (self.miss(low)?, self.miss(high)?);
        if at_low * at_high > 0.0 {
            return None;
        }
        let (mut last, mut low_stayed, mut high_stayed) = (f64::NAN, false, false);
        for _ in 0..MAX_NARROWINGS {
            let guess = (low * at_high - high * at_low) / (at_high - at_low);
            let middle = if guess > low && guess < high { guess } else { 0.5 * (low + high) };
            let at = self.miss(middle)?;
            if at == 0.0 || (middle - last).abs() < ANGLE_TOLERANCE {
                return Some(middle);
            }
            last = middle;
            // The function value at an end that is retained twice is halved.
            if at * at_low > 0.0 {
                (low, at_low) = (middle, at);
                at_high *= if high_stayed { 0.5 } else { 1.0 };
                (low_stayed, high_stayed) = (false, true);
            } else {
                (high, at_high) = (middle, at);
                at_low *= if low_stayed { 0.5 } else { 1.0 };
                (low_stayed, high_stayed) = (true, false);
            }
        }
        Some(0.5 * (low + high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(size: f64) -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
    }

    /// Random inverse effective masses: symmetric positive definite, with a condition number of up to about a
    /// hundred.
    fn delassus() -> impl Strategy<Value = DMat3> {
        (vector(1.0), vector(1.0), vector(1.0), 0.2..1.0f64).prop_map(|(a, b, c, d)| {
            let m = DMat3::from_cols(a, b, c);
            m * m.transpose() + DMat3::from_diagonal(DVec3::splat(d))
        })
    }

    proptest! {
        #[test]
        fn impulse_satisfies_signorini_and_coulomb(
            w in delassus(),
            free in vector(1.0),
            normal in vector(1.0).prop_filter("a direction", |n| n.length() > 0.1),
            mu in 0.0..1.0f64,
        ) {
            let n = normal.normalize();
            let contact = Coulomb::new(n, mu).unwrap();
            let r = contact.impulse(w, free);
            let u = w * r + free;
            let (r_n, u_n) = (r.dot(n), u.dot(n));
            let (r_t, u_t) = (r - r_n * n, u - u_n * n);
            prop_assert!(r_n >= 0.0 && u_n >= -1e-12, "r_n {r_n}, u_n {u_n}");
            prop_assert!((r_n * u_n).abs() < 1e-12, "r_n {r_n}, u_n {u_n}");
            prop_assert!(r_t.length() <= mu * r_n + 1e-12);
            // Friction dissipates energy, as much as possible.
            prop_assert!(r_t.dot(u_t) <= 1e-12);
            if u_t.length() > 1e-9 && r_n > 0.0 {
                let slipping = -mu * r_n * u_t.normalize();
                // Painlevé's case has no solution. It needs more friction than this inverse mass allows.
                let bears = (0..64).all(|i| {
                    let (a, t) = (f64::from(i) * 0.1, n.any_orthonormal_vector());
                    n.dot(w * (n + mu * (t * a.cos() + n.cross(t) * a.sin()))) > 0.0
                });
                prop_assert!(!bears || (r_t - slipping).length() < 1e-7, "{r_t}, {slipping}");
            }
        }
    }

    #[test]
    fn a_point_mass_slips_slows_and_sticks() {
        let w = DMat3::from_diagonal(DVec3::splat(2.0));
        let contact = Coulomb::new(DVec3::Z, 0.5).unwrap();
        // Too fast to be stopped: 0.5 kg arriving at 2 m/s takes 1 N s, friction half of it.
        let r = contact.impulse(w, DVec3::new(3.0, 0.0, -2.0));
        assert!((r - DVec3::new(-0.5, 0.0, 1.0)).length() < 1e-12, "{r}");
        // Slow enough to be stopped.
        let r = contact.impulse(w, DVec3::new(0.0, 0.9, -2.0));
        assert!((r - DVec3::new(0.0, -0.45, 1.0)).length() < 1e-12, "{r}");
        assert_eq!(contact.impulse(w, DVec3::new(5.0, 0.0, 1e-9)), DVec3::ZERO);
        assert_eq!(contact.impulse(w, DVec3::NAN), DVec3::ZERO);
    }

    #[test]
    fn in_cone_projects_outside_forces_onto_the_cone() {
        let contact = Coulomb::new(DVec3::Z, 0.5).unwrap();
        assert_eq!(contact.in_cone(DVec3::new(0.3, 0.0, 1.0)), DVec3::new(0.3, 0.0, 1.0));
        assert!((contact.in_cone(DVec3::new(3.0, 4.0, 2.0)) - DVec3::new(0.6, 0.8, 2.0)).length() < 1e-15);
        assert_eq!(contact.in_cone(DVec3::new(0.3, 0.0, -1.0)), DVec3::ZERO);
        assert_eq!(contact.in_cone(DVec3::NAN), DVec3::ZERO);
        assert_eq!(Coulomb::new(DVec3::Z, 0.0).unwrap().in_cone(DVec3::ONE), DVec3::Z);
    }

    #[test]
    fn rejects_invalid_friction_and_normal() {
        for bad in [-0.1, f64::NAN, f64::INFINITY] {
            assert!(matches!(Coulomb::new(DVec3::Z, bad), Err(LawError::Friction(_))));
        }
        for bad in [DVec3::ZERO, DVec3::NAN, DVec3::Z * 1.1] {
            assert!(matches!(Coulomb::new(bad, 0.1), Err(LawError::Normal(_))));
        }
    }
}
