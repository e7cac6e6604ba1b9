//! Overlap of a tool with a body, independent of contact.

use crate::body::{SimulatedBody, SurfaceTrees};
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{Body, ToolContact};
use palpate_haptics::{DeviceDescription, DeviceFrame};

/// Overlap of a tool with the surface of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Overlap {
    /// Nearest point of the surface, m.
    pub(super) point_m: DVec3,
    /// Radius of the tool minus the distance of its centre from the surface, m.
    pub(super) depth_m: f64,
    /// Radius of the tool, m.
    pub(super) radius_m: f64,
    /// Weight of the nearest point on free nodes, 0 to 1.
    pub(super) free_share: f64,
}

/// The overlap of `contact` with the body `entity` in its shape after model step `step`, with the device at `device_m`; `None` if they are
/// apart or the contact holds a point.
pub(super) fn overlap(
    trees: &mut SurfaceTrees,
    (entity, simulated, step): (Entity, &SimulatedBody, u64),
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
    let closest = trees.of(entity, simulated, step).closest(core_m, f64::INFINITY)?;
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

/// Distance from the workspace of the device `description`, mapped by `frame`, to `body`, minus `radius_m`, m; `None` if the tool can reach
/// the body. Compares boxes in the device frame, which underestimates the distance.
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

/// Whether the device is inside the workspace of its description.
pub(super) fn is_in_workspace(description: &DeviceDescription, frame: &DeviceFrame, at_m: DVec3) -> bool {
    let at = frame.position_to_device_m(at_m);
    let [from, to] = description.workspace_m;
    let margin = ROUNDING * (1.0 + at.abs().max_element());
    (from - margin).cmple(at).all() && (to + margin).cmpge(at).all()
}

/// Tolerance of the workspace, relative to the distance from the origin, and in metres.
const ROUNDING: f64 = 1e-9;

/// Corners of the bounding box of all points of the surface of `body`, mapped by `map`.
fn bounds(body: &Body, map: impl Fn(DVec3) -> DVec3) -> Option<(DVec3, DVec3)> {
    let points = body.surface().points.iter().map(|point| map(point.of(body.positions_m())));
    points.map(|at| (at, at)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}
