//! Thickness of what a surface encloses.

use crate::parallel;
use glam::DVec3;
use parry3d_f64::partitioning::Bvh;
use parry3d_f64::query::{Ray, RayCast};
use parry3d_f64::shape::Triangle;

/// Length of the line from each point against its normal to where it leaves the closed surface, at most `max_m`.
/// `bvh` has the boxes of the triangles.
pub(super) fn thickness_m(
    bvh: &Bvh,
    triangles: &[[usize; 3]],
    points_m: &[DVec3],
    normals: &[DVec3],
    max_m: f64,
) -> Vec<f64> {
    let corners = |t: &[usize; 3]| t.map(|point| points_m[point]);
    let along = |point: usize| {
        let inward = -normals[point];
        let ray = Ray::new(points_m[point], inward);
        let leaves = |leaf: u32, nearest_m: f64| {
            let [a, b, c] = corners(&triangles[leaf as usize]);
            let is_left = (b - a).cross(c - a).dot(inward) > 0.0;
            is_left.then(|| Triangle::new(a, b, c).cast_local_ray(&ray, nearest_m, false)).flatten()
        };
        bvh.cast_ray(&ray, max_m, leaves).map_or(max_m, |(_, distance_m)| distance_m)
    };
    parallel::map_ranges(points_m.len(), |range| range.map(along).collect())
}
