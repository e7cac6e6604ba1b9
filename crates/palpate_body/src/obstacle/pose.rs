//! Position and rotation of an obstacle.

use crate::BodyError;
use crate::error::check;
use glam::{DQuat, DVec3};

/// Position and rotation of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    pub(crate) position_m: DVec3,
    pub(crate) rotation: DQuat,
}

/// Deviation of the length of a quaternion from 1 up to which it counts as a rotation.
const ROTATION_TOLERANCE: f64 = 1e-3;

impl Pose {
    /// Creates a pose and normalises its rotation.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the position is not finite or the rotation is not a unit quaternion within 0.001.
    pub(crate) fn new(position_m: DVec3, rotation: DQuat) -> Result<Self, BodyError> {
        let far = position_m.abs().max_element();
        check("position of an obstacle, m", far, position_m.is_finite(), "finite")?;
        let length = rotation.length();
        let is_unit = (length - 1.0).abs() < ROTATION_TOLERANCE;
        check("length of the rotation of an obstacle", length, is_unit, "1 within 0.001")?;
        Ok(Self { position_m, rotation: normalized(rotation) })
    }

    pub(crate) fn at(position_m: DVec3) -> Self {
        Self { position_m, rotation: DQuat::IDENTITY }
    }

    /// Transforms a point from the obstacle's frame.
    pub(crate) fn place_m(&self, local_m: DVec3) -> DVec3 {
        self.rotation * local_m + self.position_m
    }

    /// Transforms a point into the obstacle's frame.
    pub(crate) fn local_m(&self, place_m: DVec3) -> DVec3 {
        self.rotation.conjugate() * (place_m - self.position_m)
    }

    /// The pose at the fraction `share` of the way to `to`: linear in the position, at constant angular velocity along
    /// the shorter arc in the rotation.
    pub(crate) fn towards(&self, to: &Self, share: f64) -> Self {
        if share <= 0.0 {
            return *self;
        }
        if share >= 1.0 {
            return *to;
        }
        Self {
            position_m: self.position_m + (to.position_m - self.position_m) * share,
            rotation: normalized(self.rotation.slerp(to.rotation, share)),
        }
    }

    /// Displacement by the motion to `to` of the material point that is at `place_m` before it, m.
    pub(crate) fn displacement_m(&self, to: &Self, place_m: DVec3) -> DVec3 {
        if self.rotation == to.rotation {
            return to.position_m - self.position_m;
        }
        to.place_m(self.local_m(place_m)) - place_m
    }

    /// Upper bound of the displacement by the motion to `to` of points within `radius_m` of `center_m`, m.
    pub(crate) fn max_displacement_m(&self, to: &Self, center_m: DVec3, radius_m: f64) -> f64 {
        let arm_m = (center_m - self.position_m).length() + radius_m;
        (to.position_m - self.position_m).length() + self.angle_to(to) * arm_m
    }

    /// Angle between the rotations, rad.
    pub(crate) fn angle_to(&self, to: &Self) -> f64 {
        if self.rotation == to.rotation {
            return 0.0;
        }
        let turn = to.rotation * self.rotation.conjugate();
        2.0 * turn.xyz().length().atan2(turn.w.abs())
    }
}

/// The unit quaternion. The bits of a quaternion whose squared length is 1 stay.
fn normalized(rotation: DQuat) -> DQuat {
    if rotation.length_squared() == 1.0 { rotation } else { rotation.normalize() }
}
