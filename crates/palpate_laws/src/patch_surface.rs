//! A triangulated surface and places on it.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use glam::DVec3;

/// Most nodes that carry a point of a surface: those of a cell.
pub const POINT_NODES: usize = 8;

/// What is across an edge of a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Neighbour {
    /// The triangle beside it, if there is one.
    pub triangle: Option<u32>,
    /// Whether the surface has a sharp edge there at rest.
    pub is_crease: bool,
}

/// A triangulated surface where it is now.
pub trait PatchSurface {
    /// Where the corners of a triangle are, m, counter-clockwise seen from outside; `None` where there is no such triangle.
    fn corners_m(&self, triangle: usize) -> Option<[DVec3; 3]>;

    /// What is across the edges from corner 0 to 1, 1 to 2 and 2 to 0.
    fn neighbours(&self, triangle: usize) -> [Neighbour; 3];

    /// Where a place is, m; `None` where there is no such triangle.
    fn place_m(&self, place: SurfacePlace) -> Option<DVec3> {
        self.corners_m(place.triangle).map(|corners_m| weighted(place.weights, corners_m))
    }
}

/// A place on a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePlace {
    /// The triangle.
    pub triangle: usize,
    /// The weights of its corners, at least 0, which sum to 1.
    pub weights: [f64; 3],
}

pub(crate) fn weighted(weights: [f64; 3], [a, b, c]: [DVec3; 3]) -> DVec3 {
    let [u, v, w] = weights;
    u * a + v * b + w * c
}
