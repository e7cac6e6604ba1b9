//! Projection of points onto a triangulated surface along a direction, by descent from triangle to triangle.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::triangle::weights_of_products;
use crate::{PatchSurface, SurfacePlace};
use glam::{DVec2, DVec3};

/// Most triangles that a projection passes.
const MOST_TRIANGLES: usize = 48;
/// Most triangles round a corner that are looked at.
const MOST_ROUND_CORNER: usize = 12;
/// A triangle that looks less along the normal than that is not seen along it.
const LEAST_FACING: f64 = 0.1;
/// Triangles that are kept as they are seen along the direction.
const KEPT: usize = 32;

/// Which edges a projection may pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edges {
    Smooth,
    All,
}

/// What a projection ends on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projected {
    pub(super) place: SurfacePlace,
    /// How far it is from the target across the direction, m.
    pub(super) off_m: f64,
}

/// A surface as it is seen along a direction.
pub(super) struct Projection<'a, S> {
    surface: &'a S,
    edges: Edges,
    /// A place that counts as the origin, m.
    origin_m: DVec3,
    normal: DVec3,
    /// Across the direction.
    axes: [DVec3; 2],
    /// Triangle i at i modulo their number: points near each other lead to the same ones.
    kept: [Option<(usize, Option<Facet>)>; KEPT],
}

/// A triangle as it is seen.
#[derive(Clone, Copy, Debug)]
struct Facet {
    /// Its first corner, and the edges to the others.
    a: DVec2,
    ab: DVec2,
    ac: DVec2,
    /// The products of the edges.
    ab_ab: f64,
    ab_ac: f64,
    ac_ac: f64,
}

impl<'a, S: PatchSurface> Projection<'a, S> {
    /// Along `normal`, with unit vectors across it.
    pub(super) fn new(
        surface: &'a S,
        edges: Edges,
        origin_m: DVec3,
        (normal, axes): (DVec3, [DVec3; 2]),
    ) -> Self {
        Self { surface, edges, origin_m, normal, axes, kept: [None; KEPT] }
    }

    /// Where a place is seen.
    pub(super) fn seen(&self, at_m: DVec3) -> DVec2 {
        let [u, v] = self.axes;
        let away = at_m - self.origin_m;
        DVec2::new(away.dot(u), away.dot(v))
    }

    /// Where a place of the surface is, m.
    pub(super) fn at_m(&self, place: SurfacePlace) -> Option<DVec3> {
        self.surface.place_m(place)
    }

    /// A triangle as it is seen. One that stands upright, or looks away, has no place under a target.
    fn facet(&mut self, triangle: usize) -> Option<&Facet> {
        let is_kept = matches!(self.kept.get(triangle % KEPT), Some(Some((kept, _))) if *kept == triangle);
        let facet = if is_kept { None } else { Some(self.look(triangle)) };
        let kept = self.kept.get_mut(triangle % KEPT)?;
        if let Some(facet) = facet {
            *kept = Some((triangle, facet));
        }
        kept.as_ref()?.1.as_ref()
    }

    fn look(&self, triangle: usize) -> Option<Facet> {
        let [a, b, c] = self.surface.corners_m(triangle)?;
        let outward = (b - a).cross(c - a);
        let along = outward.dot(self.normal);
        if along.is_nan()
            || along <= 0.0
            || along * along <= LEAST_FACING * LEAST_FACING * outward.length_squared()
        {
            return None;
        }
        let a = self.seen(a);
        let (ab, ac) = (self.seen(b) - a, self.seen(c) - a);
        Some(Facet { a, ab, ac, ab_ab: ab.dot(ab), ab_ac: ab.dot(ac), ac_ac: ac.dot(ac) })
    }

    /// The place of a triangle that is nearest to what is seen at `target`.
    fn on(&mut self, triangle: usize, target: DVec2) -> Option<Projected> {
        let &Facet { a, ab, ac, ab_ab, ab_ac, ac_ac } = self.facet(triangle)?;
        let away = target - a;
        let of_a = (ab.dot(away), ac.dot(away));
        let of_b = (of_a.0 - ab_ab, of_a.1 - ab_ac);
        let of_c = (of_a.0 - ab_ac, of_a.1 - ac_ac);
        let weights @ [_, v, w] = weights_of_products(of_a, of_b, of_c);
        // A target within the triangle is met.
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

    /// The place of the surface under what is seen at `target`: by descent from `start` over triangles that face the direction. Where the
    /// surface ends before, its nearest place.
    pub(super) fn find(&mut self, start: SurfacePlace, target: DVec2) -> Option<Projected> {
        let mut now = match self.on(start.triangle, target) {
            Some(now) => now,
            // From the nearest corner of a triangle that does not face the direction to those round it.
            None => {
                self.surface.corners_m(start.triangle)?;
                let mut weights = [0.0; 3];
                let largest = start.weights.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
                *weights.get_mut(largest.map(|(corner, _)| corner)?)? = 1.0;
                Projected { place: SurfacePlace { triangle: start.triangle, weights }, off_m: f64::MAX }
            }
        };
        for _ in 0..MOST_TRIANGLES {
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

    /// The place nearest to the target on the triangles beside that on whose edge or corner `now` lies, if it is nearer.
    fn nearer(&mut self, now: &Projected, target: DVec2) -> Option<Projected> {
        let mut best: Option<Projected> = None;
        let SurfacePlace { triangle, weights } = now.place;
        let mut look = |this: &mut Self, triangle: usize| {
            if let Some(other) = this.on(triangle, target)
                && other.off_m < best.map_or(now.off_m, |best| best.off_m) * (1.0 - 1e-12)
            {
                best = Some(other);
            }
        };
        for (edge, opposite) in [(0, 2), (1, 0), (2, 1)] {
            // Across an edge that the place lies on.
            if weights.get(opposite).is_some_and(|w| *w > 0.0) {
                continue;
            }
            let Some(mut next) = self.across(triangle, edge) else { continue };
            look(self, next);
            // On round the corner that the place lies on, away from the edge.
            let Some(corner) = weights.iter().position(|w| *w >= 1.0) else { continue };
            let mut pivot_edge = (triangle, edge, corner);
            for _ in 0..MOST_ROUND_CORNER {
                let Some(after) = turn(self.surface, pivot_edge, next) else { break };
                pivot_edge = (next, after.0, after.1);
                let Some(further) = self.across(next, after.0) else { break };
                if further == triangle {
                    break;
                }
                next = further;
                look(self, next);
            }
        }
        best
    }
}

/// The other edge of triangle `next` at a corner, and the corner's place in it, where `next` is across edge `edge` of a triangle that has the
/// corner at `corner`.
fn turn(
    surface: &impl PatchSurface,
    (from, edge, corner): (usize, usize, usize),
    next: usize,
) -> Option<(usize, usize)> {
    let back = surface.neighbours(next).iter().position(|n| n.triangle == Some(from as u32))?;
    // The edge from i to i + 1 here runs from i + 1 to i there.
    let is_begin = corner == edge;
    let place = if is_begin { (back + 1) % 3 } else { back };
    // The two edges at `place` begin at it and end at it.
    let (begins, ends) = (place, (place + 2) % 3);
    Some((if begins == back { ends } else { begins }, place))
}
