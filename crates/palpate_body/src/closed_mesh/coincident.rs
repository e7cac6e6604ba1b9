//! Triangles that have the same three corners.

use super::MeshError;
use super::geometry::same_winding;
use super::orient::Oriented;

/// A closed surface without coincident triangles.
pub(super) struct Surface {
    /// Which of the triangles given are in it.
    pub kept: Vec<usize>,
    pub oriented: Oriented,
    pub duplicates: usize,
    pub back_to_back: usize,
}

/// Triangles with the same corners, and how they were dealt with.
struct Distinct {
    kept: Vec<usize>,
    duplicates: usize,
    back_to_back: usize,
}

/// The surface of `triangles` (with what they were made of), each set of corners at most once.
///
/// Two triangles back to back are a wall without thickness, and both are left out; where that leaves no closed surface, as
/// with a mesh that has every triangle in both windings, one of them is.
///
/// # Errors
/// That of `orient`, or [`MeshError::Flat`] when nothing but walls without thickness is there.
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

fn distinct(triangles: &[(usize, [usize; 3])], cancel: bool) -> Distinct {
    // Sorted corners, whether that took an odd permutation, and the index.
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
        // Even ones come first.
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
