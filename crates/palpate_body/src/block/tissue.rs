//! Masses and springs of a block filled with tissue.

use super::slit::LipShares;
use super::{Block, BlockBody, LatticeMaterial};
use crate::cell_tissue::CellTissue;
use crate::damping::DampingCoefficients;
use crate::tissue_sampling::{cell_tissues, cells_beside};
use crate::{BodyError, CellStiffness, Tissue, lattice};
use glam::DVec3;

impl Block {
    /// Mean tissue of each cell, of `tissue` and of the regions, in the order of [`Block::cells`].
    pub(super) fn cell_tissues(&self, tissue: &Tissue) -> Result<Vec<CellTissue>, BodyError> {
        tissue.validate()?;
        self.regions.iter().try_for_each(|(_, other)| other.validate())?;
        let cell = self.cell_m();
        let at_m = |place: DVec3| self.center_m - 0.5 * self.size_m + cell * place;
        let places = lattice::grid(self.nodes.map(|n| n - 1));
        cell_tissues(places, at_m, |_, _| true, tissue, &self.regions, cell.min_element())
    }

    /// Creates the block filled with `tissue`, and with the tissues of its regions.
    ///
    /// # Errors
    /// [`BodyError`] if a parameter is invalid, the cells are too far from cubes, all nodes are fixed, or none is
    /// without [`Block::allow_unconstrained`]; [`MeshError::EmptyRegion`](crate::MeshError::EmptyRegion) for a region
    /// outside the block.
    pub fn tissue(&self, tissue: &Tissue) -> Result<BlockBody, BodyError> {
        let (cell, cells) = (self.cell_m(), self.nodes.map(|n| n - 1));
        let tissues = self.cell_tissues(tissue)?;
        let beside = |ijk: [usize; 3], step: [i32; 3]| {
            let index = |[i, j, k]: [usize; 3]| i + cells[0] * (j + cells[1] * k);
            cells_beside(ijk, step, cells).map(move |place| (place, index(place)))
        };
        let node_cells = |ijk| beside(ijk, [0; 3]).map(|(_, cell)| &tissues[cell]);
        let eighth_kg = |of: &CellTissue| cell.element_product() / 8.0 * of.density_kg_per_m3;
        let drag_ns_per_m = |of: &CellTissue| of.drag_ns_per_m(eighth_kg(of));
        // For a modulus of 1 Pa: springs are proportional to it.
        let springs = CellStiffness::isotropic(1.0, cell)?;
        let spring = |ijk: [usize; 3], step: [i32; 3], (m_a, m_b): (f64, f64)| {
            let along = springs.along(step) / f64::from(1 << step.iter().filter(|s| **s == 0).count());
            let (mut k, mut damping) = (0.0, DampingCoefficients::default());
            for (_, cell) in beside(ijk, step) {
                let part = tissues[cell].youngs_modulus_pa * along;
                k += part;
                damping = damping.plus(part, &tissues[cell].damping);
            }
            (k, damping.scaled(1.0 / k).of_spring(k, (m_a, m_b)))
        };
        let share_of = |ijk: [usize; 3], step: [i32; 3], amount: fn(&CellTissue) -> f64| {
            let sum = |left: bool| -> f64 {
                let is_left = |place: [usize; 3]| place[0] < ijk[0];
                let of_lip = beside(ijk, step).filter(|(place, _)| !left || is_left(*place));
                of_lip.map(|(_, cell)| amount(&tissues[cell])).sum()
            };
            sum(true) / sum(false)
        };
        let modulus = |ijk| {
            let (sum, count) = node_cells(ijk)
                .fold((0.0, 0.0), |(sum, count), tissue| (sum + tissue.youngs_modulus_pa, count + 1.0));
            sum / count
        };
        let material = LatticeMaterial {
            mass_kg: self.grid().map(|ijk| node_cells(ijk).map(eighth_kg).sum()).collect(),
            drag_ns_per_m: self.grid().map(|ijk| node_cells(ijk).map(drag_ns_per_m).sum()).collect(),
            youngs_modulus_pa: self.grid().map(modulus).collect(),
            spring: &spring,
            lips: LipShares {
                mass: &|ijk| share_of(ijk, [0; 3], |tissue| tissue.density_kg_per_m3),
                spring: &|ijk, step| share_of(ijk, step, |tissue| tissue.youngs_modulus_pa),
            },
        };
        self.build(material, |grid| grid)
    }
}

#[cfg(test)]
mod tests;
