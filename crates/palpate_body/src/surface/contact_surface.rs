//! The triangles on which contact patches are found.

use crate::{BodyPoint, Network, Surface};
use glam::DVec3;
use palpate_laws::{Neighbour, POINT_NODES, PatchSurface};
use std::collections::HashMap;

/// The triangles of a surface on which contact patches are found, with their neighbours. Rectangles, the faces of a
/// lattice's cells, are split at their centre into four triangles, which preserves the symmetries of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactSurface {
    points: Vec<BodyPoint>,
    triangles: Vec<[usize; 3]>,
    neighbours: Vec<[Neighbour; 3]>,
    rest_normals: Vec<DVec3>,
    /// Contact triangles of each triangle of the surface, at most four.
    parts: Vec<[Option<u32>; 4]>,
    mean_edge_m: f64,
}

/// Cosine of the angle between two triangles at rest below which their edge is sharp.
const CREASE: f64 = 0.642_787_609_686_539_3;
/// Tolerance of a rectangle, relative to its size: its diagonals bisect each other and are equally long.
const RECTANGLE: f64 = 1e-6;

/// An edge: index of the triangle, and of the edge in it.
type Side = (usize, usize);

impl ContactSurface {
    /// Creates the contact surface of `surface`, carried by `network`.
    #[must_use]
    pub fn new(surface: &Surface, network: &Network) -> Self {
        let of: Vec<[usize; 3]> =
            (0..surface.triangles.len()).map(|triangle| surface.corners(triangle)).collect();
        let mut points = surface.points.clone();
        let mut rest: Vec<DVec3> = points.iter().map(|point| point.of(network.rest_m())).collect();
        let mut triangles: Vec<[usize; 3]> = Vec::with_capacity(2 * of.len());
        let mut parts = vec![[None; 4]; of.len()];
        let mut is_split = vec![false; of.len()];
        for [(t, edge), (s, back)] in sides(&of).into_iter().flatten() {
            let (corners, apex) = (of[t], of[s][(back + 2) % 3]);
            let [p, q, r] = [0, 1, 2].map(|i| corners[(edge + i) % 3]);
            let (one, other) = (rest[q] - rest[p], rest[apex] - rest[r]);
            let size = one.length();
            let halved = (rest[p] + rest[q]).distance(rest[r] + rest[apex]);
            if is_split[t]
                || is_split[s]
                || halved > RECTANGLE * size
                || (other.length() - size).abs() > RECTANGLE * size
            {
                continue;
            }
            let middle = BodyPoint::between([(&points[p], 0.5), (&points[q], 0.5), (&points[p], 0.0)]);
            let other = BodyPoint::between([(&points[r], 0.5), (&points[apex], 0.5), (&points[r], 0.0)]);
            let center = BodyPoint::between([(&middle, 0.5), (&other, 0.5), (&middle, 0.0)]);
            if center.nodes().len() > POINT_NODES {
                continue;
            }
            (is_split[t], is_split[s]) = (true, true);
            rest.push(center.of(network.rest_m()));
            points.push(center);
            let center = points.len() - 1;
            let first = triangles.len() as u32;
            // Around the rectangle.
            let around = [p, apex, q, r];
            triangles.extend((0..4).map(|i| [around[i], around[(i + 1) % 4], center]));
            let four = [0, 1, 2, 3].map(|i| Some(first + i));
            (parts[t], parts[s]) = (four, four);
        }
        for (index, corners) in of.iter().enumerate().filter(|(index, _)| !is_split[*index]) {
            parts[index][0] = Some(triangles.len() as u32);
            triangles.push(*corners);
        }
        let normal =
            |&[a, b, c]: &[usize; 3]| (rest[b] - rest[a]).cross(rest[c] - rest[a]).normalize_or_zero();
        let rest_normals: Vec<DVec3> = triangles.iter().map(normal).collect();
        let mut neighbours = vec![[Neighbour::default(); 3]; triangles.len()];
        for [(t, edge), (s, back)] in sides(&triangles).into_iter().flatten() {
            let is_crease = rest_normals[t].dot(rest_normals[s]) < CREASE;
            neighbours[t][edge] = Neighbour { triangle: Some(s as u32), is_crease };
            neighbours[s][back] = Neighbour { triangle: Some(t as u32), is_crease };
        }
        let edges = of.iter().flat_map(|t| [0, 1, 2].map(|i| rest[t[i]].distance(rest[t[(i + 1) % 3]])));
        let mean_edge_m = edges.sum::<f64>() / (3 * of.len()).max(1) as f64;
        Self { points, triangles, neighbours, rest_normals, parts, mean_edge_m }
    }

    /// Points: those of the surface, followed by the centres of rectangles.
    #[must_use]
    pub fn points(&self) -> &[BodyPoint] {
        &self.points
    }

    /// Triangles as indices of points, counter-clockwise as seen from outside.
    #[must_use]
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// Neighbours across the edges of a triangle: from corner 0 to 1, 1 to 2, 2 to 0.
    ///
    /// # Panics
    /// If the triangle does not exist.
    #[must_use]
    pub fn neighbours(&self, triangle: usize) -> [Neighbour; 3] {
        self.neighbours[triangle]
    }

    /// Outward unit normal of a triangle at rest.
    ///
    /// # Panics
    /// If the triangle does not exist.
    #[must_use]
    pub fn rest_normal(&self, triangle: usize) -> DVec3 {
        self.rest_normals[triangle]
    }

    /// Contact triangles of the given surface triangles, each once, in ascending order.
    #[must_use]
    pub fn parts_of(&self, triangles: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let parts = triangles.into_iter().filter_map(|triangle| self.parts.get(triangle)).flatten();
        let mut parts: Vec<usize> = parts.flatten().map(|&part| part as usize).collect();
        parts.sort_unstable();
        parts.dedup();
        parts
    }

    /// Mean edge length of the surface at rest, m.
    #[must_use]
    pub fn mean_edge_m(&self) -> f64 {
        self.mean_edge_m
    }
}

/// The two triangles at each edge, in the order of the first one; `None` for an edge of one or more than two
/// triangles, or with inconsistent winding.
fn sides(triangles: &[[usize; 3]]) -> Vec<Option<[Side; 2]>> {
    let mut beside: HashMap<(usize, usize), Vec<Side>> = HashMap::with_capacity(2 * triangles.len());
    let mut order = Vec::with_capacity(2 * triangles.len());
    for (index, corners) in triangles.iter().enumerate() {
        for edge in 0..3 {
            let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
            let key = (a.min(b), a.max(b));
            let sides = beside.entry(key).or_default();
            if sides.is_empty() {
                order.push(key);
            }
            sides.push((index, edge));
        }
    }
    let pair = |key: &(usize, usize)| match beside[key][..] {
        [(t, edge), (s, back)] if triangles[t][edge] != triangles[s][back] => Some([(t, edge), (s, back)]),
        _ => None,
    };
    order.iter().map(pair).collect()
}

/// A contact surface with the current positions of its points.
pub(crate) struct PlacedSurface<'a> {
    pub(crate) surface: &'a ContactSurface,
    /// Position of every point, m.
    pub(crate) x: &'a [DVec3],
}

impl PatchSurface for PlacedSurface<'_> {
    fn corners_m(&self, triangle: usize) -> Option<[DVec3; 3]> {
        let corners = self.surface.triangles.get(triangle)?;
        Some(corners.map(|point| self.x[point]))
    }

    fn neighbours(&self, triangle: usize) -> [Neighbour; 3] {
        self.surface.neighbours.get(triangle).copied().unwrap_or_default()
    }
}
