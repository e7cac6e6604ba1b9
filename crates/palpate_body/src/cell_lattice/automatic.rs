//! Cells whose size is chosen for the mesh.

use super::kept_cells::KeptCells;
use super::{CellLattice, Embedding, fill};
use crate::{CellSize, ClosedMesh, MeshError, ThinParts};

/// Ratio of successive numbers of cells that are tried for thin parts.
const MORE_CELLS: f64 = 1.2;

impl<'a> CellLattice<'a> {
    /// Fits cells as [`CellSize::Automatic`].
    ///
    /// # Errors
    /// As [`CellLattice::fit`] with [`CellSize::START_ALONG`] cells.
    pub(super) fn automatic(mesh: &'a ClosedMesh, max_nodes: usize) -> Result<Self, MeshError> {
        let start = CellSize::START_ALONG;
        match Self::within(mesh, start, max_nodes) {
            Ok(lattice) if lattice.is_resolving() => Ok(lattice),
            Ok(lattice) => Ok(Self::finer(lattice, mesh, max_nodes)),
            Err(MeshError::TooManyNodes { .. }) => {
                let fitted = (2..start).rev().find_map(|along| Self::within(mesh, along, max_nodes).ok());
                fitted.map_or_else(|| Self::fit(mesh, CellSize::Along(1)), Ok)
            }
            Err(error) => Err(error),
        }
    }

    /// The coarsest of the lattices with more cells than `coarse` that resolves the thin parts of `mesh`, or the finest one with at most
    /// `max_nodes` nodes.
    fn finer(coarse: Self, mesh: &'a ClosedMesh, max_nodes: usize) -> Self {
        let mut finest = coarse;
        let mut along = CellSize::START_ALONG;
        // One more cell than this has too many nodes.
        let mut limit = ThinParts::MAX_TRIED_CELLS;
        while along < limit {
            let more = ((MORE_CELLS * along as f64).round() as usize).clamp(along + 1, limit);
            match Self::within(mesh, more, max_nodes) {
                Ok(lattice) => (finest, along) = (lattice, more),
                Err(_) => limit = more - 1,
            }
            if along == more && finest.is_resolving() {
                break;
            }
        }
        finest
    }

    /// Fits `along` cells along the longest side; the error [`MeshError::TooManyNodes`] for more than `max_nodes` nodes.
    fn within(mesh: &'a ClosedMesh, along: usize, max_nodes: usize) -> Result<Self, MeshError> {
        let mut lattice = Self::fit(mesh, CellSize::Along(along))?;
        let too_many =
            |nodes: usize| MeshError::TooManyNodes { along, nodes, most: max_nodes, advised: along - 1 };
        let fill = fill::fill(mesh, &lattice.grid);
        // Each cell that is no sliver has a node of its own: that at its lowest corner.
        let cells = fill.cells_above(KeptCells::SLIVER);
        if cells > max_nodes {
            return Err(too_many(cells));
        }
        let parts = lattice.parts_of(fill)?;
        let kept = KeptCells::choose(&lattice.grid, &parts);
        let nodes = Embedding::new(lattice.grid, &parts, &kept).nodes().len();
        if nodes > max_nodes {
            return Err(too_many(nodes));
        }
        lattice.computed.parts = parts.into();
        Ok(lattice)
    }
}
