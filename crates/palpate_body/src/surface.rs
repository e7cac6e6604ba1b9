//! The touchable surface of a body.

use glam::DVec3;

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
    pub nodes: Vec<usize>,
    /// Outward unit normal at rest of each entry of `nodes`.
    pub normals: Vec<DVec3>,
    /// How far from a surface node, along the surface, a tool still touches that node, m.
    pub reach_m: f64,
}
