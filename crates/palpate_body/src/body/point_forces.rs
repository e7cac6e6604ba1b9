//! The internal force on a point of a body, and on the first point of a tie.

use super::Body;
use crate::{BodyPoint, Tie};
use glam::DVec3;

impl BodyPoint {
    /// The internal force on it, Σ w_i F_i / Σ w_i² over its free nodes, N: what the springs of `body` pull it with, at rest
    /// the opposite of what holds it. Zero where all its nodes are fixed.
    ///
    /// # Panics
    /// When `body` has not its nodes.
    #[must_use]
    pub fn internal_force_n(&self, body: &Body) -> DVec3 {
        let free = || self.nodes().iter().filter(|(node, _)| !body.network().is_fixed(*node));
        let force: DVec3 = free().map(|&(node, w)| w * body.internal_force_on_n(node)).sum();
        let share: f64 = free().map(|(_, w)| w * w).sum();
        if share > 0.0 { force / share } else { DVec3::ZERO }
    }
}

impl Tie {
    /// What the body does to a hand that holds the tie's first point, N: the internal force on the row,
    /// Σ w_i F_i / Σ w_i², without the impacts of the step.
    #[must_use]
    pub fn displayed_force_n(&self, body: &Body) -> DVec3 {
        self.point().internal_force_n(body)
    }
}
