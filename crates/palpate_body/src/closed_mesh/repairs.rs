//! Repairs of a mesh.

/// Repairs of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshRepairs {
    /// Number of vertices that coincided with another.
    pub welded: usize,
    /// Number of degenerate triangles.
    pub collapsed: usize,
    /// Number of repeated triangles.
    pub duplicates: usize,
    /// Number of triangles omitted together with their opposite.
    pub back_to_back: usize,
    /// Number of flipped triangles.
    pub turned: usize,
    /// Number of edges with four or more triangles.
    pub pinched_edges: usize,
}
