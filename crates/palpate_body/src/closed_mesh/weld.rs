//! Welding of coincident vertices.

use glam::{DVec3, I64Vec3};
use std::collections::HashMap;

pub(super) struct Welded {
    /// Welded point of each vertex that a triangle uses.
    pub point_of: Vec<Option<usize>>,
    /// Positions relative to the centre, m.
    pub points_m: Vec<DVec3>,
    /// Number of vertices that coincide with an earlier one.
    pub count: usize,
}

/// Welds the vertices of `triangles` that are within `tolerance_m` of each other. The first of them in vertex order
/// defines the point.
pub(super) fn weld(
    vertices_m: &[DVec3],
    triangles: &[[usize; 3]],
    center_m: DVec3,
    tolerance_m: f64,
) -> Welded {
    let mut named = vec![false; vertices_m.len()];
    triangles.iter().flatten().for_each(|&vertex| named[vertex] = true);
    let mut welded = Welded { point_of: vec![None; vertices_m.len()], points_m: Vec::new(), count: 0 };
    // Boxes are much wider than the tolerance, so that few points are close to a side.
    let box_m = 16.0 * tolerance_m;
    let box_of = |x: DVec3| (x / box_m).floor().as_i64vec3();
    let mut boxes: HashMap<I64Vec3, Vec<usize>> = HashMap::with_capacity(vertices_m.len());
    for vertex in (0..vertices_m.len()).filter(|&vertex| named[vertex]) {
        let x = vertices_m[vertex] - center_m;
        let (low, high) = (box_of(x - tolerance_m), box_of(x + tolerance_m));
        let near = |points: &Vec<usize>| {
            points.iter().copied().find(|&point| welded.points_m[point].distance(x) <= tolerance_m)
        };
        let found = boxes_between(low, high).find_map(|key| boxes.get(&key).and_then(near));
        welded.count += usize::from(found.is_some());
        let point = found.unwrap_or_else(|| {
            boxes.entry(box_of(x)).or_default().push(welded.points_m.len());
            welded.points_m.push(x);
            welded.points_m.len() - 1
        });
        welded.point_of[vertex] = Some(point);
    }
    welded
}

fn boxes_between(low: I64Vec3, high: I64Vec3) -> impl Iterator<Item = I64Vec3> {
    (low.x..=high.x).flat_map(move |x| {
        (low.y..=high.y).flat_map(move |y| (low.z..=high.z).map(move |z| I64Vec3::new(x, y, z)))
    })
}
