//! The size of the cells of a mesh.

/// Size of the cells of a [`CellLattice`](crate::CellLattice).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellSize {
    /// Chosen for the mesh: [`CellSize::START_ALONG`] cells along its longest side; fewer where these have more than `max_nodes` nodes;
    /// otherwise more, up to that number of nodes, where over a tenth of the volume is thinner than two cells
    /// ([`ThinParts`](crate::ThinParts)). At least one cell.
    Automatic {
        /// Maximum number of nodes.
        max_nodes: usize,
    },
    /// Number of cells along the longest side of the mesh.
    Along(usize),
    /// Side of a cell, m.
    Side(f64),
}

impl CellSize {
    /// Number of cells along the longest side from which [`CellSize::Automatic`] starts.
    pub const START_ALONG: usize = 10;
    /// Default of the maximum number of nodes. A body of that many nodes holds 20 model steps per second with a tool on it, its local models
    /// included, on one core.
    pub const DEFAULT_MAX_NODES: usize = 400;
}

impl Default for CellSize {
    fn default() -> Self {
        Self::Automatic { max_nodes: Self::DEFAULT_MAX_NODES }
    }
}
