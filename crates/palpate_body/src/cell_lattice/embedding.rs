//! Embedding of positions in the cells of a body.

use super::cell_grid::CellGrid;
use super::cell_parts::CellParts;
use super::kept_cells::KeptCells;
use crate::BodyPoint;
use crate::disjoint_sets::DisjointSets;
use glam::DVec3;
use std::collections::BTreeMap;

/// Nodes at the corners of the kept parts of cells, and the part that carries each position.
///
/// Parts that are connected through a face share its corners; others at the same corner of the grid have nodes of their own.
/// Corner c of a cell lies towards +x where bit 0 of c is set, +y with bit 1, +z with bit 2.
pub(crate) struct Embedding<'a> {
    grid: CellGrid,
    parts: &'a CellParts,
    /// Nodes of each kept part.
    cells: Vec<[usize; 8]>,
    /// (i, j, k) of the cell of each kept part.
    place: Vec<[usize; 3]>,
    /// The kept part that carries each part.
    carrier: Vec<usize>,
    /// (i, j, k) of each node, with i fastest, as in a block.
    nodes: Vec<[usize; 3]>,
    /// Kept parts of each cell of the grid that has some.
    of_cell: BTreeMap<usize, Vec<usize>>,
}

/// Distance in cells within which a position counts as on a side of its cell.
const ON_SIDE: f64 = 1e-9;

impl<'a> Embedding<'a> {
    pub(super) fn new(grid: CellGrid, parts: &'a CellParts, kept: &KeptCells) -> Self {
        let corners = grid.cells.map(|n| n + 1);
        let corner_index = |[i, j, k]: [usize; 3]| i + corners[0] * (j + corners[1] * k);
        let mut sets = united_corners(&grid, parts);
        let place: Vec<[usize; 3]> =
            kept.cells.iter().map(|(part, _)| grid.place(parts.parts[*part].cell)).collect();
        // The corners of kept parts, in the order of the grid.
        let mut used: Vec<(usize, usize, [usize; 3])> = Vec::with_capacity(8 * place.len());
        for (cell, (part, _)) in place.iter().zip(&kept.cells) {
            for c in 0..8 {
                let at = corner(*cell, c);
                used.push((corner_index(at), sets.find(8 * part + c), at));
            }
        }
        used.sort_unstable();
        used.dedup();
        let number: BTreeMap<usize, usize> =
            used.iter().enumerate().map(|(node, (_, set, _))| (*set, node)).collect();
        let node = |part: usize, c: usize, sets: &mut DisjointSets| number[&sets.find(8 * part + c)];
        let cells = kept.cells.iter().map(|&(part, _)| std::array::from_fn(|c| node(part, c, &mut sets)));
        let cells = cells.collect();
        let mut carrier = vec![usize::MAX; parts.parts.len()];
        let mut of_cell: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (index, (part, _)) in kept.cells.iter().enumerate() {
            carrier[*part] = index;
            of_cell.entry(parts.parts[*part].cell).or_default().push(index);
        }
        for &(sliver, by) in &kept.carried {
            carrier[sliver] = carrier[by];
        }
        let nodes = used.into_iter().map(|(.., at)| at).collect();
        Self { grid, parts, cells, place, carrier, nodes, of_cell }
    }

    /// Nodes of each kept part.
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

    /// (i, j, k) of the cell of each kept part.
    pub(super) fn places(&self) -> &[[usize; 3]] {
        &self.place
    }

    /// Kept parts of the cell at (i, j, k).
    pub(super) fn kept_in(&self, place: [usize; 3]) -> &[usize] {
        self.of_cell.get(&self.grid.index(place)).map_or(&[], Vec::as_slice)
    }

    /// The kept part that carries a position (m, relative to the mesh's centre) on the surface with the outward `normal`, and the local
    /// coordinates there: 0 to 1 along each side of its cell, or slightly beyond. With a normal of zero the nearest part carries it.
    pub(crate) fn locate(&self, place_m: DVec3, normal: DVec3) -> (usize, DVec3) {
        let at = self.grid.in_cells(place_m);
        let own: [usize; 3] =
            std::array::from_fn(|axis| (at[axis].max(0.0) as usize).min(self.grid.cells[axis] - 1));
        let cell = self.carrier_in(own, at, normal).unwrap_or_else(|| self.nearest(own, at, normal));
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

    /// The kept part that carries a position in the cell at `place`, or near it.
    fn carrier_in(&self, place: [usize; 3], at: DVec3, normal: DVec3) -> Option<usize> {
        let local = at - DVec3::from_array(place.map(|n| n as f64));
        let part = self.parts.part_at(self.grid.index(place), local, normal)?;
        Some(self.carrier[part])
    }

    /// The kept part nearest to a position in an empty cell. Positions on a side get there by rounding.
    fn nearest(&self, own: [usize; 3], at: DVec3, normal: DVec3) -> usize {
        let distance = |cell: usize| {
            let low = DVec3::from_array(self.place[cell].map(|n| n as f64));
            (at - at.clamp(low, low + 1.0)).length_squared()
        };
        let round = self.grid.round(self.grid.index(own));
        let round = round.filter_map(|(_, cell)| self.carrier_in(self.grid.place(cell), at, normal));
        let near = round.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        let all = || (0..self.cells.len()).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        near.or_else(all).unwrap_or_default()
    }

    /// The point of the body at a position (m, relative to the mesh's centre) on the surface with the outward `normal`.
    pub(crate) fn point(&self, place_m: DVec3, normal: DVec3) -> BodyPoint {
        let (cell, local) = self.locate(place_m, normal);
        let weights = trilinear_weights(local);
        let nodes = self.cells[cell].into_iter().zip(weights).filter(|(_, w)| *w != 0.0);
        BodyPoint::carried_by(nodes.collect())
    }
}

/// The corners of all parts, eight for each, united where connected parts have them in common.
fn united_corners(grid: &CellGrid, parts: &CellParts) -> DisjointSets {
    let mut sets = DisjointSets::new(8 * parts.parts.len());
    for part in 0..parts.parts.len() {
        let own = grid.place(parts.parts[part].cell);
        for &other in parts.linked(part).iter().filter(|other| **other > part) {
            let place = grid.place(parts.parts[other].cell);
            for c in 0..8 {
                let at = corner(own, c);
                let same = (0..8).find(|&other| corner(place, other) == at);
                same.into_iter().for_each(|same| sets.unite(8 * part + c, 8 * other + same));
            }
        }
    }
    sets
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
