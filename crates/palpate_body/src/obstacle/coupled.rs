//! Obstacle that another solver moves as a rigid body, and that responds to the body's impulses.

use super::pose::Pose;
use crate::BodyError;
use crate::error::check;
use glam::{DMat3, DQuat, DVec3};

/// Inverse mass matrix of a rigid body about its centre of mass, in the axes of the surroundings. It may be singular: a locked
/// axis, or one along which other constraints hold the body, has zeros.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidResponse {
    /// Velocity of the centre of mass per impulse, 1/kg.
    pub linear: DMat3,
    /// Velocity of the centre of mass per angular impulse, 1/(kg m). Its transpose is the angular velocity per impulse.
    pub coupling: DMat3,
    /// Angular velocity per angular impulse, 1/(kg m²).
    pub angular: DMat3,
}

impl RigidResponse {
    /// No response: the body is not moved by impulses.
    pub const ZERO: Self = Self { linear: DMat3::ZERO, coupling: DMat3::ZERO, angular: DMat3::ZERO };

    /// Returns the changes of the velocity of the centre of mass, m/s, and of the angular velocity, rad/s, by an
    /// impulse (N s) and an angular impulse about the centre of mass (N m s).
    #[must_use]
    pub fn change(&self, impulse_ns: DVec3, angular_impulse_nms: DVec3) -> (DVec3, DVec3) {
        (
            self.linear * impulse_ns + self.coupling * angular_impulse_nms,
            self.coupling.transpose() * impulse_ns + self.angular * angular_impulse_nms,
        )
    }

    fn is_finite(&self) -> bool {
        self.linear.is_finite() && self.coupling.is_finite() && self.angular.is_finite()
    }
}

impl std::ops::Mul<f64> for RigidResponse {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            linear: self.linear * factor,
            coupling: self.coupling * factor,
            angular: self.angular * factor,
        }
    }
}

/// Motion of an obstacle during an advance as another solver has computed it, and its response to the body.
///
/// Without impulses of the body other than [`Self::expected_ns`] the obstacle ends at [`Self::position_m`]. Every deviation of the
/// body's impulses from the expected ones, which count as spread evenly over the advance, moves the obstacle away from
/// there. Body and obstacle are solved together, so their masses and stiffness may have any ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoupledMotion {
    /// Position at the end of the advance, m.
    pub position_m: DVec3,
    /// Rotation at the end of the advance.
    pub rotation: DQuat,
    /// Centre of mass in the obstacle's frame, m.
    pub center_m: DVec3,
    /// Change of the velocity of the centre of mass during the advance, m/s. Its path is a parabola.
    pub velocity_change_m_per_s: DVec3,
    /// Change of the angular velocity during the advance, rad/s.
    pub angular_velocity_change_rad_per_s: DVec3,
    /// Impulse of the body that this motion already contains, N s.
    pub expected_ns: DVec3,
    /// Angular impulse of the body about the centre of mass that this motion already contains, N m s.
    pub expected_nms: DVec3,
    /// Response to impulses.
    pub response: RigidResponse,
}

impl CoupledMotion {
    /// Creates the motion to `position_m` (m) and `rotation` at constant velocity, without a response and an expected impulse.
    #[must_use]
    pub fn prescribed(position_m: DVec3, rotation: DQuat) -> Self {
        Self {
            position_m,
            rotation,
            center_m: DVec3::ZERO,
            velocity_change_m_per_s: DVec3::ZERO,
            angular_velocity_change_rad_per_s: DVec3::ZERO,
            expected_ns: DVec3::ZERO,
            expected_nms: DVec3::ZERO,
            response: RigidResponse::ZERO,
        }
    }

    pub(crate) fn validate(&self) -> Result<(), BodyError> {
        for (what, value) in [
            ("centre of mass of an obstacle, m", self.center_m),
            ("change of the velocity of an obstacle, m/s", self.velocity_change_m_per_s),
            ("change of the angular velocity of an obstacle, rad/s", self.angular_velocity_change_rad_per_s),
            ("expected impulse on an obstacle, N s", self.expected_ns),
            ("expected angular impulse on an obstacle, N m s", self.expected_nms),
        ] {
            check(what, value.abs().max_element(), value.is_finite(), "finite")?;
        }
        let is_positive = [self.response.linear, self.response.angular]
            .iter()
            .all(|matrix| matrix.x_axis.x >= 0.0 && matrix.y_axis.y >= 0.0 && matrix.z_axis.z >= 0.0);
        let trace = (0..3).map(|i| self.response.linear.col(i)[i]).sum();
        let is_valid = is_positive && self.response.is_finite();
        check("trace of the response of an obstacle, 1/kg", trace, is_valid, "finite and at least 0")
            .map(drop)
    }
}

/// A coupled obstacle during an advance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Coupled {
    pub(crate) motion: CoupledMotion,
    /// Displacement of the centre of mass from its path, m, and rotation away from it.
    pub(crate) displacement_m: DVec3,
    pub(crate) turn: DQuat,
    /// Velocity of that deviation, m/s and rad/s.
    pub(crate) velocity_m_per_s: DVec3,
    pub(crate) angular_velocity_rad_per_s: DVec3,
    /// Duration of the advance, s.
    pub(crate) duration_s: f64,
}

impl Coupled {
    pub(crate) fn new(motion: CoupledMotion) -> Self {
        Self {
            motion,
            displacement_m: DVec3::ZERO,
            turn: DQuat::IDENTITY,
            velocity_m_per_s: DVec3::ZERO,
            angular_velocity_rad_per_s: DVec3::ZERO,
            duration_s: 0.0,
        }
    }

    /// The pose at the fraction `share` of the way from `from` to `to`, with the deviation of the present step, and the
    /// centre of mass there, m.
    pub(crate) fn pose(&self, from: &Pose, to: &Pose, share: f64) -> (Pose, DVec3) {
        let straight = from.towards(to, share);
        let ends_m = [from, to].map(|pose| pose.place_m(self.motion.center_m));
        // Twice the integral of a constant acceleration, less that of its mean velocity.
        let bend_s = 0.5 * self.duration_s * (share * share - share);
        let center_m = ends_m[0]
            + (ends_m[1] - ends_m[0]) * share
            + bend_s * self.motion.velocity_change_m_per_s
            + self.displacement_m;
        let bent = bend_s * self.motion.angular_velocity_change_rad_per_s;
        let mut rotation = straight.rotation;
        if bent != DVec3::ZERO {
            rotation = DQuat::from_scaled_axis(bent) * rotation;
        }
        if self.turn != DQuat::IDENTITY {
            rotation = (self.turn * rotation).normalize();
        }
        (Pose { position_m: center_m - rotation * self.motion.center_m, rotation }, center_m)
    }

    /// Upper bound of the speed of points within `reach_m` of the centre of mass, m/s, on the way from `from` to `to`.
    pub(super) fn speed_m_per_s(&self, from: &Pose, to: &Pose, reach_m: f64) -> f64 {
        let motion = &self.motion;
        let [start_m, end_m] = [from, to].map(|pose| pose.place_m(motion.center_m));
        let of_path_m = start_m.distance(end_m) + from.angle_to(to) * reach_m;
        let of_path = if self.duration_s > 0.0 { of_path_m / self.duration_s } else { 0.0 };
        let of_bend = motion.velocity_change_m_per_s.length()
            + motion.angular_velocity_change_rad_per_s.length() * reach_m;
        let of_deviation =
            self.velocity_m_per_s.length() + self.angular_velocity_rad_per_s.length() * reach_m;
        of_path + 0.5 * of_bend + of_deviation
    }
}
