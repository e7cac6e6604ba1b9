//! Checks and measurements of a mesh before any computation.

use super::MeshError;
use crate::implausible_size::common_factor;
use crate::limits::{MAX_MESH_SIZE_M, MAX_MESH_TRIANGLES, MIN_MESH_SIZE_M};
use glam::DVec3;

/// Coordinates beyond this, m, have no digits left for a body.
const MAX_COORDINATE_M: f64 = 1e15;

/// Distance of neighbouring coordinates relative to the size, beyond which a mesh has lost its digits.
const MAX_LOST: f64 = 1e-3;

/// Measurements of a mesh before any computation.
pub(super) struct Measured {
    /// Bounds of the vertices in use.
    pub bounds_m: (DVec3, DVec3),
    /// Whether all coordinates in use are single-precision numbers.
    pub is_single: bool,
}

impl Measured {
    /// Checks indices and coordinates, and measures the mesh.
    pub(super) fn of(vertices_m: &[DVec3], triangles: &[[usize; 3]]) -> Result<Self, MeshError> {
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        let most = MAX_MESH_TRIANGLES;
        for (what, found, most) in
            [("triangles", triangles.len(), most), ("vertices", vertices_m.len(), 3 * most)]
        {
            if found > most {
                return Err(MeshError::TooLarge { what, found, most });
            }
        }
        let vertices = vertices_m.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|vertex| **vertex >= vertices) {
                return Err(MeshError::Index { triangle, vertex, vertices });
            }
        }
        let taken = |x: &DVec3| x.is_finite() && x.abs().max_element() < MAX_COORDINATE_M;
        if let Some(vertex) = vertices_m.iter().position(|x| !taken(x)) {
            return Err(MeshError::NotFinite { vertex });
        }
        let (mut low, mut high, mut is_single) = (DVec3::INFINITY, DVec3::NEG_INFINITY, true);
        for &vertex in triangles.iter().flatten() {
            let x = vertices_m[vertex];
            (low, high) = (low.min(x), high.max(x));
            is_single &= x.as_vec3().as_dvec3() == x;
        }
        Ok(Self { bounds_m: (low, high), is_single })
    }

    pub(super) fn size_m(&self) -> f64 {
        (self.bounds_m.1 - self.bounds_m.0).max_element()
    }

    /// The error of closing the mesh, whose coordinates are `grid_m` apart: with few digits, holes, slivers and intersections are their
    /// consequence.
    pub(super) fn reason(&self, error: MeshError, grid_m: f64) -> MeshError {
        if grid_m > MAX_LOST * self.size_m().max(MIN_MESH_SIZE_M) {
            return MeshError::LostDigits { distance_m: self.distance_m(), grid_m };
        }
        error
    }

    /// Maximum absolute coordinate, m.
    pub(super) fn distance_m(&self) -> f64 {
        let (low, high) = self.bounds_m;
        low.abs().max(high.abs()).max_element()
    }
}

/// Rejects a mesh whose longest side is `size_m`, centred at `center_m`, outside the range of sizes.
///
/// # Errors
/// [`MeshError::Size`], [`MeshError::Flat`].
pub(super) fn check_size(size_m: f64, center_m: DVec3) -> Result<(), MeshError> {
    if (MIN_MESH_SIZE_M..=MAX_MESH_SIZE_M).contains(&size_m) {
        return Ok(());
    }
    if size_m < 1e-12 {
        return Err(MeshError::Flat { at_m: center_m });
    }
    Err(MeshError::Size { size_m, factor: common_factor(size_m) })
}
