//! Errors of a mesh, with remedies.

use glam::DVec3;
use thiserror::Error;

/// Reason why a mesh cannot become a body. Positions are in the coordinates of the mesh, m.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MeshError {
    /// The mesh has no triangles.
    #[error("the mesh has no triangles; give it a closed surface")]
    Empty,
    /// The mesh has too many triangles or vertices.
    #[error("the mesh has {found} {what}; it must have at most {most}: decimate it")]
    TooLarge {
        /// "triangles" or "vertices".
        what: &'static str,
        /// Number given.
        found: usize,
        /// Maximum number.
        most: usize,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error(
        "triangle {triangle} refers to vertex {vertex}; it must be below {vertices}: check whether both lists belong to one mesh"
    )]
    Index {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the vertex.
        vertex: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A coordinate of a vertex is not finite or too large.
    #[error(
        "the position of vertex {vertex} is not a finite number below 1e15 m: repair it, or export the mesh again"
    )]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The mesh is too small or too large, probably because of its units.
    #[error(
        "the mesh is {size_m} m long; it must be {least} m to {most} m: scale it by `metres_per_unit` (--scale), for example by {factor}",
        least = crate::limits::MIN_MESH_SIZE_M,
        most = crate::limits::MAX_MESH_SIZE_M
    )]
    Size {
        /// Longest side, m.
        size_m: f64,
        /// A factor that gives a body of a common size.
        factor: f64,
    },
    /// At this distance from the origin, single-precision coordinates cannot distinguish the vertices.
    #[error(
        "the mesh is {distance_m} m from the origin, where its single-precision vertices are {grid_m} m apart: move it \
         to the origin before it is saved, and place the body instead"
    )]
    LostDigits {
        /// Distance from the origin, m.
        distance_m: f64,
        /// Spacing of single-precision numbers there, m.
        grid_m: f64,
    },
    /// At this distance from the origin, single-precision coordinates are too coarse for the cells.
    #[error(
        "the mesh is {distance_m} m from the origin, where its single-precision vertices are {grid_m:.1e} m apart, more than a \
         hundredth of a cell of {cell_m} m: move it to the origin before it is saved, and place the body instead"
    )]
    CoarseGrid {
        /// Distance from the origin, m.
        distance_m: f64,
        /// Spacing of single-precision numbers there, m.
        grid_m: f64,
        /// Side of a cell, m.
        cell_m: f64,
    },
    /// A part has no thickness.
    #[error(
        "the mesh has no thickness at {at_m:.4}: give it a volume (a solidify or shell modifier), or remove that part"
    )]
    Flat {
        /// Position on the part, m.
        at_m: DVec3,
    },
    /// The mesh has no inside: its winding number is below 1/2 everywhere.
    #[error(
        "the mesh encloses nothing that is thicker than {spacing_m:.2e} m: it is a sheet, or has thinner walls; set \
         `thickness_m` (--thickness-m), which makes its open parts sheets"
    )]
    NoInside {
        /// Distance between samples of the winding number, m.
        spacing_m: f64,
    },
    /// The thickness of sheets is out of range.
    #[error(
        "the thickness of the open parts of the mesh is {thickness_m} m; it must be more than a thousandth of the longest side and at most \
         the longest side, {size_m} m: change `thickness_m` (--thickness-m)"
    )]
    Thickness {
        /// The thickness, m.
        thickness_m: f64,
        /// Longest side, m.
        size_m: f64,
    },
    /// Some edges have only one triangle.
    #[error(
        "the mesh has holes: {edges} edges have one triangle only, one of them at {at_m:.4}; fill them, or join the mesh with its other parts"
    )]
    Holes {
        /// Number of edges.
        edges: usize,
        /// Midpoint of one of them, m.
        at_m: DVec3,
    },
    /// Some edges have more than two triangles and leave the inside undefined.
    #[error(
        "{edges} edges have more than two triangles, one of them at {at_m:.4}; remove inner walls and separate parts that \
         share an edge"
    )]
    NonManifold {
        /// Number of edges.
        edges: usize,
        /// Midpoint of one of them, m.
        at_m: DVec3,
    },
    /// The mesh is one-sided: neighbouring triangles cannot be made consistent.
    #[error(
        "the mesh is one-sided like a Klein bottle, at {at_m:.4}; cut it open and close it around a volume"
    )]
    OneSided {
        /// Position of an inconsistency, m.
        at_m: DVec3,
    },
    /// Triangles intersect.
    #[error(
        "the mesh passes through itself: {pairs} pairs of triangles cross, one of them at {at_m:.4}; unite the parts (a boolean \
         union or a voxel remesh)"
    )]
    Crossing {
        /// Number of pairs found before the search ended.
        pairs: usize,
        /// Position of one intersection, m.
        at_m: DVec3,
    },
    /// Too many triangles overlap for the intersection test.
    #[error(
        "the triangles are so long and close that more than {pairs} pairs would have to be tested; remesh with triangles of \
         even size"
    )]
    Tangled {
        /// Number of pairs after which the test ended.
        pairs: usize,
    },
    /// A closed surface lies inside another with the same orientation.
    #[error(
        "a closed surface at {at_m:.4} lies inside another and faces the same way: invert it for a cavity, or \
         remove it and give that region another tissue"
    )]
    Nested {
        /// Position on it, m.
        at_m: DVec3,
    },
    /// A list does not have one entry for each vertex.
    #[error("{what} has {found} entries for {vertices} vertices; it must have exactly one for each")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Length of the list.
        found: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// The number of cells along the longest side is out of range.
    #[error(
        "cells of {cell_m} m make {cells} along the longest side of the mesh, {size_m} m; it must be 1 to {most}",
        most = crate::limits::MAX_CELLS_ALONG
    )]
    Cells {
        /// Side of a cell, m.
        cell_m: f64,
        /// Number of cells along the longest side.
        cells: f64,
        /// Longest side, m.
        size_m: f64,
    },
    /// The body would have too many nodes.
    #[error(
        "{along} cells along the longest side make a body of {nodes} nodes; it must have at most {most}: use {advised} cells \
         along it"
    )]
    TooManyNodes {
        /// Number of cells along the longest side.
        along: usize,
        /// Number of nodes that they would create.
        nodes: usize,
        /// Maximum number of nodes, [`crate::CellLattice::MAX_NODES`].
        most: usize,
        /// Number of cells along the longest side that stays below it.
        advised: usize,
    },
    /// The mesh consists of pieces that are not connected.
    #[error(
        "the mesh is in {pieces} pieces that are not connected, one at {at_m:.4}: select one, make a body of each, or allow separate parts (`allow_unconstrained`, or `FixedRegion::None` of a component)"
    )]
    Pieces {
        /// Number of pieces.
        pieces: usize,
        /// Centre of a cell of the smallest piece, m.
        at_m: DVec3,
    },
    /// The selected piece does not exist.
    #[error(
        "piece {index} of the mesh is selected; it has {count} pieces, with indices from 0: change `pieces` (--piece)"
    )]
    Piece {
        /// Index of the piece.
        index: usize,
        /// Number of pieces.
        count: usize,
    },
    /// A region contains no part of the body.
    #[error(
        "{what} {index} contains no part of the body, whose cells are {cell_m} m wide; move it, enlarge it or use smaller cells"
    )]
    EmptyRegion {
        /// Kind of the region.
        what: &'static str,
        /// Index among the regions of its kind.
        index: usize,
        /// Side of a cell, m.
        cell_m: f64,
    },
}
