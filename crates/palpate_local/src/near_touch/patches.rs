//! The contact patches that the tool may have on S in a tick, as the body's approach finds them.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::dense::room;
use crate::near_tick::get;
use crate::{NearField, NearFieldCapacity, NearPatch, NearPoint};
use glam::DVec3;
use palpate_laws::{
    MAX_PATCHES, Neighbour, PATCH_ROWS, Patch, PatchLayout, PatchStart, PatchSurface, Seed, SurfacePlace,
    ToolMove, ToolShape, contact_radius_m,
};

/// Where S and the ring are: δx_S, v_S, and the displacements of the ring.
pub(crate) struct Placed<'a> {
    pub(crate) z: &'a [f64],
    pub(crate) z_dot: &'a [f64],
    pub(crate) ring_dx: &'a [f64],
}

/// The triangles of a near field with their points where they are now.
pub(super) struct PlacedTriangles<'a> {
    pub(super) field: &'a NearField,
    pub(super) x: &'a [DVec3],
}

impl PatchSurface for PlacedTriangles<'_> {
    fn corners_m(&self, triangle: usize) -> Option<[DVec3; 3]> {
        let [a, b, c] = self.field.triangle.get(triangle).filter(|_| triangle < self.field.triangles)?.points;
        Some([*self.x.get(a)?, *self.x.get(b)?, *self.x.get(c)?])
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
    /// The points of the surface, m.
    pub(super) point_m: Vec<DVec3>,
    /// Whether there were more than there may be.
    pub(super) is_full: bool,
}

/// Patches of one place have normals with a cosine above that.
const SAME: f64 = 0.9;

impl Patches {
    pub(super) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        Self {
            before: [NearPatch::default(); MAX_PATCHES],
            held: 0,
            now: [None; MAX_PATCHES],
            seeds: Vec::with_capacity(capacity.triangles),
            point_m: room(capacity.points, DVec3::ZERO),
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
    }

    pub(super) fn now(&self) -> impl Iterator<Item = &TickPatch> {
        self.now.iter().flatten()
    }

    /// Finds the patches of a tool of `shape` that moves so in a tick.
    pub(super) fn find(
        &mut self,
        field: &NearField,
        shape: &ToolShape,
        tool: &ToolMove,
        placed: &Placed<'_>,
    ) {
        let Self { before, held, now, seeds, point_m, is_full } = self;
        place(field, placed, point_m);
        let surface = PlacedTriangles { field, x: point_m };
        let scale = field.contact.scale;
        let mut count = 0;
        let elastic = |place: SurfacePlace| (modulus_pa(field, place), field.contact.poissons_ratio);
        let laid_out = |known: NearPatch| {
            let elastic = elastic(known.patch.foot);
            let layout = PatchLayout::new(shape, &known.patch, elastic, &known.row_n, &scale);
            TickPatch { known, layout }
        };
        let find = |start: &PatchStart| Patch::find(&surface, shape, tool.to_m, start, &scale);
        for known in before.iter().take(*held) {
            let elastic = elastic(known.patch.foot);
            let contact_m = contact_radius_m(shape, known.patch.normal, elastic, known.row_n.iter().sum());
            if let Some(patch) = find(&known.patch.start(contact_m))
                && let Some(to) = now.get_mut(count)
            {
                *to = Some(laid_out(NearPatch { patch, ..*known }));
                count += 1;
            }
        }
        now.iter_mut().skip(count).for_each(|patch| *patch = None);
        let fastest = (0..field.nodes).map(|i| get(placed.z_dot, i).length()).fold(0.0, f64::max);
        let beside = 2.0 * fastest * field.tick_s + tool.short_m().length();
        seeds.clear();
        let triangles = field.triangle.iter().take(field.triangles).enumerate();
        for (index, triangle) in triangles {
            let Some(corners) = surface.corners_m(index) else { continue };
            let of = (index, corners, triangle.rest_normal);
            let seed = Seed::of(shape, (tool.from_m, tool.to_m), of, beside);
            if let Some(seed) = seed.filter(|_| seeds.len() < seeds.capacity()) {
                seeds.push(seed);
            }
        }
        while let Some(first) = seeds.iter().copied().reduce(|a, b| if b.is_before(&a) { b } else { a }) {
            seeds.retain(|seed| seed.place.triangle != first.place.triangle);
            let is_apart = |rest_normal: DVec3, TickPatch { known, layout }: &TickPatch| {
                let SurfacePlace { triangle, weights: [u, v, w] } = known.patch.foot;
                let at_m = surface.corners_m(triangle).map_or(first.at_m, |[a, b, c]| u * a + v * b + w * c);
                first.is_apart((at_m, rest_normal, layout.pressure.1), scale.cell_m)
            };
            if !now.iter().flatten().all(|patch| is_apart(patch.known.rest_normal, patch)) {
                continue;
            }
            let Some(patch) = find(&PatchStart::on(first.place, first.normal)) else { continue };
            // Where two places lead to one patch, it is one.
            let is_same = |other: &TickPatch| {
                let known = &other.known.patch;
                known.foot.triangle == patch.foot.triangle
                    || known.normal.dot(patch.normal) > SAME && !is_apart(first.rest_normal, other)
            };
            if now.iter().flatten().any(is_same) {
                continue;
            }
            let new = NearPatch {
                patch,
                rest_normal: first.rest_normal,
                row_n: [0.0; PATCH_ROWS],
                force_n: [DVec3::ZERO; PATCH_ROWS],
            };
            match now.iter_mut().find(|to| to.is_none()) {
                Some(to) => *to = Some(laid_out(new)),
                None => *is_full = true,
            }
        }
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

/// Where the points of the surface are, m.
fn place(field: &NearField, placed: &Placed<'_>, point_m: &mut Vec<DVec3>) {
    let at = |i: usize| match i.checked_sub(field.nodes) {
        None => field.node_m.get(i).copied().unwrap_or_default() + get(placed.z, i),
        Some(i) => field.ring_m.get(i).copied().unwrap_or_default() + get(placed.ring_dx, i),
    };
    let of = |point: &NearPoint| point.fixed_m + point.carriers().map(|(i, w)| w * at(i)).sum::<DVec3>();
    point_m.clear();
    point_m.extend(field.point.iter().take(field.points.min(point_m.capacity())).map(of));
}
