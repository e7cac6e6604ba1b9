//! Normals of the points of triangles.

use glam::DVec3;

/// Area-weighted normals of points, twice the sum of the areas long.
pub(crate) fn vertex_normals<'a>(
    triangles: impl IntoIterator<Item = &'a [usize; 3]>,
    points_m: &[DVec3],
) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; points_m.len()];
    for t in triangles {
        let [a, b, c] = t.map(|point| points_m[point]);
        t.iter().for_each(|&point| normals[point] += (b - a).cross(c - a));
    }
    normals
}
