//! The shape of a tool.

use crate::LawError;
use glam::DVec3;

/// The part of a tool that touches, rigid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolShape {
    /// A ball round the tool's position.
    Sphere {
        /// Its radius, m.
        radius_m: f64,
    },
    /// A flat disc round the tool's position, the end of a cylinder: everything behind it is tool.
    FlatPunch {
        /// Its radius, m.
        radius_m: f64,
        /// Unit vector along the cylinder, the way it presses.
        axis: DVec3,
    },
}

impl ToolShape {
    /// Refuses a shape that makes no sense.
    ///
    /// # Errors
    /// [`LawError::Radius`] when the radius is not finite and above 0, [`LawError::Normal`] when the axis is not of unit
    /// length.
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

    /// A point that is well inside the tool when the tool is at `center_m`, and outside of any body it touches.
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
    fn tools_that_make_no_sense_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(ToolShape::Sphere { radius_m: bad }.validate(), Err(LawError::Radius(_))));
        }
        let long = ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::Z * 2.0 };
        assert_eq!(long.validate(), Err(LawError::Normal(2.0)));
        assert!(ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::NAN }.validate().is_err());
        assert_eq!(ToolShape::FlatPunch { radius_m: 1.0, axis: DVec3::X }.validate(), Ok(()));
    }
}
