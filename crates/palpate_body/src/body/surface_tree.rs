//! Surface tree of a body.

use super::Body;
use crate::SurfaceTree;

impl SurfaceTree {
    /// Creates the tree of the surface of `body` in its current shape.
    #[must_use]
    pub fn new(body: &Body) -> Self {
        Self::of_surface(body.surface(), body.positions_m())
    }

    /// Refits the tree to the current shape of `body`.
    ///
    /// # Panics
    /// If `body` has fewer nodes or points than the one that the tree was created for.
    pub fn refit(&mut self, body: &Body) {
        self.refit_to(body.surface(), body.positions_m());
    }
}
