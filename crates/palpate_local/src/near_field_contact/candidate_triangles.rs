//! Broad phase of contact detection: the triangles within reach of the tool over the next ticks.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::placed_surface::PlacedSurface;
use crate::NearFieldCapacity;
use crate::dense::{touched_capacity, zeros};
use glam::DVec3;
use palpate_laws::{ActivePatches, PatchSurface, Seed, ToolShape};

/// How far tool and surface may move before the list is rebuilt, the larger of: a share of the tool's radius, a share of a cell.
const MARGIN_RADII: f64 = 0.5;
const MARGIN_CELLS: f64 = 0.25;

/// The triangles that were near the tool when the list was built, and the displacements of S and of the ring at that time.
#[derive(Debug)]
pub(super) struct CandidateTriangles {
    list: Vec<Candidate>,
    /// Position of the tool's core at that time, and the distance from it up to which triangles are listed, m.
    core_m: DVec3,
    within_m: f64,
    /// δx_S, and the displacements of the ring.
    z: Vec<f64>,
    ring_dx: Vec<f64>,
    /// Maximum displacement of a point when no node moves by more than 1.
    max_amplification: f64,
}

/// A triangle and its bounding ball when the list was built.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    index: usize,
    centre_m: DVec3,
    radius_m: f64,
}

impl CandidateTriangles {
    pub(super) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        let NearFieldCapacity { nodes, ring, triangles, .. } = capacity;
        let fill = Candidate { index: 0, centre_m: DVec3::ZERO, radius_m: 0.0 };
        Self {
            list: touched_capacity(triangles, fill),
            core_m: DVec3::ZERO,
            within_m: f64::NEG_INFINITY,
            z: zeros(3 * nodes),
            ring_dx: zeros(3 * ring),
            max_amplification: 0.0,
        }
    }

    /// Invalidates the list.
    pub(super) fn invalidate(&mut self) {
        self.within_m = f64::NEG_INFINITY;
    }

    /// Calls `visit` with the index, the corners, m, and the normal at rest of every triangle on which the tool may have a [`Seed`] that
    /// is not part of the `known` patches. The tool has the given shape, moves along `path` and reaches `reach_m` beyond it.
    pub(super) fn for_each(
        &mut self,
        surface: &PlacedSurface<'_>,
        (shape, path, reach_m): (&ToolShape, (DVec3, DVec3), f64),
        known: &ActivePatches,
        mut visit: impl FnMut(usize, [DVec3; 3], DVec3),
    ) {
        let (core_m, farthest_m) = (shape.core_m(path.0), Seed::farthest_m(shape, path, reach_m));
        let mut moved_m = self.max_displacement_m(surface);
        let is_current = farthest_m + moved_m + core_m.distance(self.core_m) <= self.within_m;
        let cell_m = surface.field.contact.scale.cell_m;
        if !is_current {
            let margin_m = (MARGIN_RADII * shape.radius_m()).max(MARGIN_CELLS * cell_m);
            self.rebuild(surface, core_m, farthest_m + margin_m);
            moved_m = 0.0;
        }
        for &Candidate { index, centre_m, radius_m } in &self.list {
            let limit_m = farthest_m + moved_m + radius_m;
            if centre_m.distance_squared(core_m) > limit_m * limit_m {
                continue;
            }
            let Some(rest_normal) = surface.field.triangle.get(index).map(|triangle| triangle.rest_normal)
            else {
                continue;
            };
            if known.covers(rest_normal, (centre_m, radius_m + moved_m), cell_m) {
                continue;
            }
            if let Some(corners) = surface.corners_m(index) {
                visit(index, corners, rest_normal);
            }
        }
    }

    /// Upper bound of the displacement of any surface point since the list was built, m.
    fn max_displacement_m(&self, surface: &PlacedSurface<'_>) -> f64 {
        let (field, motion) = (surface.field, surface.motion);
        let farthest = |now: &[f64], then: &[f64], nodes: usize| {
            let (now, then) = (now.as_chunks::<3>().0.iter(), then.as_chunks::<3>().0.iter());
            now.zip(then)
                .take(nodes)
                .map(|(now, then)| DVec3::from_array(*now).distance_squared(DVec3::from_array(*then)))
                .fold(0.0, f64::max)
        };
        let of_support = farthest(motion.z, &self.z, field.nodes);
        let of_ring = farthest(motion.ring_dx, &self.ring_dx, field.ring);
        self.max_amplification * of_support.max(of_ring).sqrt()
    }

    /// Lists the triangles within `within_m` of the tool's core.
    fn rebuild(&mut self, surface: &PlacedSurface<'_>, core_m: DVec3, within_m: f64) {
        let (field, motion) = (surface.field, surface.motion);
        (self.core_m, self.within_m) = (core_m, within_m);
        let copy = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        copy(&mut self.z, motion.z);
        copy(&mut self.ring_dx, motion.ring_dx);
        let points = field.point.iter().take(field.points);
        let weights = points.map(|point| point.nodes.iter().map(|(_, w)| w.abs()).sum());
        self.max_amplification = weights.fold(0.0, f64::max);
        self.list.clear();
        for index in 0..field.triangles {
            let Some([a, b, c]) = surface.corners_m(index) else { continue };
            let centre_m = (a + b + c) / 3.0;
            let radius2 = [a, b, c].map(|x| x.distance_squared(centre_m)).into_iter().fold(0.0, f64::max);
            let radius_m = radius2.sqrt();
            let limit_m = within_m + radius_m;
            if centre_m.distance_squared(core_m) <= limit_m * limit_m
                && self.list.len() < self.list.capacity()
            {
                self.list.push(Candidate { index, centre_m, radius_m });
            }
        }
    }
}
