//! What can be wrong with a mesh, and what to do about it.

use glam::DVec3;
use thiserror::Error;

/// Why a mesh could not become a body. Places are in the mesh's own coordinates, m.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MeshError {
    /// Nothing to make a body of.
    #[error("the mesh has no triangles; give it a closed surface")]
    Empty,
    /// More triangles or vertices than are taken.
    #[error("the mesh has {found} {what}; at most {most} are taken: decimate it")]
    TooLarge {
        /// Vertices or triangles.
        what: &'static str,
        /// How many.
        found: usize,
        /// How many are taken.
        most: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle} names vertex {vertex}, but there are only {vertices}: its list is cut off or of another mesh"
    )]
    Index {
        /// The triangle's index.
        triangle: usize,
        /// The vertex it names.
        vertex: usize,
        /// How many there are.
        vertices: usize,
    },
    /// A vertex has a coordinate that is not finite, or too large to compute with.
    #[error(
        "the position of vertex {vertex} is not a finite number below 1e15 m: repair it, or export the mesh again"
    )]
    NotFinite {
        /// The vertex's index.
        vertex: usize,
    },
    /// Smaller or larger than any body: the units are probably others.
    #[error(
        "the mesh is {size_m} m across; {least} m to {most} m are taken. Are its units metres? Scale it by {factor}, \
         for instance",
        least = crate::limits::MIN_MESH_SIZE_M,
        most = crate::limits::MAX_MESH_SIZE_M
    )]
    Size {
        /// Its longest side, m.
        size_m: f64,
        /// A factor that makes a body of a usual size of it.
        factor: f64,
    },
    /// Single-precision numbers so far from the origin do not tell its vertices apart.
    #[error(
        "the mesh is {distance_m} m from the origin, where its single-precision vertices are {grid_m} m apart: move it \
         to the origin before it is stored, and place the body instead"
    )]
    LostDigits {
        /// How far from the origin, m.
        distance_m: f64,
        /// The least difference of two coordinates there, m.
        grid_m: f64,
    },
    /// Single-precision numbers so far from the origin are too coarse for the cells.
    #[error(
        "the mesh is {distance_m} m from the origin, where its single-precision vertices are {grid_m:.1e} m apart, more than a \
         hundredth of a cell of {cell_m} m: move it to the origin before it is stored, and place the body instead"
    )]
    CoarseGrid {
        /// How far from the origin, m.
        distance_m: f64,
        /// The least difference of two coordinates there, m.
        grid_m: f64,
        /// Side of a cell, m.
        cell_m: f64,
    },
    /// A part has no thickness.
    #[error(
        "the mesh has no thickness at {at_m:.4}: give it a volume (a solidify or shell modifier), or remove that part"
    )]
    Flat {
        /// A place of it.
        at_m: DVec3,
    },
    /// Edges with one triangle.
    #[error(
        "the mesh has holes: {edges} edges have one triangle only, one of them at {at_m:.4}; fill them, or join the mesh with its other parts"
    )]
    Holes {
        /// How many edges.
        edges: usize,
        /// The middle of one.
        at_m: DVec3,
    },
    /// Edges with more than two triangles, between which inside and outside cannot be told apart.
    #[error(
        "{edges} edges have more than two triangles, one of them at {at_m:.4}; remove inner walls and separate parts that \
         share an edge"
    )]
    NonManifold {
        /// How many edges.
        edges: usize,
        /// The middle of one.
        at_m: DVec3,
    },
    /// Neighbours look opposite ways however they are turned.
    #[error(
        "the mesh has one side only, like a Klein bottle, as seen at {at_m:.4}; it has no inside: cut it open and close it round a volume"
    )]
    OneSided {
        /// Where two neighbours could not be made to agree.
        at_m: DVec3,
    },
    /// Triangles pass through each other.
    #[error(
        "the mesh passes through itself: {pairs} pairs of triangles cross, one at {at_m:.4}; unite the parts (a boolean \
         union or a voxel remesh)"
    )]
    Crossing {
        /// Pairs found before the search ended.
        pairs: usize,
        /// Where two of them cross.
        at_m: DVec3,
    },
    /// Too many triangles lie over each other to see whether they cross.
    #[error(
        "triangles are so long and close that {pairs} pairs of them would have to be looked at; remesh with triangles of \
         even size"
    )]
    Tangled {
        /// Pairs after which the search was given up.
        pairs: usize,
    },
    /// A closed surface lies inside another and looks the same way.
    #[error(
        "a closed surface at {at_m:.4} lies inside another and looks outward like it: turn it inside out for a cavity, or \
         remove it and give that region another tissue"
    )]
    Nested {
        /// A place of it.
        at_m: DVec3,
    },
    /// A list with one entry for each vertex has another length.
    #[error("{what} has {found} entries for {vertices} vertices; it needs exactly one for each")]
    Length {
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The number of vertices.
        vertices: usize,
    },
    /// Too few or too many cells.
    #[error(
        "cells of {cell_m} m make {cells} along the longest side of the mesh, {size_m} m; it must be 1 to {most}",
        most = crate::limits::MAX_CELLS_ALONG
    )]
    Cells {
        /// Side of a cell, m.
        cell_m: f64,
        /// Cells along the longest side.
        cells: f64,
        /// The longest side, m.
        size_m: f64,
    },
    /// More cells than a body can be stepped with.
    #[error(
        "{along} cells along the longest side make a body of {nodes} nodes; at most {most} are taken: take {advised} cells along \
         it"
    )]
    TooManyNodes {
        /// Cells along the longest side.
        along: usize,
        /// The nodes that they would make.
        nodes: usize,
        /// [`crate::CellLattice::MOST_NODES`].
        most: usize,
        /// Cells along the longest side that stay below it.
        advised: usize,
    },
    /// Parts of the mesh that share no cell.
    #[error(
        "the mesh is in {pieces} pieces that no cells join, one at {at_m:.4}: make a body of each, use larger cells, or \
         let them float (`allow_free`; of a component `FixedRegion::Nothing`)"
    )]
    Pieces {
        /// How many.
        pieces: usize,
        /// The centre of a cell of the smallest.
        at_m: DVec3,
    },
    /// A region in which there is nothing of the body.
    #[error(
        "{what} {index} holds no part of the body, whose cells are {cell_m} m wide; move it, enlarge it or use smaller cells"
    )]
    EmptyRegion {
        /// A region of tissue, of fixed nodes, of fixed vertices.
        what: &'static str,
        /// Its index in the order in which they were given.
        index: usize,
        /// Side of a cell, m.
        cell_m: f64,
    },
}
