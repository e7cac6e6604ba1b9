//! The triangles that a tool may come to in the next ticks, so that a tick looks at those alone.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::patches::PlacedTriangles;
use crate::NearFieldCapacity;
use crate::dense::{room, zeros};
use glam::DVec3;
use palpate_laws::{KnownPatches, PatchSurface, Seed, ToolShape};

/// How far the tool and the surface may move until triangles are looked for again: so much of the tool's radius, or of a cell.
const AHEAD_RADII: f64 = 0.5;
const AHEAD_CELLS: f64 = 0.25;

/// The triangles that were near the tool at a moment of the past, and where S and the ring were then.
#[derive(Debug)]
pub(super) struct NearTriangles {
    all: Vec<Listed>,
    /// Where the tool's core was, and how far from it triangles were listed, m.
    core_m: DVec3,
    within_m: f64,
    /// δx_S, and the displacements of the ring.
    z: Vec<f64>,
    ring_dx: Vec<f64>,
    /// How far a point moves where no node moves farther than 1.
    stretch: f64,
}

/// A triangle and a ball round it, as of then.
#[derive(Clone, Copy, Debug)]
struct Listed {
    index: usize,
    middle_m: DVec3,
    radius_m: f64,
}

impl NearTriangles {
    pub(super) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        let NearFieldCapacity { nodes, ring, triangles, .. } = capacity;
        let one = Listed { index: 0, middle_m: DVec3::ZERO, radius_m: 0.0 };
        Self {
            all: room(triangles, one),
            core_m: DVec3::ZERO,
            within_m: f64::NEG_INFINITY,
            z: zeros(3 * nodes),
            ring_dx: zeros(3 * ring),
            stretch: 0.0,
        }
    }

    /// Forgets them.
    pub(super) fn forget(&mut self) {
        self.within_m = f64::NEG_INFINITY;
    }

    /// Calls `look` with every triangle on which a tool of that shape, way and reach may have a [`Seed`] apart from the `known` patches, where
    /// its corners are, m, and its normal at rest.
    pub(super) fn each(
        &mut self,
        surface: &PlacedTriangles<'_>,
        (shape, way, reach_m): (&ToolShape, (DVec3, DVec3), f64),
        known: &KnownPatches,
        mut look: impl FnMut(usize, [DVec3; 3], DVec3),
    ) {
        let (core_m, farthest_m) = (shape.core_m(way.0), Seed::farthest_m(shape, way, reach_m));
        let mut moved_m = self.moved_m(surface);
        let is_listed = farthest_m + moved_m + core_m.distance(self.core_m) <= self.within_m;
        let cell_m = surface.field.contact.scale.cell_m;
        if !is_listed {
            let ahead_m = (AHEAD_RADII * shape.radius_m()).max(AHEAD_CELLS * cell_m);
            self.list(surface, core_m, farthest_m + ahead_m);
            moved_m = 0.0;
        }
        for &Listed { index, middle_m, radius_m } in &self.all {
            let most_m = farthest_m + moved_m + radius_m;
            if middle_m.distance_squared(core_m) > most_m * most_m {
                continue;
            }
            let Some(rest_normal) = surface.field.triangle.get(index).map(|triangle| triangle.rest_normal)
            else {
                continue;
            };
            if known.covers(rest_normal, (middle_m, radius_m + moved_m), cell_m) {
                continue;
            }
            if let Some(corners) = surface.corners_m(index) {
                look(index, corners, rest_normal);
            }
        }
    }

    /// How far any point of the surface has moved at most, m.
    fn moved_m(&self, surface: &PlacedTriangles<'_>) -> f64 {
        let (field, placed) = (surface.field, surface.placed);
        let farthest = |now: &[f64], then: &[f64], nodes: usize| {
            let (now, then) = (now.as_chunks::<3>().0.iter(), then.as_chunks::<3>().0.iter());
            now.zip(then)
                .take(nodes)
                .map(|(now, then)| DVec3::from_array(*now).distance_squared(DVec3::from_array(*then)))
                .fold(0.0, f64::max)
        };
        let of_s = farthest(placed.z, &self.z, field.nodes);
        let of_ring = farthest(placed.ring_dx, &self.ring_dx, field.ring);
        self.stretch * of_s.max(of_ring).sqrt()
    }

    /// Lists the triangles that are within that distance of the tool's core.
    fn list(&mut self, surface: &PlacedTriangles<'_>, core_m: DVec3, within_m: f64) {
        let (field, placed) = (surface.field, surface.placed);
        (self.core_m, self.within_m) = (core_m, within_m);
        let copy = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        copy(&mut self.z, placed.z);
        copy(&mut self.ring_dx, placed.ring_dx);
        let points = field.point.iter().take(field.points);
        let weights = points.map(|point| point.nodes.iter().map(|(_, w)| w.abs()).sum());
        self.stretch = weights.fold(0.0, f64::max);
        self.all.clear();
        for index in 0..field.triangles {
            let Some([a, b, c]) = surface.corners_m(index) else { continue };
            let middle_m = (a + b + c) / 3.0;
            let radius2 = [a, b, c].map(|x| x.distance_squared(middle_m)).into_iter().fold(0.0, f64::max);
            let radius_m = radius2.sqrt();
            let most_m = within_m + radius_m;
            if middle_m.distance_squared(core_m) <= most_m * most_m && self.all.len() < self.all.capacity() {
                self.all.push(Listed { index, middle_m, radius_m });
            }
        }
    }
}
