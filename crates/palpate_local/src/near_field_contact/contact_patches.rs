//! The contact patches of the tool on the near field's surface in a tick, found as in the body's step.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::candidate_triangles::CandidateTriangles;
use super::placed_surface::{NodeMotion, PointCache};
use crate::dense::{touched_capacity, vec3_at};
use crate::{NearField, NearFieldCapacity, NearPatch};
use glam::DVec3;
use palpate_laws::{
    ActivePatch, ActivePatches, LoadedPoint, MAX_LOADED_POINTS, MAX_PATCHES, PATCH_ROWS, Patch, PatchLayout,
    PatchStart, PatchSurface, Seed, SurfacePlace, ToolMove, ToolShape,
};

/// A patch in a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct TickPatch {
    pub(super) near: NearPatch,
    pub(super) layout: PatchLayout,
}

/// The patches of a tick, and the buffers used to find them.
#[derive(Debug)]
pub(super) struct ContactPatches {
    /// The loaded patches of the previous step with their forces, the first `previous_count` of these.
    previous: [NearPatch; MAX_PATCHES],
    previous_count: usize,
    current: [Option<TickPatch>; MAX_PATCHES],
    seeds: Vec<Seed>,
    candidates: CandidateTriangles,
    points: PointCache,
    carried: Vec<LoadedPoint>,
    /// Whether a patch was dropped because the maximum number was reached.
    pub(super) is_full: bool,
}

impl ContactPatches {
    pub(super) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        Self {
            previous: [NearPatch::default(); MAX_PATCHES],
            previous_count: 0,
            current: [None; MAX_PATCHES],
            seeds: Vec::with_capacity(capacity.triangles),
            candidates: CandidateTriangles::with_capacity(capacity),
            points: PointCache::with_capacity(capacity.points),
            carried: touched_capacity(MAX_LOADED_POINTS, LoadedPoint::default()),
            is_full: false,
        }
    }

    /// Copies the patches of `other` and keeps the own buffers.
    pub(super) fn copy_from(&mut self, other: &Self) {
        (self.previous, self.previous_count, self.current, self.is_full) =
            (other.previous, other.previous_count, other.current, other.is_full);
    }

    /// Resets to the patches of the model step of `field`.
    pub(super) fn restart(&mut self, field: &NearField) {
        (self.previous, self.previous_count) = (field.contact.patches, field.contact.count.min(MAX_PATCHES));
        self.current = [None; MAX_PATCHES];
        self.is_full = false;
        self.points.invalidate();
        self.candidates.invalidate();
    }

    /// The current patches, the positions of the surface points, and a buffer for the points that carry a patch.
    pub(super) fn parts(
        &mut self,
    ) -> (impl Iterator<Item = &TickPatch>, &mut PointCache, &mut Vec<LoadedPoint>) {
        (self.current.iter().flatten(), &mut self.points, &mut self.carried)
    }

    /// Finds the patches of a tool of `shape` that moves by `tool` in this tick: those of the previous step first, then new ones.
    pub(super) fn detect(
        &mut self,
        field: &NearField,
        shape: &ToolShape,
        tool: &ToolMove,
        motion: &NodeMotion<'_>,
    ) {
        let scale = field.contact.scale;
        self.points.invalidate();
        let Self { previous, previous_count, current, seeds, candidates, points, is_full, .. } = self;
        *is_full = false;
        let surface = points.surface(field, motion);
        let elastic = |foot: SurfacePlace| (modulus_pa(field, foot), field.contact.poissons_ratio);
        let find = |start: &PatchStart| Patch::find(&surface, shape, tool.to_m, start, &scale);
        let mut count = 0;
        let mut lay_out = |near: NearPatch| {
            let elastic = elastic(near.patch.foot);
            let layout = PatchLayout::new(shape, &near.patch, elastic, &near.row_n, &scale);
            let NearPatch { patch, rest_normal, .. } = near;
            let at_m = surface.place_m(patch.foot)?;
            *current.get_mut(count)? = Some(TickPatch { near, layout });
            count += 1;
            Some(ActivePatch { patch, at_m, rest_normal, radius_m: layout.pressure.1 })
        };
        let mut found = ActivePatches::default();
        for near in previous.iter().take(*previous_count) {
            let elastic = elastic(near.patch.foot);
            let force_n = near.row_n.iter().sum();
            let Some(patch) = find(&near.patch.start(shape, elastic, (force_n, field.tick_s))) else {
                continue;
            };
            let Some(at_m) = surface.place_m(patch.foot) else { continue };
            if !found.contains(&patch, at_m, scale.cell_m)
                && let Some(known) = lay_out(NearPatch { patch, ..*near })
            {
                found.add(known);
            }
        }
        let max_speed = (0..field.nodes).map(|i| vec3_at(motion.z_dot, i).length()).fold(0.0, f64::max);
        let reach_m = 2.0 * max_speed * field.tick_s + tool.remaining_m().length();
        seeds.clear();
        let path = (tool.from_m, tool.to_m);
        candidates.for_each(&surface, (shape, path, reach_m), &found, |index, corners, rest_normal| {
            let seed = Seed::of(shape, path, (index, corners, rest_normal), reach_m);
            if let Some(seed) = seed.filter(|_| seeds.len() < seeds.capacity()) {
                seeds.push(seed);
            }
        });
        found.begin(seeds, scale.cell_m, find, |patch, seed| {
            let (row_n, force_n) = ([0.0; PATCH_ROWS], [DVec3::ZERO; PATCH_ROWS]);
            let known = lay_out(NearPatch { patch, rest_normal: seed.rest_normal, row_n, force_n });
            *is_full |= known.is_none();
            known
        });
        current.iter_mut().skip(count).for_each(|patch| *patch = None);
    }

    /// Stores the patches that carried a load in the step just solved. `force` returns the normal force of a row, N, and the whole
    /// force on the body, N, by patch and row.
    pub(super) fn store_forces(&mut self, force: impl Fn(usize, usize) -> (f64, DVec3)) {
        self.previous_count = 0;
        for (index, patch) in self.current.iter().flatten().enumerate() {
            let (mut row_n, mut force_n) = ([0.0; PATCH_ROWS], [DVec3::ZERO; PATCH_ROWS]);
            for (row, (n, whole)) in row_n.iter_mut().zip(&mut force_n).enumerate() {
                (*n, *whole) = force(index, row);
            }
            if row_n.iter().any(|n| *n > 0.0)
                && let Some(to) = self.previous.get_mut(self.previous_count)
            {
                *to = NearPatch { row_n, force_n, ..patch.near };
                self.previous_count += 1;
            }
        }
    }
}

/// Young's modulus at a place of the surface, Pa; `None` where the body has none.
pub(super) fn modulus_pa(field: &NearField, place: SurfacePlace) -> Option<f64> {
    let corners = field.triangle.get(place.triangle)?.points;
    let of = |(point, w): (usize, f64)| Some(w * field.point.get(point)?.modulus_pa);
    let modulus: f64 = corners.into_iter().zip(place.weights).filter_map(of).sum();
    (modulus > 0.0).then_some(modulus)
}
