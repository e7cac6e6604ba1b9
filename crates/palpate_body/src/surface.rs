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

/// A triangulated surface that a body carries: every point of it is a node, or Σ w_i x_i over the nodes of the cell that it is
/// embedded in.
///
/// A point can be several vertices: a block's faces do not share theirs, so that its edges stay sharp when it is drawn.
/// Triangles count as neighbours by their points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Its points.
    pub points: Vec<BodyPoint>,
    /// The point at each vertex.
    pub vertices: Vec<usize>,
    /// Triangles as indices into `vertices`, counter-clockwise seen from outside. [`crate::Body::new`] turns those that are not.
    pub triangles: Vec<[usize; 3]>,
}

impl Surface {
    /// The points of a triangle.
    ///
    /// # Panics
    /// When there is no such triangle.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [usize; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex])
    }

    /// Refuses indices beyond `nodes` nodes, the points or the vertices.
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
