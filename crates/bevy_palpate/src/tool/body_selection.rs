//! Selects the bodies that a tool can touch.

use super::components::{ContactEnd, HapticTool};
use super::local_models::horizon_s;
use super::second_contact::SecondContact;
use super::tool_loop::ToolLoop;
use crate::body::{DeformableBody, SimulatedBody, SurfaceTrees};
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::layers::TouchLayers;
use crate::model_time::{ModelPeriod, ModelStepCount};
use bevy::prelude::*;
use glam::DVec3;
use palpate_local::MAX_BODIES;
use palpate_reduce::BuilderOptions;

/// Simulated bodies with their layers.
type Bodies<'w, 's> = Query<'w, 's, (Entity, &'static SimulatedBody, Option<&'static TouchLayers>)>;

/// Selects for every tool with samples the body of [`HapticTool::body`], or the nearest one, of those that share a layer with the tool, and
/// a second body if the tool reaches one before the next local models.
pub(super) fn select_bodies(
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop, Option<&TouchLayers>)>,
    bodies: Bodies<'_, '_>,
    described_bodies: Query<(), With<DeformableBody>>,
    mut trees: Local<SurfaceTrees>,
    (steps, period): (Res<ModelStepCount>, ModelPeriod),
    mut ends: MessageWriter<ContactEnd>,
    mut faults: FaultWriter,
) {
    trees.retain(|body| bodies.contains(body));
    for (entity, described, mut tool, layers) in &mut tools {
        let is_touchable = |body: Entity| {
            bodies.get(body).is_ok_and(|(.., of_body)| TouchLayers::are_shared(layers, of_body))
        };
        let Some(at) = tool.path.last().map(|point| point.position_m) else { continue };
        // The second body takes the place of the first one when only that one is touched, or when the first one is gone.
        if let Some(second) = tool.second.as_ref().filter(|second| is_touchable(second.body)) {
            let is_gone = !tool.body.is_some_and(is_touchable);
            if is_gone || second.is_touched() && !tool.is_in_contact_with_first() {
                tool.exchange_bodies();
            }
        }
        let is_out = |second: &SecondContact| described.body.is_some() || !is_touchable(second.body);
        if tool.second.as_ref().is_some_and(is_out) {
            tool.drop_second(entity).map(|message| ends.write(message));
        }
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
        if selected != tool.body && selected.is_some() && selected == tool.second().map(|(body, _)| body) {
            tool.exchange_bodies();
        }
        if selected != tool.body {
            ends.write_batch(tool.reset_contacts(entity));
            (tool.body, tool.second) = (selected, None);
        }
        let Some(first) = selected.filter(|_| described.body.is_none() && bodies.iter().len() > 1) else {
            continue;
        };
        if tool.contact.held_point().is_some() {
            tool.drop_second(entity).map(|message| ends.write(message));
            continue;
        }
        let reach = Reach::of(&tool, described, period.s());
        let mut others: Vec<(bool, f64, Entity)> = Vec::new();
        for (body, simulated, _) in bodies.iter().filter(|(body, ..)| *body != first && is_touchable(*body)) {
            let known = tool.second.as_ref().filter(|second| second.body == body);
            let within_m = reach.within_m + if known.is_some() { SWITCH_DISTANCE_M } else { 0.0 };
            if let Some(distance_m) = distance_m(&mut trees, (body, simulated, steps.0), reach.at_m, within_m)
            {
                let kept_m = if known.is_some() { SWITCH_DISTANCE_M } else { 0.0 };
                let is_touched = known.is_some_and(SecondContact::is_touched);
                others.push((!is_touched, distance_m - kept_m, body));
            }
        }
        others.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        let second = others.first().map(|(.., body)| *body);
        if second != tool.second().map(|(body, _)| body) {
            tool.drop_second(entity).map(|message| ends.write(message));
            tool.second = second.map(|body| SecondContact::new(body, &tool.untouched));
        }
        let reached = 1 + others.iter().filter(|(_, distance_m, _)| *distance_m <= reach.touch_m).count();
        let is_left_out = reached > MAX_BODIES;
        if is_left_out && !tool.reported_left_out {
            faults.write(entity, HapticFaultKind::BodiesLeftOut { reached, max: MAX_BODIES });
        }
        tool.reported_left_out = is_left_out;
    }
}

/// Minimum difference of the distances at which a tool changes to a nearer body, m.
const SWITCH_DISTANCE_M: f64 = 0.005;

/// How far a tool reaches.
struct Reach {
    /// Centre of the tool, m.
    at_m: DVec3,
    /// Distance of a surface that it may touch before the next local models, m.
    within_m: f64,
    /// Distance of a surface that it touches, m.
    touch_m: f64,
}

impl Reach {
    fn of(tool: &ToolLoop, described: &HapticTool, period_s: f64) -> Self {
        let last = tool.path.last().copied().unwrap_or_default();
        let proxy_m = tool.contact.proxy_m(last.position_m);
        let speed_m_per_s = last.velocity_m_per_s.length() + BuilderOptions::REACH_SPEED_M_PER_S;
        let moved_m = horizon_s(period_s) * speed_m_per_s;
        let radius_m = described.shape.radius_m();
        let within_m = radius_m + moved_m + proxy_m.distance(last.position_m);
        Self { at_m: described.shape.core_m(proxy_m), within_m, touch_m: radius_m }
    }
}

/// Distance of `at_m` from the surface of a body after model step `step`, m, 0 inside; `None` if it is above `within_m`.
fn distance_m(
    trees: &mut SurfaceTrees,
    (entity, simulated, step): (Entity, &SimulatedBody, u64),
    at_m: DVec3,
    within_m: f64,
) -> Option<f64> {
    let body = simulated.body();
    let points = body.surface().points.iter().map(|point| point.of(body.positions_m()));
    let (low, high) = points.map(|x| (x, x)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
    if !((low - within_m).cmple(at_m).all() && (high + within_m).cmpge(at_m).all()) {
        return None;
    }
    let closest = trees.of(entity, simulated, step).closest(at_m, within_m)?;
    Some(closest.distance_m.max(0.0))
}

/// Returns the body that shares one of `layers` and has the surface point nearest to `at`, or the `last` one if it is hardly farther. Of
/// equally near bodies it is always the one with the lowest entity.
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
