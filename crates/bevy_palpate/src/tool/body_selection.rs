//! Selects the body that a tool can touch.

use super::components::{ContactEnd, HapticTool};
use super::tool_loop::ToolLoop;
use crate::body::{DeformableBody, SimulatedBody};
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::layers::TouchLayers;
use bevy::prelude::*;
use glam::DVec3;

/// Simulated bodies with their layers.
type Bodies<'w, 's> = Query<'w, 's, (Entity, &'static SimulatedBody, Option<&'static TouchLayers>)>;

/// Selects for every tool with samples the body of [`HapticTool::body`], or the nearest one, of those that share a layer with the tool.
pub(super) fn select_bodies(
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop, Option<&TouchLayers>)>,
    bodies: Bodies<'_, '_>,
    described_bodies: Query<(), With<DeformableBody>>,
    mut ends: MessageWriter<ContactEnd>,
    mut faults: FaultWriter,
) {
    for (entity, described, mut tool, layers) in &mut tools {
        let is_touchable = |body: Entity| {
            bodies.get(body).is_ok_and(|(.., of_body)| TouchLayers::are_shared(layers, of_body))
        };
        let Some(at) = tool.path.last().map(|point| point.position_m) else { continue };
        let candidate = match (described.body, tool.body) {
            (Some(body), _) => Some(body),
            // A contact keeps its body.
            (None, Some(body)) if is_touchable(body) && tool.is_in_contact() => Some(body),
            (None, last) => nearest(&bodies, layers, at, last),
        };
        let selected = candidate.filter(|body| is_touchable(*body));
        // A body that is not built yet is no fault.
        let rejected = candidate.filter(|body| !bodies.contains(*body) && !described_bodies.contains(*body));
        match rejected {
            None => tool.rejected_body = None,
            Some(body) => {
                if tool.rejected_body.replace(body) != Some(body) {
                    faults.write(entity, HapticFaultKind::NotABody { body });
                }
            }
        }
        if selected != tool.body {
            tool.reset_contact(entity).map(|message| ends.write(message));
            tool.body = selected;
        }
    }
}

/// Minimum difference of the distances at which a tool changes to a nearer body, m.
const SWITCH_DISTANCE_M: f64 = 0.005;

/// Returns the body that shares one of `layers` and has the surface point nearest to `at`, or the `last` one if it is hardly farther. Of equally near bodies it is always
/// the one with the lowest entity.
fn nearest(
    bodies: &Bodies<'_, '_>,
    layers: Option<&TouchLayers>,
    at: DVec3,
    last: Option<Entity>,
) -> Option<Entity> {
    let touchable = || bodies.iter().filter(move |(.., of_body)| TouchLayers::are_shared(layers, *of_body));
    let mut all = touchable();
    if let (Some((only, ..)), None) = (all.next(), all.next()) {
        return Some(only);
    }
    let distance = |simulated: &SimulatedBody| {
        let body = simulated.body();
        let points = body.surface().points.iter();
        points.map(|point| point.of(body.positions_m()).distance(at)).fold(f64::INFINITY, f64::min)
    };
    let penalty = |entity: Entity| if last == Some(entity) { 0.0 } else { SWITCH_DISTANCE_M };
    touchable()
        .map(|(entity, simulated, _)| (distance(simulated) + penalty(entity), entity))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
        .map(|(_, entity)| entity)
}
