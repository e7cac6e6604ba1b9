//! Faces and regions of a body, in its own frame.

use bevy::prelude::*;
use glam::DVec3;

/// A side of a body, in its own frame, named as in Bevy: y is up, −z is forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum BoxFace {
    /// −x.
    Left,
    /// +x.
    Right,
    /// −y.
    Bottom,
    /// +y.
    Top,
    /// −z.
    Front,
    /// +z.
    Back,
}

/// A region of space in a body's own frame, m.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub enum BodyRegion {
    /// A solid sphere.
    Sphere {
        /// Centre of the sphere, m.
        center_m: DVec3,
        /// Radius of the sphere, m.
        radius_m: f64,
    },
    /// A box along the axes.
    Cuboid {
        /// Centre of the box, m.
        center_m: DVec3,
        /// Half of the side lengths, m.
        half_m: DVec3,
    },
    /// The points within a radius of a line segment.
    Capsule {
        /// One end of the segment, m.
        from_m: DVec3,
        /// The other end, m.
        to_m: DVec3,
        /// Radius of the capsule, m.
        radius_m: f64,
    },
    /// The points on one side of a plane.
    HalfSpace {
        /// A point of the plane, m.
        point_m: DVec3,
        /// Normal of the plane, out of the region, of any length.
        outward: DVec3,
    },
}

impl From<BodyRegion> for palpate_body::Region {
    fn from(region: BodyRegion) -> Self {
        match region {
            BodyRegion::Sphere { center_m, radius_m } => Self::Sphere { center_m, radius_m },
            BodyRegion::Cuboid { center_m, half_m } => Self::Cuboid { center_m, half_m },
            BodyRegion::Capsule { from_m, to_m, radius_m } => Self::Capsule { from_m, to_m, radius_m },
            BodyRegion::HalfSpace { point_m, outward } => Self::HalfSpace { point_m, outward },
        }
    }
}

impl From<BoxFace> for palpate_body::Face {
    fn from(face: BoxFace) -> Self {
        match face {
            BoxFace::Left => Self::NegX,
            BoxFace::Right => Self::PosX,
            BoxFace::Bottom => Self::NegY,
            BoxFace::Top => Self::PosY,
            BoxFace::Front => Self::NegZ,
            BoxFace::Back => Self::PosZ,
        }
    }
}
