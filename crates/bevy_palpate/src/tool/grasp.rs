//! Grasps of tools.

use super::components::{
    ContactEnd, ContactStart, GraspEnd, GraspStart, GraspedPoint, HapticTool, ToolCoupling, ToolGrasp,
};
use super::tool_loop::ToolLoop;
use crate::body::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind};
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{Body, BodyError, ClosestPoint, SurfaceTree, ToolContact};

/// Closes and opens grasps according to the buttons.
pub(super) fn grasp(
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop, Option<&ToolGrasp>, Option<&mut GraspedPoint>)>,
    bodies: Query<&SimulatedBody>,
    mut starts: MessageWriter<ContactStart>,
    mut ends: MessageWriter<ContactEnd>,
    (mut grasp_starts, mut grasp_ends): (MessageWriter<GraspStart>, MessageWriter<GraspEnd>),
    mut faults: FaultWriter,
) {
    for (entity, described, mut tool, grasp, grasped) in &mut tools {
        let tool = &mut *tool;
        let pressed = grasp
            .is_some_and(|grasp| tool.buttons().checked_shr(grasp.button).is_some_and(|rest| rest & 1 == 1));
        let was_pressed = std::mem::replace(&mut tool.was_pressed, pressed);
        let closes = pressed && !was_pressed;
        if !pressed && tool.contact.held_point().is_some() {
            ends.write_batch(tool.release(entity));
        }
        if let (true, Some(at)) = (closes, tool.path.last().map(|point| point.position_m)) {
            // The nearer of two bodies.
            let distance_m = |body: Entity| {
                let body = bodies.get(body).ok()?.body();
                Some(SurfaceTree::new(body).closest(at, f64::INFINITY)?.distance_m.abs())
            };
            let second = tool.second.as_ref().and_then(|second| distance_m(second.body));
            if let (Some(first), Some(second)) = (tool.body.and_then(distance_m), second)
                && second < first
            {
                tool.exchange_bodies();
            }
        }
        let body = tool.body.and_then(|body| Some((body, bodies.get(body).ok()?.body())));
        let place = tool.path.last().map(|point| point.position_m);
        if let (true, Some(grasp), Some((on, body)), Some(at)) = (closes, grasp, body, place) {
            match hold(body, described.coupling, at, grasp.reach_m) {
                Ok(Some((contact, closest))) => {
                    // A tool that holds touches nothing else.
                    tool.drop_second(entity).map(|message| ends.write(message));
                    if !tool.is_in_contact() {
                        let (point_m, normal) = (closest.point_m, closest.normal);
                        starts.write(ContactStart { tool: entity, body: on, point_m, normal });
                    }
                    (tool.contact, tool.has_support) = (contact.with_identity(entity.to_bits()), false);
                }
                Ok(None) => {}
                Err(error) => {
                    let kind = HapticFaultKind::Grasp(error);
                    faults.write(entity, kind);
                }
            }
        }
        let Some(mut grasped) = grasped else { continue };
        let held = tool.contact.held_point().zip(body);
        let now = held.map_or_else(GraspedPoint::default, |(point, (on, body))| GraspedPoint {
            body: Some(on),
            point_m: point.of(body.positions_m()),
        });
        if grasped.body != now.body || closes && now.body.is_some() {
            if let Some(body) = grasped.body {
                grasp_ends.write(GraspEnd { tool: entity, body });
            }
            if let Some(body) = now.body {
                grasp_starts.write(GraspStart { tool: entity, body, point_m: now.point_m });
            }
        }
        grasped.set_if_neq(now);
    }
}

/// Returns a contact that holds the point of `body` nearest to `at_m`; `None` if the surface is farther than `reach_m`.
fn hold(
    body: &Body,
    coupling: ToolCoupling,
    at_m: DVec3,
    reach_m: f64,
) -> Result<Option<(ToolContact, ClosestPoint)>, BodyError> {
    let Some(closest) = SurfaceTree::new(body).closest(at_m, reach_m) else { return Ok(None) };
    let contact = ToolContact::hold_point(body, closest.body_point(body.surface()), at_m)?;
    Ok(Some((coupling.apply_to(contact)?, closest)))
}

impl ToolLoop {
    /// The buttons at the newest sample along which the body has been stepped.
    fn buttons(&mut self) -> u32 {
        let consumed = self.consumed;
        let samples = self.handle.samples();
        consumed.and_then(|sequence| samples.get(sequence)).map_or(0, |sample| sample.buttons)
    }
}
