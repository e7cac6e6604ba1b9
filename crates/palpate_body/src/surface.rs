//! The touchable surface of a body.

mod closest;

pub use closest::{ClosestPoint, SurfaceTree};

use crate::BodyError;
use glam::{DQuat, DVec3};

/// A triangulated surface whose vertices are nodes, and the surface nodes with their outward normals.
///
/// A node can be several vertices: a block's faces do not share theirs, so that its edges stay sharp.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// The node at each vertex.
    pub vertices: Vec<usize>,
    /// Triangles as indices into `vertices`, counter-clockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
    /// Each surface node once.
    pub nodes: Vec<SurfaceNode>,
    /// How far from a surface node, along the surface, a tool still touches that node, m.
    pub reach_m: f64,
}

/// A node of the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceNode {
    /// The node.
    pub node: usize,
    /// Outward unit normals, at rest, of the faces that meet there: one inside a face, two on an edge, three at a
    /// corner of a block. A tool is outside if it is outside of one of them.
    pub normals: Vec<DVec3>,
}

impl Surface {
    /// Refuses indices beyond `nodes` nodes or the vertices, and normals that are not of unit length.
    pub(crate) fn validate(&self, nodes: usize) -> Result<(), BodyError> {
        let of_nodes = self.vertices.iter().chain(self.nodes.iter().map(|n| &n.node)).copied();
        let of_vertices = self.triangles.iter().flatten().copied();
        for (mut indices, below) in [
            (Box::new(of_nodes) as Box<dyn Iterator<Item = usize>>, nodes),
            (Box::new(of_vertices), self.vertices.len()),
        ] {
            if let Some(index) = indices.find(|&index| index >= below) {
                return Err(BodyError::Surface { index, below });
            }
        }
        let length = |n: &DVec3| n.length();
        let bad = self
            .nodes
            .iter()
            .flat_map(|n| &n.normals)
            .map(length)
            .find(|l| l.is_nan() || (l - 1.0).abs() > 1e-6);
        match bad {
            Some(length) => {
                Err(BodyError::Parameter { what: "length of a surface normal", value: length, allowed: "1" })
            }
            None => Ok(()),
        }
    }

    /// Turns every normal.
    pub(crate) fn turn(&mut self, rotation: DQuat) {
        self.nodes.iter_mut().flat_map(|n| &mut n.normals).for_each(|n| *n = rotation * *n);
    }
}
