//! The one-sided problem of a step: which impulses keep rows of nodes out of what they must not enter.

use glam::{DMat3, DVec3};
use palpate_laws::Coulomb;

/// A point Σ w_i x_i of a body that must not go beyond a surface.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// Nodes and weights.
    pub(crate) nodes: Vec<(usize, f64)>,
    pub(crate) law: Coulomb,
    /// Distance from the surface at the beginning of the step, m.
    pub(crate) gap_m: f64,
    /// λ, N s.
    pub(crate) impulse: DVec3,
}

/// What an impulse on a row does to the velocities of the nodes: A⁻¹ Hᵀ.
pub(crate) trait Answer {
    /// Adds A⁻¹ Hᵀ `impulse` of row `row` to `v`.
    fn push(&self, row: usize, impulse: DVec3, v: &mut [DVec3]);

    /// H A⁻¹ Hᵀ of row `row` with itself, 1/kg.
    fn own(&self, row: usize) -> DMat3;
}

/// Most sweeps over all rows. Where a node sticks between two obstacles its impulses are not determined and may creep for
/// ever; every row's own answer is exact all the same, and no row is left open by more than nanometres.
const SWEEPS: usize = 1000;
/// Change of an impulse, relative to the largest, below which a sweep was the last.
const TOLERANCE: f64 = 1e-8;

/// Gives every row its impulse, so that at the end of the step of length `h` no row has gone beyond its surface, by
/// projected Gauss-Seidel: row after row answers exactly (see [`Coulomb::impulse`]) while the others stand, until
/// nothing changes. `v` are the velocities of all nodes without contact, and become those with it. Returns the sweeps
/// taken.
pub(crate) fn solve(rows: &mut [Row], answer: &impl Answer, h: f64, v: &mut [DVec3]) -> usize {
    let own: Vec<DMat3> = (0..rows.len()).map(|row| answer.own(row)).collect();
    for sweep in 1..=SWEEPS {
        let (mut largest, mut change) = (0.0_f64, 0.0_f64);
        for i in 0..rows.len() {
            let Row { nodes, law, gap_m, impulse: before } = &rows[i];
            let u: DVec3 = nodes.iter().map(|&(node, w)| w * v[node]).sum();
            // Velocity without this row's impulse; what is left of the gap may still be closed.
            let free = u - own[i] * *before + *gap_m / h * law.normal();
            let impulse = law.impulse(own[i], free);
            let more = impulse - *before;
            answer.push(i, more, v);
            rows[i].impulse = impulse;
            largest = largest.max(impulse.length());
            change = change.max(more.length());
        }
        if change <= TOLERANCE * largest {
            return sweep;
        }
    }
    SWEEPS
}

/// A = M: every node for itself.
pub(crate) struct Masses<'a> {
    pub(crate) rows: Vec<Vec<(usize, f64)>>,
    pub(crate) mass_kg: &'a [f64],
}

impl Answer for Masses<'_> {
    fn push(&self, row: usize, impulse: DVec3, v: &mut [DVec3]) {
        for &(node, w) in &self.rows[row] {
            v[node] += w / self.mass_kg[node] * impulse;
        }
    }

    fn own(&self, row: usize) -> DMat3 {
        let per_mass: f64 = self.rows[row].iter().map(|&(node, w)| w * w / self.mass_kg[node]).sum();
        DMat3::from_diagonal(DVec3::splat(per_mass))
    }
}

/// A = M + hB + h²K: an impulse moves the whole body.
pub(crate) struct Coupled {
    pub(crate) rows: Vec<Vec<(usize, f64)>>,
    /// A⁻¹ Hᵀ of every row: for each of three axes of the impulse the velocity of every node.
    pub(crate) columns: Vec<[Vec<DVec3>; 3]>,
}

impl Answer for Coupled {
    fn push(&self, row: usize, impulse: DVec3, v: &mut [DVec3]) {
        let [x, y, z] = &self.columns[row];
        for (node, v) in v.iter_mut().enumerate() {
            *v += impulse.x * x[node] + impulse.y * y[node] + impulse.z * z[node];
        }
    }

    fn own(&self, row: usize) -> DMat3 {
        let moved = |column: &Vec<DVec3>| self.rows[row].iter().map(|&(node, w)| w * column[node]).sum();
        let [x, y, z] = self.columns[row].each_ref().map(moved);
        DMat3::from_cols(x, y, z)
    }
}
