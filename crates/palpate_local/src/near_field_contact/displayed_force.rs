//! The force on the hand from the internal forces on S and the impulses of the rows.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::contact_row::{ContactRow, row_weights};
use crate::NearField;
use crate::dense::{Cholesky, zeros};
use glam::DVec3;
use palpate_laws::Coulomb;

/// Relative regularisation of the Gram matrix. Forces of nearly equal rows, which H Hᵀ cannot separate, are then taken from their impulses.
const GRAM_REGULARISATION: f64 = 1e-2;

/// Buffers for the displayed force: the Gram matrix of the rows, its factor, and the forces by axis.
#[derive(Debug)]
pub(super) struct DisplayedForce {
    gram: Vec<f64>,
    factor: Cholesky,
    shares: [Vec<f64>; 3],
}

impl DisplayedForce {
    /// Buffers for up to `rows` rows.
    pub(super) fn with_capacity(rows: usize) -> Self {
        let shares = zeros(rows);
        Self {
            gram: zeros(rows * rows),
            factor: Cholesky::with_capacity(rows),
            shares: [shares.clone(), shares.clone(), shares],
        }
    }

    /// The force on the hand, N: the sum of (H Hᵀ)⁻¹ H F over the `active` rows, the force of each row projected onto its friction
    /// cone. F are the internal forces on S, N, and `h` is the length of the last step, s. Fixed nodes do not contribute.
    pub(super) fn compute(
        &mut self,
        field: &NearField,
        (active, rows, weights): (&[usize], &[ContactRow], &[f64]),
        internal_n: &[DVec3],
        friction: f64,
        h: f64,
    ) -> DVec3 {
        let is_free = |node: usize| field.node_per_kg.get(node).is_some_and(|per_kg| *per_kg > 0.0);
        let force = |node: usize| internal_n.get(node).copied().unwrap_or_default();
        let m = active.len();
        let weights = |index: usize| row_weights(weights, field.nodes, index);
        let impulse = |index: usize| rows.get(index).map_or(DVec3::ZERO, |row| row.impulse_ns);
        let product = |a: usize, b: usize| -> f64 {
            let pairs = weights(a).iter().zip(weights(b)).enumerate();
            pairs.filter(|(node, _)| is_free(*node)).map(|(_, (a, b))| a * b).sum()
        };
        // H (F − Hᵀ g) with the guess g = −λ/h, λ the impulses of the rows.
        for (r, &row) in active.iter().enumerate() {
            let free = weights(row).iter().enumerate().filter(|(node, _)| is_free(*node));
            let mut rest: DVec3 = free.map(|(node, w)| *w * force(node)).sum();
            for (c, &other) in active.iter().enumerate() {
                let gram = product(row, other);
                rest += gram * impulse(other) / h;
                if let Some(entry) = self.gram.get_mut(r * m + c) {
                    // The force of a row without free nodes is its impulse over h.
                    *entry = match r == c {
                        true if gram <= 0.0 => 1.0,
                        true if m > 1 => gram * (1.0 + GRAM_REGULARISATION),
                        _ => gram,
                    };
                }
            }
            for (shares, part) in self.shares.iter_mut().zip(rest.to_array()) {
                if let Some(share) = shares.get_mut(r) {
                    *share = part;
                }
            }
        }
        let is_solved = self.factor.factorise(m, &self.gram).is_ok();
        for shares in &mut self.shares {
            if let Some(shares) = shares.get_mut(..m) {
                if is_solved { self.factor.solve_in_place(shares) } else { shares.fill(0.0) }
            }
        }
        let [x, y, z] = &self.shares;
        let shares = x.iter().zip(y).zip(z).map(|((x, y), z)| DVec3::new(*x, *y, *z));
        let in_cone = |row: &ContactRow, f: DVec3| {
            Coulomb::new(-row.inward, friction).map_or(DVec3::ZERO, |cone| cone.in_cone(f))
        };
        let force = |(index, correction): (&usize, DVec3)| {
            rows.get(*index).map_or(DVec3::ZERO, |row| in_cone(row, correction - row.impulse_ns / h))
        };
        active.iter().zip(shares).map(force).sum()
    }
}
