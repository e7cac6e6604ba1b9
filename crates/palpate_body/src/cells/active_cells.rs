//! Cells whose barriers may act.

use super::{BarrierTetrahedron, Cells};
use crate::Network;
use crate::eigenvalue::largest_eigenvalue;
use glam::{DMat3, DVec3};
use palpate_laws::VolumeBarrier;
use std::collections::BTreeMap;

/// Distance that nodes may move from where their cells were examined, in shortest edges at rest.
const REACH: f64 = 0.05;
/// Rounding error of a volume ratio.
const ROUNDING: f64 = 1e-9;

/// Cells whose barriers may act while each node is near the position at which its cells were last examined.
///
/// The volume that three edges of length at most L span changes by at most (L + 2d)³ − L³ if no node moves further
/// than d. Cells whose volume ratio exceeds the onset by more need no examination. This saves time only: no result
/// depends on when cells were examined.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActiveCells {
    /// Positions at which cells were examined, m.
    at_m: Vec<DVec3>,
    /// Whether the barriers of each cell may act.
    may_act: Vec<bool>,
    /// Indices of the cells whose barriers may act, ascending.
    cells: Vec<usize>,
}

impl ActiveCells {
    /// Updates and returns the cells whose barriers may act while no node is further than `beyond_m` from `x`,
    /// ascending. `beyond_m` must be below the reach.
    fn update(&mut self, cells: &Cells, x: &[DVec3], beyond_m: f64) -> &[usize] {
        if cells.with_barriers() == 0 {
            return &[];
        }
        let reach_m = REACH * cells.shortest_m;
        let near2 = (reach_m - beyond_m).powi(2);
        // A position that is not finite is never near.
        let is_near = |at: DVec3, x: DVec3| (x - at).length_squared() <= near2;
        if self.at_m.len() != x.len() {
            self.at_m = x.to_vec();
            self.may_act = (0..cells.with_barriers()).map(|cell| !cells.is_clear(cell, x, reach_m)).collect();
        } else if self.at_m.iter().zip(x).all(|(&at, &x)| is_near(at, x)) {
            return &self.cells;
        } else {
            let moved: Vec<usize> = (0..x.len()).filter(|&node| !is_near(self.at_m[node], x[node])).collect();
            moved.iter().for_each(|&node| self.at_m[node] = x[node]);
            let mut around: Vec<usize> =
                moved.iter().flat_map(|&node| cells.cells_of(node)).copied().collect();
            around.sort_unstable();
            around.dedup();
            for cell in around {
                self.may_act[cell] = !cells.is_clear(cell, &self.at_m, reach_m);
            }
        }
        self.cells.clear();
        self.cells.extend((0..cells.with_barriers()).filter(|&cell| self.may_act[cell]));
        &self.cells
    }

    /// Adds the forces of all active barriers, N.
    pub(crate) fn add_forces(&mut self, cells: &Cells, x: &[DVec3], force: &mut [DVec3]) {
        for &cell in self.update(cells, x, 0.0) {
            cells.add_forces(cell, x, force);
        }
    }

    /// Number of inverted cells of springs.
    pub(crate) fn inverted_count(&mut self, cells: &Cells, x: &[DVec3]) -> usize {
        self.update(cells, x, 0.0).iter().filter(|&&cell| cells.is_inverted(cell, x)).count()
    }

    /// Upper bound of the largest eigenvalue of M⁻¹K, 1/s², over the barriers that act now or may act within
    /// `ahead_s` at the present velocities; 0 without any.
    pub(crate) fn rate_bound(
        &mut self,
        network: &Network,
        (x, v): (&[DVec3], &[DVec3]),
        ahead_s: f64,
    ) -> f64 {
        let cells = network.barriers();
        let fastest = v.iter().map(|v| v.length_squared()).fold(0.0, f64::max).sqrt();
        if cells.with_barriers() == 0 {
            0.0
        } else if fastest * ahead_s < REACH * cells.shortest_m {
            let watched = self.update(cells, x, fastest * ahead_s).iter();
            rate_bound(watched.flat_map(|&cell| cells.tetrahedra(cell)), network, (x, v), ahead_s)
        } else {
            rate_bound(cells.all_tetrahedra(), network, (x, v), ahead_s)
        }
    }
}

/// Margin by which a volume ratio may fall below its prediction within a tick.
const BELOW_PREDICTED: f64 = 0.1;

/// [`ActiveCells::rate_bound`] for given tetrahedra.
///
/// Each node gets a block such that the sum of the blocks' quadratic forms bounds that of the stiffness. The gradient
/// g of J satisfies (Σ g_i·x_i)² ≤ Σ_i |g_i| Σ_j |g_j| (ĝ_i·x_i)². Its curvature satisfies |d_iᵀ (∂²J/∂e_i∂e_j) d_j|
/// ≤ |e_k| |d_i| |d_j|/V, where the difference d of two displacements has |d|² ≤ 2|x|² + 2|x_o|².
pub(crate) fn rate_bound(
    tetrahedra: impl Iterator<Item = BarrierTetrahedron>,
    network: &Network,
    (x, v): (&[DVec3], &[DVec3]),
    ahead_s: f64,
) -> f64 {
    let mut blocks: BTreeMap<usize, DMat3> = BTreeMap::new();
    for tetrahedron in tetrahedra {
        let lowest = tetrahedron.lowest_ratio(x, v, ahead_s);
        if !VolumeBarrier::is_active(lowest) {
            continue;
        }
        let barrier = tetrahedron.barrier;
        let (slope, curvature) = barrier.bounds_j(lowest - BELOW_PREDICTED);
        let edges = tetrahedron.edges_m(x);
        let [a, b, c] = barrier.gradient_per_m(edges);
        let gradients = [-(a + b + c), a, b, c];
        let total: f64 = gradients.iter().map(|g| g.length()).sum();
        let lengths = edges.map(DVec3::length);
        let sum: f64 = lengths.iter().sum();
        let bend = lengths.map(|own| 2.0 * slope * barrier.ratio_per_m3() * (sum - own));
        let bends = [bend.iter().sum(), bend[0], bend[1], bend[2]];
        for ((node, g), bend) in tetrahedron.nodes.into_iter().zip(gradients).zip(bends) {
            let block = blocks.entry(node).or_insert(DMat3::ZERO);
            *block += DMat3::from_diagonal(DVec3::splat(bend));
            if g.length() > 0.0 {
                let scaled = g * (curvature * total / g.length());
                *block += DMat3::from_cols(scaled * g.x, scaled * g.y, scaled * g.z);
            }
        }
    }
    let free = blocks.iter().filter(|(node, _)| !network.is_fixed(**node));
    free.map(|(&node, block)| largest_eigenvalue(block) / network.mass_kg()[node]).fold(0.0, f64::max)
}

impl BarrierTetrahedron {
    /// Minimum of the volume ratios now and `ahead_s` later at the velocities `v`.
    fn lowest_ratio(&self, x: &[DVec3], v: &[DVec3], ahead_s: f64) -> f64 {
        let (now, change) = (self.edges_m(x), self.edges_m(v));
        let later = [0, 1, 2].map(|i| now[i] + ahead_s * change[i]);
        self.barrier.ratio(now).min(self.barrier.ratio(later))
    }
}

impl Cells {
    /// Whether no barrier of `cell` can act while no node is further than `reach_m` from `x`.
    fn is_clear(&self, cell: usize, x: &[DVec3], reach_m: f64) -> bool {
        self.tetrahedra(cell).all(|tetrahedron| {
            let edges = tetrahedron.edges_m(x);
            let longest = edges.iter().map(|e| e.length_squared()).fold(0.0, f64::max).sqrt();
            let change =
                ((longest + 2.0 * reach_m).powi(3) - longest.powi(3)) * tetrahedron.barrier.ratio_per_m3();
            tetrahedron.barrier.ratio(edges) - change > VolumeBarrier::ONSET + ROUNDING
        })
    }
}
