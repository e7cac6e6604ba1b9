//! The support set S: the nodes that carry every point which the tool can reach before the next hand-over.

use glam::DVec3;
use palpate_body::{Body, SurfaceTree, ToolContact, ToolPoint};
use palpate_local::{NearFieldCapacity, Support};

/// S with what the tool does to it.
pub(super) struct SupportSet {
    pub(super) support: Support,
    pub(super) nodes: Vec<usize>,
    /// w of a held point; zero otherwise.
    pub(super) weights: Vec<f64>,
    /// Points of the surface that nodes of S carry.
    pub(super) points: Vec<usize>,
    /// Triangles between those, by the surface's points, and their longest edge at rest, m.
    pub(super) triangles: Vec<([usize; 3], f64)>,
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
        let points = &body.surface().points;
        let place = |point: usize| points[point].of(body.positions_m());
        let is_free =
            |point: usize| points[point].nodes().iter().any(|(node, _)| !body.network().is_fixed(*node));
        let at = contact.proxy_m(tool.position_m);
        let reach = horizon_s * (tool.velocity_m_per_s.length() + START_M_PER_S);
        // What it comes to first, if it goes on like that, matters most; what it cannot see yet, least.
        let way = horizon_s * tool.velocity_m_per_s;
        let around = shape.radius_m() + reach;
        let mut near: Vec<((bool, f64), [usize; 3], f64)> = tree
            .within(at - around, at + around)
            .into_iter()
            .filter(|(corners, _)| corners.iter().any(|&point| is_free(point)))
            .map(|(corners, longest)| (lateness(at, way, corners.map(place)), corners, longest))
            .collect();
        near.sort_by(|a, b| a.0.0.cmp(&b.0.0).then(a.0.1.total_cmp(&b.0.1)));
        let (mut nodes, mut triangles, mut is_cut) = (Vec::new(), Vec::new(), false);
        let mut carried: Vec<usize> = Vec::new();
        for (_, corners, longest) in near {
            let new: Vec<usize> = corners.into_iter().filter(|point| !carried.contains(point)).collect();
            let mut more: Vec<usize> = Vec::new();
            for &(node, _) in new.iter().flat_map(|&point| points[point].nodes()) {
                if !(nodes.contains(&node) || more.contains(&node)) {
                    more.push(node);
                }
            }
            let fits = nodes.len() + more.len() <= most
                && carried.len() + new.len() <= room.points
                && triangles.len() < room.triangles;
            if fits {
                nodes.extend(more);
                carried.extend(new);
                triangles.push((corners, longest));
            } else {
                is_cut = true;
            }
        }
        let weights = vec![0.0; nodes.len()];
        let support = Support::Touched { shape, friction };
        (!nodes.is_empty()).then_some(Self { support, nodes, weights, points: carried, triangles, is_cut })
    }

    /// A node that the tool drives.
    pub(super) fn driven(node: usize) -> Self {
        Self::held(Support::Driven, vec![node], vec![1.0])
    }

    fn held(support: Support, nodes: Vec<usize>, weights: Vec<f64>) -> Self {
        Self { support, nodes, weights, points: Vec::new(), triangles: Vec::new(), is_cut: false }
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
