//! The cells whose barriers may act before nodes have moved on.

use super::Cells;
use glam::DVec3;
use palpate_laws::VolumeBarrier;

/// How far nodes may move from where the cells were examined, in shortest edges at rest.
const REACH: f64 = 0.05;
/// What rounding may do to a volume ratio.
const ROUNDING: f64 = 1e-9;

/// The cells whose barriers may act, as far as nodes are near the positions at which all cells were last examined.
///
/// The volume that three edges of length L at most span changes by at most (L + 2d)³ − L³ when no node moves farther than d.
/// Cells whose volume ratio is farther than that above the onset need not be examined. The watch saves time only:
/// no result depends on when cells were examined.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watch {
    /// Positions at which all cells were examined, m.
    at_m: Vec<DVec3>,
    /// The cells that may act, ascending.
    cells: Vec<usize>,
}

impl Watch {
    /// The cells that may act while no node is farther than `beyond_m` from `x`, ascending; `beyond_m` is below the reach.
    fn update(&mut self, cells: &Cells, x: &[DVec3], beyond_m: f64) -> &[usize] {
        if cells.nodes.is_empty() {
            return &[];
        }
        let reach_m = REACH * cells.shortest_m;
        let near2 = (reach_m - beyond_m).powi(2);
        // A position that is not finite is never near.
        let is_near = self.at_m.len() == x.len()
            && self.at_m.iter().zip(x).all(|(at, x)| (*x - *at).length_squared() <= near2);
        if !is_near {
            self.at_m.clear();
            self.at_m.extend_from_slice(x);
            self.cells.clear();
            self.cells.extend((0..cells.nodes.len()).filter(|&cell| !cells.is_clear(cell, x, reach_m)));
        }
        &self.cells
    }

    /// Adds the forces of the barriers that act, N.
    pub(crate) fn add_forces(&mut self, cells: &Cells, x: &[DVec3], force: &mut [DVec3]) {
        for &cell in self.update(cells, x, 0.0) {
            cells.add_forces(cell, x, force);
        }
    }

    /// Number of inverted cells.
    pub(crate) fn inverted_count(&mut self, cells: &Cells, x: &[DVec3]) -> usize {
        self.update(cells, x, 0.0).iter().filter(|&&cell| cells.is_inverted(cell, x)).count()
    }

    /// Whether a barrier acts now, or will within `ahead_s` at the present velocities.
    pub(crate) fn acts_within(&mut self, cells: &Cells, (x, v): (&[DVec3], &[DVec3]), ahead_s: f64) -> bool {
        if cells.nodes.is_empty() {
            return false;
        }
        let reach_m = REACH * cells.shortest_m;
        let fastest = v.iter().map(|v| v.length_squared()).fold(0.0, f64::max).sqrt();
        if fastest * ahead_s < reach_m {
            let watched = self.update(cells, x, fastest * ahead_s).iter();
            return watched.flat_map(|&cell| cells.tetrahedra(cell)).any(|t| t.acts_within(x, v, ahead_s));
        }
        cells.all_tetrahedra().any(|tetrahedron| tetrahedron.acts_within(x, v, ahead_s))
    }
}

impl super::BarrierTetrahedron {
    /// The lowest of the volume ratios now and `ahead_s` later at the velocities `v`.
    pub(crate) fn lowest_ratio(&self, x: &[DVec3], v: &[DVec3], ahead_s: f64) -> f64 {
        let (now, change) = (self.edges_m(x), self.edges_m(v));
        let later = [0, 1, 2].map(|i| now[i] + ahead_s * change[i]);
        self.barrier.ratio(now).min(self.barrier.ratio(later))
    }

    fn acts_within(&self, x: &[DVec3], v: &[DVec3], ahead_s: f64) -> bool {
        VolumeBarrier::is_active(self.lowest_ratio(x, v, ahead_s))
    }
}

impl Cells {
    /// Whether no barrier of `cell` can act while no node is farther than `reach_m` from `x`.
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
