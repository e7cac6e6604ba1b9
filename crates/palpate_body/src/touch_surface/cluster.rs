//! Clustering of vertices.

use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

pub(super) struct Clustered {
    /// Kept points.
    pub kept: Vec<usize>,
    /// Triangles as indices into `kept`.
    pub triangles: Vec<[usize; 3]>,
}

/// Clusters points (J. Rossignac and P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes",
/// 1993). The clusters are Voronoi cells along the edges instead of boxes.
///
/// Points are kept in order if they are at least their own or the others' `apart_m` from earlier kept points that edges connect within that
/// distance. Every other point joins the kept point nearest along edges, except one with an opposite normal. This
/// separates the two sides of a thin wall. Degenerate triangles are omitted.
pub(super) fn cluster(
    triangles: &[[usize; 3]],
    points_m: &[DVec3],
    normals: &[DVec3],
    apart_m: &[f64],
) -> Clustered {
    let edges = Edges::new(triangles, points_m.len());
    let along = |seed: usize, point: usize| normals[seed].dot(normals[point]) > 0.0;
    let mut seed_of = vec![usize::MAX; points_m.len()];
    // The last seed that visited each point.
    let mut seen = vec![usize::MAX; points_m.len()];
    let mut kept = Vec::new();
    for seed in 0..points_m.len() {
        if seed_of[seed] != usize::MAX {
            continue;
        }
        kept.push(seed);
        (seed_of[seed], seen[seed]) = (seed, seed);
        let mut front = vec![seed];
        while let Some(point) = front.pop() {
            for &other in edges.of(point) {
                let near = points_m[seed].distance(points_m[other]) < apart_m[seed].min(apart_m[other]);
                if seen[other] != seed && near && along(seed, other) {
                    seen[other] = seed;
                    front.push(other);
                    if seed_of[other] == usize::MAX {
                        seed_of[other] = seed;
                    }
                }
            }
        }
    }
    nearest(&kept, &edges, points_m, &mut seed_of, along);
    let mut index = vec![usize::MAX; points_m.len()];
    kept.iter().enumerate().for_each(|(i, &point)| index[point] = i);
    let of = |t: &[usize; 3]| t.map(|point| index[seed_of[point]]);
    Clustered { triangles: distinct(triangles.iter().map(of)), kept }
}

/// Assigns every point to the nearest of `seeds` along edges that satisfies `along` (E. W. Dijkstra, Numerische
/// Mathematik 1 (1959) 269). Other points keep their seed.
fn nearest(
    seeds: &[usize],
    edges: &Edges,
    points_m: &[DVec3],
    seed_of: &mut [usize],
    along: impl Fn(usize, usize) -> bool,
) {
    let mut distance = vec![f64::INFINITY; points_m.len()];
    // The bits of non-negative numbers are ordered like the numbers.
    let mut queue: BinaryHeap<Reverse<(u64, usize, usize)>> =
        seeds.iter().map(|&seed| Reverse((0, seed, seed))).collect();
    while let Some(Reverse((bits, point, seed))) = queue.pop() {
        if distance[point] <= f64::from_bits(bits) {
            continue;
        }
        distance[point] = f64::from_bits(bits);
        seed_of[point] = seed;
        for &other in edges.of(point) {
            let there = distance[point] + points_m[point].distance(points_m[other]);
            if there < distance[other] && along(seed, other) {
                queue.push(Reverse((there.to_bits(), other, seed)));
            }
        }
    }
}

/// Triangles with three different corners, without pairs of opposite triangles. The surface stays closed: where more remain of one winding, all
/// of them do.
fn distinct(triangles: impl Iterator<Item = [usize; 3]>) -> Vec<[usize; 3]> {
    let mut sorted: Vec<([usize; 3], bool)> = triangles
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .map(|[a, b, c]| {
            let mut corners = [a, b, c];
            corners.sort_unstable();
            let even = [[a, b, c], [b, c, a], [c, a, b]].contains(&corners);
            (corners, even)
        })
        .collect();
    sorted.sort_unstable();
    let mut kept = Vec::new();
    for same in sorted.chunk_by(|a, b| a.0 == b.0) {
        let [a, b, c] = same[0].0;
        let even = same.iter().filter(|(_, even)| *even).count();
        let odd = same.len() - even;
        let remaining = if even > odd { [a, b, c] } else { [a, c, b] };
        kept.extend(std::iter::repeat_n(remaining, even.abs_diff(odd)));
    }
    kept
}

/// For each point the other ends of its edges.
struct Edges {
    start: Vec<usize>,
    ends: Vec<usize>,
}

impl Edges {
    fn new(triangles: &[[usize; 3]], points: usize) -> Self {
        // A closed surface has every edge in both directions.
        let all = || triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let mut start = vec![0; points + 1];
        all().for_each(|(from, _)| start[from + 1] += 1);
        for i in 0..points {
            start[i + 1] += start[i];
        }
        let (mut next, mut ends) = (start.clone(), vec![0; 3 * triangles.len()]);
        for (from, to) in all() {
            ends[next[from]] = to;
            next[from] += 1;
        }
        Self { start, ends }
    }

    fn of(&self, point: usize) -> &[usize] {
        &self.ends[self.start[point]..self.start[point + 1]]
    }
}
