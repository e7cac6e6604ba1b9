//! The grid of cubic cells around a mesh.

use glam::DVec3;

/// Cells around a mesh: their number along each axis, their size, and the lowest corner relative to the mesh's
/// centre, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CellGrid {
    pub(super) cells: [usize; 3],
    pub(super) cell_m: f64,
    pub(super) low_m: DVec3,
}

impl CellGrid {
    pub(super) fn cell_total(&self) -> usize {
        self.cells.iter().product()
    }

    /// Number of cells along the longest side.
    pub(super) fn along(&self) -> usize {
        self.cells.into_iter().fold(1, usize::max)
    }

    pub(super) fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.cells[0] * (j + self.cells[1] * k)
    }

    pub(super) fn place(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells;
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// A position in units of cells from the lowest corner.
    pub(super) fn in_cells(&self, place_m: DVec3) -> DVec3 {
        (place_m - self.low_m) / self.cell_m
    }

    /// Position of a place given in cells from the lowest corner, m.
    pub(super) fn at_m(&self, in_cells: DVec3) -> DVec3 {
        self.low_m + self.cell_m * in_cells
    }

    /// The cell before `cell` along `axis`.
    pub(super) fn before(&self, cell: usize, axis: usize) -> Option<usize> {
        let mut place = self.place(cell);
        place[axis] = place[axis].checked_sub(1)?;
        Some(self.index(place))
    }

    /// Number of faces between two cells that meet: 0 for the same one, 1 for cells that share a face, 2 for an edge, 3 for a corner. `None`
    /// for others.
    pub(super) fn faces_between(&self, a: usize, b: usize) -> Option<usize> {
        let (a, b) = (self.place(a), self.place(b));
        let apart = [0, 1, 2].map(|axis| a[axis].abs_diff(b[axis]));
        apart.iter().all(|n| *n < 2).then(|| apart.iter().sum())
    }

    /// The up to 26 neighbours of a cell, with the steps to them.
    pub(super) fn round(&self, cell: usize) -> impl Iterator<Item = ([i32; 3], usize)> {
        let (grid, own) = (*self, self.place(cell));
        let both = crate::lattice::steps().flat_map(|step| [step, step.map(|s| -s)]);
        both.filter_map(move |step| {
            crate::lattice::neighbour(grid.cells, own, step).map(|other| (step, grid.index(other)))
        })
    }
}
