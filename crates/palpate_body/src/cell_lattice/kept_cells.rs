//! The cells that make the body.

use super::cell_grid::CellGrid;
use super::cell_parts::CellParts;
use glam::DVec3;

/// Slivers: a cell filled less than the first number is carried by a neighbour filled at least that much, if its
/// surface is at most the second number of cells outside the neighbour. The second entry is for almost empty cells.
const SLIVER_LIMITS: [(f64, f64); 2] = [(KeptCells::SLIVER, 0.25), (MIN_FILL, 0.5)];
/// Minimum filled share of a cell that must be kept.
const MIN_FILL: f64 = 0.01;

/// Statistics of the cells of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshCells {
    /// Side of a cell, m.
    pub cell_m: f64,
    /// Number of cells along the longest side of the mesh.
    pub along: usize,
    /// Number of cells of the body.
    pub cells: usize,
    /// Number of almost empty cells whose surface a neighbour carries.
    pub slivers_carried: usize,
    /// Number of almost empty cells that count as filled to the minimum, which makes the body too heavy.
    pub raised: usize,
    /// Additional volume of those cells as a share of the mesh's volume; of its mass for a single tissue.
    pub raised_share: f64,
    /// Minimum φ of a kept cell.
    pub least_fill: f64,
}

/// The parts of cells that make the body.
pub(super) struct KeptCells {
    /// Index of each part, in the order of their cells, and its φ.
    pub cells: Vec<(usize, f64)>,
    /// Removed slivers, each with the part that carries it.
    pub carried: Vec<(usize, usize)>,
    pub report: MeshCells,
}

impl KeptCells {
    /// φ below which a part may be a sliver.
    pub(super) const SLIVER: f64 = 0.1;

    /// Chooses the parts. A sliver is removed if a part near it can carry all of its surface (see [`SLIVER_LIMITS`]) and the
    /// others that are connected with it stay connected. Its volume is added to that part.
    pub(super) fn choose(grid: &CellGrid, parts: &CellParts) -> Self {
        let mut share: Vec<f64> = parts.parts.iter().map(|part| part.share).collect();
        let mut kept = vec![true; share.len()];
        let mut carried = Vec::new();
        for (least, farthest) in SLIVER_LIMITS {
            let mut slivers: Vec<(f64, usize, [DVec3; 2])> = (0..share.len())
                .filter(|&part| share[part] < least && kept[part])
                .filter_map(|part| Some((share[part], part, parts.parts[part].surface?)))
                .collect();
            slivers.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for (_, sliver, surface) in slivers {
                let around = Around::new(grid, parts, sliver);
                let can = |other: usize| (kept[other] && share[other] >= least).then_some(share[other]);
                let Some(carrier) = around.carrier(surface, farthest, can) else { continue };
                kept[sliver] = false;
                if around.is_joined_without(parts, &kept, sliver) {
                    carried.push((sliver, carrier));
                } else {
                    kept[sliver] = true;
                }
            }
        }
        for &(sliver, carrier) in &carried {
            share[carrier] += share[sliver];
        }
        carried.sort_unstable();
        let mut report = MeshCells { slivers_carried: carried.len(), ..MeshCells::default() };
        report.least_fill = 1.0;
        let (mut added, mut held) = (0.0, 0.0);
        let mut cells = Vec::new();
        for part in (0..share.len()).filter(|&part| kept[part]) {
            report.raised += usize::from(share[part] < MIN_FILL);
            let filled = share[part].max(MIN_FILL);
            added += filled - share[part];
            held += share[part];
            report.least_fill = report.least_fill.min(filled);
            cells.push((part, filled));
        }
        report.cells = cells.len();
        report.raised_share = added / held;
        Self { cells, carried, report }
    }

    /// Connected pieces: the indices of each in [`Self::cells`].
    pub(super) fn pieces(&self, parts: &CellParts) -> Vec<Vec<usize>> {
        let mut left = vec![None; parts.parts.len()];
        self.cells.iter().enumerate().for_each(|(index, (part, _))| left[*part] = Some(index));
        let mut pieces = Vec::new();
        for &(start, _) in &self.cells {
            let Some(first) = left[start].take() else { continue };
            let mut piece = vec![first];
            let mut next = 0;
            while let Some(&index) = piece.get(next) {
                next += 1;
                for &other in parts.linked(self.cells[index].0) {
                    piece.extend(left[other].take());
                }
            }
            pieces.push(piece);
        }
        pieces
    }
}

/// The parts in the up to 26 cells around a part, with the steps to them, that are connected with it there.
struct Around {
    parts: Vec<([i32; 3], usize)>,
}

impl Around {
    fn new(grid: &CellGrid, parts: &CellParts, part: usize) -> Self {
        let own = parts.parts[part].cell;
        // Another part of the same cell is near only if it is one with this part.
        let beside = parts.linked(part).iter().filter(|&&other| parts.parts[other].cell == own);
        let near: Vec<([i32; 3], usize)> = beside
            .map(|&other| ([0; 3], other))
            .chain(
                grid.round(own).flat_map(|(step, cell)| parts.of_cell(cell).map(move |other| (step, other))),
            )
            .collect();
        let mut is_reached = vec![false; near.len()];
        let mut front = vec![part];
        while let Some(at) = front.pop() {
            for (index, (_, other)) in near.iter().enumerate() {
                if !is_reached[index] && parts.linked(at).contains(other) {
                    is_reached[index] = true;
                    front.push(*other);
                }
            }
        }
        let reached = near.into_iter().zip(is_reached).filter(|(_, is)| *is).map(|(part, _)| part);
        Self { parts: reached.collect() }
    }

    /// The nearest part that `can` carry the surface within `low` and `high` of the cell, at most `farthest` outside its
    /// own. Among equally near ones the fullest.
    fn carrier(
        &self,
        [low, high]: [DVec3; 2],
        farthest: f64,
        can: impl Fn(usize) -> Option<f64>,
    ) -> Option<usize> {
        let mut best: Option<(f64, f64, usize)> = None;
        for &(step, other) in &self.parts {
            let out = |axis: usize| match step[axis] {
                1 => 1.0 - low[axis],
                -1 => high[axis],
                _ => 0.0,
            };
            let far = out(0).max(out(1)).max(out(2));
            let Some(share) = can(other).filter(|_| far <= farthest) else { continue };
            if best.is_none_or(|(least, most, _)| far < least || (far == least && share > most)) {
                best = Some((far, share, other));
            }
        }
        best.map(|(.., other)| other)
    }

    /// Whether the kept parts that are connected with `part` are connected through the kept parts around it.
    fn is_joined_without(&self, parts: &CellParts, kept: &[bool], part: usize) -> bool {
        let round: Vec<usize> =
            self.parts.iter().map(|(_, other)| *other).filter(|&other| kept[other]).collect();
        let beside: Vec<usize> =
            (0..round.len()).filter(|&i| parts.linked(part).contains(&round[i])).collect();
        let Some(&start) = beside.first() else { return true };
        let mut is_reached = vec![false; round.len()];
        is_reached[start] = true;
        let mut front = vec![start];
        while let Some(at) = front.pop() {
            for other in 0..round.len() {
                if !is_reached[other] && parts.linked(round[at]).contains(&round[other]) {
                    is_reached[other] = true;
                    front.push(other);
                }
            }
        }
        beside.into_iter().all(|i| is_reached[i])
    }
}
