//! The grid of cells of a network.

use glam::{DQuat, DVec3};

/// Cells of a network that represents a continuum. The contact model uses them below the size of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    pub(crate) cell_m: f64,
    pub(crate) youngs_modulus_pa: Vec<f64>,
    pub(crate) axes: [DVec3; 3],
    pub(crate) adds_compliance: bool,
    pub(crate) has_partial_cells: bool,
    /// Poisson's ratio of elements; `None` for springs.
    elements_ratio: Option<f64>,
}

/// Poisson's ratio of an isotropic network of springs.
const POISSONS_RATIO: f64 = 0.25;

impl Grid {
    /// Creates a grid of cells of `cell_m` along the coordinate axes, with Young's modulus at every node.
    pub(crate) fn new(cell_m: f64, youngs_modulus_pa: Vec<f64>) -> Self {
        Self {
            cell_m,
            youngs_modulus_pa,
            axes: DVec3::AXES,
            adds_compliance: true,
            has_partial_cells: false,
            elements_ratio: None,
        }
    }

    /// Marks the cells as hexahedral elements with Poisson's ratio `poissons_ratio`.
    pub(crate) fn of_elements(self, poissons_ratio: f64) -> Self {
        Self { elements_ratio: Some(poissons_ratio), ..self }
    }

    /// Poisson's ratio of elements; `None` for springs.
    pub(crate) fn elements_ratio(&self) -> Option<f64> {
        self.elements_ratio
    }

    /// Marks some cells as partly filled.
    pub(crate) fn partly_filled(mut self) -> Self {
        self.has_partial_cells = true;
        self
    }

    /// Marks the network as one of equal springs, as in the paper: contact gets no compliance besides that of the
    /// springs.
    pub(crate) fn of_equal_springs(mut self) -> Self {
        self.adds_compliance = false;
        self
    }

    pub(crate) fn turned(mut self, rotation: DQuat) -> Self {
        self.axes = self.axes.map(|axis| rotation * axis);
        self
    }

    /// Side of a cell, m; for cells that are not cubes, that of a cube of the same volume.
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Young's modulus of the tissue at every node, Pa. For a lattice of equal springs, which is anisotropic, a mean
    /// over directions.
    #[must_use]
    pub fn youngs_modulus_pa(&self) -> &[f64] {
        &self.youngs_modulus_pa
    }

    /// Poisson's ratio of the tissue: 1/4 for an isotropic network of springs.
    #[must_use]
    pub fn poissons_ratio(&self) -> f64 {
        self.elements_ratio.unwrap_or(POISSONS_RATIO)
    }

    /// Unit vectors along the cell sides at rest.
    #[must_use]
    pub fn axes(&self) -> [DVec3; 3] {
        self.axes
    }

    /// Whether contact gets the compliance that the grid lacks below a cell. True for tissue, false for equal
    /// springs.
    #[must_use]
    pub fn adds_compliance(&self) -> bool {
        self.adds_compliance
    }

    /// Whether some cells are partly filled, so that the surface is no plane of nodes.
    pub(crate) fn has_partial_cells(&self) -> bool {
        self.has_partial_cells
    }
}
