//! Results of contacts with obstacles.

use glam::{DMat3, DVec3};

/// Contact of a point of a body with an obstacle in the last step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstacleContact {
    /// Index of the point in [`crate::Body::obstacle_points`].
    pub point: usize,
    /// Index of the obstacle.
    pub obstacle: usize,
    /// Unit normal away from the obstacle.
    pub normal: DVec3,
    /// Distance of the point from the obstacle at the end of the step, m; first-order accurate for curved and turning
    /// obstacles.
    pub gap_m: f64,
    /// Impulse λ on the point, N s. The obstacle gets −λ.
    pub impulse_ns: DVec3,
    /// Velocity of the point at the end of the step, m/s.
    pub velocity_m_per_s: DVec3,
    /// Velocity of the point relative to the obstacle at the end of the step, m/s.
    pub slip_m_per_s: DVec3,
    /// Length of the step, s.
    pub step_s: f64,
    /// Velocity of the obstacle at the point per impulse there, 1/kg; zero for a fixed or moved obstacle.
    pub response_per_kg: DMat3,
    /// Mean velocity of the obstacle at the point during the step, m/s.
    pub(crate) carried_m_per_s: DVec3,
}

/// Reaction of a body on an obstacle during the last advance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ObstacleReaction {
    /// Impulse on the obstacle, N s.
    pub impulse_ns: DVec3,
    /// Angular impulse on the obstacle about its position, N m s. Each step counts about the position at its
    /// beginning.
    pub angular_impulse_nms: DVec3,
    /// Angular impulse on the obstacle about the origin, N m s: the body's angular momentum about it changes by the
    /// opposite.
    pub moment_nms: DVec3,
    /// Change of the velocity of the obstacle's centre of mass by the contacts, m/s; zero if it neither has a mass nor is coupled.
    pub velocity_change_m_per_s: DVec3,
    /// Change of the obstacle's angular velocity by the contacts, rad/s; zero if it neither has a mass nor is coupled.
    pub angular_velocity_change_rad_per_s: DVec3,
    /// Displacement of the centre of mass of a coupled obstacle from the end of its given path, m.
    pub displacement_m: DVec3,
    /// Rotation vector of a coupled obstacle from the end of its given path, rad.
    pub turn_rad: DVec3,
    /// Length of the advance, s.
    pub duration_s: f64,
}

impl ObstacleReaction {
    /// Mean force on the obstacle, N.
    #[must_use]
    pub fn force_n(&self) -> DVec3 {
        self.mean(self.impulse_ns)
    }

    /// Mean torque on the obstacle about its position, N m.
    #[must_use]
    pub fn torque_nm(&self) -> DVec3 {
        self.mean(self.angular_impulse_nms)
    }

    fn mean(&self, sum: DVec3) -> DVec3 {
        if self.duration_s > 0.0 { sum / self.duration_s } else { DVec3::ZERO }
    }
}
