//! The support set S: the nodes that carry every point which the tool can reach before the next hand-over.

use glam::DVec3;
use palpate_body::{Body, SurfaceTree, ToolContact, ToolPoint};
use palpate_laws::ToolShape;
use palpate_local::{NearFieldCapacity, Support};

/// S with what the tool does to it.
pub(super) struct SupportSet {
    pub(super) support: Support,
    pub(super) nodes: Vec<usize>,
    /// w of a held point; zero otherwise.
    pub(super) weights: Vec<f64>,
    /// Triangles of the contact surface that nodes of S carry alone.
    pub(super) triangles: Vec<usize>,
    /// Whether what is within reach did not find room.
    pub(super) is_cut: bool,
}

/// What a hand that is at rest may be up to before the next hand-over, m/s.
const START_M_PER_S: f64 = 0.2;

impl SupportSet {
    /// S of `body` with `contact` and the tool at `tool`, of at most `most` nodes and what there is `room` for; for `horizon_s`
    /// to come. `None` where the tool can reach nothing.
    pub(super) fn of(
        body: &Body,
        contact: &ToolContact,
        tree: Option<&SurfaceTree>,
        tool: ToolPoint,
        horizon_s: f64,
        (most, room): (usize, NearFieldCapacity),
    ) -> Option<Self> {
        if let Some(node) = contact.driven_node() {
            return Some(Self::driven(node));
        }
        if let Some(point) = contact.held_point() {
            let (nodes, weights) = point.nodes().iter().copied().unzip();
            return Some(Self::held(Support::Held, nodes, weights));
        }
        let ((shape, friction), tree) = contact.shape().zip(tree)?;
        if !contact.is_clear() {
            return None;
        }
        let surface = body.contact_surface();
        let points = surface.points();
        let place = |point: usize| points[point].of(body.positions_m());
        let is_free =
            |point: usize| points[point].nodes().iter().any(|(node, _)| !body.network().is_fixed(*node));
        let at = contact.proxy_m(tool.position_m);
        let reach = horizon_s * (tool.velocity_m_per_s.length() + START_M_PER_S);
        // What it comes to first, if it goes on like that, matters most; what it cannot see yet, least.
        let way = horizon_s * tool.velocity_m_per_s;
        let around = shape.radius_m() + reach;
        let touched: Vec<usize> =
            contact.touched().iter().flat_map(|t| t.nodes.iter().map(|(node, _)| *node)).collect();
        let mut near: Vec<((bool, bool, f64), usize)> = surface
            .parts_of(tree.near(at - around, at + around))
            .into_iter()
            .filter(|&triangle| surface.triangles()[triangle].iter().any(|&point| is_free(point)))
            .map(|triangle| {
                let corners = surface.triangles()[triangle];
                let (is_behind, off) = lateness(at, way, corners.map(place));
                // What is pressed on comes first, though the tool may be behind it.
                let mut nodes = corners.iter().flat_map(|&point| points[point].nodes());
                let is_touched = !touched.is_empty() && nodes.all(|(node, _)| touched.contains(node));
                ((!is_touched, is_behind && !is_touched, off), triangle)
            })
            .collect();
        near.sort_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.total_cmp(&b.2)));
        let (mut nodes, mut triangles, mut is_cut) = (Vec::new(), Vec::new(), false);
        for (_, triangle) in near {
            let corners = surface.triangles()[triangle];
            let mut more: Vec<usize> = Vec::new();
            for &(node, _) in corners.iter().flat_map(|&point| points[point].nodes()) {
                if !(nodes.contains(&node) || more.contains(&node)) {
                    more.push(node);
                }
            }
            if nodes.len() + more.len() <= most && triangles.len() < room.triangles {
                nodes.extend(more);
                triangles.push(triangle);
            } else {
                is_cut = true;
            }
        }
        let weights = vec![0.0; nodes.len()];
        let support = Support::Touched { shape, friction };
        (!nodes.is_empty()).then_some(Self { support, nodes, weights, triangles, is_cut })
    }

    /// None, for a tool that is too far away.
    pub(super) fn out_of_reach(shape: ToolShape, friction: f64) -> Self {
        Self::held(Support::Touched { shape, friction }, Vec::new(), Vec::new())
    }

    /// A node that the tool drives.
    pub(super) fn driven(node: usize) -> Self {
        Self::held(Support::Driven, vec![node], vec![1.0])
    }

    fn held(support: Support, nodes: Vec<usize>, weights: Vec<f64>) -> Self {
        Self { support, nodes, weights, triangles: Vec::new(), is_cut: false }
    }
}

/// How far along its way a place is looked at, in so many parts; a way to a place counts as a part of its distance.
const PARTS: u32 = 8;
const WAY_SHARE: f64 = 0.3;

/// How late a tool at `at`, with `way` before it, comes to a triangle: whether it is behind it now, and how far it is off its
/// way, m.
fn lateness(at: DVec3, way: DVec3, corners: [DVec3; 3]) -> (bool, f64) {
    let [a, b, c] = corners;
    let is_behind = (at - a).dot((b - a).cross(c - a)) < 0.0;
    let off = (0..=PARTS).map(|i| {
        let gone = way * (f64::from(i) / f64::from(PARTS));
        let weights = palpate_laws::nearest_weights(at + gone, corners);
        let point: DVec3 = corners.iter().zip(weights).map(|(x, w)| w * *x).sum();
        let distance = point.distance(at + gone) + WAY_SHARE * gone.length();
        // A triangle that is none is touched by its neighbours.
        if distance.is_nan() { f64::INFINITY } else { distance }
    });
    (is_behind, off.fold(f64::INFINITY, f64::min))
}
