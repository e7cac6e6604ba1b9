//! The contact patches that the tool may have on S in a tick, as the body's approach finds them.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::near_triangles::NearTriangles;
use crate::dense::room;
use crate::near_tick::vec3_at;
use crate::{NearField, NearFieldCapacity, NearPatch};
use glam::DVec3;
use palpate_laws::{
    CarriedPoint, KnownPatch, KnownPatches, MAX_CARRIED, MAX_PATCHES, Neighbour, PATCH_ROWS, Patch,
    PatchLayout, PatchStart, PatchSurface, Seed, SurfacePlace, ToolMove, ToolShape,
};
use std::cell::Cell;

/// Where S and the ring are: δx_S, v_S, and the displacements of the ring.
#[derive(Clone, Copy)]
pub(crate) struct Placed<'a> {
    pub(crate) z: &'a [f64],
    pub(crate) z_dot: &'a [f64],
    pub(crate) ring_dx: &'a [f64],
}

impl Placed<'_> {
    /// Where a node of S or of the ring is, m.
    fn node_m(&self, field: &NearField, node: usize) -> DVec3 {
        match node.checked_sub(field.nodes) {
            None => field.node_m.get(node).copied().unwrap_or_default() + vec3_at(self.z, node),
            Some(i) => field.ring_m.get(i).copied().unwrap_or_default() + vec3_at(self.ring_dx, i),
        }
    }
}

/// The points of a surface, each placed when it is first needed in a tick: few are near the tool.
#[derive(Debug)]
pub(super) struct Points {
    /// Where each was, m, and in which tick.
    known: Vec<(u64, DVec3)>,
    tick: u64,
}

impl Points {
    fn with_capacity(points: usize) -> Self {
        Self { known: vec![(0, DVec3::ZERO); points], tick: 1 }
    }

    /// Forgets where they were.
    fn forget(&mut self) {
        self.tick = self.tick.wrapping_add(1);
    }

    /// The triangles of `field` with these points, where S and the ring are now.
    pub(super) fn of<'a>(&'a mut self, field: &'a NearField, placed: &'a Placed<'a>) -> PlacedTriangles<'a> {
        let known = Cell::from_mut(&mut self.known[..]).as_slice_of_cells();
        PlacedTriangles { field, placed, known, tick: self.tick }
    }
}

/// The triangles of a near field with their points where they are now.
#[derive(Clone, Copy)]
pub(super) struct PlacedTriangles<'a> {
    pub(super) field: &'a NearField,
    pub(super) placed: &'a Placed<'a>,
    /// See [`Points`].
    known: &'a [Cell<(u64, DVec3)>],
    tick: u64,
}

impl PlacedTriangles<'_> {
    /// Where a point is, m.
    pub(super) fn point_m(&self, point: usize) -> Option<DVec3> {
        let known = self.known.get(point)?;
        let (tick, x) = known.get();
        if tick == self.tick {
            return Some(x);
        }
        let carried = self.field.point.get(point)?;
        let carriers = carried.nodes.iter().filter(|(_, w)| *w != 0.0);
        let x = carriers.map(|(node, w)| *w * self.placed.node_m(self.field, *node)).sum::<DVec3>()
            + carried.fixed_m;
        known.set((self.tick, x));
        Some(x)
    }
}

impl PatchSurface for PlacedTriangles<'_> {
    fn corners_m(&self, triangle: usize) -> Option<[DVec3; 3]> {
        let [a, b, c] = self.field.triangle.get(triangle).filter(|_| triangle < self.field.triangles)?.points;
        Some([self.point_m(a)?, self.point_m(b)?, self.point_m(c)?])
    }

    fn neighbours(&self, triangle: usize) -> [Neighbour; 3] {
        self.field.triangle.get(triangle).map_or([Neighbour::default(); 3], |triangle| triangle.neighbours)
    }
}

/// A patch in a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct TickPatch {
    pub(super) known: NearPatch,
    pub(super) layout: PatchLayout,
}

/// The patches of a tick, and room to find them in.
#[derive(Debug)]
pub(super) struct Patches {
    /// Those of the step before, with their forces, and how many.
    pub(super) before: [NearPatch; MAX_PATCHES],
    pub(super) held: usize,
    now: [Option<TickPatch>; MAX_PATCHES],
    seeds: Vec<Seed>,
    near: NearTriangles,
    points: Points,
    carried: Vec<CarriedPoint>,
    /// Whether there were more than there may be.
    pub(super) is_full: bool,
}

impl Patches {
    pub(super) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        Self {
            before: [NearPatch::default(); MAX_PATCHES],
            held: 0,
            now: [None; MAX_PATCHES],
            seeds: Vec::with_capacity(capacity.triangles),
            near: NearTriangles::with_capacity(capacity),
            points: Points::with_capacity(capacity.points),
            carried: room(MAX_CARRIED, CarriedPoint::default()),
            is_full: false,
        }
    }

    /// Becomes `other`, with its own room.
    pub(super) fn copy_from(&mut self, other: &Self) {
        (self.before, self.held, self.now, self.is_full) =
            (other.before, other.held, other.now, other.is_full);
    }

    /// Those of the model step, where `field` begins.
    pub(super) fn restart(&mut self, field: &NearField) {
        (self.before, self.held) = (field.contact.patches, field.contact.count.min(MAX_PATCHES));
        self.now = [None; MAX_PATCHES];
        self.is_full = false;
        self.points.forget();
        self.near.forget();
    }

    /// Those of the tick, the points of the surface, and room for those that carry one.
    pub(super) fn parts(
        &mut self,
    ) -> (impl Iterator<Item = &TickPatch>, &mut Points, &mut Vec<CarriedPoint>) {
        (self.now.iter().flatten(), &mut self.points, &mut self.carried)
    }

    /// Finds the patches of a tool of `shape` that moves so in a tick.
    pub(super) fn find(
        &mut self,
        field: &NearField,
        shape: &ToolShape,
        tool: &ToolMove,
        placed: &Placed<'_>,
    ) {
        let scale = field.contact.scale;
        self.points.forget();
        let Self { before, held, now, seeds, near, points, is_full, .. } = self;
        *is_full = false;
        let surface = points.of(field, placed);
        let elastic = |foot: SurfacePlace| (modulus_pa(field, foot), field.contact.poissons_ratio);
        let find = |start: &PatchStart| Patch::find(&surface, shape, tool.to_m, start, &scale);
        let mut count = 0;
        let mut lay_out = |known: NearPatch| {
            let elastic = elastic(known.patch.foot);
            let layout = PatchLayout::new(shape, &known.patch, elastic, &known.row_n, &scale);
            let NearPatch { patch, rest_normal, .. } = known;
            let at_m = surface.place_m(patch.foot)?;
            *now.get_mut(count)? = Some(TickPatch { known, layout });
            count += 1;
            Some(KnownPatch { patch, at_m, rest_normal, radius_m: layout.pressure.1 })
        };
        let mut all = KnownPatches::default();
        for known in before.iter().take(*held) {
            let elastic = elastic(known.patch.foot);
            let force_n = known.row_n.iter().sum();
            let Some(patch) = find(&known.patch.start(shape, elastic, (force_n, field.tick_s))) else {
                continue;
            };
            let Some(at_m) = surface.place_m(patch.foot) else { continue };
            if !all.contains(&patch, at_m, scale.cell_m)
                && let Some(known) = lay_out(NearPatch { patch, ..*known })
            {
                all.add(known);
            }
        }
        let fastest = (0..field.nodes).map(|i| vec3_at(placed.z_dot, i).length()).fold(0.0, f64::max);
        let beside = 2.0 * fastest * field.tick_s + tool.short_m().length();
        seeds.clear();
        let way = (tool.from_m, tool.to_m);
        near.each(&surface, (shape, way, beside), &all, |index, corners, rest_normal| {
            let seed = Seed::of(shape, way, (index, corners, rest_normal), beside);
            if let Some(seed) = seed.filter(|_| seeds.len() < seeds.capacity()) {
                seeds.push(seed);
            }
        });
        all.begin(seeds, scale.cell_m, find, |patch, seed| {
            let (row_n, force_n) = ([0.0; PATCH_ROWS], [DVec3::ZERO; PATCH_ROWS]);
            let known = lay_out(NearPatch { patch, rest_normal: seed.rest_normal, row_n, force_n });
            *is_full |= known.is_none();
            known
        });
        now.iter_mut().skip(count).for_each(|patch| *patch = None);
    }

    /// Notes the forces on the rows of the patches in the step that has been made.
    pub(super) fn note(&mut self, force: impl Fn(usize, usize) -> (f64, DVec3)) {
        self.held = 0;
        for (index, patch) in self.now.iter().flatten().enumerate() {
            let (mut row_n, mut force_n) = ([0.0; PATCH_ROWS], [DVec3::ZERO; PATCH_ROWS]);
            for (row, (n, whole)) in row_n.iter_mut().zip(&mut force_n).enumerate() {
                (*n, *whole) = force(index, row);
            }
            if row_n.iter().any(|n| *n > 0.0)
                && let Some(to) = self.before.get_mut(self.held)
            {
                *to = NearPatch { row_n, force_n, ..patch.known };
                self.held += 1;
            }
        }
    }
}

/// Young's modulus at a place, Pa, where the body has one.
pub(super) fn modulus_pa(field: &NearField, place: SurfacePlace) -> Option<f64> {
    let corners = field.triangle.get(place.triangle)?.points;
    let of = |(point, w): (usize, f64)| Some(w * field.point.get(point)?.modulus_pa);
    let modulus: f64 = corners.into_iter().zip(place.weights).filter_map(of).sum();
    (modulus > 0.0).then_some(modulus)
}
