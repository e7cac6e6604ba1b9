//! The contact problem of a step: which impulses make rows of nodes obey their laws.

use glam::{DMat3, DVec3};
use palpate_laws::Coulomb;

/// Σ w_i x_i over some nodes of a body, a point or the difference of two, that has to obey a law.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// Nodes and weights.
    pub(crate) nodes: Vec<(usize, f64)>,
    pub(crate) law: Law,
    /// How far it would be beyond the law, or short of it, if it did not move in the step, m.
    pub(crate) gap: DVec3,
    /// The part of the gap that was there before: positions close it, velocities keep nothing of that.
    pub(crate) overdue: DVec3,
    /// λ, N s.
    pub(crate) impulse: DVec3,
}

/// What a row has to obey.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Law {
    /// A surface that pushes and rubs; the gap is along its normal.
    OneSided(Coulomb),
    /// No gap is left.
    TwoSided,
    /// No gap is left along a direction, by pulling against it only.
    Tension(DVec3),
}

impl Law {
    /// The impulse of a row with answer `w` whose velocity without it, the gap over the length of the step added, is
    /// `free`.
    fn impulse(self, w: DMat3, free: DVec3) -> DVec3 {
        match self {
            Self::OneSided(coulomb) => coulomb.impulse(w, free),
            Self::TwoSided => -(w.inverse() * free),
            Self::Tension(direction) => {
                -direction * (free.dot(direction).max(0.0) / direction.dot(w * direction))
            }
        }
    }
}

/// What an impulse on a row does to the velocities of the nodes: A⁻¹ Hᵀ.
pub(crate) trait Answer {
    /// Adds A⁻¹ Hᵀ `impulse` of row `row` to `v`.
    fn push(&self, row: usize, impulse: DVec3, v: &mut [DVec3]);

    /// H A⁻¹ Hᵀ of row `row` with itself, 1/kg.
    fn own(&self, row: usize) -> DMat3;
}

/// Most sweeps over all rows. Where a node sticks between two obstacles its impulses are not determined and may creep for
/// ever; where rows contradict each other they grow; and very unequal masses on threads converge slowly.
pub(crate) const SWEEPS: usize = 1000;
/// Change of an impulse, relative to the largest, below which a sweep was the last.
const TOLERANCE: f64 = 1e-8;

/// Gives every row its impulse, so that at the end of the step of length `h` each obeys its law, by projected
/// Gauss-Seidel: row after row answers exactly (see [`Coulomb::impulse`]) while the others stand, until nothing changes. `v` are the velocities of all nodes without contact, and become those with it. Returns the sweeps
/// taken.
pub(crate) fn solve(rows: &mut [Row], answer: &impl Answer, h: f64, v: &mut [DVec3]) -> usize {
    let own: Vec<DMat3> = (0..rows.len()).map(|row| answer.own(row)).collect();
    for sweep in 1..=SWEEPS {
        let (mut largest, mut change) = (0.0_f64, 0.0_f64);
        for i in 0..rows.len() {
            // A row of nothing but what is fixed cannot obey.
            if own[i].determinant() <= 0.0 {
                continue;
            }
            let Row { nodes, law, gap, impulse: before, .. } = &rows[i];
            let u: DVec3 = nodes.iter().map(|&(node, w)| w * v[node]).sum();
            // Velocity without this row's impulse; what is left of the gap may still be closed.
            let free = u - own[i] * *before + *gap / h;
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
