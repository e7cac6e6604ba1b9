//! Triangles with the same three corners.

use super::MeshError;
use super::geometry::same_winding;
use super::orient::Oriented;

/// A closed surface without coincident triangles.
pub(super) struct Surface {
    /// Indices of the given triangles that are kept.
    pub kept: Vec<usize>,
    pub oriented: Oriented,
    pub duplicates: usize,
    pub back_to_back: usize,
}

/// Selection among triangles with the same corners.
pub(super) struct Distinct {
    /// Indices of the given triangles that are kept.
    pub kept: Vec<usize>,
    pub duplicates: usize,
    pub back_to_back: usize,
}

/// Orients `triangles` with each set of corners at most once. The first entry of a pair is the index of the original
/// triangle.
///
/// Two opposite triangles form a wall without thickness, and both are omitted. If no closed surface remains, as with
/// a mesh that has every triangle in both windings, only one of them is.
///
/// # Errors
/// Error of `orient`; [`MeshError::Flat`] if only walls without thickness remain.
pub(super) fn without_coincident(
    triangles: &[(usize, [usize; 3])],
    orient: impl Fn(&[[usize; 3]]) -> Result<Oriented, MeshError>,
) -> Result<Surface, MeshError> {
    let cancelled = distinct(triangles, true);
    let close = |distinct: Distinct| {
        let chosen: Vec<[usize; 3]> = distinct.kept.iter().map(|&k| triangles[k].1).collect();
        let oriented = orient(&chosen)?;
        let Distinct { kept, duplicates, back_to_back } = distinct;
        Ok(Surface { kept, oriented, duplicates, back_to_back })
    };
    let pairs = cancelled.back_to_back > 0;
    match close(cancelled) {
        Err(error) if pairs => close(distinct(triangles, false)).map_err(|_| error),
        made => made,
    }
}

/// Keeps one of the triangles with the same corners; with `cancel`, none of two opposite ones.
pub(super) fn distinct(triangles: &[(usize, [usize; 3])], cancel: bool) -> Distinct {
    // Sorted corners, parity of the permutation, and index.
    let mut sorted: Vec<([usize; 3], bool, usize)> =
        triangles.iter().enumerate().map(|(k, (_, corners))| sort(*corners, k)).collect();
    sorted.sort_unstable();
    let mut made = Distinct { kept: Vec::with_capacity(sorted.len()), duplicates: 0, back_to_back: 0 };
    for same in sorted.chunk_by(|a, b| a.0 == b.0) {
        let odd = same.iter().filter(|(_, odd, _)| *odd).count();
        let even = same.len() - odd;
        if cancel && odd == even {
            made.back_to_back += same.len();
            continue;
        }
        // Even permutations come first.
        let keep = if odd > even { even } else { 0 };
        made.kept.push(same[keep].2);
        let paired = if cancel { 2 * odd.min(even) } else { 0 };
        made.back_to_back += paired;
        made.duplicates += same.len() - 1 - paired;
    }
    made.kept.sort_unstable();
    made
}

fn sort([a, b, c]: [usize; 3], index: usize) -> ([usize; 3], bool, usize) {
    let mut corners = [a, b, c];
    corners.sort_unstable();
    let odd = !same_winding([a, b, c], corners);
    (corners, odd, index)
}
