//! The points of a body that touch obstacles.

use crate::{BodyPoint, Network, Surface};
use glam::DVec3;
use std::collections::BTreeMap;

/// The points of a body that touch obstacles.
#[derive(Clone, Debug)]
pub(crate) struct ObstaclePoints {
    pub(crate) points: Vec<BodyPoint>,
    /// Distance between neighbouring points, m.
    pub(crate) spacing_m: f64,
    /// Maximum speed of a point, relative to the maximum speed of its nodes.
    pub(crate) max_speed_ratio: f64,
}

/// Minimum distance between points inside cells, in cells. Rows of closer points are nearly dependent.
const SPACING_CELLS: f64 = 1.0;
/// Number of levels of sharpness. Points in corners and on edges are selected before points on faces.
const SHARPNESS_LEVELS: f64 = 8.0;

impl ObstaclePoints {
    /// Creates the points of a body: those of its surface, or its nodes if it has no surface.
    ///
    /// All points on single nodes are selected. Of points inside cells those are selected that are at least a cell
    /// apart, in corners and on edges first.
    pub(crate) fn new(surface: &Surface, network: &Network) -> Self {
        let cell_m = network.grid().map_or(0.0, crate::Grid::cell_m);
        let points = if surface.triangles.is_empty() {
            (0..network.node_count()).map(BodyPoint::node).collect()
        } else {
            select(surface, network, SPACING_CELLS * cell_m)
        };
        let spacing_m = if cell_m > 0.0 { cell_m } else { mean_link_m(network) };
        let ratio = |point: &BodyPoint| point.nodes().iter().map(|(_, w)| w.abs()).sum();
        let max_speed_ratio = points.iter().map(ratio).fold(1.0, f64::max);
        Self { points, spacing_m, max_speed_ratio }
    }
}

fn select(surface: &Surface, network: &Network, spacing_m: f64) -> Vec<BodyPoint> {
    let sharpness = sharpness(surface, network);
    let mut singles: Vec<usize> = Vec::new();
    let mut inside: Vec<(usize, usize)> = Vec::new();
    for (index, point) in surface.points.iter().enumerate() {
        match (sharpness[index], point.nodes()) {
            (Some(_), [(node, _)]) => singles.push(*node),
            (Some(level), _) => inside.push((level, index)),
            (None, _) => {}
        }
    }
    singles.sort_unstable();
    singles.dedup();
    inside.sort_unstable();
    let mut points: Vec<BodyPoint> = singles.into_iter().map(BodyPoint::node).collect();
    let mut kept = Spaced::new(spacing_m);
    for point in &points {
        kept.add(point.of(network.rest_m()));
    }
    for (_, index) in inside {
        let at_m = surface.points[index].of(network.rest_m());
        if !kept.has_near(at_m) {
            kept.add(at_m);
            points.push(surface.points[index].clone());
        }
    }
    points
}

/// How flat the surface is at each point at rest, from 0 in a sharp corner; `None` for a point without triangles.
fn sharpness(surface: &Surface, network: &Network) -> Vec<Option<usize>> {
    let rest: Vec<DVec3> = surface.points.iter().map(|point| point.of(network.rest_m())).collect();
    let mut around: Vec<Option<(DVec3, f64)>> = vec![None; rest.len()];
    for triangle in 0..surface.triangles.len() {
        let corners = surface.corners(triangle);
        for corner in 0..3 {
            let [at, next, last] = [0, 1, 2].map(|i| rest[corners[(corner + i) % 3]]);
            let (to, back) = (next - at, last - at);
            let angle = if to == DVec3::ZERO || back == DVec3::ZERO { 0.0 } else { to.angle_between(back) };
            let (sum, total) = around[corners[corner]].get_or_insert((DVec3::ZERO, 0.0));
            *sum += angle * to.cross(back).normalize_or_zero();
            *total += angle;
        }
    }
    let level = |(sum, total): (DVec3, f64)| {
        let flatness = if total > 0.0 { (sum.length() / total).min(1.0) } else { 1.0 };
        (SHARPNESS_LEVELS * flatness).round() as usize
    };
    around.into_iter().map(|of| of.map(level)).collect()
}

/// Positions at least a certain distance apart, sorted into cubes of that size.
struct Spaced {
    spacing_m: f64,
    cubes: BTreeMap<[i64; 3], Vec<DVec3>>,
}

/// Share of the spacing within which rounding is ignored.
const ROUNDING: f64 = 1e-6;

impl Spaced {
    fn new(spacing_m: f64) -> Self {
        Self { spacing_m: spacing_m * (1.0 - ROUNDING), cubes: BTreeMap::new() }
    }

    fn cube(&self, at_m: DVec3) -> [i64; 3] {
        (at_m / self.spacing_m).floor().to_array().map(|i| i as i64)
    }

    fn add(&mut self, at_m: DVec3) {
        if self.spacing_m > 0.0 {
            self.cubes.entry(self.cube(at_m)).or_default().push(at_m);
        }
    }

    fn has_near(&self, at_m: DVec3) -> bool {
        if self.spacing_m <= 0.0 {
            return false;
        }
        let [x, y, z] = self.cube(at_m);
        let near = |i: i64, j: i64, k: i64| {
            let cube = self.cubes.get(&[x + i, y + j, z + k]);
            cube.is_some_and(|of| of.iter().any(|other| other.distance(at_m) < self.spacing_m))
        };
        (-1..=1).any(|i| (-1..=1).any(|j| (-1..=1).any(|k| near(i, j, k))))
    }
}

/// Mean length of the links at rest, or without links mean distance of the nodes that share an element.
fn mean_link_m(network: &Network) -> f64 {
    let rest = network.rest_m();
    let mean = |lengths_m: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = lengths_m.fold((0.0, 0_usize), |(sum, count), length| (sum + length, count + 1));
        sum / count.max(1) as f64
    };
    if network.links().is_empty() {
        let of = |node| network.neighbours(node).map(move |other| rest[node].distance(rest[other]));
        return mean(&mut (0..rest.len()).flat_map(of));
    }
    mean(&mut network.links().iter().map(|link| rest[link.a].distance(rest[link.b])))
}
