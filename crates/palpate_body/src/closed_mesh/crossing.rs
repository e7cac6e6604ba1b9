//! Detection of self-intersections.

use super::MeshError;
use super::geometry::bounds;
use crate::parallel;
use glam::DVec3;
use parry3d_f64::partitioning::Bvh;
use std::ops::Range;

/// Maximum number of tested pairs of boxes: per triangle, plus a constant. A mesh of even triangles has about ten
/// pairs per triangle.
const MAX_PAIRS: (usize, usize) = (64, 1 << 20);
/// Number of intersecting pairs after which the search ends.
const MAX_FOUND: usize = 1000;

/// Number of triangles that a thread examines before the sums of all are compared with the limits.
const EXAMINED: usize = 4096;

/// Rejects triangles that intersect by more than `tolerance_m`, in bounded time. Those before `first` do not intersect one another. `bvh` has the
/// boxes of the triangles.
///
/// # Errors
/// [`MeshError::Crossing`], [`MeshError::Tangled`].
pub(super) fn check(
    bvh: &Bvh,
    triangles: &[[usize; 3]],
    first: usize,
    points_m: &[DVec3],
    (center_m, tolerance_m): (DVec3, f64),
) -> Result<(), MeshError> {
    let corners = |triangle: usize| triangles[triangle].map(|point| points_m[point]);
    let max_pairs = MAX_PAIRS.0 * triangles.len() + MAX_PAIRS.1;
    let examine = |owns: Range<usize>| {
        let mut examined = Examined::default();
        for own in owns {
            for other in bvh.intersect_aabb(&bounds(corners(own), 0.0)).map(|other| other as usize) {
                examined.tested += 1;
                if other >= first && other <= own {
                    continue;
                }
                if let Some(at_m) = meet(triangles, points_m, [own.min(other), own.max(other)], tolerance_m) {
                    examined.found += 1;
                    examined.first_m.get_or_insert(at_m);
                }
            }
            if examined.is_enough(max_pairs) {
                break;
            }
        }
        examined
    };
    let mut all = Examined::default();
    let ranges: Vec<Range<usize>> = (first..triangles.len())
        .step_by(EXAMINED)
        .map(|from| from..(from + EXAMINED).min(triangles.len()))
        .collect();
    for ranges in ranges.chunks(parallel::threads()) {
        for examined in parallel::map_each(ranges, |range| examine(range.clone())) {
            all.tested += examined.tested;
            all.found += examined.found;
            all.first_m = all.first_m.or(examined.first_m);
            // What later threads examined does not count, so that the result is that of any number of them.
            if all.is_enough(max_pairs) {
                return all.result(center_m, max_pairs);
            }
        }
    }
    all.result(center_m, max_pairs)
}

/// Numbers of tested pairs of boxes and of pairs of triangles that intersect, and where the first do.
#[derive(Default)]
struct Examined {
    tested: usize,
    found: usize,
    first_m: Option<DVec3>,
}

impl Examined {
    /// Whether the search ends.
    fn is_enough(&self, max_pairs: usize) -> bool {
        self.found >= MAX_FOUND || self.tested > max_pairs
    }

    fn result(self, center_m: DVec3, max_pairs: usize) -> Result<(), MeshError> {
        match self.first_m {
            Some(at_m) => Err(MeshError::Crossing { pairs: self.found, at_m: center_m + at_m }),
            None if self.tested > max_pairs => Err(MeshError::Tangled { pairs: self.tested }),
            None => Ok(()),
        }
    }
}

/// A point of intersection of two triangles. Triangles that share an edge do not intersect.
fn meet(triangles: &[[usize; 3]], points_m: &[DVec3], pair: [usize; 2], tolerance_m: f64) -> Option<DVec3> {
    let [t, u] = pair.map(|triangle| triangles[triangle]);
    let shared = t.iter().filter(|point| u.contains(point)).count();
    if shared >= 2 {
        return None;
    }
    let corners_m = |t: [usize; 3]| t.map(|point| points_m[point]);
    let (plane_t, plane_u) = (Plane::of(corners_m(t)), Plane::of(corners_m(u)));
    let heights = |plane: Option<&Plane>, t: [usize; 3]| {
        plane.map(|plane| corners_m(t).map(|x| (x - plane.corners_m[0]).dot(plane.normal)))
    };
    let (of_u, of_t) = (heights(plane_t.as_ref(), u), heights(plane_u.as_ref(), t));
    // A triangle on one side of the plane of another does not meet it.
    let is_apart = |heights: &[f64; 3]| heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0);
    if of_u.as_ref().is_some_and(is_apart) || of_t.as_ref().is_some_and(is_apart) {
        return None;
    }
    let pierces =
        |from: [usize; 3], heights: Option<[f64; 3]>, through: [usize; 3], plane: Option<&Plane>| {
            let (heights, plane) = (heights?, plane?);
            (0..3).find_map(|corner| {
                let next = (corner + 1) % 3;
                // An edge that starts at a shared corner cannot return to the triangle.
                if [from[corner], from[next]].iter().any(|point| through.contains(point)) {
                    return None;
                }
                let [p, q] = [corner, next].map(|corner| (points_m[from[corner]], heights[corner]));
                plane.pierced(p, q, tolerance_m)
            })
        };
    pierces(t, of_t, u, plane_u.as_ref()).or_else(|| pierces(u, of_u, t, plane_t.as_ref()))
}

/// A triangle in its plane.
struct Plane {
    corners_m: [DVec3; 3],
    normal: DVec3,
}

impl Plane {
    /// `None` for a triangle without area.
    fn of([a, b, c]: [DVec3; 3]) -> Option<Self> {
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some(Self { corners_m: [a, b, c], normal })
    }

    /// The point at which the edge between two points with their heights above the plane passes through the triangle, by more than `tolerance_m`
    /// on both sides.
    fn pierced(&self, (p, below): (DVec3, f64), (q, above): (DVec3, f64), tolerance_m: f64) -> Option<DVec3> {
        if below.abs() <= tolerance_m || above.abs() <= tolerance_m || (below > 0.0) == (above > 0.0) {
            return None;
        }
        let at = p + (q - p) * (below / (below - above));
        let within = |from: DVec3, to: DVec3| (to - from).cross(at - from).dot(self.normal) >= 0.0;
        let [a, b, c] = self.corners_m;
        (within(a, b) && within(b, c) && within(c, a)).then_some(at)
    }
}
