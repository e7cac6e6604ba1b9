//! Cracks between triangles whose corners nearly coincide.

use super::edges::sides;
use super::geometry::TOLERANCE;
use super::weld;
use glam::DVec3;

/// Tolerances of coincident vertices, as fractions of the longest side, that are tried on a mesh with open edges.
const CRACKS: [f64; 2] = [1e-5, 1e-4];

/// The tolerance of coincident vertices, as a fraction of the longest side: [`TOLERANCE`], or a larger one that closes at least half
/// of the open edges which the one before leaves.
pub(super) fn weld_tolerance(
    vertices_m: &[DVec3],
    triangles: &[[usize; 3]],
    center_m: DVec3,
    size_m: f64,
) -> f64 {
    let open_edges = |tolerance: f64| {
        let welded = weld::weld(vertices_m, triangles, center_m, tolerance * size_m);
        let of_points: Vec<[usize; 3]> = triangles
            .iter()
            .map(|corners| corners.map(|vertex| welded.point_of[vertex].unwrap_or_default()))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        sides(&of_points).chunk_by(|a, b| a.edge == b.edge).filter(|edge| edge.len() == 1).count()
    };
    let (mut chosen, mut open) = (TOLERANCE, open_edges(TOLERANCE));
    for tolerance in CRACKS {
        if open == 0 {
            break;
        }
        let left = open_edges(tolerance);
        if 2 * left <= open {
            (chosen, open) = (tolerance, left);
        }
    }
    chosen
}
