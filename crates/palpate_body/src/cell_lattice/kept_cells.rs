//! The cells that make the body.

use super::cell_grid::CellGrid;
use super::fill::Fill;
use glam::DVec3;

/// Slivers: a cell filled less than the first number is carried by a neighbour filled at least that much, if its
/// surface is at most the second number of cells outside the neighbour. The second entry is for almost empty cells.
const SLIVER_LIMITS: [(f64, f64); 2] = [(0.1, 0.25), (MIN_FILL, 0.5)];
/// Minimum filled share of a cell that must be kept.
const MIN_FILL: f64 = 0.01;

/// Statistics of the cells of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshCells {
    /// Side of a cell, m.
    pub cell_m: f64,
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

/// The kept cells.
pub(super) struct KeptCells {
    /// Index in the grid and φ of each, in grid order.
    pub cells: Vec<(usize, f64)>,
    /// Removed slivers, each with the cell of the grid that carries it.
    pub carried: Vec<(usize, usize)>,
    pub report: MeshCells,
}

impl KeptCells {
    /// Chooses the cells. A sliver is removed if a neighbour can carry all of its surface (see [`SLIVER_LIMITS`]) and its
    /// other neighbours stay connected by faces. Its volume is added to that neighbour.
    pub(super) fn choose(grid: &CellGrid, fill: Fill) -> Self {
        let Fill { mut share, surface } = fill;
        // A cell without surface is entirely inside or outside.
        let mut kept: Vec<bool> =
            (0..share.len()).map(|cell| share[cell] > 0.5 || surface.contains_key(&cell)).collect();
        let mut carried = Vec::new();
        for (least, farthest) in SLIVER_LIMITS {
            let mut slivers: Vec<(f64, usize)> = surface
                .keys()
                .map(|&cell| (share[cell], cell))
                .filter(|(share, cell)| *share < least && kept[*cell])
                .collect();
            slivers.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for (_, sliver) in slivers {
                let can = |other: usize| (kept[other] && share[other] >= least).then_some(share[other]);
                let Some(carrier) = carrier(grid, sliver, surface[&sliver], farthest, can) else { continue };
                kept[sliver] = false;
                if joined_without(grid, &kept, sliver) {
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
        for cell in (0..share.len()).filter(|&cell| kept[cell]) {
            report.raised += usize::from(share[cell] < MIN_FILL);
            let filled = share[cell].max(MIN_FILL);
            added += filled - share[cell];
            held += share[cell];
            report.least_fill = report.least_fill.min(filled);
            cells.push((cell, filled));
        }
        report.cells = cells.len();
        report.raised_share = added / held;
        Self { cells, carried, report }
    }
}

/// The nearest neighbour that `can` carry the surface within `low` and `high` of a cell, at most `farthest` outside
/// it. Among equally near ones the fullest.
fn carrier(
    grid: &CellGrid,
    cell: usize,
    [low, high]: [DVec3; 2],
    farthest: f64,
    can: impl Fn(usize) -> Option<f64>,
) -> Option<usize> {
    let mut best: Option<(f64, f64, usize)> = None;
    for (step, other) in grid.round(cell) {
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

/// Whether the kept face neighbours of `cell` are connected through the kept cells around it.
fn joined_without(grid: &CellGrid, kept: &[bool], cell: usize) -> bool {
    let round: Vec<([i32; 3], usize)> = grid.round(cell).filter(|(_, other)| kept[*other]).collect();
    let beside = |step: &[i32; 3]| step.iter().map(|s| s.abs()).sum::<i32>() == 1;
    let at_faces: Vec<usize> = (0..round.len()).filter(|&i| beside(&round[i].0)).collect();
    let Some(&start) = at_faces.first() else { return true };
    let mut reached = vec![false; round.len()];
    reached[start] = true;
    let mut front = vec![start];
    while let Some(at) = front.pop() {
        for other in 0..round.len() {
            let apart = (0..3).map(|i| (round[at].0[i] - round[other].0[i]).abs()).sum::<i32>();
            if apart == 1 && !reached[other] {
                reached[other] = true;
                front.push(other);
            }
        }
    }
    at_faces.into_iter().all(|i| reached[i])
}

/// Pieces of the kept cells, connected by faces: the indices of each in `cells`.
pub(super) fn pieces(grid: &CellGrid, cells: &[(usize, f64)]) -> Vec<Vec<usize>> {
    let mut left = vec![None; grid.cell_total()];
    cells.iter().enumerate().for_each(|(index, (cell, _))| left[*cell] = Some(index));
    let mut pieces = Vec::new();
    for &(start, _) in cells {
        let Some(first) = left[start].take() else { continue };
        let mut piece = vec![first];
        let mut next = 0;
        while let Some(&index) = piece.get(next) {
            next += 1;
            for (step, other) in grid.round(cells[index].0) {
                if step.iter().map(|s| s.abs()).sum::<i32>() == 1 {
                    piece.extend(left[other].take());
                }
            }
        }
        pieces.push(piece);
    }
    pieces
}
