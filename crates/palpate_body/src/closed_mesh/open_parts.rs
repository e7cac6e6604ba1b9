//! Parts, orientation and holes of a mesh that need not close.

use super::closed_surface::ClosedSurface;
use super::edges::{Side, open_edges, sides};
use super::geometry::{double_area, volume};
use super::winding_tree::WindingTree;
use glam::DVec3;
use std::collections::BTreeMap;

/// Triangles that are oriented as far as their edges determine it, with caps on their holes.
pub(super) struct OpenParts {
    /// Triangles in the given order; a closed part faces outward, unless it is a cavity.
    pub triangles: Vec<[usize; 3]>,
    /// Part of each triangle.
    pub part: Vec<usize>,
    /// Triangles that close all holes, few of them large: the sum of `triangles` and caps has no boundary.
    pub caps: Vec<[DVec3; 3]>,
    /// Closed loops of points along the holes.
    pub holes: Vec<Vec<usize>>,
    /// Number of parts connected by edges of two triangles.
    pub part_count: usize,
    /// Number of parts that faced inward.
    pub reoriented_parts: usize,
    /// Number of edges along the holes.
    pub open_edge_count: usize,
    /// Number of edges with more than two triangles.
    pub branching_edge_count: usize,
}

impl OpenParts {
    /// Orients `triangles` of `points_m`.
    pub(super) fn new(triangles: &[[usize; 3]], points_m: &[DVec3]) -> Self {
        let sides = sides(triangles);
        let branching_edge_count =
            sides.chunk_by(|a, b| a.edge == b.edge).filter(|edge| edge.len() > 2).count();
        let (part, part_count, mut turned) = connect(&sides, triangles.len());
        let mut oriented: Vec<[usize; 3]> = triangles
            .iter()
            .zip(&turned)
            .map(|(&[a, b, c], is_turned)| if *is_turned { [a, c, b] } else { [a, b, c] })
            .collect();
        let edges = open_edges(&sides, |triangle| part[triangle], |triangle| turned[triangle]);
        let turn = parts_to_turn(&TrianglesOfParts::new(&oriented, &part, part_count), &edges, points_m);
        for ((t, turned), _) in
            oriented.iter_mut().zip(&mut turned).zip(&part).filter(|(_, part)| turn[**part])
        {
            t.swap(1, 2);
            *turned = !*turned;
        }
        let open = open_edges(&sides, |_| (), |triangle| turned[triangle]);
        let loops = boundary_loops(open.into_iter().map(|(edge, ())| edge).collect());
        Self {
            caps: caps(&loops, points_m),
            triangles: oriented,
            part,
            part_count,
            reoriented_parts: turn.iter().filter(|turn| **turn).count(),
            open_edge_count: loops.iter().map(Vec::len).sum(),
            holes: loops,
            branching_edge_count,
        }
    }

    /// The triangles with fans on their holes, as one surface.
    pub(super) fn capped(&self, points_m: &[DVec3]) -> ClosedSurface {
        let mut surface = ClosedSurface { points_m: points_m.to_vec(), triangles: self.triangles.clone() };
        for corners in self.holes.iter().filter(|corners| corners.len() > 2) {
            let middle = surface.points_m.len();
            if corners.len() > 3 {
                surface.points_m.push(mean(corners.iter().map(|&point| points_m[point])));
            }
            surface.triangles.extend(fan(corners, middle));
        }
        surface
    }

    /// Share of fans on the holes in the area of the triangles.
    pub(super) fn cap_share(&self, points_m: &[DVec3]) -> f64 {
        let caps: f64 = fans(&self.holes, points_m).into_iter().map(double_area).sum();
        caps / self.triangles.iter().map(|t| double_area(t.map(|point| points_m[point]))).sum::<f64>()
    }

    /// Twice the volume per area of the surface with fans on its holes: the thickness of a wall.
    pub(super) fn mean_thickness_m(&self, points_m: &[DVec3]) -> f64 {
        let ClosedSurface { points_m, triangles } = self.capped(points_m);
        let double_areas = triangles.iter().map(|t| double_area(t.map(|point| points_m[point])));
        4.0 * volume(&triangles, &points_m).abs() / double_areas.sum::<f64>()
    }
}

/// Part of every triangle, the number of parts, and whether each triangle is turned so that it agrees with the first of its part. Edges
/// of exactly two triangles connect; on a one-sided part the first path decides.
fn connect(sides: &[Side], triangle_count: usize) -> (Vec<usize>, usize, Vec<bool>) {
    let mut neighbours = vec![[None::<(u32, bool)>; 3]; triangle_count];
    for edge in sides.chunk_by(|a, b| a.edge == b.edge) {
        if let [a, b] = edge {
            let agrees = a.is_up != b.is_up;
            for (own, other) in [(a, b), (b, a)] {
                if let Some(free) = neighbours[own.triangle as usize].iter_mut().find(|entry| entry.is_none())
                {
                    *free = Some((other.triangle, agrees));
                }
            }
        }
    }
    let (mut part, mut turned) = (vec![usize::MAX; triangle_count], vec![false; triangle_count]);
    let mut part_count = 0;
    for start in 0..triangle_count {
        if part[start] != usize::MAX {
            continue;
        }
        part[start] = part_count;
        let mut front = vec![start];
        while let Some(triangle) = front.pop() {
            for &(other, agrees) in neighbours[triangle].iter().flatten() {
                let other = other as usize;
                if part[other] == usize::MAX {
                    (part[other], turned[other]) = (part_count, turned[triangle] == agrees);
                    front.push(other);
                }
            }
        }
        part_count += 1;
    }
    (part, part_count, turned)
}

/// Whether each part is to be turned, so that it faces outward, or inward if it is a cavity of another part: a part whose orientation as
/// given is opposite to that of the smallest part around it.
/// `open` has the open edges of each part, sorted by part.
fn parts_to_turn(
    parts: &TrianglesOfParts<'_>,
    open: &[((usize, usize), usize)],
    points_m: &[DVec3],
) -> Vec<bool> {
    let corners = |t: [usize; 3]| t.map(|point| points_m[point]);
    let of_parts = open.iter().map(|&((from, to), part)| ((part, from), (part, to)));
    // Sorted by part, as the edges are.
    let loops = boundary_loops(of_parts.collect());
    let mut rest = loops.as_slice();
    let shapes: Vec<Shape> = (0..parts.count())
        .map(|part| {
            let (own, later) = rest.split_at(rest.iter().take_while(|corners| corners[0].0 == part).count());
            rest = later;
            let own: Vec<Vec<usize>> =
                own.iter().map(|corners| corners.iter().map(|(_, point)| *point).collect()).collect();
            let fans = fans(&own, points_m);
            let all = || parts.of(part).map(corners).chain(fans.iter().copied());
            let of_origin = || all().map(|[a, b, c]| a.dot(b.cross(c)) / 6.0);
            let (sum, rounding) =
                (of_origin().sum::<f64>(), ROUNDING * of_origin().map(f64::abs).sum::<f64>());
            let volume_m3 = if sum.abs() > rounding { sum } else { 0.0 };
            let low_m = all().flatten().fold(DVec3::INFINITY, DVec3::min);
            let high_m = all().flatten().fold(DVec3::NEG_INFINITY, DVec3::max);
            Shape { volume_m3, bounds_m: (low_m, high_m), first_m: all().next().unwrap_or_default() }
        })
        .collect();
    let mut order: Vec<usize> = (0..parts.count()).collect();
    order.sort_by(|&a, &b| shapes[b].volume_m3.abs().total_cmp(&shapes[a].volume_m3.abs()).then(a.cmp(&b)));
    // Trees of the parts that may contain others.
    let mut trees: BTreeMap<usize, WindingTree> = BTreeMap::new();
    let mut faces_out = vec![true; parts.count()];
    let mut examined = 0;
    for (rank, &own) in order.iter().enumerate() {
        let [a, b, c] = shapes[own].first_m;
        let place_m = (a + b + c) / 3.0;
        let mut container = None;
        for &other in &order[..rank.min(MAX_CONTAINERS)] {
            let (low, high) = shapes[other].bounds_m;
            if !(place_m.cmpge(low).all() && place_m.cmple(high).all()) {
                continue;
            }
            examined += 1;
            if examined > MAX_EXAMINED {
                break;
            }
            let tree = trees
                .entry(other)
                .or_insert_with(|| WindingTree::new(parts.of(other).map(corners).collect()));
            if tree.winding(place_m).abs() > 0.5 {
                // Later parts are smaller.
                container = Some(other);
            }
        }
        faces_out[own] = container.is_none_or(|other| {
            let is_opposite = (shapes[own].volume_m3 < 0.0) != (shapes[other].volume_m3 < 0.0);
            !(is_opposite && faces_out[other])
        });
    }
    (0..parts.count())
        .map(|part| (shapes[part].volume_m3 < 0.0) == faces_out[part] && shapes[part].volume_m3 != 0.0)
        .collect()
}

/// Volume of a part, relative to the sum of the magnitudes of its terms, that counts as zero: a flat part has no orientation.
const ROUNDING: f64 = 1e-12;

/// A part with its holes capped.
struct Shape {
    volume_m3: f64,
    bounds_m: (DVec3, DVec3),
    first_m: [DVec3; 3],
}

/// Maximum number of parts, the largest, that may contain cavities, and of pairs of parts that are examined. Files of thousands of parts
/// would take too long.
const MAX_CONTAINERS: usize = 1000;
const MAX_EXAMINED: usize = 20_000;

/// Triangles, sorted by their part.
struct TrianglesOfParts<'a> {
    triangles: &'a [[usize; 3]],
    sorted: Vec<u32>,
    /// Triangles of part i: `sorted[first[i]..first[i + 1]]`.
    first: Vec<usize>,
}

impl<'a> TrianglesOfParts<'a> {
    fn new(triangles: &'a [[usize; 3]], part: &[usize], part_count: usize) -> Self {
        let mut first = vec![0; part_count + 1];
        part.iter().for_each(|part| first[part + 1] += 1);
        for part in 0..part_count {
            first[part + 1] += first[part];
        }
        let (mut next, mut sorted) = (first.clone(), vec![0; triangles.len()]);
        for (triangle, &part) in part.iter().enumerate() {
            sorted[next[part]] = triangle as u32;
            next[part] += 1;
        }
        Self { triangles, sorted, first }
    }

    fn count(&self) -> usize {
        self.first.len() - 1
    }

    /// The triangles of `part`, in their order.
    fn of(&self, part: usize) -> impl Iterator<Item = [usize; 3]> {
        self.sorted[self.first[part]..self.first[part + 1]]
            .iter()
            .map(|&triangle| self.triangles[triangle as usize])
    }
}

/// Closed loops of the directed edges `leaving`, of which as many enter each point as leave it. Loops are sorted by the point where the path
/// through them starts.
fn boundary_loops<P: Copy + Ord>(mut leaving: Vec<(P, P)>) -> Vec<Vec<P>> {
    // Of those that leave a point, the last one that is not yet used comes next.
    leaving.sort_by_key(|(from, _)| *from);
    let starts: Vec<P> = leaving.chunk_by(|a, b| a.0 == b.0).map(|edges| edges[0].0).collect();
    let ends: Vec<usize> = leaving
        .chunk_by(|a, b| a.0 == b.0)
        .scan(0, |end, edges| {
            *end += edges.len();
            Some(*end)
        })
        .collect();
    let mut unused = ends.clone();
    // Index in the path of each point of it.
    let mut place = vec![None; starts.len()];
    let mut loops = Vec::new();
    let mut path: Vec<usize> = Vec::new();
    for start in 0..starts.len() {
        // The path ends at its start, with all loops through it. A loop is cut off where the path meets itself, so that loops are simple.
        path.push(start);
        place[start] = Some(0);
        while let Some(&at) = path.last() {
            let first = at.checked_sub(1).map_or(0, |before| ends[before]);
            if unused[at] == first {
                break;
            }
            unused[at] -= 1;
            let Ok(next) = starts.binary_search(&leaving[unused[at]].1) else { break };
            if let Some(from) = place[next] {
                let closed = path.drain(from + 1..);
                let corners = std::iter::once(next).chain(closed.inspect(|point| place[*point] = None));
                loops.push(corners.map(|point| starts[point]).collect());
            } else {
                place[next] = Some(path.len());
                path.push(next);
            }
        }
        path.drain(..).for_each(|point| place[point] = None);
    }
    loops
}

/// Triangles on each loop, opposite to its edges: one between its first, middle and last point, and so on in both halves, so that most are as
/// small as the edges.
fn caps(loops: &[Vec<usize>], points_m: &[DVec3]) -> Vec<[DVec3; 3]> {
    let mut caps = Vec::new();
    let mut left = Vec::new();
    for corners in loops.iter().filter(|corners| corners.len() > 2) {
        left.push((0, corners.len() - 1));
        while let Some((first, last)) = left.pop() {
            if last - first < 2 {
                continue;
            }
            let middle = usize::midpoint(first, last);
            caps.push([last, middle, first].map(|corner| points_m[corners[corner]]));
            left.extend([(first, middle), (middle, last)]);
        }
    }
    caps
}

/// Fans around the middle of each loop.
fn fans(loops: &[Vec<usize>], points_m: &[DVec3]) -> Vec<[DVec3; 3]> {
    let of_loop = |corners: &Vec<usize>| {
        let corners_m: Vec<DVec3> = corners.iter().map(|&point| points_m[point]).collect();
        fan(&corners_m, mean(corners_m.iter().copied()))
    };
    loops.iter().filter(|corners| corners.len() > 2).flat_map(of_loop).collect()
}

/// Triangles from the edges of a loop to its `middle`, opposite to the edges; a loop of three edges is one triangle without it.
fn fan<P: Copy>(corners: &[P], middle: P) -> Vec<[P; 3]> {
    if let &[a, b, c] = corners {
        return vec![[c, b, a]];
    }
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(from, to)| [*to, *from, middle]).collect()
}

fn mean(points_m: impl ExactSizeIterator<Item = DVec3>) -> DVec3 {
    let count = points_m.len() as f64;
    points_m.sum::<DVec3>() / count
}
