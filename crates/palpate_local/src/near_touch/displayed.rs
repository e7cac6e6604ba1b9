//! The force that the rows of the contact patches, or of a point that is held, display.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::ContactSolver;
use super::row::ContactRow;
use crate::NearField;
use glam::DVec3;
use palpate_laws::Coulomb;

/// What several rows can hardly tell apart, by less than that share of them, is taken from their impulses.
const SHARE: f64 = 1e-2;

impl ContactSolver {
    /// The force on the hand, N, from the internal forces on S: the sum over the rows that pushed in the last step, of
    /// length `h`, of (H Hᵀ)⁻¹ H F, each as far as it lies in its friction cone.
    pub(crate) fn displayed_n(
        &mut self,
        field: &NearField,
        internal_n: &[DVec3],
        friction: f64,
        h: f64,
    ) -> DVec3 {
        let s = field.nodes;
        // What is fixed bears what it bears.
        let is_free = |node: usize| field.node_per_kg.get(node).is_some_and(|per_kg| *per_kg > 0.0);
        let force = |node: usize| internal_n.get(node).copied().unwrap_or_default();
        let (rows, all) = (&self.rows, &self.weights);
        self.active.retain(|index| rows.get(*index).is_some_and(|row| row.impulse_ns != DVec3::ZERO));
        let m = self.active.len();
        let weights = |index: usize| all.get(index * s..(index + 1) * s).unwrap_or_default();
        let impulse = |index: usize| rows.get(index).map_or(DVec3::ZERO, |row| row.impulse_ns);
        let product = |a: usize, b: usize| -> f64 {
            let pairs = weights(a).iter().zip(weights(b)).enumerate();
            pairs.filter(|(node, _)| is_free(*node)).map(|(_, (a, b))| a * b).sum()
        };
        // H (F − Hᵀ guess), the guess being −λ/h.
        for (r, &row) in self.active.iter().enumerate() {
            let free = weights(row).iter().enumerate().filter(|(node, _)| is_free(*node));
            let mut rest: DVec3 = free.map(|(node, w)| *w * force(node)).sum();
            for (c, &other) in self.active.iter().enumerate() {
                let gram = product(row, other);
                rest += gram * impulse(other) / h;
                if let Some(entry) = self.gram.get_mut(r * m + c) {
                    // A row that no free node carries has its impulse.
                    *entry = match r == c {
                        true if gram <= 0.0 => 1.0,
                        true if m > 1 => gram * (1.0 + SHARE),
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
        let force = |(index, more): (&usize, DVec3)| {
            self.rows.get(*index).map_or(DVec3::ZERO, |row| in_cone(row, more - row.impulse_ns / h))
        };
        self.active.iter().zip(shares).map(force).sum()
    }
}
