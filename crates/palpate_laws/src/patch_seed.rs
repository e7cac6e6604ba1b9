//! Where a tool comes to a surface first: the triangles on which contact patches begin.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{MAX_PATCHES, Patch, PatchStart, SurfacePlace, ToolShape, nearest_weights};
use glam::DVec3;

/// A place on which a contact patch may begin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// The place of its triangle that the tool comes nearest to.
    pub place: SurfacePlace,
    /// Where it is, m.
    pub at_m: DVec3,
    /// The triangle's unit normal now, and that at rest.
    pub normal: DVec3,
    /// See `normal`.
    pub rest_normal: DVec3,
    /// The look at the way at which it was within the tool's reach, and how far it was then, m: smaller comes first.
    order: (u32, f64),
}

/// Of the way between two looks at the surface, the largest part of a tool's radius, and the most looks.
const LOOK_SHARE: f64 = 0.5;
const MOST_LOOKS: f64 = 64.0;
/// Patches are apart where their normals at rest are at an angle with a cosine below that.
const APART: f64 = 0.5;
/// And where they are farther from each other than that multiple of the first one's radius and so many cells.
const BEYOND_RADII: f64 = 2.0;
const BEYOND_CELLS: f64 = 2.0;
/// Patches of one place have normals with a cosine above that.
const SAME: f64 = 0.9;

impl Seed {
    /// The seed on a triangle for a tool whose position goes straight from `from_m` to `to_m`; `None` where the tool does not come within
    /// `reach_m` of it beside its own radius, or begins behind it.
    #[must_use]
    pub fn of(
        shape: &ToolShape,
        (from_m, to_m): (DVec3, DVec3),
        (triangle, corners_m, rest_normal): (usize, [DVec3; 3], DVec3),
        reach_m: f64,
    ) -> Option<Self> {
        let [a, b, c] = corners_m;
        // What is far is seen at a glance.
        let size = a.distance(b).max(a.distance(c));
        let far = reach_m + from_m.distance(to_m) + 3.0 * shape.radius_m() + size;
        if a.distance_squared(from_m) > far * far {
            return None;
        }
        let normal = (b - a).cross(c - a).try_normalize()?;
        let core = |share: f64| shape.core_m(from_m.lerp(to_m, share));
        if (core(0.0) - a).dot(normal) < 0.0 {
            return None;
        }
        let radius_m = shape.radius_m();
        let looks = (from_m.distance(to_m) / (LOOK_SHARE * radius_m)).ceil().clamp(1.0, MOST_LOOKS) as u32;
        let around = around_m(shape);
        let mut best: Option<Self> = None;
        for look in 0..=looks {
            let core = core(f64::from(look) / f64::from(looks));
            let weights = nearest_weights(core, corners_m);
            let [u, v, w] = weights;
            let at_m = u * a + v * b + w * c;
            let away = at_m.distance(core) - around;
            // What is passed is met.
            let is_passed = (core - a).dot(normal) < 0.0;
            if away.is_nan() || away > reach_m && !(is_passed && weights.iter().all(|w| *w > 0.0)) {
                continue;
            }
            let order = (if away <= 0.0 { look } else { looks + 1 }, away);
            if best.is_none_or(|best| order < best.order) {
                let place = SurfacePlace { triangle, weights };
                best = Some(Self { place, at_m, normal, rest_normal, order });
            }
            if away <= 0.0 {
                break;
            }
        }
        best
    }

    /// No triangle has a seed that is farther than that from the tool's core at the beginning of its way, m: see [`Seed::of`].
    #[must_use]
    pub fn farthest_m(shape: &ToolShape, (from_m, to_m): (DVec3, DVec3), reach_m: f64) -> f64 {
        let moved_m = from_m.distance(to_m);
        // What is passed is in front of the core at first, and no deeper than the way is long in the end.
        (reach_m + around_m(shape) + moved_m).max(2.0 * moved_m) * (1.0 + 1e-9)
    }

    /// Whether it comes before `other`.
    fn is_before(&self, other: &Self) -> bool {
        (self.order, self.place.triangle) < (other.order, other.place.triangle)
    }

    /// Whether the tool is in contact on it apart from a patch that began on a place with that normal at rest: because the surface looks
    /// elsewhere there, or is met beyond the patch.
    fn is_apart(&self, rest_normal: DVec3, known: &KnownPatch, cell_m: f64) -> bool {
        let is_met = self.order.1 < 0.0;
        self.rest_normal.dot(rest_normal) < APART
            || is_met && self.at_m.distance(known.at_m) > known.across_m(cell_m)
    }
}

/// How far the surface of a tool is from its core at most, m.
fn around_m(shape: &ToolShape) -> f64 {
    match *shape {
        ToolShape::Sphere { radius_m } => radius_m,
        ToolShape::FlatPunch { radius_m, .. } => std::f64::consts::SQRT_2 * radius_m,
    }
}

/// A patch that a tool has already.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KnownPatch {
    /// Where it is.
    pub patch: Patch,
    /// Where its foot is, m.
    pub at_m: DVec3,
    /// The normal at rest of the triangle on which it began.
    pub rest_normal: DVec3,
    /// Radius of the contact, m.
    pub radius_m: f64,
}

impl KnownPatch {
    /// How far from it the tool is in contact apart from it, m.
    fn across_m(&self, cell_m: f64) -> f64 {
        BEYOND_RADII * self.radius_m + BEYOND_CELLS * cell_m
    }
}

/// The patches that a tool has already.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KnownPatches {
    all: [KnownPatch; MAX_PATCHES],
    count: usize,
}

impl KnownPatches {
    fn iter(&self) -> impl Iterator<Item = &KnownPatch> {
        self.all.iter().take(self.count)
    }

    /// Adds one; whether there was room for it.
    pub fn add(&mut self, patch: KnownPatch) -> bool {
        let Some(to) = self.all.get_mut(self.count) else { return false };
        *to = patch;
        self.count += 1;
        true
    }

    /// Whether a patch whose foot is at `at_m` is one of those that are known: two that come to one place are one.
    #[must_use]
    pub fn contains(&self, patch: &Patch, at_m: DVec3, cell_m: f64) -> bool {
        self.iter().any(|known| {
            let overlap_m = 0.5 * (known.radius_m + cell_m);
            known.patch.foot.triangle == patch.foot.triangle
                || known.patch.normal.dot(patch.normal) > SAME && known.at_m.distance(at_m) < overlap_m
        })
    }

    /// Whether no patch can begin on a triangle with that normal at rest, because all of it is on a known one: it lies in a ball of radius
    /// `radius_m` about `middle_m`.
    #[must_use]
    pub fn covers(&self, rest_normal: DVec3, (middle_m, radius_m): (DVec3, f64), cell_m: f64) -> bool {
        self.iter().any(|known| {
            rest_normal.dot(known.rest_normal) >= APART
                && middle_m.distance(known.at_m) + radius_m <= known.across_m(cell_m)
        })
    }

    /// Begins patches on `seeds` that are apart from all that are known, the first of them first: `find` is where a patch comes to from its
    /// start, and `begin` begins one that is new and returns it, or `None` where there is no room for it. The seeds are used up.
    pub fn begin(
        &mut self,
        seeds: &mut Vec<Seed>,
        cell_m: f64,
        find: impl Fn(&PatchStart) -> Option<Patch>,
        mut begin: impl FnMut(Patch, &Seed) -> Option<KnownPatch>,
    ) {
        loop {
            // What is not apart from a patch now is not later.
            seeds.retain(|seed| self.iter().all(|known| seed.is_apart(known.rest_normal, known, cell_m)));
            let first = seeds.iter().copied().reduce(|a, b| if b.is_before(&a) { b } else { a });
            let Some(first) = first else { return };
            seeds.retain(|seed| seed.place.triangle != first.place.triangle);
            let Some(patch) = find(&PatchStart::on(first.place, first.normal)) else { continue };
            // Where two places lead to one patch, it is one.
            let is_same = |known: &KnownPatch| {
                known.patch.foot.triangle == patch.foot.triangle
                    || known.patch.normal.dot(patch.normal) > SAME
                        && !first.is_apart(first.rest_normal, known, cell_m)
            };
            if self.iter().any(is_same) {
                continue;
            }
            if let Some(known) = begin(patch, &first) {
                self.add(known);
            }
        }
    }
}
