//! Limits shared by types and their errors.

/// Maximum number of nodes along one side of a block.
pub(crate) const MAX_NODES_PER_SIDE: usize = 128;
/// Minimum length of the longest side of a mesh, m.
pub(crate) const MIN_MESH_SIZE_M: f64 = 1e-3;
/// Maximum length of the longest side of a mesh, m.
pub(crate) const MAX_MESH_SIZE_M: f64 = 10.0;
/// Maximum number of cells along the longest side of a mesh.
pub(crate) const MAX_CELLS_ALONG: usize = 127;
/// Maximum number of triangles of a mesh.
pub(crate) const MAX_MESH_TRIANGLES: usize = 2_000_000;
