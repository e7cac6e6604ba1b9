//! Sheets with a thickness.

use super::closed_surface::ClosedSurface;
use super::edges::{open_edges, sides};
use super::geometry::TOLERANCE;
use super::open_parts::OpenParts;
use glam::DVec3;

/// Gives the open parts among `parts` a thickness: their triangles once on either side, half of `thickness_m` away along the normals of the
/// points, and a wall along every open edge. Closed parts stay as they are.
pub(super) fn thicken(parts: &OpenParts, points_m: &[DVec3], thickness_m: f64) -> ClosedSurface {
    let mut is_open = vec![false; parts.part_count];
    let edges = open_edges(&sides(&parts.triangles), |triangle| parts.part[triangle], |_| false);
    edges.iter().for_each(|(_, part)| is_open[*part] = true);
    // Points of a part at which another part begins move with their own part.
    let open = || parts.triangles.iter().zip(&parts.part).filter(|(_, part)| is_open[**part]);
    let mut moved: Vec<(u32, u32)> =
        open().flat_map(|(t, part)| t.map(|point| (*part as u32, point as u32))).collect();
    moved.sort_unstable();
    moved.dedup();
    let index =
        |part: usize, point: usize| moved.binary_search(&(part as u32, point as u32)).unwrap_or_default();
    let mut normals = vec![DVec3::ZERO; moved.len()];
    for (t, &part) in open() {
        let [a, b, c] = t.map(|point| points_m[point]);
        let area = (b - a).cross(c - a);
        t.iter().for_each(|&point| normals[index(part, point)] += area);
    }
    let mut made = ClosedSurface { points_m: points_m.to_vec(), triangles: Vec::new() };
    for (&(_, point), normal) in moved.iter().zip(normals) {
        let (at_m, step_m) = (points_m[point as usize], 0.5 * thickness_m * normal.normalize_or_zero());
        made.points_m.extend([at_m + step_m, at_m - step_m]);
    }
    let sides_of = |part: usize, point: usize| {
        let first = points_m.len() + 2 * index(part, point);
        [first, first + 1]
    };
    for (&t, &part) in parts.triangles.iter().zip(&parts.part) {
        if !is_open[part] {
            made.triangles.push(t);
            continue;
        }
        let [a, b, c] = t.map(|point| sides_of(part, point));
        made.triangles.extend([[a[0], b[0], c[0]], [a[1], c[1], b[1]]]);
    }
    for ((a, b), part) in edges {
        let [a, b] = [a, b].map(|point| sides_of(part, point));
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
