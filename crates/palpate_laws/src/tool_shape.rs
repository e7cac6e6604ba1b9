//! The shape of a tool.

use crate::LawError;
use glam::DVec3;

/// Rigid shape of the part of a tool that touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolShape {
    /// A ball around the tool's position.
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// The flat end of a cylinder: a disc around the tool's position. The cylinder extends behind it.
    FlatPunch {
        /// Radius, m.
        radius_m: f64,
        /// Unit vector along the cylinder, in the direction in which it presses.
        axis: DVec3,
    },
}

impl ToolShape {
    /// Checks radius and axis.
    ///
    /// # Errors
    /// [`LawError::Radius`] if the radius is not finite or not above 0, [`LawError::Normal`] if the axis is not a
    /// unit vector.
    pub fn validate(&self) -> Result<(), LawError> {
        let radius_m = self.radius_m();
        if !(radius_m.is_finite() && radius_m > 0.0) {
            return Err(LawError::Radius(radius_m));
        }
        match self {
            Self::FlatPunch { axis, .. } if !axis.is_normalized() => Err(LawError::Normal(axis.length())),
            _ => Ok(()),
        }
    }

    /// Radius, m.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        match *self {
            Self::Sphere { radius_m } | Self::FlatPunch { radius_m, .. } => radius_m,
        }
    }

    /// A point well inside the tool at `center_m`, m, and outside of any body that it touches.
    #[must_use]
    pub fn core_m(&self, center_m: DVec3) -> DVec3 {
        match *self {
            Self::Sphere { .. } => center_m,
            Self::FlatPunch { radius_m, axis } => center_m - radius_m * axis,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_invalid_radius_and_axis() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(ToolShape::Sphere { radius_m: bad }.validate(), Err(LawError::Radius(_))));
        }
        let long = ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::Z * 2.0 };
        assert_eq!(long.validate(), Err(LawError::Normal(2.0)));
        assert!(ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::NAN }.validate().is_err());
        assert_eq!(ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::X }.validate(), Ok(()));
    }
}
