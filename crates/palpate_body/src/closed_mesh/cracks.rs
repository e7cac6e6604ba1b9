//! Cracks between triangles whose corners nearly coincide.

use super::edges::sides;
use super::geometry::TOLERANCE;
use super::weld::{Welded, weld};
use crate::parallel;
use glam::DVec3;

/// Tolerances of coincident vertices, as fractions of the longest side, that are tried on a mesh with open edges.
const CRACKS: [f64; 2] = [1e-5, 1e-4];

/// Welds vertices within a fraction of the longest side, and returns it too: [`TOLERANCE`], with which they are `welded`, or a larger one that
/// closes at least half of the open edges which the one before leaves.
pub(super) fn weld_cracks(
    welded: Welded,
    vertices_m: &[DVec3],
    triangles: &[[usize; 3]],
    center_m: DVec3,
    size_m: f64,
) -> (Welded, f64) {
    let edges = open_edges(&welded, triangles);
    let left_open = |tolerance: &f64| {
        let corners: Vec<[usize; 3]> = edges.iter().map(|&[a, b]| [a, b, b]).collect();
        let welded = weld(vertices_m, &corners, center_m, tolerance * size_m);
        let mut edges: Vec<[Option<usize>; 2]> = edges
            .iter()
            .map(|edge| edge.map(|vertex| welded.point_of.of(vertex)))
            .filter(|[a, b]| a != b)
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).count()
    };
    let (mut chosen, mut open) = (TOLERANCE, edges.len());
    let lefts = if open > 0 { parallel::map_each(&CRACKS, left_open) } else { Vec::new() };
    for (tolerance, left) in CRACKS.into_iter().zip(lefts) {
        if open > 0 && 2 * left <= open {
            (chosen, open) = (tolerance, left);
        }
    }
    if chosen > TOLERANCE {
        return (weld(vertices_m, triangles, center_m, chosen * size_m), chosen);
    }
    (welded, chosen)
}

/// Edges of one triangle only, as vertices.
fn open_edges(welded: &Welded, triangles: &[[usize; 3]]) -> Vec<[usize; 2]> {
    let of_points: Vec<[usize; 3]> = triangles
        .iter()
        .map(|corners| corners.map(|vertex| welded.point_of.of(vertex).unwrap_or_default()))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let mut vertex_of = vec![0; welded.points_m.len()];
    for &vertex in triangles.iter().flatten() {
        vertex_of[welded.point_of.of(vertex).unwrap_or_default()] = vertex;
    }
    let sides = sides(&of_points);
    let of_one = sides.chunk_by(|a, b| a.edge == b.edge).filter(|edge| edge.len() == 1);
    of_one.map(|edge| [edge[0].edge.0, edge[0].edge.1].map(|point| vertex_of[point as usize])).collect()
}
