//! Selects the body that a tool can touch.

use super::components::{ContactEnd, HapticTool};
use super::tool_loop::ToolLoop;
use crate::body::{DeformableBody, SimulatedBody};
use crate::fault::{HapticFault, HapticFaultKind};
use bevy::prelude::*;
use glam::DVec3;

/// Gives every tool that has samples the body it asks for, or the nearest.
pub(super) fn select_bodies(
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop)>,
    bodies: Query<(Entity, &SimulatedBody)>,
    to_come: Query<(), With<DeformableBody>>,
    mut ended: MessageWriter<ContactEnd>,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, asked, mut tool) in &mut tools {
        let Some(at) = tool.path.last().map(|point| point.position_m) else { continue };
        let wanted = match (asked.body, tool.body) {
            (Some(body), _) => Some(body),
            // What it touches or holds it keeps.
            (None, Some(body)) if bodies.contains(body) && tool.is_in_contact() => Some(body),
            (None, last) => nearest(&bodies, at, last),
        };
        let chosen = wanted.filter(|body| bodies.contains(*body));
        // A body that is still to be built is waited for.
        let refused = wanted.filter(|body| !bodies.contains(*body) && !to_come.contains(*body));
        match refused {
            None => tool.refused_body = None,
            Some(body) => {
                if tool.refused_body.replace(body) != Some(body) {
                    faults.write(HapticFault {
                        entity: Some(entity),
                        kind: HapticFaultKind::NotABody { body },
                    });
                }
            }
        }
        if chosen != tool.body {
            tool.reset_contact(entity).map(|message| ended.write(message));
            tool.body = chosen;
        }
    }
}

/// A tool goes over to another body that is nearer than the one it had by so much, m.
const NEARER_M: f64 = 0.005;

/// The body with the surface point nearest to `at`, or the `last` one, if that is hardly farther; of several equally near, always
/// the same one.
fn nearest(bodies: &Query<(Entity, &SimulatedBody)>, at: DVec3, last: Option<Entity>) -> Option<Entity> {
    let mut all = bodies.iter();
    if let (Some((only, _)), None) = (all.next(), all.next()) {
        return Some(only);
    }
    let distance = |simulated: &SimulatedBody| {
        let body = simulated.body();
        let points = body.surface().points.iter();
        points.map(|point| point.of(body.positions_m()).distance(at)).fold(f64::INFINITY, f64::min)
    };
    let farther = |entity: Entity| if last == Some(entity) { 0.0 } else { NEARER_M };
    bodies
        .iter()
        .map(|(entity, simulated)| (distance(simulated) + farther(entity), entity))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
        .map(|(_, entity)| entity)
}
