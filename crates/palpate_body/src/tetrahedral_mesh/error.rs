//! Errors of meshes of tetrahedra.

use thiserror::Error;

/// Reason why a mesh of tetrahedra cannot become a body.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum TetrahedralMeshError {
    /// An element refers to a vertex that does not exist.
    #[error("element {element} has vertex {vertex}, but there are only {vertices} vertices (0 to {})", .vertices.saturating_sub(1))]
    Vertex {
        /// Index of the element.
        element: usize,
        /// Index of the vertex.
        vertex: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// The position of a vertex is not finite.
    #[error("the position of vertex {vertex} is not finite")]
    Position {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The list of regions does not have one entry for each element.
    #[error(
        "the list of regions has {found} entries for {elements} elements; it must have one for each, or none"
    )]
    Regions {
        /// Length of the list.
        found: usize,
        /// Number of elements.
        elements: usize,
    },
    /// No element has a volume.
    #[error("none of the {elements} elements has a volume; a body needs at least one")]
    NoVolume {
        /// Number of elements given.
        elements: usize,
    },
    /// An element inside the mesh is flat.
    #[error(
        "element {element} is flat (mean ratio {quality:e}) and cannot be left out without a gap; remesh the volume around it"
    )]
    Flat {
        /// Index of the element.
        element: usize,
        /// Mean ratio, 1 for a regular tetrahedron.
        quality: f64,
    },
}
