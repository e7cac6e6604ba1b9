//! Response of a body to impulses on constraint rows.

use crate::weights::Weights;
use glam::{DMat3, DVec3};
use palpate_laws::ImpulseResponse;

/// Response of the explicit step, A = M: impulses change only the nodes of their row.
pub(crate) struct LumpedMassResponse<'a> {
    pub(crate) rows: &'a [Weights],
    pub(crate) mass_kg: &'a [f64],
    /// Velocities of all nodes, m/s.
    pub(crate) v: &'a mut [DVec3],
}

impl LumpedMassResponse<'_> {
    pub(crate) fn inv_effective_mass_per_kg(&self, row: usize) -> DMat3 {
        let per_mass: f64 = self.rows[row].iter().map(|&(node, w)| w * w / self.mass_kg[node]).sum();
        DMat3::from_diagonal(DVec3::splat(per_mass))
    }
}

impl ImpulseResponse for LumpedMassResponse<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        self.rows[row].iter().map(|&(node, w)| w * self.v[node]).sum()
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        for &(node, w) in &self.rows[row] {
            self.v[node] += w / self.mass_kg[node] * impulse_ns;
        }
    }
}

/// Response of the implicit step, A = M + hB + h²K: the Delassus matrix H A⁻¹ Hᵀ couples all rows.
pub(crate) struct DelassusMatrix {
    /// Blocks in row-major order, 1/kg.
    delassus: Vec<DMat3>,
    /// Velocity of each row, m/s.
    u: Vec<DVec3>,
}

impl DelassusMatrix {
    /// Creates the matrix for `rows`. `v` holds the velocities of the nodes without impulses; `block(i, j)` is the
    /// velocity of node i per impulse on node j.
    pub(crate) fn new(rows: &[Weights], v: &[DVec3], block: impl Fn(usize, usize) -> DMat3) -> Self {
        let mut delassus = Vec::with_capacity(rows.len() * rows.len());
        for row in rows {
            for other in rows {
                let pairs = row.iter().flat_map(|&(i, w)| other.iter().map(move |&(j, o)| (i, j, w * o)));
                delassus.push(pairs.map(|(i, j, w)| block(i, j) * w).sum());
            }
        }
        let u = rows.iter().map(|row| row.iter().map(|&(node, w)| w * v[node]).sum()).collect();
        Self { delassus, u }
    }

    pub(crate) fn inv_effective_mass_per_kg(&self, row: usize) -> DMat3 {
        self.delassus[row * self.u.len() + row]
    }
}

impl ImpulseResponse for DelassusMatrix {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        self.u[row]
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        let rows = self.u.len();
        for (other, u) in self.u.iter_mut().enumerate() {
            *u += self.delassus[other * rows + row] * impulse_ns;
        }
    }
}
