//! The support set S: the nodes of the surface that the tool can reach within the horizon of a local model.

use crate::options::BuilderOptions;
use glam::DVec3;
use palpate_body::{Body, SurfaceTree, ToolContact, ToolPoint};
use palpate_laws::ToolShape;
use palpate_local::{NearFieldCapacity, Support};
use std::cmp::Ordering;
use std::collections::BTreeSet;

/// Maximum sizes of a support set.
pub(super) struct SupportLimits {
    /// Maximum number of nodes.
    nodes: usize,
    /// Maximum number of nodes that carry triangles which the tool touches, or will first touch.
    touched_nodes: usize,
    /// Maximum number of triangles.
    triangles: usize,
}

impl SupportLimits {
    /// The limits of `options`, raised where the tool touches more nodes: it slides onto others. `capacity` bounds them.
    pub(super) fn new(contact: &ToolContact, options: &BuilderOptions, capacity: NearFieldCapacity) -> Self {
        let touched: BTreeSet<usize> =
            contact.touched().iter().flat_map(|t| t.nodes.iter().map(|n| n.0)).collect();
        let beside = (touched.len() / 3).min(MAX_NODES_BESIDE);
        let nodes = options.support_nodes.max(touched.len() + beside).min(capacity.nodes);
        Self { nodes, touched_nodes: capacity.nodes, triangles: capacity.triangles }
    }
}

/// Maximum number of nodes beside the touched ones where these are more than usual.
const MAX_NODES_BESIDE: usize = 4;

/// A support set S, and how the tool acts on it.
pub(super) struct SupportSet {
    pub(super) support: Support,
    pub(super) nodes: Vec<usize>,
    /// Weights of a held point over S; zero for a touching tool.
    pub(super) weights: Vec<f64>,
    /// Triangles of the contact surface that nodes of S alone carry.
    pub(super) triangles: Vec<usize>,
    /// Whether triangles that a tool of constant velocity touches within the horizon were left out because of the limits.
    pub(super) is_truncated: bool,
}

impl SupportSet {
    /// The support set of `body` under `contact` with the tool at `tool`, for the horizon `horizon_s`. `None` where the tool reaches
    /// nothing.
    pub(super) fn of(
        body: &Body,
        contact: &ToolContact,
        tree: Option<&SurfaceTree>,
        tool: ToolPoint,
        horizon_s: f64,
        limits: &SupportLimits,
    ) -> Option<Self> {
        if let Some(node) = contact.driven_node() {
            return Some(Self::driven(node));
        }
        if let Some(point) = contact.held_point() {
            let (nodes, weights) = point.nodes().iter().copied().unzip();
            return Some(Self::with_weights(Support::Held, nodes, weights));
        }
        let ((shape, friction), tree) = contact.shape().zip(tree)?;
        if !contact.is_clear() {
            return None;
        }
        let surface = body.contact_surface();
        let points = surface.points();
        let position = |point: usize| points[point].of(body.positions_m());
        let is_free =
            |point: usize| points[point].nodes().iter().any(|(node, _)| !body.network().is_fixed(*node));
        let at = contact.proxy_m(tool.position_m);
        let reach = horizon_s * (tool.velocity_m_per_s.length() + BuilderOptions::REACH_SPEED_M_PER_S);
        // Triangles are sorted by the order in which a tool of constant velocity reaches them; those that it is behind come last.
        let path = horizon_s * tool.velocity_m_per_s;
        let around = shape.radius_m() + reach;
        let touched: Vec<usize> =
            contact.touched().iter().flat_map(|t| t.nodes.iter().map(|(node, _)| *node)).collect();
        let mut near: Vec<(Expected, usize)> = surface
            .parts_of(tree.near(at - around, at + around))
            .into_iter()
            .filter(|&triangle| surface.triangles()[triangle].iter().any(|&point| is_free(point)))
            .map(|triangle| {
                let corners = surface.triangles()[triangle];
                let mut expected = Expected::on_path(at, path, corners.map(position));
                // Touched triangles come first, even where the tool is behind them.
                let mut nodes = corners.iter().flat_map(|&point| points[point].nodes());
                expected.is_touched = !touched.is_empty() && nodes.all(|(node, _)| touched.contains(node));
                (expected, triangle)
            })
            // A box has corners beyond the reach, which depend on its orientation.
            .filter(|(expected, _)| expected.is_touched || expected.start_m <= around)
            .collect();
        let resolution_m = ORDER_RESOLUTION * around;
        near.sort_by(|(a, i), (b, j)| a.order(b, resolution_m).then(i.cmp(j)));
        let (mut nodes, mut triangles, mut is_truncated) = (Vec::new(), Vec::new(), false);
        for (expected, triangle) in near {
            let corners = surface.triangles()[triangle];
            let mut new: Vec<usize> = Vec::new();
            for &(node, _) in corners.iter().flat_map(|&point| points[point].nodes()) {
                if !(nodes.contains(&node) || new.contains(&node)) {
                    new.push(node);
                }
            }
            let max_nodes =
                if expected.is_touched || touched.is_empty() && expected.is_within(shape.radius_m()) {
                    limits.touched_nodes
                } else {
                    limits.nodes
                };
            if nodes.len() + new.len() <= max_nodes && triangles.len() < limits.triangles {
                nodes.extend(new);
                triangles.push(triangle);
            } else {
                is_truncated |= expected.is_within(shape.radius_m());
            }
        }
        let weights = vec![0.0; nodes.len()];
        let support = Support::Touched { shape, friction };
        (!nodes.is_empty()).then_some(Self { support, nodes, weights, triangles, is_truncated })
    }

    /// An empty support set, for a touching tool that reaches no node.
    pub(super) fn empty(shape: ToolShape, friction: f64) -> Self {
        Self::with_weights(Support::Touched { shape, friction }, Vec::new(), Vec::new())
    }

    /// The support set of a driven node.
    fn driven(node: usize) -> Self {
        Self::with_weights(Support::Driven, vec![node], vec![1.0])
    }

    fn with_weights(support: Support, nodes: Vec<usize>, weights: Vec<f64>) -> Self {
        Self { support, nodes, weights, triangles: Vec::new(), is_truncated: false }
    }
}

/// Number of intervals into which the tool's path is divided, and weight of the distance along the path.
const PATH_INTERVALS: u32 = 8;
const PATH_WEIGHT: f64 = 0.3;
/// Resolution of the distances that are compared, relative to the reach of the tool, and offset of the limits between them.
const ORDER_RESOLUTION: f64 = 1e-6;
const OFF_LIMITS: f64 = 0.37;

/// How soon a tool of constant velocity reaches a triangle.
struct Expected {
    /// Whether the tool touches the triangle now.
    is_touched: bool,
    /// Whether the tool is behind the triangle.
    is_behind: bool,
    /// Distance of the triangle from the tool's centre, m.
    start_m: f64,
    /// Distance of the triangle from the path of the tool's centre, m.
    distance_m: f64,
    /// The same, plus a share of the distance along the path, m.
    weighted_m: f64,
}

impl Expected {
    /// Of a triangle that is not touched, for a tool at `at` with the path `path`.
    fn on_path(at: DVec3, path: DVec3, corners: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        let is_behind = (at - a).dot((b - a).cross(c - a)) < 0.0;
        let (mut distance_m, mut weighted_m, mut start_m) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
        for i in 0..=PATH_INTERVALS {
            let travelled = path * (f64::from(i) / f64::from(PATH_INTERVALS));
            let weights = palpate_laws::nearest_weights(at + travelled, corners);
            let point: DVec3 = corners.iter().zip(weights).map(|(x, w)| w * *x).sum();
            // A degenerate triangle has no nearest point; its neighbours cover it. `min` ignores NaN.
            let distance = point.distance(at + travelled);
            distance_m = distance_m.min(distance);
            if i == 0 {
                start_m = start_m.min(distance);
            }
            weighted_m = weighted_m.min(distance + PATH_WEIGHT * travelled.length());
        }
        Self { is_touched: false, is_behind, start_m, distance_m, weighted_m }
    }

    /// Touched triangles come first; those that the tool is behind come last.
    /// Distances that differ by less than `resolution_m` are equal: a rotated body has other rounding errors, and the same support set.
    fn order(&self, other: &Self, resolution_m: f64) -> Ordering {
        let rank = |x: &Self| (!x.is_touched, x.is_behind && !x.is_touched);
        // Common distances are far from the limits between two numbers.
        let number = |x: &Self| (x.weighted_m / resolution_m + OFF_LIMITS).floor();
        rank(self).cmp(&rank(other)).then(number(self).total_cmp(&number(other)))
    }

    /// Whether a tool of this radius touches the triangle.
    fn is_within(&self, radius_m: f64) -> bool {
        self.is_touched || !self.is_behind && self.distance_m < radius_m
    }
}
