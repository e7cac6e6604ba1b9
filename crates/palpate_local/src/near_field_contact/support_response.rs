//! The Delassus operator of a tick: the velocities of S that impulses on the active rows cause.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::contact_row::{row_weights, weighted_sum};
use crate::dense::{set_vec3, vec3_at};
use crate::{NearField, TickIntegrator};
use glam::{DMat3, DVec3};
use palpate_laws::ImpulseResponse;

/// W = H A⁻¹ Hᵀ of the active rows, applied one impulse at a time. A is the mass matrix of S in explicit ticks, and the implicit
/// matrix of the whole near field, times h, in implicit ones.
pub(crate) struct SupportResponse<'a> {
    /// Indices of the active rows.
    pub(super) active: &'a [usize],
    pub(super) weights: &'a [f64],
    /// For implicit ticks: see [`write_row_responses`].
    pub(super) response: &'a [f64],
    pub(super) field: &'a NearField,
    /// Velocities of S, m/s.
    pub(super) velocity: &'a mut [f64],
    /// Sum of the impulses on the nodes of S, N s; kept for implicit ticks only.
    pub(super) impulses: &'a mut [f64],
}

/// Writes the velocities of S that unit impulses on the first `rows` rows cause, 3 × 3s numbers a row. Explicit ticks do not use them.
pub(super) fn write_row_responses(field: &NearField, weights: &[f64], rows: usize, responses: &mut [f64]) {
    if !field.integrator.is_implicit() {
        return;
    }
    let (s, n) = (3 * field.nodes, field.unknowns());
    let pairs = weights.chunks_exact(field.nodes.max(1)).zip(responses.chunks_exact_mut((3 * s).max(1)));
    for (weights, response) in pairs.take(rows) {
        response.fill(0.0);
        for (axis, to) in response.chunks_exact_mut(s.max(1)).enumerate() {
            for (node, w) in weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                let start = n * (3 * node + axis);
                let column = field.impulse_response.get(start..start + s).unwrap_or_default();
                to.iter_mut().zip(column).for_each(|(v, c)| *v += w * c);
            }
        }
    }
}

impl SupportResponse<'_> {
    fn weights(&self, index: usize) -> &[f64] {
        let row = self.active.get(index).copied();
        row.map_or(&[], |row| row_weights(self.weights, self.field.nodes, row))
    }

    /// The velocities of S that a unit impulse on a row causes, axis by axis.
    fn response(&self, index: usize) -> &[f64] {
        let size = 9 * self.field.nodes;
        let row = self.active.get(index).copied().unwrap_or(usize::MAX / (size + 1));
        self.response.get(row * size..(row + 1) * size).unwrap_or_default()
    }

    /// The diagonal block of W of a row, the inverse of its effective mass, 1/kg.
    pub(crate) fn inv_effective_mass_per_kg(&self, index: usize) -> DMat3 {
        let weights = self.weights(index);
        if self.field.integrator.is_implicit() {
            let s = 3 * self.field.nodes;
            let mut columns = self.response(index).chunks_exact(s.max(1)).map(|v| weighted_sum(weights, v));
            let mut next = || columns.next().unwrap_or_default();
            return DMat3::from_cols(next(), next(), next());
        }
        let per_kg: f64 = weights.iter().zip(&self.field.node_per_kg).map(|(w, per_kg)| w * w * per_kg).sum();
        DMat3::from_diagonal(DVec3::splat(per_kg))
    }
}

impl ImpulseResponse for SupportResponse<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        weighted_sum(self.weights(row), self.velocity)
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        let nodes = self.field.nodes;
        let Some(at) = self.active.get(row).map(|row| row * nodes) else { return };
        let weights = self.weights.get(at..at + nodes).unwrap_or_default();
        let weighted = weights.iter().enumerate().filter(|(_, w)| **w != 0.0);
        match self.field.integrator {
            TickIntegrator::Explicit { .. } => {
                for ((node, w), per_kg) in
                    weighted.map(|(node, w)| ((node, w), self.field.node_per_kg.get(node)))
                {
                    let v = vec3_at(self.velocity, node) + *w * per_kg.copied().unwrap_or(0.0) * impulse_ns;
                    set_vec3(self.velocity, node, v);
                }
            }
            TickIntegrator::Implicit { .. } => {
                for (node, w) in weighted {
                    let sum = vec3_at(self.impulses, node) + *w * impulse_ns;
                    set_vec3(self.impulses, node, sum);
                }
                let (size, s) = (9 * nodes, 3 * nodes);
                let start = self.active.get(row).map_or(0, |row| row * size);
                let response = self.response.get(start..start + size).unwrap_or_default();
                for (column, part) in response.chunks_exact(s.max(1)).zip(impulse_ns.to_array()) {
                    self.velocity.iter_mut().zip(column).for_each(|(v, c)| *v += part * c);
                }
            }
        }
    }
}
