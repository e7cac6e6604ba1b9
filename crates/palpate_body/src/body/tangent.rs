//! Tangent of a body in its current state.

use super::Body;
use crate::{Tangent, TangentPattern};

impl TangentPattern {
    /// Creates the pattern of the network of `body`.
    #[must_use]
    pub fn new(body: &Body) -> Self {
        Self::of_network(body.network())
    }

    /// Fills `tangent` with K and B of `body` in its current state. With `clamped`, the contribution of every spring
    /// and of every volume barrier to K is made positive semidefinite (see [`palpate_laws::Spring::tangent`] and
    /// [`palpate_laws::VolumeBarrier::tangent`]).
    ///
    /// # Panics
    /// If `body` or `tangent` belongs to another network.
    pub fn fill(&self, body: &Body, clamped: bool, tangent: &mut Tangent) {
        self.fill_at(body.network_state(), (clamped, clamped), tangent);
    }
}
