//! The tangent of a body at its present state.

use super::Body;
use crate::{Tangent, TangentPattern};

impl TangentPattern {
    /// The pattern of `body`'s network.
    #[must_use]
    pub fn new(body: &Body) -> Self {
        Self::of_network(body.network())
    }

    /// Fills `tangent` with K and B of `body` at its present state. With `clamped`, every spring's share of K
    /// and every volume barrier's share of K is made positive semidefinite (see [`palpate_laws::Spring::tangent`] and
    /// [`palpate_laws::VolumeBarrier::tangent`]), and so is K.
    ///
    /// # Panics
    /// When `body` or `tangent` belongs to another network.
    pub fn fill(&self, body: &Body, clamped: bool, tangent: &mut Tangent) {
        self.fill_at(body.network(), body.positions_m(), (clamped, clamped), tangent);
    }
}
