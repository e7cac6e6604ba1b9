//! Mass and motion of an obstacle that moves as a rigid body.

use crate::BodyError;
use crate::error::{check, check_positive};
use glam::{DMat3, DQuat, DVec3};

/// Mass, centre of mass and inertia of a rigid body, in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMass {
    mass_kg: f64,
    center_m: DVec3,
    inertia_kg_m2: DMat3,
    inverse: DMat3,
}

/// Motion of a rigid body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidMotion {
    /// Velocity of the centre of mass, m/s.
    pub velocity_m_per_s: DVec3,
    /// Angular velocity in the frame of the soft body, rad/s.
    pub angular_velocity_rad_per_s: DVec3,
    /// External acceleration of the centre of mass, m/s², for example that of gravity. It is constant during an
    /// advance.
    pub acceleration_m_per_s2: DVec3,
}

/// Asymmetry of an inertia tensor, relative to its largest entry, that counts as rounding.
const ASYMMETRY: f64 = 1e-6;

impl RigidMass {
    /// Creates a mass of `mass_kg` (kg) with the centre of mass `center_m` (m) and the inertia tensor `inertia_kg_m2`
    /// (kg m²) about it, both in the obstacle's frame. For a tensor J in the axes of the surroundings that is Rᵀ J R
    /// with the obstacle's rotation R.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the mass is not above zero, the centre is not finite, or the tensor is not
    /// symmetric and positive definite.
    pub fn new(mass_kg: f64, center_m: DVec3, inertia_kg_m2: DMat3) -> Result<Self, BodyError> {
        check_positive("mass of an obstacle, kg", mass_kg)?;
        let far = center_m.abs().max_element();
        check("centre of mass of an obstacle, m", far, center_m.is_finite(), "finite")?;
        let transposed = inertia_kg_m2.transpose();
        let largest = |m: DMat3| m.to_cols_array().iter().fold(0.0_f64, |most, of| most.max(of.abs()));
        let (most, asymmetry) = (largest(inertia_kg_m2), largest(inertia_kg_m2 - transposed));
        let is_symmetric = inertia_kg_m2.is_finite() && asymmetry <= ASYMMETRY * most;
        check("asymmetry of an inertia tensor, kg m2", asymmetry, is_symmetric, "0 within rounding")?;
        let inertia_kg_m2 = (inertia_kg_m2 + transposed) * 0.5;
        let m = inertia_kg_m2;
        let minor = m.x_axis.x * m.y_axis.y - m.x_axis.y * m.y_axis.x;
        let determinant = m.determinant();
        let inverse = m.inverse();
        let is_positive = m.x_axis.x > 0.0 && minor > 0.0 && determinant > 0.0 && inverse.is_finite();
        check(
            "determinant of an inertia tensor, kg3 m6",
            determinant,
            is_positive,
            "that of a positive definite tensor",
        )?;
        Ok(Self { mass_kg, center_m, inertia_kg_m2, inverse: (inverse + inverse.transpose()) * 0.5 })
    }

    /// Creates the mass of a solid ball around the obstacle's position.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the mass (kg) or the radius (m) is not above zero.
    pub fn of_sphere(mass_kg: f64, radius_m: f64) -> Result<Self, BodyError> {
        check_positive("radius of a sphere, m", radius_m)?;
        Self::new(
            mass_kg,
            DVec3::ZERO,
            DMat3::from_diagonal(DVec3::splat(0.4 * mass_kg * radius_m * radius_m)),
        )
    }

    /// Creates the mass of a solid box around the obstacle's position with half the sides `half_m`, m.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the mass (kg) or a side is not above zero.
    pub fn of_cuboid(mass_kg: f64, half_m: DVec3) -> Result<Self, BodyError> {
        check_positive("half side of a box, m", half_m.min_element())?;
        let squares = half_m * half_m;
        let sums = DVec3::splat(squares.element_sum()) - squares;
        Self::new(mass_kg, DVec3::ZERO, DMat3::from_diagonal(mass_kg / 3.0 * sums))
    }

    /// Mass, kg.
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// Centre of mass in the obstacle's frame, m.
    #[must_use]
    pub fn center_m(&self) -> DVec3 {
        self.center_m
    }

    /// Inertia tensor about the centre of mass in the obstacle's frame, kg m².
    #[must_use]
    pub fn inertia_kg_m2(&self) -> DMat3 {
        self.inertia_kg_m2
    }

    /// Inertia tensor in the axes of the surroundings, and its inverse.
    pub(crate) fn turned(&self, rotation: DQuat) -> (DMat3, DMat3) {
        let r = DMat3::from_quat(rotation);
        let back = r.transpose();
        (r * self.inertia_kg_m2 * back, r * self.inverse * back)
    }
}

impl RigidMotion {
    pub(crate) fn validate(&self) -> Result<(), BodyError> {
        for (what, value) in [
            ("velocity of an obstacle, m/s", self.velocity_m_per_s),
            ("angular velocity of an obstacle, rad/s", self.angular_velocity_rad_per_s),
            ("acceleration of an obstacle, m/s2", self.acceleration_m_per_s2),
        ] {
            check(what, value.abs().max_element(), value.is_finite(), "finite")?;
        }
        Ok(())
    }
}
