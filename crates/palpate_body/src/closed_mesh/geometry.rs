//! Tolerance, winding, volume and bounds of the triangles of a mesh.

use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;

/// Tolerance for coincident points and for intersections, as a fraction of the longest side.
pub(super) const TOLERANCE: f64 = 1e-6;

/// Whether `b` is `a` or a rotation of it.
pub(super) fn same_winding(a: [usize; 3], b: [usize; 3]) -> bool {
    (0..3).any(|turn| (0..3).all(|i| a[(i + turn) % 3] == b[i]))
}

/// Enclosed volume Σ a · (b × c)/6, m³.
pub(super) fn volume(triangles: &[[usize; 3]], points_m: &[DVec3]) -> f64 {
    let of = |t: &[usize; 3]| {
        let [a, b, c] = t.map(|point| points_m[point]);
        a.dot(b.cross(c)) / 6.0
    };
    triangles.iter().map(of).sum()
}

/// Twice the area of a triangle, m².
pub(super) fn double_area([a, b, c]: [DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length()
}

/// Bounding box of a triangle, enlarged by `margin_m`.
pub(super) fn bounds([a, b, c]: [DVec3; 3], margin_m: f64) -> Aabb {
    Aabb::new(a.min(b).min(c) - margin_m, a.max(b).max(c) + margin_m)
}
