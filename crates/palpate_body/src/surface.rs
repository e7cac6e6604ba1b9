//! The touchable surface of a body.

mod closest;

pub use closest::{ClosestPoint, SurfaceTree};

use crate::BodyError;

/// A triangulated surface whose vertices are nodes.
///
/// A node can be several vertices: a block's faces do not share theirs, so that its edges stay sharp when it is drawn.
/// Triangles count as neighbours by their nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// The node at each vertex.
    pub vertices: Vec<usize>,
    /// Triangles as indices into `vertices`, counter-clockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
}

impl Surface {
    /// Refuses indices beyond `nodes` nodes or the vertices.
    pub(crate) fn validate(&self, nodes: usize) -> Result<(), BodyError> {
        let beyond = |mut indices: Box<dyn Iterator<Item = &usize> + '_>, below: usize| {
            indices.find(|&&index| index >= below).map(|&index| BodyError::Surface { index, below })
        };
        let vertices = beyond(Box::new(self.vertices.iter()), nodes);
        let triangles = beyond(Box::new(self.triangles.iter().flatten()), self.vertices.len());
        vertices.or(triangles).map_or(Ok(()), Err)
    }
}
