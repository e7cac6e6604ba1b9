//! Seeds of contact patches: the first places of a surface that a moving tool reaches.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{MAX_PATCHES, Patch, PatchStart, SurfacePlace, ToolShape, nearest_weights};
use glam::DVec3;

/// A place at which a contact patch may start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// Place of the triangle that the tool comes closest to.
    pub place: SurfacePlace,
    /// Position, m.
    pub at_m: DVec3,
    /// Unit normal with which a patch starts: from the place to the middle of a ball, and that of the triangle for a punch. The nearest place
    /// of a curved surface is often on an edge or a corner, and which of its triangles the seed has depends on rounding.
    pub normal: DVec3,
    /// Unit normal of the triangle at rest.
    pub rest_normal: DVec3,
    /// Sample of the path at which the place came within reach, and its distance then, m. Seeds are ordered by both.
    order: (u32, f64),
}

/// Maximum spacing of the samples on the tool's path, in tool radii, and their maximum number.
const SAMPLE_SPACING_RADII: f64 = 0.5;
const MAX_SAMPLES: f64 = 64.0;
/// Two patches are separate if the cosine between their rest normals is below this value.
const SEPARATE_COSINE: f64 = 0.5;
/// Two patches are also separate if they are further apart than this multiple of the first one's radius plus this
/// number of cells.
const BEYOND_RADII: f64 = 2.0;
const BEYOND_CELLS: f64 = 2.0;
/// Two patches are the same if the cosine between their normals is above this value.
const SAME_COSINE: f64 = 0.9;
/// Distance of two seeds, in cells, up to which they are at the same place.
const SAME_PLACE_CELLS: f64 = 1e-5;

impl Seed {
    /// The seed on a triangle for a tool that moves straight from `from_m` to `to_m`. `None` if the tool's surface
    /// does not come within `reach_m` of the triangle, or the tool starts behind it.
    #[must_use]
    pub fn of(
        shape: &ToolShape,
        (from_m, to_m): (DVec3, DVec3),
        (triangle, corners_m, rest_normal): (usize, [DVec3; 3], DVec3),
        reach_m: f64,
    ) -> Option<Self> {
        let [a, b, c] = corners_m;
        // Reject distant triangles early.
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
        let samples =
            (from_m.distance(to_m) / (SAMPLE_SPACING_RADII * radius_m)).ceil().clamp(1.0, MAX_SAMPLES) as u32;
        let around = around_m(shape);
        let mut best: Option<Self> = None;
        for sample in 0..=samples {
            let core = core(f64::from(sample) / f64::from(samples));
            let weights = nearest_weights(core, corners_m);
            let [u, v, w] = weights;
            let at_m = u * a + v * b + w * c;
            let away = at_m.distance(core) - around;
            // A triangle that the tool has crossed counts as reached.
            let is_passed = (core - a).dot(normal) < 0.0;
            if away.is_nan() || away > reach_m && !(is_passed && weights.iter().all(|w| *w > 0.0)) {
                continue;
            }
            let order = (if away <= 0.0 { sample } else { samples + 1 }, away);
            if best.is_none_or(|best| order < best.order) {
                let place = SurfacePlace { triangle, weights };
                let normal = start_normal(shape, core - at_m, normal);
                best = Some(Self { place, at_m, normal, rest_normal, order });
            }
            if away <= 0.0 {
                break;
            }
        }
        best
    }

    /// Maximum distance between a seed and the tool's core at the beginning of its path, m; see [`Seed::of`].
    #[must_use]
    pub fn farthest_m(shape: &ToolShape, (from_m, to_m): (DVec3, DVec3), reach_m: f64) -> f64 {
        let moved_m = from_m.distance(to_m);
        // A crossed triangle was in front of the core and is no deeper than the length of the path.
        (reach_m + around_m(shape) + moved_m).max(2.0 * moved_m) * (1.0 + 1e-9)
    }

    /// Whether this seed is ordered before `other`. Of two on a common edge or corner of their triangles, which have the same order up to
    /// rounding, it is the one on the triangle with the lower number.
    fn is_before(&self, other: &Self, cell_m: f64) -> bool {
        let is_same_place = self.at_m.distance(other.at_m) <= SAME_PLACE_CELLS * cell_m;
        if is_same_place || self.order == other.order {
            self.place.triangle < other.place.triangle
        } else {
            self.order < other.order
        }
    }

    /// Whether a contact here is separate from the patch `known`, which started on a triangle with the given rest
    /// normal. It is if the surface faces another way, or if the tool touches it beyond the patch.
    fn is_apart(&self, rest_normal: DVec3, known: &ActivePatch, cell_m: f64) -> bool {
        let is_met = self.order.1 < 0.0;
        self.rest_normal.dot(rest_normal) < SEPARATE_COSINE
            || is_met && self.at_m.distance(known.at_m) > known.across_m(cell_m)
    }
}

/// Normal with which a patch starts, for a tool whose core lies `to_core` from the place, on a triangle with the given normal.
fn start_normal(shape: &ToolShape, to_core: DVec3, normal: DVec3) -> DVec3 {
    let direction = match shape {
        ToolShape::Sphere { .. } => to_core.try_normalize(),
        ToolShape::FlatPunch { .. } => None,
    };
    // In or behind the surface the core has no direction.
    direction.filter(|direction| direction.dot(normal) > MIN_FACING).unwrap_or(normal)
}

/// Minimum cosine between the direction from a place to the core of a ball and the normal of the triangle there.
const MIN_FACING: f64 = 1e-3;

/// Maximum distance of the tool's surface from its core, m.
fn around_m(shape: &ToolShape) -> f64 {
    match *shape {
        ToolShape::Sphere { radius_m } => radius_m,
        ToolShape::FlatPunch { radius_m, .. } => std::f64::consts::SQRT_2 * radius_m,
    }
}

/// An existing patch of a tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActivePatch {
    /// The patch.
    pub patch: Patch,
    /// Position of its foot, m.
    pub at_m: DVec3,
    /// Rest normal of the triangle on which it started.
    pub rest_normal: DVec3,
    /// Contact radius, m.
    pub radius_m: f64,
}

impl ActivePatch {
    /// Distance from its foot beyond which a contact is separate, m.
    fn across_m(&self, cell_m: f64) -> f64 {
        BEYOND_RADII * self.radius_m + BEYOND_CELLS * cell_m
    }
}

/// The existing patches of a tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActivePatches {
    all: [ActivePatch; MAX_PATCHES],
    count: usize,
}

impl ActivePatches {
    fn iter(&self) -> impl Iterator<Item = &ActivePatch> {
        self.all.iter().take(self.count)
    }

    /// Adds a patch. Returns whether the capacity sufficed.
    pub fn add(&mut self, patch: ActivePatch) -> bool {
        let Some(to) = self.all.get_mut(self.count) else { return false };
        *to = patch;
        self.count += 1;
        true
    }

    /// Whether a patch with its foot at `at_m` coincides with an existing one.
    #[must_use]
    pub fn contains(&self, patch: &Patch, at_m: DVec3, cell_m: f64) -> bool {
        self.iter().any(|known| {
            let overlap_m = 0.5 * (known.radius_m + cell_m);
            known.patch.foot.triangle == patch.foot.triangle
                || known.patch.normal.dot(patch.normal) > SAME_COSINE && known.at_m.distance(at_m) < overlap_m
        })
    }

    /// Whether an existing patch covers a whole triangle with that rest normal, so that no patch can start on it. The
    /// triangle lies in a ball of radius `radius_m` around `middle_m`.
    #[must_use]
    pub fn covers(&self, rest_normal: DVec3, (middle_m, radius_m): (DVec3, f64), cell_m: f64) -> bool {
        self.iter().any(|known| {
            rest_normal.dot(known.rest_normal) >= SEPARATE_COSINE
                && middle_m.distance(known.at_m) + radius_m <= known.across_m(cell_m)
        })
    }

    /// Starts patches on `seeds` that are separate from all existing ones, in the order of the seeds.
    ///
    /// `find` returns the patch that a start leads to. `begin` creates a new patch and returns it, or `None` without
    /// capacity for it. The seeds are consumed.
    pub fn begin(
        &mut self,
        seeds: &mut Vec<Seed>,
        cell_m: f64,
        find: impl Fn(&PatchStart) -> Option<Patch>,
        mut begin: impl FnMut(Patch, &Seed) -> Option<ActivePatch>,
    ) {
        loop {
            // A seed that is not separate now will not be later.
            seeds.retain(|seed| self.iter().all(|known| seed.is_apart(known.rest_normal, known, cell_m)));
            let first = seeds.iter().copied().reduce(|a, b| if b.is_before(&a, cell_m) { b } else { a });
            let Some(first) = first else { return };
            seeds.retain(|seed| seed.place.triangle != first.place.triangle);
            let Some(patch) = find(&PatchStart::on(first.place, first.normal)) else { continue };
            // Two seeds that lead to the same place are one patch.
            let is_same = |known: &ActivePatch| {
                known.patch.foot.triangle == patch.foot.triangle
                    || known.patch.normal.dot(patch.normal) > SAME_COSINE
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Seeds of a ball of radius 1 above the ridge of a roof, on both of its sides.
    fn seeds_on_ridge(height: f64) -> [Seed; 2] {
        let ball = ToolShape::Sphere { radius_m: 1.0 };
        let (along, ridge) = (DVec3::X, [DVec3::NEG_X, DVec3::X]);
        let at = DVec3::Z * height + 0.3 * along;
        [-1.0, 1.0].map(|side: f64| {
            let eave = DVec3::new(0.0, side, -0.5);
            let corners = if side < 0.0 { [ridge[1], ridge[0], eave] } else { [ridge[0], ridge[1], eave] };
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            assert!(normal.z > 0.8);
            Seed::of(&ball, (at, at), (usize::from(side > 0.0), corners, normal), 0.5).unwrap()
        })
    }

    #[test]
    fn seeds_of_a_ball_on_both_sides_of_an_edge_start_in_the_same_direction() {
        for height in [0.2, 0.9, 1.0, 1.4] {
            for seed in seeds_on_ridge(height) {
                assert!(seed.normal.distance(DVec3::Z) < 1e-12, "{height}: {seed:?}");
                assert!(seed.at_m.distance(DVec3::X * 0.3) < 1e-12, "{height}: {seed:?}");
            }
        }
        // On the ridge itself the ball's middle has no direction.
        for seed in seeds_on_ridge(0.0) {
            assert!(seed.normal.distance(seed.rest_normal) < 1e-12, "{seed:?}");
        }
    }

    /// Starts a patch at the first of `seeds`, and returns the triangle on which it starts.
    fn first_triangle(seeds: &[Seed]) -> usize {
        let mut first = None;
        let find = |start: &PatchStart| Some(Patch { foot: start.foot, ..Patch::default() });
        ActivePatches::default().begin(&mut seeds.to_vec(), 1.0, find, |_, seed| {
            first.get_or_insert(seed.place.triangle);
            None
        });
        first.unwrap()
    }

    #[test]
    fn a_patch_on_a_common_edge_starts_on_the_same_triangle_whatever_the_rounding() {
        let seeds = seeds_on_ridge(0.9);
        for lower in [-1e-15, 0.0, 1e-15] {
            let mut seeds = seeds;
            seeds[1].order.1 += lower;
            assert_eq!(first_triangle(&seeds), 0);
            seeds.reverse();
            assert_eq!(first_triangle(&seeds), 0);
        }
        // Elsewhere the nearer place comes first.
        let mut seeds = seeds;
        seeds[1].at_m += 1e-3 * DVec3::X;
        seeds[1].order.1 -= 1e-15;
        assert_eq!(first_triangle(&seeds), 1);
    }
}
