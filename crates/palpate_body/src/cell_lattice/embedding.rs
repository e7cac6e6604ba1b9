//! Embedding of positions in the cells of a body.

use super::cell_grid::CellGrid;
use super::kept_cells::KeptCells;
use crate::BodyPoint;
use crate::lattice;
use glam::DVec3;

/// Nodes at the corners of the kept cells, and the cell that carries each position.
///
/// Corner c of a cell lies towards +x where bit 0 of c is set, +y with bit 1, +z with bit 2.
#[derive(Clone, Debug)]
pub(crate) struct Embedding {
    grid: CellGrid,
    /// Nodes of each kept cell.
    cells: Vec<[usize; 8]>,
    /// (i, j, k) of each kept cell.
    place: Vec<[usize; 3]>,
    /// The kept cell that carries each cell of the grid.
    carrier: Vec<Option<u32>>,
    /// (i, j, k) of each node, with i fastest, as in a block.
    nodes: Vec<[usize; 3]>,
    /// The node at each corner of the grid.
    node_at: Vec<Option<u32>>,
}

/// Distance in cells within which a position counts as on a side of its cell.
const ON_SIDE: f64 = 1e-9;

impl Embedding {
    pub(super) fn new(grid: CellGrid, kept: &KeptCells) -> Self {
        let corners = grid.cells.map(|n| n + 1);
        let corner_index = |[i, j, k]: [usize; 3]| i + corners[0] * (j + corners[1] * k);
        let place: Vec<[usize; 3]> = kept.cells.iter().map(|(cell, _)| grid.place(*cell)).collect();
        let mut used = vec![false; corners.iter().product()];
        for cell in &place {
            (0..8).for_each(|c| used[corner_index(corner(*cell, c))] = true);
        }
        let mut node_at = vec![None; used.len()];
        let mut nodes = Vec::new();
        for ijk in lattice::grid(corners).filter(|ijk| used[corner_index(*ijk)]) {
            node_at[corner_index(ijk)] = Some(nodes.len() as u32);
            nodes.push(ijk);
        }
        let node = |ijk| node_at[corner_index(ijk)].map_or(usize::MAX, |node| node as usize);
        let cells = place.iter().map(|cell| std::array::from_fn(|c| node(corner(*cell, c)))).collect();
        let mut carrier = vec![None; grid.cell_total()];
        for (index, (cell, _)) in kept.cells.iter().enumerate() {
            carrier[*cell] = Some(index as u32);
        }
        for &(sliver, by) in &kept.carried {
            carrier[sliver] = carrier[by];
        }
        Self { grid, cells, place, carrier, nodes, node_at }
    }

    /// Nodes of each cell.
    pub(crate) fn cells(&self) -> &[[usize; 8]] {
        &self.cells
    }

    pub(super) fn grid(&self) -> &CellGrid {
        &self.grid
    }

    /// (i, j, k) of each node.
    pub(super) fn nodes(&self) -> &[[usize; 3]] {
        &self.nodes
    }

    /// (i, j, k) of each cell.
    pub(super) fn places(&self) -> &[[usize; 3]] {
        &self.place
    }

    /// The node at (i, j, k), if there is one.
    pub(super) fn node(&self, [i, j, k]: [usize; 3]) -> Option<usize> {
        let corners = self.grid.cells.map(|n| n + 1);
        self.node_at[i + corners[0] * (j + corners[1] * k)].map(|node| node as usize)
    }

    /// The cell that carries a position (m, relative to the mesh's centre), and the local coordinates there: 0 to 1
    /// along each side, or slightly beyond.
    pub(crate) fn locate(&self, place_m: DVec3) -> (usize, DVec3) {
        let at = self.grid.in_cells(place_m);
        let own: [usize; 3] =
            std::array::from_fn(|axis| (at[axis].max(0.0) as usize).min(self.grid.cells[axis] - 1));
        let cell = match self.carrier[self.grid.index(own)] {
            Some(cell) => cell as usize,
            None => self.nearest(own, at),
        };
        let [i, j, k] = self.place[cell];
        let mut local = at - DVec3::new(i as f64, j as f64, k as f64);
        for axis in 0..3 {
            let side = local[axis].round();
            if (local[axis] - side).abs() < ON_SIDE {
                local[axis] = side;
            }
        }
        (cell, local)
    }

    /// The kept cell nearest to a position in an empty cell. Positions on a side get there by rounding.
    fn nearest(&self, own: [usize; 3], at: DVec3) -> usize {
        let distance = |cell: usize| {
            let low = DVec3::from_array(self.place[cell].map(|n| n as f64));
            (at - at.clamp(low, low + 1.0)).length_squared()
        };
        let round = self.grid.round(self.grid.index(own)).filter_map(|(_, cell)| self.carrier[cell]);
        let near = round.map(|cell| cell as usize).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        let all = || (0..self.cells.len()).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        near.or_else(all).unwrap_or_default()
    }

    /// The point of the body at a position (m, relative to the mesh's centre).
    pub(crate) fn point(&self, place_m: DVec3) -> BodyPoint {
        let (cell, local) = self.locate(place_m);
        let weights = trilinear_weights(local);
        let nodes = self.cells[cell].into_iter().zip(weights).filter(|(_, w)| *w != 0.0);
        BodyPoint::carried_by(nodes.collect())
    }
}

/// (i, j, k) of corner `c` of a cell.
pub(super) fn corner([i, j, k]: [usize; 3], c: usize) -> [usize; 3] {
    [i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]
}

/// Trilinear weights of the corners.
pub(super) fn trilinear_weights(local: DVec3) -> [f64; 8] {
    std::array::from_fn(|c| {
        let along = |axis: usize| if c >> axis & 1 == 1 { local[axis] } else { 1.0 - local[axis] };
        along(0) * along(1) * along(2)
    })
}
