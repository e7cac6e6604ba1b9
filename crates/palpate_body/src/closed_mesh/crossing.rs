//! Detection of self-intersections.

use super::MeshError;
use super::geometry::bounds;
use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

/// Maximum number of tested pairs of boxes: per triangle, plus a constant. A mesh of even triangles has about ten
/// pairs per triangle.
const MAX_PAIRS: (usize, usize) = (64, 1 << 20);
/// Number of intersecting pairs after which the search ends.
const MAX_FOUND: usize = 1000;

/// Rejects triangles that intersect by more than `tolerance_m`, in bounded time.
///
/// # Errors
/// [`MeshError::Crossing`], [`MeshError::Tangled`].
pub(super) fn check(
    triangles: &[[usize; 3]],
    points_m: &[DVec3],
    center_m: DVec3,
    tolerance_m: f64,
) -> Result<(), MeshError> {
    let corners = |triangle: usize| triangles[triangle].map(|point| points_m[point]);
    let boxes: Vec<Aabb> = (0..triangles.len()).map(|t| bounds(corners(t), 0.0)).collect();
    let bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    let max_pairs = MAX_PAIRS.0 * triangles.len() + MAX_PAIRS.1;
    let (mut tested, mut found, mut first) = (0, 0, None);
    for (own, bounds) in boxes.iter().enumerate() {
        for other in bvh.intersect_aabb(bounds).map(|other| other as usize) {
            tested += 1;
            if other <= own {
                continue;
            }
            if let Some(at_m) = meet(triangles, points_m, [own, other], tolerance_m) {
                found += 1;
                first.get_or_insert(at_m);
            }
        }
        if found >= MAX_FOUND {
            break;
        }
        if tested > max_pairs && found == 0 {
            return Err(MeshError::Tangled { pairs: tested });
        }
        if tested > max_pairs {
            break;
        }
    }
    first.map_or(Ok(()), |at_m| Err(MeshError::Crossing { pairs: found, at_m: center_m + at_m }))
}

/// A point of intersection of two triangles. Triangles that share an edge do not intersect.
fn meet(triangles: &[[usize; 3]], points_m: &[DVec3], pair: [usize; 2], tolerance_m: f64) -> Option<DVec3> {
    let [t, u] = pair.map(|triangle| triangles[triangle]);
    let shared = t.iter().filter(|point| u.contains(point)).count();
    if shared >= 2 {
        return None;
    }
    let pierces = |from: [usize; 3], through: [usize; 3]| {
        let through_m = through.map(|point| points_m[point]);
        (0..3).find_map(|corner| {
            let edge = [from[corner], from[(corner + 1) % 3]];
            // An edge that starts at a shared corner cannot return to the triangle.
            let away = edge.iter().all(|point| !through.contains(point));
            let [p, q] = edge.map(|point| points_m[point]);
            away.then(|| pierced(through_m, p, q, tolerance_m)).flatten()
        })
    };
    pierces(t, u).or_else(|| pierces(u, t))
}

/// The point at which the edge from `p` to `q` passes through a triangle, by more than `tolerance_m` on both sides.
fn pierced([a, b, c]: [DVec3; 3], p: DVec3, q: DVec3, tolerance_m: f64) -> Option<DVec3> {
    let normal = (b - a).cross(c - a);
    let unit = normal.try_normalize()?;
    let (below, above) = ((p - a).dot(unit), (q - a).dot(unit));
    if below.abs() <= tolerance_m || above.abs() <= tolerance_m || (below > 0.0) == (above > 0.0) {
        return None;
    }
    let at = p + (q - p) * (below / (below - above));
    let within = |from: DVec3, to: DVec3| (to - from).cross(at - from).dot(unit) >= 0.0;
    (within(a, b) && within(b, c) && within(c, a)).then_some(at)
}
