//! Regions of space for tissue and fixed nodes.

use crate::Face;
use glam::DVec3;
use std::sync::Arc;

/// A region of space in the coordinates of the mesh or lattice.
#[derive(Clone)]
#[non_exhaustive]
pub enum Region {
    /// A ball.
    Sphere {
        /// Centre, m.
        center_m: DVec3,
        /// Radius, m.
        radius_m: f64,
    },
    /// An axis-aligned box.
    Cuboid {
        /// Centre, m.
        center_m: DVec3,
        /// Half of its size, m.
        half_m: DVec3,
    },
    /// All points within a radius of a line segment.
    Capsule {
        /// One end of the segment, m.
        from_m: DVec3,
        /// Other end of the segment, m.
        to_m: DVec3,
        /// Radius, m.
        radius_m: f64,
    },
    /// One side of a plane.
    HalfSpace {
        /// A point of the plane, m.
        point_m: DVec3,
        /// Normal of the plane away from the region, of any length.
        outward: DVec3,
    },
    /// A region defined by a function; see [`Region::from_fn`].
    Where(Arc<dyn Fn(DVec3) -> bool + Send + Sync>),
}

impl Region {
    /// Creates the region where `inside` returns true for a position in m.
    pub fn from_fn(inside: impl Fn(DVec3) -> bool + Send + Sync + 'static) -> Self {
        Self::Where(Arc::new(inside))
    }

    /// Creates the region within `depth_m` of the side `face` of the box from `bounds_m[0]` to `bounds_m[1]`, m, and all that lies
    /// beyond that side.
    #[must_use]
    pub fn layer(bounds_m: [DVec3; 2], face: Face, depth_m: f64) -> Self {
        let inward = -face.normal();
        let at_m = bounds_m[usize::from(face.is_positive())];
        Self::HalfSpace { point_m: at_m + depth_m * inward, outward: inward }
    }

    /// Whether `place_m` is in the region, including its boundary.
    #[must_use]
    pub fn contains(&self, place_m: DVec3) -> bool {
        match self {
            Self::Sphere { center_m, radius_m } => center_m.distance(place_m) <= *radius_m,
            Self::Cuboid { center_m, half_m } => (place_m - *center_m).abs().cmple(*half_m).all(),
            Self::Capsule { from_m, to_m, radius_m } => {
                let along = *to_m - *from_m;
                let share = (place_m - *from_m).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
                (*from_m + share.clamp(0.0, 1.0) * along).distance(place_m) <= *radius_m
            }
            Self::HalfSpace { point_m, outward } => (place_m - *point_m).dot(*outward) <= 0.0,
            Self::Where(inside) => inside(place_m),
        }
    }
}

impl std::fmt::Debug for Region {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Sphere { center_m, radius_m } => write!(f, "Sphere({center_m}, {radius_m})"),
            Self::Cuboid { center_m, half_m } => write!(f, "Cuboid({center_m}, {half_m})"),
            Self::Capsule { from_m, to_m, radius_m } => write!(f, "Capsule({from_m}, {to_m}, {radius_m})"),
            Self::HalfSpace { point_m, outward } => write!(f, "HalfSpace({point_m}, {outward})"),
            Self::Where(_) => f.write_str("Where(..)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layer_extends_from_its_side_to_its_depth() {
        let bounds_m = [DVec3::splat(-1.0), DVec3::splat(2.0)];
        for face in Face::ALL {
            let layer = Region::layer(bounds_m, face, 0.3);
            let side = if face.is_positive() { 2.0 } else { 1.0 };
            assert!(
                layer.contains((side - 0.299) * face.normal()) && layer.contains(99.0 * face.normal()),
                "{face:?}"
            );
            assert!(!layer.contains((side - 0.301) * face.normal()), "{face:?}");
        }
    }

    #[test]
    fn places_on_either_side_of_each_boundary() {
        let regions = [
            Region::Sphere { center_m: DVec3::X, radius_m: 0.5 },
            Region::Cuboid { center_m: DVec3::X, half_m: DVec3::new(0.5, 2.0, 2.0) },
            Region::Capsule { from_m: DVec3::new(0.6, 0.0, 0.0), to_m: DVec3::X, radius_m: 0.1 },
            Region::HalfSpace { point_m: 0.5 * DVec3::X, outward: -3.0 * DVec3::X },
            Region::from_fn(|x| x.x >= 0.5),
        ];
        for region in regions {
            assert!(region.contains(DVec3::X * 0.501), "{region:?}");
            assert!(!region.contains(DVec3::X * 0.499), "{region:?}");
        }
        let point = Region::Capsule { from_m: DVec3::ZERO, to_m: DVec3::ZERO, radius_m: 1.0 };
        assert!(point.contains(0.9 * DVec3::Z) && !point.contains(1.1 * DVec3::Z));
    }
}
