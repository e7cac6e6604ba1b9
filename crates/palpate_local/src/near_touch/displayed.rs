//! What the points that are touched display.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::Meeting;
use super::look::Point;
use crate::NearField;
use glam::DVec3;
use palpate_laws::Coulomb;

/// What several rows can hardly tell apart, by less than that share of them, is taken from their impulses.
const SHARE: f64 = 1e-2;

impl Meeting {
    /// The force on the hand, N, from the internal forces on S: the sum over the points that pushed in the last step, of
    /// length `h`, of (H Hᵀ)⁻¹ H F, each as far as it lies in its friction cone.
    pub(crate) fn displayed_n(
        &mut self,
        field: &NearField,
        internal_n: &[DVec3],
        friction: f64,
        h: f64,
    ) -> DVec3 {
        self.points.retain(|point| point.is_met && point.impulse_ns != DVec3::ZERO);
        let m = self.points.len();
        let in_cone = |point: &Point, f: DVec3| {
            Coulomb::new(-point.push, friction).map_or(DVec3::ZERO, |cone| cone.in_cone(f))
        };
        // What is fixed bears what it bears.
        let is_free = |node: usize| field.node_per_kg.get(node).is_some_and(|per_kg| *per_kg > 0.0);
        let of = |point: &Point, node: usize| -> f64 {
            point.carriers.iter().filter(|(n, _)| *n == node && is_free(*n)).map(|(_, w)| w).sum()
        };
        let product =
            |a: &Point, b: &Point| -> f64 { a.carriers.iter().map(|(node, w)| w * of(b, node)).sum() };
        let force = |node: usize| internal_n.get(node).copied().unwrap_or_default();
        // H (F − Hᵀ guess), the guess being −λ/h.
        for (r, point) in self.points.iter().enumerate() {
            let free = point.carriers.iter().filter(|(node, _)| is_free(*node));
            let mut rest: DVec3 = free.map(|(node, w)| w * force(node)).sum();
            for (s, other) in self.points.iter().enumerate() {
                let gram = product(point, other);
                rest += gram * other.impulse_ns / h;
                if let Some(entry) = self.gram.get_mut(r * m + s) {
                    *entry = if r == s && m > 1 { gram * (1.0 + SHARE) } else { gram };
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
        self.points.iter().zip(shares).map(|(point, more)| in_cone(point, more - point.impulse_ns / h)).sum()
    }
}
