//! A block of elements.

use super::slit::{self, LipShares};
use super::{Block, BlockBody};
use crate::cell_tissue::CellTissue;
use crate::{BodyError, Grid, NetworkBuilder, Tissue};
use glam::DVec3;

/// The tetrahedra of a hexahedral cell with the nodes `corners`: corner c lies towards +x where bit 0 of c is set, +y with bit 1, +z with bit 2.
/// Six of equal volume surround the diagonal from the first to the last corner (H. W. Kuhn, IBM J. Res. Dev. 4 (1960) 518). Equal neighbouring cells
/// fit together, and all nodes of a grid are alike.
#[must_use]
pub fn cell_tetrahedra(corners: [usize; 8]) -> [[usize; 4]; 6] {
    const PATHS: [[usize; 4]; 6] =
        [[0, 1, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 1, 7, 5], [0, 2, 7, 3], [0, 4, 7, 6]];
    PATHS.map(|path| path.map(|corner| corners[corner]))
}

impl Block {
    /// Creates the block of hexahedral elements, one for each cell, filled with `tissue` and with the tissues of its regions.
    ///
    /// # Errors
    /// [`BodyError`] if a parameter is invalid, all nodes are fixed, or none is without [`Block::allow_unconstrained`];
    /// [`MeshError::EmptyRegion`](crate::MeshError::EmptyRegion) for a region outside the block.
    pub fn elements(&self, tissue: &Tissue) -> Result<BlockBody, BodyError> {
        self.build_elements(tissue, |network, corners, tissue| {
            network.cell(corners, tissue, 1.0);
        })
    }

    /// Creates the block of tetrahedral elements, six for each cell ([`cell_tetrahedra`]), filled with `tissue` and with the tissues of its
    /// regions.
    ///
    /// # Errors
    /// As [`Block::elements`].
    pub fn tetrahedra(&self, tissue: &Tissue) -> Result<BlockBody, BodyError> {
        self.build_elements(tissue, |network, corners, tissue| {
            network.tetrahedral_cell(&cell_tetrahedra(corners), tissue);
        })
    }

    /// Creates the block of elements that `add` adds for the corners of each cell and its tissue.
    fn build_elements(
        &self,
        tissue: &Tissue,
        add: impl Fn(&mut NetworkBuilder, [usize; 8], &CellTissue),
    ) -> Result<BlockBody, BodyError> {
        let (cell, tissues) = (self.cell_m(), self.cell_tissues(tissue)?);
        let mut rest_m: Vec<DVec3> = self.grid().map(|ijk| self.rest(ijk)).collect();
        let (mut fixed, mut surface, mut cells) = (self.fixed_nodes(), self.surface(), self.cells());
        if let Some(slit) = self.slit {
            let nodes = rest_m.len();
            slit::cut(
                slit,
                (self.nodes, cell),
                &mut slit::Pieces {
                    rest_m: &mut rest_m,
                    mass_kg: &mut vec![0.0; nodes],
                    drag_ns_per_m: &mut vec![0.0; nodes],
                    youngs_modulus_pa: &mut vec![0.0; nodes],
                    lips: LipShares::HALVES,
                    fixed: &mut fixed,
                    links: &mut Vec::new(),
                    cells: &mut cells,
                    surface: &mut surface,
                },
            )?;
        }
        let (mut sums, mut counts) = (vec![0.0; rest_m.len()], vec![0.0; rest_m.len()]);
        for (nodes, tissue) in cells.iter().zip(&tissues) {
            for &node in nodes {
                sums[node] += tissue.youngs_modulus_pa;
                counts[node] += 1.0;
            }
        }
        let moduli_pa = sums.iter().zip(counts).map(|(sum, count)| sum / count).collect();
        let massless = vec![0.0; rest_m.len()];
        let mut network = NetworkBuilder::of(rest_m, massless, fixed, Vec::new());
        for (nodes, tissue) in cells.into_iter().zip(&tissues) {
            add(&mut network, nodes, tissue);
        }
        let network = if self.allow_free { network.allow_unconstrained() } else { network }.build()?;
        let grid = Grid::new(cell.element_product().cbrt(), moduli_pa).of_elements(tissue.poissons_ratio);
        Ok(BlockBody { network: network.with_grid(grid), surface })
    }
}
