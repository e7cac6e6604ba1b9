//! A closed surface of triangles.

use glam::DVec3;

/// A closed surface of triangles that face outward.
pub(super) struct ClosedSurface {
    pub points_m: Vec<DVec3>,
    pub triangles: Vec<[usize; 3]>,
}
