//! A triangulated surface and places on it.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use glam::DVec3;

/// Maximum number of nodes that carry a point of a surface: the corners of a cell.
pub const POINT_NODES: usize = 8;

/// The neighbour across an edge of a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Neighbour {
    /// Index of the adjacent triangle, if there is one.
    pub triangle: Option<u32>,
    /// Whether the edge is sharp at rest.
    pub is_crease: bool,
}

/// A triangulated surface in its current shape.
pub trait PatchSurface {
    /// Corners of a triangle, m, counter-clockwise as seen from outside; `None` for an invalid index.
    fn corners_m(&self, triangle: usize) -> Option<[DVec3; 3]>;

    /// Neighbours across the edges from corner 0 to 1, 1 to 2 and 2 to 0.
    fn neighbours(&self, triangle: usize) -> [Neighbour; 3];

    /// Position of a place, m; `None` for an invalid index.
    fn place_m(&self, place: SurfacePlace) -> Option<DVec3> {
        self.corners_m(place.triangle).map(|corners_m| weighted(place.weights, corners_m))
    }
}

/// A place on a triangle in barycentric coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePlace {
    /// Index of the triangle.
    pub triangle: usize,
    /// Weights of the corners; they are at least 0 and sum to 1.
    pub weights: [f64; 3],
}

pub(crate) fn weighted(weights: [f64; 3], [a, b, c]: [DVec3; 3]) -> DVec3 {
    let [u, v, w] = weights;
    u * a + v * b + w * c
}
