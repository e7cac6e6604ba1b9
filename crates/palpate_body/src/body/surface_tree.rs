//! The surface tree of a body.

use super::Body;
use crate::SurfaceTree;

impl SurfaceTree {
    /// The tree of `body`'s surface where it is now.
    #[must_use]
    pub fn new(body: &Body) -> Self {
        Self::of_surface(body.surface(), body.positions_m())
    }

    /// Fits the tree to where `body` is now: fast as long as its triangles stay neighbours, which they do.
    ///
    /// # Panics
    /// When `body` is not the one that the tree is of and has fewer nodes or points.
    pub fn refit(&mut self, body: &Body) {
        self.refit_to(body.surface(), body.positions_m());
    }
}
