//! The tool's way to the surface of a body: what it may touch, and in steps short enough not to miss it.

use super::Body;
use crate::tool::Hold;
use crate::{SurfaceTree, ToolContact};
use glam::DVec3;

/// Of a step of the tool that touches, the largest part of its radius.
const SHARE_OF_RADIUS: f64 = 0.5;
/// A tool that moves farther in a millisecond than that many such steps has jumped: what lay between was not touched.
const MOST_CUTS_PER_MS: f64 = 256.0;

/// Of its radius, by so much a tool may be in the surface and still count as clear of it.
const CLEAR_SHARE: f64 = 1e-3;

/// What a tool may touch on a piece of its path.
pub(super) struct Approach {
    /// The triangles that it comes near: their points, and their longest edge at rest, m.
    pub(super) near: Vec<([usize; 3], f64)>,
    /// Into so many steps each step is to be cut, so that nothing is passed unseen.
    pub(super) cuts: usize,
}

impl Approach {
    /// Far from everything.
    pub(super) fn none() -> Self {
        Self { near: Vec::new(), cuts: 1 }
    }
}

impl Body {
    /// The approach of a tool whose device goes from `from_m` to `to_m`, straight and in `steps` steps, which take `span_s`
    /// together. A tool that is inside the body at the beginning touches nothing until it has come out.
    pub(super) fn approach(
        &mut self,
        contact: &mut ToolContact,
        (from_m, to_m): (DVec3, DVec3),
        span_s: f64,
        steps: usize,
    ) -> Approach {
        let proxy_m = contact.proxy_m(from_m);
        let Hold::Nothing { shape, clear, .. } = &mut contact.hold else { return Approach::none() };
        let (radius, moved) = (shape.radius_m(), from_m.distance(to_m));
        let speed2 = |&node: &usize| self.v[node].length_squared();
        let fastest = self.network.free().iter().map(speed2).fold(0.0, f64::max).sqrt();
        // Nodes are pushed by the tool, or move by themselves; what comes from farther is met in the next piece.
        let reach = 1.5 * radius + moved + 2.0 * fastest * span_s;
        let way = [from_m, to_m, proxy_m, proxy_m + (to_m - from_m)];
        let low = way.into_iter().fold(DVec3::INFINITY, DVec3::min) - reach;
        let high = way.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max) + reach;
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for x in self.surface.points.iter().map(|point| point.of(&self.x)) {
            (least, most) = (least.min(x), most.max(x));
        }
        if !(least.cmple(high).all() && most.cmpge(low).all()) {
            *clear = true;
            return Approach::none();
        }
        let mut tree = self.tree.take().unwrap_or_else(|| Box::new(SurfaceTree::new(self)));
        tree.refit(self);
        let near = tree.within(low, high);
        let closest = tree.closest(shape.core_m(proxy_m), reach + radius);
        self.tree = Some(tree);
        *clear = closest.is_some_and(|closest| {
            let least = if *clear { 0.0 } else { radius * (1.0 - CLEAR_SHARE) };
            closest.distance_m > least
        });
        // A share that is met to rounding is met.
        let cuts = (moved / (SHARE_OF_RADIUS * radius * steps as f64) - 1e-9).ceil().max(1.0);
        let has_jumped = cuts * steps as f64 > MOST_CUTS_PER_MS * (1e3 * span_s).max(1.0);
        if !near.is_empty() && has_jumped {
            *clear = false;
        }
        if *clear && !near.is_empty() { Approach { near, cuts: cuts as usize } } else { Approach::none() }
    }
}
