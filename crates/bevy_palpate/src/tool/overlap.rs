//! Where a tool is relative to a body, whether they are in contact or not.

use crate::body::SimulatedBody;
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{Body, SurfaceTree, ToolContact};
use palpate_haptics::{DeviceDescription, DeviceFrame};

/// The surfaces of bodies, as trees that are kept from one model step to the next.
#[derive(Default)]
pub(super) struct Surfaces {
    /// Shape of the body ([`SimulatedBody::shape`]) and its tree.
    trees: EntityHashMap<(u64, SurfaceTree)>,
}

/// A tool in the surface of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Overlap {
    /// The nearest point of the surface, m.
    pub(super) point_m: DVec3,
    /// How far the tool is beyond that surface, m: its radius when its centre is on it.
    pub(super) depth_m: f64,
    /// Radius of the tool, m.
    pub(super) radius_m: f64,
    /// Share of the nearest point that nodes carry which can move, 0 to 1.
    pub(super) free_share: f64,
}

impl Surfaces {
    /// Forgets bodies for which `is_there` is false.
    pub(super) fn retain(&mut self, is_there: impl Fn(Entity) -> bool) {
        self.trees.retain(|entity, _| is_there(*entity));
    }

    /// The overlap of `contact` with the body `entity`, its device at `device_m`; `None` where they are apart or it holds a point.
    pub(super) fn overlap(
        &mut self,
        (entity, simulated): (Entity, &SimulatedBody),
        contact: &ToolContact,
        device_m: DVec3,
    ) -> Option<Overlap> {
        let (shape, _) = contact.shape()?;
        let (core_m, radius_m) = (shape.core_m(contact.proxy_m(device_m)), shape.radius_m());
        let body = simulated.body();
        let (low, high) = bounds(body, |at_m| at_m)?;
        if !((low - radius_m).cmple(core_m).all() && (high + radius_m).cmpge(core_m).all()) {
            return None;
        }
        let known = self.trees.remove(&entity).filter(|(shape, _)| *shape == simulated.shape);
        let tree = match known {
            Some((_, mut tree)) => {
                tree.refit(body);
                tree
            }
            None => SurfaceTree::new(body),
        };
        let (_, tree) = self.trees.entry(entity).insert((simulated.shape, tree)).into_mut();
        let closest = tree.closest(core_m, f64::INFINITY)?;
        let point = closest.body_point(body.surface());
        let is_free = |(node, _): &&(usize, f64)| !body.network().is_fixed(*node);
        let overlap = Overlap {
            point_m: closest.point_m,
            depth_m: radius_m - closest.distance_m,
            radius_m,
            free_share: point.nodes().iter().filter(is_free).map(|(_, weight)| weight).sum(),
        };
        Some(overlap).filter(|overlap| overlap.depth_m > 0.0)
    }
}

/// Distance from the workspace of the device `description`, mapped by `frame`, to `body`, less `radius_m`, m; `None` if the
/// tool can reach it. Compares boxes in the device's frame, so that it is an underestimate.
pub(super) fn beyond_workspace_m(
    description: &DeviceDescription,
    frame: &DeviceFrame,
    body: &Body,
    radius_m: f64,
) -> Option<f64> {
    let (low, high) = bounds(body, |at_m| frame.position_to_device_m(at_m))?;
    let [from, to] = description.workspace_m;
    let apart = (low - to).max(from - high).max(DVec3::ZERO);
    Some(apart.length() * frame.scale - radius_m).filter(|distance_m| *distance_m > 0.0)
}

/// Whether the device is where its description says that it can be.
pub(super) fn is_in_workspace(description: &DeviceDescription, frame: &DeviceFrame, at_m: DVec3) -> bool {
    let at = frame.position_to_device_m(at_m);
    let [from, to] = description.workspace_m;
    let margin = ROUNDING * (1.0 + at.abs().max_element());
    (from - margin).cmple(at).all() && (to + margin).cmpge(at).all()
}

/// A place may be beyond the workspace by so much of its distance from the origin, and that many metres.
const ROUNDING: f64 = 1e-9;

/// Corners of the box round `map` of all points of the surface of `body`.
fn bounds(body: &Body, map: impl Fn(DVec3) -> DVec3) -> Option<(DVec3, DVec3)> {
    let points = body.surface().points.iter().map(|point| map(point.of(body.positions_m())));
    points.map(|at| (at, at)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}
