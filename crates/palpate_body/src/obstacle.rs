//! Fixed rigid obstacles: planes and spheres.

use crate::BodyError;
use crate::error::{check, check_positive};
use glam::DVec3;
use palpate_laws::Coulomb;

/// A rigid obstacle. Nodes of a body cannot enter it, and slide on it with friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle {
    shape: Shape,
    friction: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Plane { point_m: DVec3, normal: DVec3 },
    Sphere { center_m: DVec3, radius_m: f64 },
}

/// Contact of a node with an obstacle in the last step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeContact {
    /// Index of the node.
    pub node: usize,
    /// Index of the obstacle.
    pub obstacle: usize,
    /// Unit normal away from the obstacle.
    pub normal: DVec3,
    /// Distance of the node from the obstacle at the end of the step, m; first-order accurate for a sphere.
    pub gap_m: f64,
    /// Impulse λ on the node, N s.
    pub impulse_ns: DVec3,
    /// Velocity of the node at the end of the step, m/s.
    pub velocity_m_per_s: DVec3,
    /// Length of the step, s.
    pub step_s: f64,
}

impl Obstacle {
    /// Creates a half-space bounded by the plane through `point_m` (m) with outward unit normal `normal`, with
    /// coefficient of friction `friction`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the normal is not a unit vector, the point is not finite or the friction is
    /// negative.
    pub fn plane(point_m: DVec3, normal: DVec3, friction: f64) -> Result<Self, BodyError> {
        let length = normal.length();
        check("length of the normal of a plane", length, (length - 1.0).abs() < 1e-9, "1 within 1e-9")?;
        check("point of a plane, m", point_m.abs().max_element(), point_m.is_finite(), "finite")?;
        Self { shape: Shape::Plane { point_m, normal }, friction }.checked()
    }

    /// Creates a ball of radius `radius_m` (m) around `center_m` (m), with coefficient of friction `friction`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the radius is not above zero, the centre is not finite or the friction is
    /// negative.
    pub fn sphere(center_m: DVec3, radius_m: f64, friction: f64) -> Result<Self, BodyError> {
        check("centre of a sphere, m", center_m.abs().max_element(), center_m.is_finite(), "finite")?;
        check_positive("radius of a sphere, m", radius_m)?;
        Self { shape: Shape::Sphere { center_m, radius_m }, friction }.checked()
    }

    fn checked(self) -> Result<Self, BodyError> {
        let ok = self.friction.is_finite() && self.friction >= 0.0;
        check("coefficient of friction", self.friction, ok, "finite and at least 0")?;
        Ok(self)
    }

    /// Coefficient of friction μ.
    #[must_use]
    pub fn friction(&self) -> f64 {
        self.friction
    }

    /// Distance of `x_m` from the obstacle, m, negative inside, and the unit normal there. In the centre of a sphere
    /// the normal is z.
    #[must_use]
    pub fn gap_m(&self, x_m: DVec3) -> (f64, DVec3) {
        match self.shape {
            Shape::Plane { point_m, normal } => ((x_m - point_m).dot(normal), normal),
            Shape::Sphere { center_m, radius_m } => {
                let out = x_m - center_m;
                (out.length() - radius_m, out.try_normalize().unwrap_or(DVec3::Z))
            }
        }
    }

    /// The contact law at a normal.
    pub(crate) fn law(&self, normal: DVec3) -> Option<Coulomb> {
        Coulomb::new(normal, self.friction).ok()
    }
}
