//! The grid of cells that a network's springs were laid in, where there is one.

use glam::{DQuat, DVec3};

/// The cells of a network that stands for a continuum. Contact finer than a cell is computed from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    pub(crate) cell_m: f64,
    pub(crate) youngs_modulus_pa: Vec<f64>,
    pub(crate) axes: [DVec3; 3],
    pub(crate) adds_compliance: bool,
    pub(crate) has_partial_cells: bool,
}

/// Poisson's ratio of an isotropic network of springs.
pub(crate) const POISSONS_RATIO: f64 = 0.25;

impl Grid {
    /// Cells of `cell_m`, along the axes of space, with Young's modulus at every node.
    pub(crate) fn new(cell_m: f64, youngs_modulus_pa: Vec<f64>) -> Self {
        Self { cell_m, youngs_modulus_pa, axes: DVec3::AXES, adds_compliance: true, has_partial_cells: false }
    }

    /// The same grid, of which some cells are partly filled.
    pub(crate) fn partly_filled(mut self) -> Self {
        self.has_partial_cells = true;
        self
    }

    /// The same grid under a network of equal springs, as the paper has it: contact gives way by what the springs give way, and by no
    /// more.
    pub(crate) fn of_equal_springs(mut self) -> Self {
        self.adds_compliance = false;
        self
    }

    pub(crate) fn turned(mut self, rotation: DQuat) -> Self {
        self.axes = self.axes.map(|axis| rotation * axis);
        self
    }

    /// Side of a cell, m; of cells that are no cubes that of a cube of the same volume.
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Young's modulus of the tissue about every node, Pa. Of a lattice of equal springs, which is not isotropic, a mean over directions.
    #[must_use]
    pub fn youngs_modulus_pa(&self) -> &[f64] {
        &self.youngs_modulus_pa
    }

    /// Poisson's ratio of the tissue: that of every isotropic network of springs, 1/4.
    #[must_use]
    pub fn poissons_ratio(&self) -> f64 {
        POISSONS_RATIO
    }

    /// Unit vectors along the sides of the cells at rest.
    #[must_use]
    pub fn axes(&self) -> [DVec3; 3] {
        self.axes
    }

    /// Whether contact gets the compliance that the grid lacks below a cell: with tissue, and not with the equal springs of the paper.
    #[must_use]
    pub fn adds_compliance(&self) -> bool {
        self.adds_compliance
    }

    /// Whether some of its cells are partly filled, so that its surface is no plane of nodes.
    pub(crate) fn has_partial_cells(&self) -> bool {
        self.has_partial_cells
    }
}
