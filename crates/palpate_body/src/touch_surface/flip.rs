//! Edge flips that remove slivers and folds.

use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Quality below which a triangle is replaced: that of a right triangle with an angle of 5°.
const MIN_QUALITY: f64 = 0.15;
/// Minimum cosine of the angle between the mean normal of four corners and each of them: edges are flipped where the surface is smooth.
const SMOOTH_COSINE: f64 = 0.6;
/// Minimum cosine of the angle between a new triangle and the mean normal of its corners.
const MIN_COSINE: f64 = 0.7;
/// Minimum improvement of the quality, so that the flips end.
const MIN_GAIN: f64 = 1e-9;
/// Maximum number of passes over all edges.
const MAX_PASSES: usize = 16;

/// Flips edges of slivers and of triangles that face against the `normals` of the points, where the surface is smooth and the flip
/// improves the worse of the two triangles. The surface stays closed, and no edge gets more triangles.
///
/// On a flat surface a triangle without area has no normal, and a folded one has the opposite normal: contact would count both as
/// another side of the body.
pub(super) fn flip(triangles: &mut [[usize; 3]], points_m: &[DVec3], normals: &[DVec3]) {
    let quality = |t: [usize; 3]| quality(t, points_m, normals);
    let mut beside: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    let edge = |a: usize, b: usize| (a.min(b), a.max(b));
    for (index, &[a, b, c]) in triangles.iter().enumerate() {
        [(a, b), (b, c), (c, a)]
            .into_iter()
            .for_each(|(a, b)| beside.entry(edge(a, b)).or_default().push(index));
    }
    let mut poor: BTreeSet<usize> =
        (0..triangles.len()).filter(|&t| quality(triangles[t]) < MIN_QUALITY).collect();
    for _ in 0..MAX_PASSES {
        let mut next = BTreeSet::new();
        while let Some(first) = poor.pop_first() {
            let own = quality(triangles[first]);
            if own >= MIN_QUALITY {
                continue;
            }
            let mut best: Option<(f64, [usize; 2], [[usize; 3]; 2])> = None;
            for corner in 0..3 {
                let [p, q, r] = [0, 1, 2].map(|i| triangles[first][(corner + i) % 3]);
                let Some(&[one, two]) = beside.get(&edge(p, q)).map(Vec::as_slice) else { continue };
                let second = if one == first { two } else { one };
                let Some(s) = opposite(triangles[second], [p, q]) else { continue };
                if r == s || beside.contains_key(&edge(r, s)) {
                    continue;
                }
                let new = [[r, p, s], [s, q, r]];
                let before = own.min(quality(triangles[second]));
                let after = new.map(quality).into_iter().fold(f64::INFINITY, f64::min);
                let is_smooth = is_smooth([p, q, r, s], normals)
                    && new.iter().all(|&t| cosine(t, points_m, normals) > MIN_COSINE);
                if is_smooth && after > before + MIN_GAIN && best.is_none_or(|(quality, ..)| after > quality)
                {
                    best = Some((after, [first, second], new));
                }
            }
            let Some((_, old, new)) = best else { continue };
            for triangle in old {
                let [a, b, c] = triangles[triangle];
                for (a, b) in [(a, b), (b, c), (c, a)] {
                    let entry = beside.entry(edge(a, b)).or_default();
                    entry.retain(|&t| t != triangle);
                    if entry.is_empty() {
                        beside.remove(&edge(a, b));
                    }
                }
            }
            for (triangle, corners) in old.into_iter().zip(new) {
                triangles[triangle] = corners;
                let [a, b, c] = corners;
                for (a, b) in [(a, b), (b, c), (c, a)] {
                    beside.entry(edge(a, b)).or_default().push(triangle);
                }
                // Its neighbours may now be improved.
                next.insert(triangle);
                for (a, b) in [(a, b), (b, c), (c, a)] {
                    next.extend(&beside[&edge(a, b)]);
                }
            }
        }
        if next.is_empty() {
            return;
        }
        poor = next;
    }
}

/// The corner that is not on the edge, if the triangle has the edge in the opposite direction.
fn opposite(t: [usize; 3], [p, q]: [usize; 2]) -> Option<usize> {
    (0..3).find(|&i| t[i] == q && t[(i + 1) % 3] == p).map(|i| t[(i + 2) % 3])
}

/// Area along the mean normal of the corners, divided by that of an equilateral triangle with the same mean squared edge: 1 for that
/// triangle, 0 without area, negative if folded.
fn quality(t: [usize; 3], points_m: &[DVec3], normals: &[DVec3]) -> f64 {
    let [a, b, c] = t.map(|point| points_m[point]);
    let normal = t.iter().map(|&point| normals[point]).sum::<DVec3>().normalize_or_zero();
    let squares = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    2.0 * 3.0_f64.sqrt() * (b - a).cross(c - a).dot(normal) / squares
}

/// Whether the normals of the corners of two triangles agree.
fn is_smooth(corners: [usize; 4], normals: &[DVec3]) -> bool {
    let normal = corners.iter().map(|&point| normals[point]).sum::<DVec3>().normalize_or_zero();
    corners.iter().all(|&point| normals[point].dot(normal) > SMOOTH_COSINE)
}

/// Cosine of the angle between a triangle and the mean normal of its corners.
fn cosine(t: [usize; 3], points_m: &[DVec3], normals: &[DVec3]) -> f64 {
    let [a, b, c] = t.map(|point| points_m[point]);
    let normal = t.iter().map(|&point| normals[point]).sum::<DVec3>().normalize_or_zero();
    (b - a).cross(c - a).normalize_or_zero().dot(normal)
}
