//! Sheets with a thickness.

use super::edges::open_edges;
use super::geometry::TOLERANCE;
use super::open_parts::OpenParts;
use glam::DVec3;
use std::collections::BTreeMap;

/// Triangles with their points, m.
pub(super) struct Thickened {
    pub points_m: Vec<DVec3>,
    pub triangles: Vec<[usize; 3]>,
}

/// Gives the open parts among `parts` a thickness: their triangles once on either side, half of `thickness_m` away along the normals of the
/// points, and a wall along every open edge. Closed parts stay as they are.
pub(super) fn thicken(parts: &OpenParts, points_m: &[DVec3], thickness_m: f64) -> Thickened {
    let mut is_open = vec![false; parts.part_count];
    let edges = open_edges(parts.triangles.iter().copied().zip(parts.part.iter().copied()));
    edges.iter().for_each(|(_, part)| is_open[*part] = true);
    // Points of a part at which another part begins move with their own part.
    let mut normals: BTreeMap<(usize, usize), DVec3> = BTreeMap::new();
    for (t, &part) in parts.triangles.iter().zip(&parts.part).filter(|(_, part)| is_open[**part]) {
        let [a, b, c] = t.map(|point| points_m[point]);
        let area = (b - a).cross(c - a);
        t.iter().for_each(|&point| *normals.entry((part, point)).or_insert(DVec3::ZERO) += area);
    }
    let mut made = Thickened { points_m: points_m.to_vec(), triangles: Vec::new() };
    let mut sides: BTreeMap<(usize, usize), [usize; 2]> = BTreeMap::new();
    for (&(part, point), normal) in &normals {
        let step_m = 0.5 * thickness_m * normal.normalize_or_zero();
        let first = made.points_m.len();
        made.points_m.extend([points_m[point] + step_m, points_m[point] - step_m]);
        sides.insert((part, point), [first, first + 1]);
    }
    for (&t, &part) in parts.triangles.iter().zip(&parts.part) {
        if !is_open[part] {
            made.triangles.push(t);
            continue;
        }
        let [a, b, c] = t.map(|point| sides[&(part, point)]);
        made.triangles.extend([[a[0], b[0], c[0]], [a[1], c[1], b[1]]]);
    }
    for ((a, b), part) in edges {
        let [a, b] = [a, b].map(|point| sides[&(part, point)]);
        made.triangles.extend([[b[0], a[0], a[1]], [b[0], a[1], b[1]]]);
    }
    made
}

/// Whether `thickness_m` is a thickness for a mesh whose longest side is `size_m`.
pub(super) fn is_valid(thickness_m: f64, size_m: f64) -> bool {
    thickness_m > MIN_SHARE * size_m && thickness_m <= size_m
}

/// Minimum thickness relative to the size: far above the tolerance of coincident points.
const MIN_SHARE: f64 = 1e3 * TOLERANCE;
