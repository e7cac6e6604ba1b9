//! Closedness and orientation of a mesh by its edges.

use super::MeshError;
use super::edges::{Side, sides};
use super::geometry::volume;
use crate::disjoint_sets::DisjointSets;
use glam::DVec3;
use std::collections::BTreeMap;

/// A closed surface with consistent triangles, in parts that are connected by edges.
pub(super) struct Oriented {
    /// Triangles in the given order. Those of one part all face outward or all inward.
    pub triangles: Vec<[usize; 3]>,
    /// Part of each triangle.
    pub part: Vec<usize>,
    pub parts: usize,
    pub pinched_edges: usize,
}

/// Flips triangles until neighbours are consistent.
///
/// # Errors
/// [`MeshError::Flat`] for no triangles, [`MeshError::Holes`], [`MeshError::NonManifold`], [`MeshError::OneSided`].
pub(super) fn orient(
    triangles: &[[usize; 3]],
    points_m: &[DVec3],
    center_m: DVec3,
) -> Result<Oriented, MeshError> {
    if triangles.is_empty() {
        return Err(MeshError::Flat { at_m: center_m });
    }
    let sides = sides(triangles);
    let middle =
        |side: &Side| center_m + 0.5 * (points_m[side.edge.0 as usize] + points_m[side.edge.1 as usize]);
    let groups = || sides.chunk_by(|a, b| a.edge == b.edge);
    let (edges, first) = count(groups().filter(|group| group.len() == 1));
    if let Some(side) = first {
        return Err(MeshError::Holes { edges, at_m: middle(side) });
    }
    let (odd, first_odd) = count(groups().filter(|group| group.len() % 2 == 1));
    let (pinched_edges, first_pinched) = count(groups().filter(|group| group.len() > 2));
    let balanced = |group: &&[Side]| 2 * group.iter().filter(|side| side.is_up).count() == group.len();
    let agreed = groups().all(|group| balanced(&group));
    if let Some(side) = first_odd {
        return Err(MeshError::NonManifold { edges: odd, at_m: middle(side) });
    }
    if let (false, Some(side)) = (agreed, first_pinched) {
        return Err(MeshError::NonManifold { edges: pinched_edges, at_m: middle(side) });
    }
    if pinched_edges > 0 {
        // All triangles are consistent already.
        let (part, parts) = parts_beside_pinched_edges(&sides, triangles.len());
        return Ok(Oriented { triangles: triangles.to_vec(), part, parts, pinched_edges });
    }
    // Every edge has two triangles.
    let neighbours = neighbours(&sides, triangles.len());
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let (mut part, mut parts) = (vec![0; triangles.len()], 0);
    for start in 0..triangles.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let mut front = vec![start];
        while let Some(triangle) = front.pop() {
            part[triangle] = parts;
            let own = turned[triangle].unwrap_or_default();
            for &(other, agree) in neighbours.of(triangle) {
                let wanted = own == agree;
                match turned[other] {
                    None => {
                        turned[other] = Some(wanted);
                        front.push(other);
                    }
                    Some(is) if is != wanted => {
                        return Err(MeshError::OneSided { at_m: center_m + points_m[triangles[other][0]] });
                    }
                    Some(_) => {}
                }
            }
        }
        parts += 1;
    }
    let turn = |(&[a, b, c], turned): (&[usize; 3], &Option<bool>)| {
        if *turned == Some(true) { [a, c, b] } else { [a, b, c] }
    };
    let triangles = triangles.iter().zip(&turned).map(turn).collect();
    Ok(Oriented { triangles, part, parts, pinched_edges })
}

/// Part of each triangle, and the number of parts, of consistent triangles of which more than two may share an edge. Parts that are closed at
/// such an edge only touch there, and may face differently.
fn parts_beside_pinched_edges(sides: &[Side], triangles: usize) -> (Vec<usize>, usize) {
    let mut sets = DisjointSets::new(triangles);
    let groups = || sides.chunk_by(|a, b| a.edge == b.edge);
    for pair in groups().filter(|group| group.len() == 2) {
        sets.unite(pair[0].triangle as usize, pair[1].triangle as usize);
    }
    for group in groups().filter(|group| group.len() > 2) {
        let mut excess: BTreeMap<usize, i32> = BTreeMap::new();
        for side in group {
            *excess.entry(sets.find(side.triangle as usize)).or_default() += if side.is_up { 1 } else { -1 };
        }
        let mut open = excess.into_iter().filter(|(_, excess)| *excess != 0).map(|(root, _)| root);
        if let Some(first) = open.next() {
            open.for_each(|other| sets.unite(first, other));
        }
    }
    let mut number = BTreeMap::new();
    let of = |triangle: usize| {
        let next = number.len();
        *number.entry(sets.find(triangle)).or_insert(next)
    };
    let part = (0..triangles).map(of).collect();
    (part, number.len())
}

/// Rejects parts whose mean thickness, 2 V/A, is within the tolerance.
///
/// # Errors
/// [`MeshError::Flat`].
pub(super) fn check_thickness(
    triangles: &[[usize; 3]],
    part: &[usize],
    parts: usize,
    points_m: &[DVec3],
    center_m: DVec3,
    tolerance_m: f64,
) -> Result<(), MeshError> {
    let (mut enclosed, mut area) = (vec![0.0; parts], vec![0.0; parts]);
    let mut first = vec![DVec3::ZERO; parts];
    for (t, &part) in triangles.iter().zip(part) {
        let [a, b, c] = t.map(|point| points_m[point]);
        area[part] += 0.5 * (b - a).cross(c - a).length();
        enclosed[part] += volume(&[*t], points_m);
        first[part] = a;
    }
    let flat = |&part: &usize| 2.0 * enclosed[part].abs() <= 4.0 * tolerance_m * area[part];
    match (0..parts).find(flat) {
        Some(part) => Err(MeshError::Flat { at_m: center_m + first[part] }),
        None => Ok(()),
    }
}

fn count<'a>(mut groups: impl Iterator<Item = &'a [Side]>) -> (usize, Option<&'a Side>) {
    let first = groups.next().and_then(<[Side]>::first);
    (usize::from(first.is_some()) + groups.count(), first)
}

/// Neighbours of each triangle, and whether they are consistent with it.
struct Neighbours {
    start: Vec<usize>,
    all: Vec<(usize, bool)>,
}

impl Neighbours {
    fn of(&self, triangle: usize) -> &[(usize, bool)] {
        &self.all[self.start[triangle]..self.start[triangle + 1]]
    }
}

/// Around each edge, every triangle is the neighbour of the next one.
fn neighbours(sides: &[Side], triangles: usize) -> Neighbours {
    let pairs = || {
        sides.chunk_by(|a, b| a.edge == b.edge).flat_map(|group| {
            let next = group.iter().cycle().skip(1);
            group
                .iter()
                .zip(next)
                .map(|(a, b)| (a.triangle as usize, b.triangle as usize, a.is_up != b.is_up))
        })
    };
    let mut start = vec![0; triangles + 1];
    pairs().for_each(|(from, ..)| start[from + 1] += 1);
    for i in 0..triangles {
        start[i + 1] += start[i];
    }
    let mut next = start.clone();
    let mut all = vec![(0, true); 3 * triangles];
    for (from, to, agree) in pairs() {
        all[next[from]] = (to, agree);
        next[from] += 1;
    }
    Neighbours { start, all }
}
