//! The touchable surface of a body.

mod contact_surface;
mod orient;
mod partial_cells;
mod surface_tree;

pub use contact_surface::ContactSurface;
pub(crate) use contact_surface::PlacedSurface;
pub(crate) use partial_cells::PartialCells;
pub use surface_tree::{ClosestPoint, SurfaceTree};

use crate::error::check;
use crate::{BodyError, BodyPoint};
use palpate_laws::POINT_NODES;

/// A triangulated surface of a body. Every point of it is a node, or a weighted sum over the nodes of the cell in
/// which it is embedded.
///
/// Several vertices may share a point: the faces of a block do not share vertices, which keeps its drawn edges sharp.
/// The adjacency of triangles is defined by points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Points of the surface.
    pub points: Vec<BodyPoint>,
    /// Index of the point of each vertex.
    pub vertices: Vec<usize>,
    /// Triangles as indices into `vertices`, counter-clockwise as seen from outside. [`crate::Body::new`] flips
    /// others.
    pub triangles: Vec<[usize; 3]>,
}

impl Surface {
    /// Indices of the points of a triangle.
    ///
    /// # Panics
    /// If the triangle does not exist.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [usize; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex])
    }

    /// Rejects indices of nodes, points and vertices that do not exist.
    pub(crate) fn validate(&self, nodes: usize) -> Result<(), BodyError> {
        for point in &self.points {
            point.validate(nodes)?;
            let count = point.nodes().len();
            check("nodes of a point of the surface", count as f64, count <= POINT_NODES, "at most 8")?;
        }
        let beyond = |mut indices: Box<dyn Iterator<Item = &usize> + '_>, below: usize| {
            indices.find(|&&index| index >= below).map(|&index| BodyError::Surface { index, below })
        };
        let vertices = beyond(Box::new(self.vertices.iter()), self.points.len());
        let triangles = beyond(Box::new(self.triangles.iter().flatten()), self.vertices.len());
        vertices.or(triangles).map_or(Ok(()), Err)
    }
}
