//! Projection of points onto a triangulated surface along a direction, by descent from triangle to triangle.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::triangle::weights_of_products;
use crate::{PatchSurface, SurfacePlace};
use glam::{DVec2, DVec3};

/// Maximum number of triangles on the path of a projection.
const MAX_TRIANGLES: usize = 48;
/// Maximum number of triangles visited around a corner.
const MAX_AROUND_CORNER: usize = 12;
/// Minimum cosine between a triangle's normal and the direction; others are treated as edge-on.
const MIN_FACING: f64 = 0.1;
/// Size of the cache of projected triangles.
const CACHE_SIZE: usize = 32;

/// Edges that a projection may cross.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edges {
    Smooth,
    All,
}

/// Result of a projection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projected {
    pub(super) place: SurfacePlace,
    /// Distance from the target perpendicular to the direction, m.
    pub(super) off_m: f64,
}

/// Projection of a surface along a direction.
pub(super) struct Projection<'a, S> {
    surface: &'a S,
    edges: Edges,
    /// Origin of the projection plane, m.
    origin_m: DVec3,
    normal: DVec3,
    /// Axes of the projection plane.
    axes: [DVec3; 2],
    /// Cache: triangle i is stored at i modulo the size. Nearby points lead to the same triangles.
    kept: [Option<(usize, Option<Facet>)>; CACHE_SIZE],
}

/// A projected triangle.
#[derive(Clone, Copy, Debug)]
struct Facet {
    /// First corner, and the edges to the other two.
    a: DVec2,
    ab: DVec2,
    ac: DVec2,
    /// Scalar products of the edges.
    ab_ab: f64,
    ab_ac: f64,
    ac_ac: f64,
}

impl<'a, S: PatchSurface> Projection<'a, S> {
    /// Creates the projection along `normal`, with unit vectors perpendicular to it.
    pub(super) fn new(
        surface: &'a S,
        edges: Edges,
        origin_m: DVec3,
        (normal, axes): (DVec3, [DVec3; 2]),
    ) -> Self {
        Self { surface, edges, origin_m, normal, axes, kept: [None; CACHE_SIZE] }
    }

    /// Position in the projection plane.
    pub(super) fn seen(&self, at_m: DVec3) -> DVec2 {
        let [u, v] = self.axes;
        let away = at_m - self.origin_m;
        DVec2::new(away.dot(u), away.dot(v))
    }

    /// Position of a place of the surface, m.
    pub(super) fn at_m(&self, place: SurfacePlace) -> Option<DVec3> {
        self.surface.place_m(place)
    }

    /// The projected triangle. A triangle that is edge-on or faces away has none.
    fn facet(&mut self, triangle: usize) -> Option<&Facet> {
        let is_kept =
            matches!(self.kept.get(triangle % CACHE_SIZE), Some(Some((kept, _))) if *kept == triangle);
        let facet = if is_kept { None } else { Some(self.project(triangle)) };
        let kept = self.kept.get_mut(triangle % CACHE_SIZE)?;
        if let Some(facet) = facet {
            *kept = Some((triangle, facet));
        }
        kept.as_ref()?.1.as_ref()
    }

    fn project(&self, triangle: usize) -> Option<Facet> {
        let [a, b, c] = self.surface.corners_m(triangle)?;
        let outward = (b - a).cross(c - a);
        let along = outward.dot(self.normal);
        if along.is_nan()
            || along <= 0.0
            || along * along <= MIN_FACING * MIN_FACING * outward.length_squared()
        {
            return None;
        }
        let a = self.seen(a);
        let (ab, ac) = (self.seen(b) - a, self.seen(c) - a);
        Some(Facet { a, ab, ac, ab_ab: ab.dot(ab), ab_ac: ab.dot(ac), ac_ac: ac.dot(ac) })
    }

    /// The place of a triangle nearest to `target` in the projection plane.
    fn on(&mut self, triangle: usize, target: DVec2) -> Option<Projected> {
        let &Facet { a, ab, ac, ab_ab, ab_ac, ac_ac } = self.facet(triangle)?;
        let away = target - a;
        let of_a = (ab.dot(away), ac.dot(away));
        let of_b = (of_a.0 - ab_ab, of_a.1 - ab_ac);
        let of_c = (of_a.0 - ab_ac, of_a.1 - ac_ac);
        let weights @ [_, v, w] = weights_of_products(of_a, of_b, of_c);
        // The target lies within the triangle.
        let is_within = weights.iter().all(|w| *w > 0.0);
        let off_m = if is_within { 0.0 } else { (v * ab + w * ac).distance(away) };
        let is_place = off_m.is_finite() && weights.iter().all(|w| *w >= 0.0);
        is_place.then_some(Projected { place: SurfacePlace { triangle, weights }, off_m })
    }

    fn across(&self, triangle: usize, edge: usize) -> Option<usize> {
        let neighbour = self.surface.neighbours(triangle).get(edge).copied()?;
        let passes = self.edges == Edges::All || !neighbour.is_crease;
        neighbour.triangle.filter(|_| passes).map(|triangle| triangle as usize)
    }

    /// The place of the surface under `target`, by descent from `start` over triangles that face the direction.
    /// Beyond the end of the surface it is the nearest place.
    pub(super) fn find(&mut self, start: SurfacePlace, target: DVec2) -> Option<Projected> {
        let mut now = match self.on(start.triangle, target) {
            Some(now) => now,
            // Start at the nearest corner of a triangle that does not face the direction.
            None => {
                self.surface.corners_m(start.triangle)?;
                let mut weights = [0.0; 3];
                let largest = start.weights.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
                *weights.get_mut(largest.map(|(corner, _)| corner)?)? = 1.0;
                Projected { place: SurfacePlace { triangle: start.triangle, weights }, off_m: f64::MAX }
            }
        };
        for _ in 0..MAX_TRIANGLES {
            if now.off_m == 0.0 {
                break;
            }
            match self.nearer(&now, target) {
                Some(best) => now = best,
                None => break,
            }
        }
        (now.off_m < f64::MAX).then_some(now)
    }

    /// The place nearest to the target on the triangles that share the edge or corner of `now`, if it is nearer.
    fn nearer(&mut self, now: &Projected, target: DVec2) -> Option<Projected> {
        let mut best: Option<Projected> = None;
        let SurfacePlace { triangle, weights } = now.place;
        let mut examine = |this: &mut Self, triangle: usize| {
            if let Some(other) = this.on(triangle, target)
                && other.off_m < best.map_or(now.off_m, |best| best.off_m) * (1.0 - 1e-12)
            {
                best = Some(other);
            }
        };
        for (edge, opposite) in [(0, 2), (1, 0), (2, 1)] {
            // Across an edge that contains the place.
            if weights.get(opposite).is_some_and(|w| *w > 0.0) {
                continue;
            }
            let Some(mut next) = self.across(triangle, edge) else { continue };
            examine(self, next);
            // Around the corner that contains the place, away from the edge.
            let Some(corner) = weights.iter().position(|w| *w >= 1.0) else { continue };
            let mut pivot_edge = (triangle, edge, corner);
            for _ in 0..MAX_AROUND_CORNER {
                let Some(after) = turn(self.surface, pivot_edge, next) else { break };
                pivot_edge = (next, after.0, after.1);
                let Some(further) = self.across(next, after.0) else { break };
                if further == triangle {
                    break;
                }
                next = further;
                examine(self, next);
            }
        }
        best
    }
}

/// The other edge of triangle `next` at a corner, and the index of the corner in it. `next` is across edge `edge` of
/// triangle `from`, whose corner has the index `corner`.
fn turn(
    surface: &impl PatchSurface,
    (from, edge, corner): (usize, usize, usize),
    next: usize,
) -> Option<(usize, usize)> {
    let back = surface.neighbours(next).iter().position(|n| n.triangle == Some(from as u32))?;
    // The edge from i to i + 1 here runs from i + 1 to i in the neighbour.
    let is_begin = corner == edge;
    let place = if is_begin { (back + 1) % 3 } else { back };
    // One of the two edges at `place` begins there, and the other ends there.
    let (begins, ends) = (place, (place + 2) % 3);
    Some((if begins == back { ends } else { begins }, place))
}
