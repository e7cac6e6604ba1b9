//! Subdivision of large triangles.

use glam::DVec3;
use std::collections::HashMap;

/// Halves edges and the adjacent triangles until no edge is longer than `max_edge_m`. New points are appended to
/// `points_m`.
pub(super) fn subdivide(
    mut triangles: Vec<[usize; 3]>,
    points_m: &mut Vec<DVec3>,
    max_edge_m: f64,
) -> Vec<[usize; 3]> {
    loop {
        let mut middle: HashMap<(usize, usize), usize> = HashMap::new();
        let mut finer = Vec::with_capacity(triangles.len());
        for &t in &triangles {
            let halved = [0, 1, 2].map(|corner| {
                let (a, b) = (t[corner], t[(corner + 1) % 3]);
                (points_m[a].distance(points_m[b]) > max_edge_m).then(|| {
                    *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        points_m.push(0.5 * (points_m[a] + points_m[b]));
                        points_m.len() - 1
                    })
                })
            });
            split(t, halved, &mut finer);
        }
        if middle.is_empty() {
            return finer;
        }
        triangles = finer;
    }
}

/// The triangle [a, b, c] with points on its edges ab, bc, ca.
fn split([a, b, c]: [usize; 3], halved: [Option<usize>; 3], out: &mut Vec<[usize; 3]>) {
    match halved {
        [None, None, None] => out.push([a, b, c]),
        [Some(ab), Some(bc), Some(ca)] => {
            out.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        // Rotated until the first edge is the only halved one, or the last one the only one that is not.
        [Some(ab), None, None] => out.extend([[a, ab, c], [ab, b, c]]),
        [Some(ab), Some(bc), None] => out.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
        [first, second, third] => split([b, c, a], [second, third, first], out),
    }
}
