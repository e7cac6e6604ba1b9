//! Faces and regions of a body, in its own frame.

use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{BodyError, Region};

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
    /// A part of a mesh, as an index of [`MeshShape::parts`](crate::MeshShape::parts), which defines its region; of a volume of tetrahedra its
    /// region with this index.
    Part(usize),
    /// The points on one side of a plane.
    HalfSpace {
        /// A point of the plane, m.
        point_m: DVec3,
        /// Normal of the plane, out of the region, of any length.
        outward: DVec3,
    },
}

impl BodyRegion {
    /// The region of a body whose mesh has the regions `parts`.
    pub(crate) fn of(self, parts: &[Region]) -> Result<Region, BodyError> {
        Ok(match self {
            Self::Sphere { center_m, radius_m } => Region::Sphere { center_m, radius_m },
            Self::Cuboid { center_m, half_m } => Region::Cuboid { center_m, half_m },
            Self::Capsule { from_m, to_m, radius_m } => Region::Capsule { from_m, to_m, radius_m },
            Self::HalfSpace { point_m, outward } => Region::HalfSpace { point_m, outward },
            Self::Part(index) => parts.get(index).cloned().ok_or(BodyError::Parameter {
                what: "index in BodyRegion::Part",
                value: index as f64,
                allowed: "below the number of MeshShape::parts; a block has none",
            })?,
        })
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
