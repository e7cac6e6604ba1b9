//! Where the tool may run into S in a step.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::{MOST_POINTS, Meeting};
use crate::near_tick::get;
use crate::{NearField, NearPoint, Support};
use glam::DVec3;
use palpate_laws::{CLOSING_M_PER_S, Coulomb, Feature, POINT_NODES, RowLaw, ToolMove};

/// Of the way between two looks at the surface, the largest part of a tool's radius.
const SHARE_OF_RADIUS: f64 = 0.5;
/// Into so many steps a tick is cut at most so that nothing is passed unseen, and so many looks are taken in a step.
const MOST_CUTS: f64 = 8.0;
const MOST_LOOKS: f64 = 64.0;

/// A row on nodes of S.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// The corners of its triangle, points of the surface, and its weights.
    corners: [(usize, f64); 3],
    /// The nodes of S that carry it, and their weights; what is held has its weights in the field.
    pub(super) carriers: Carriers,
    pub(super) is_held: bool,
    pub(super) law: RowLaw,
    /// Along which the tool pushes.
    pub(super) push: DVec3,
    pub(super) gap_m: f64,
    pub(super) gap: DVec3,
    pub(super) overdue: DVec3,
    pub(super) impulse_ns: DVec3,
    /// Whether it takes part in the problem.
    pub(super) is_met: bool,
}

impl Default for Point {
    /// One that pushes nothing, only to fill a place.
    fn default() -> Self {
        Self {
            corners: [(0, 0.0); 3],
            carriers: Carriers::default(),
            is_held: false,
            law: RowLaw::TwoSided,
            push: DVec3::ZERO,
            gap_m: 0.0,
            gap: DVec3::ZERO,
            overdue: DVec3::ZERO,
            impulse_ns: DVec3::ZERO,
            is_met: false,
        }
    }
}

impl Point {
    /// That of what the tool holds.
    pub(super) fn held(field: &NearField, tool: &ToolMove, h: f64, z: &[f64]) -> Self {
        let weights = field.weight.iter().take(field.nodes);
        let moved: DVec3 = weights.enumerate().map(|(i, w)| *w * get(z, i)).sum();
        let moved_so_far = moved - (tool.from_m - field.proxy_m);
        let overdue = moved_so_far.clamp_length_max(h * CLOSING_M_PER_S);
        Self {
            corners: [(0, 0.0); 3],
            carriers: Carriers::default(),
            is_held: true,
            law: RowLaw::TwoSided,
            push: DVec3::ZERO,
            gap_m: 0.0,
            gap: overdue - (tool.to_m - tool.from_m),
            overdue,
            impulse_ns: DVec3::ZERO,
            is_met: false,
        }
    }

    /// Its nodes and weights.
    pub(super) fn weights<'a>(&'a self, field: &'a NearField) -> impl Iterator<Item = (usize, f64)> + 'a {
        let held = field.weight.iter().take(field.nodes).copied().enumerate();
        let touched = self.carriers.iter();
        let held = if self.is_held { Some(held) } else { None };
        let touched = if self.is_held { None } else { Some(touched) };
        held.into_iter().flatten().chain(touched.into_iter().flatten()).filter(|(_, w)| *w != 0.0)
    }

    pub(super) fn velocity(&self, field: &NearField, z_dot: &[f64]) -> DVec3 {
        self.weights(field).map(|(node, w)| w * get(z_dot, node)).sum()
    }

    /// On how many corners of its triangle it lies.
    fn corner_count(&self) -> usize {
        self.corners.iter().filter(|(_, w)| *w > 0.0).count()
    }

    /// Whether it lies on the same corner, edge or face.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let on = |point: usize| other.corners.iter().any(|&(p, w)| p == point && w > 0.0);
        self.is_held == other.is_held
            && self.corner_count() == other.corner_count()
            && self.corners.iter().all(|&(p, w)| w <= 0.0 || on(p))
    }
}

/// Most nodes that carry a point of a triangle.
const MOST_CARRIERS: usize = 3 * POINT_NODES;

/// The nodes that carry a point, each once, and their weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Carriers {
    nodes: [(usize, f64); MOST_CARRIERS],
    count: usize,
}

impl Default for Carriers {
    fn default() -> Self {
        Self { nodes: [(0, 0.0); MOST_CARRIERS], count: 0 }
    }
}

impl Carriers {
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.nodes.iter().take(self.count).copied()
    }

    /// Adds those of a corner with weight `share`.
    fn add(&mut self, corner: &NearPoint, share: f64) {
        for (node, w) in corner.carriers() {
            let known = self.nodes.iter_mut().take(self.count).find(|(known, _)| *known == node);
            if let Some((_, weight)) = known {
                *weight += share * w;
            } else if let Some(new) = self.nodes.get_mut(self.count) {
                *new = (node, share * w);
                self.count += 1;
            }
        }
    }
}

impl Meeting {
    /// Substeps of a tick in which the device moves between two places: more, where that costs little, where it would pass
    /// something.
    pub(crate) fn substeps(field: &NearField, from: DVec3, to: DVec3, substeps: u32) -> u32 {
        substeps * looks(field, from.distance(to) / f64::from(substeps)).min(MOST_CUTS) as u32
    }

    /// The places where the tool may run into the triangles of S in this step, each once.
    pub(super) fn look(&mut self, field: &NearField, tool: &ToolMove, h: f64, z: &[f64], z_dot: &[f64]) {
        let Support::Touched { shape, friction } = field.support else { return };
        let moved = tool.to_m - tool.from_m;
        let fastest = (0..field.nodes).map(|i| get(z_dot, i).length()).fold(0.0, f64::max);
        let far = 2.0 * (moved.length() + h * fastest) + tool.short_m().length();
        let place = |point: usize| -> DVec3 {
            let at = |i: usize| field.node_m.get(i).copied().unwrap_or_default() + get(z, i);
            let carriers = field.point.get(point).into_iter().flat_map(NearPoint::carriers);
            carriers.map(|(i, w)| w * at(i)).sum()
        };
        let is_free = |i: usize| field.node_per_kg.get(i).is_some_and(|per_kg| *per_kg > 0.0);
        let free_share = |point: usize| -> f64 {
            let carriers = field.point.get(point).into_iter().flat_map(NearPoint::carriers);
            carriers.filter(|(i, _)| is_free(*i)).map(|(_, w)| w).sum()
        };
        let looks = looks(field, moved.length());
        for triangle in field.triangle.iter().take(field.triangles) {
            let [i, j, k] = triangle.points;
            let corners = triangle.points.map(place);
            // On its way, in order: what is met there has been passed at the end.
            for look in 1..=looks as u32 {
                let rest = moved * (1.0 - f64::from(look) / looks);
                let mut is_passed = false;
                shape.features(tool.to_m - rest, corners, triangle.longest_m, |feature| {
                    is_passed |= feature.gap_m <= 0.0;
                    if f64::from(look) < looks && feature.gap_m > 0.0 {
                        return;
                    }
                    // How far it would be from the tool at the end.
                    let gap_m = feature.gap_m - rest.dot(feature.normal);
                    if gap_m > far {
                        return;
                    }
                    let Ok(law) = Coulomb::new(feature.normal, friction) else { return };
                    let feature = Feature { gap_m, ..feature };
                    let gap = feature.gap(moved, h);
                    let [a, b, c] = feature.weights;
                    let on = [(i, a), (j, b), (k, c)];
                    let mut carriers = Carriers::default();
                    for (corner, w) in on.into_iter().filter(|(_, w)| *w != 0.0) {
                        if let Some(corner) = field.point.get(corner) {
                            carriers.add(corner, w);
                        }
                    }
                    let point = Point {
                        corners: on,
                        carriers,
                        is_held: false,
                        law: RowLaw::OneSided(law),
                        push: feature.normal,
                        gap_m: gap.normal_m,
                        gap: gap.gap_m,
                        overdue: gap.overdue_m,
                        impulse_ns: DVec3::ZERO,
                        is_met: false,
                    };
                    let is_touched = self.is_first && triangle.is_touched
                        || self.last.iter().any(|known| known.is_same(&point));
                    if !feature.is_out_of_reach(triangle.points.map(free_share), is_touched) {
                        self.add(point);
                    }
                });
                if is_passed {
                    break;
                }
            }
        }
    }

    /// Adds a point, unless it is known: an edge or a corner belongs to several triangles, while a punch touches a face at
    /// several places. Where there is no room, in place of the one that is farthest.
    fn add(&mut self, point: Point) {
        if point.corner_count() < 3 && self.points.iter().any(|known| known.is_same(&point)) {
            return;
        }
        if self.points.len() < MOST_POINTS {
            self.points.push(point);
            return;
        }
        self.unsolved = true;
        let farthest = self.points.iter_mut().max_by(|a, b| a.gap_m.total_cmp(&b.gap_m));
        if let Some(farthest) = farthest.filter(|farthest| farthest.gap_m > point.gap_m) {
            *farthest = point;
        }
    }
}

/// Looks at the surface on a way of that length, so that nothing is passed unseen.
fn looks(field: &NearField, way_m: f64) -> f64 {
    let Support::Touched { shape, .. } = field.support else { return 1.0 };
    (way_m / (SHARE_OF_RADIUS * shape.radius_m()) - 1e-9).ceil().clamp(1.0, MOST_LOOKS)
}
