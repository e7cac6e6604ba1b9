//! Internal forces on points of a body.

use super::Body;
use crate::{BodyPoint, Tie};
use glam::DVec3;

impl BodyPoint {
    /// Internal force on the point, Σ w_i F_i / Σ w_i² over its free nodes, N. At rest it balances the force that
    /// holds the point. Zero if all its nodes are fixed.
    ///
    /// # Panics
    /// If a node of the point is not in `body`.
    #[must_use]
    pub fn internal_force_n(&self, body: &Body) -> DVec3 {
        let free = || self.nodes().iter().filter(|(node, _)| !body.network().is_fixed(*node));
        let force: DVec3 = free().map(|&(node, w)| w * body.internal_force_on_n(node)).sum();
        let share: f64 = free().map(|(_, w)| w * w).sum();
        if share > 0.0 { force / share } else { DVec3::ZERO }
    }
}

impl Tie {
    /// Force of the body on a hand that holds the tie's first point, N: the internal force on the point, without the
    /// impacts of the step.
    #[must_use]
    pub fn displayed_force_n(&self, body: &Body) -> DVec3 {
        self.point().internal_force_n(body)
    }
}
