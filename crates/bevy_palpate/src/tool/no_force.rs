//! Detects and reports a missing force, with its cause.
//!
//! A model step lacks force when the mean force that reaches the device is below 1 % of the full body's, when the tool overlaps the body
//! without a contact, or when no body is within reach. A lack of half a second is reported. Pauses of the app, failing devices and stale
//! local models are excluded: other faults report them.

use super::components::HapticTool;
use super::force_watch::ForceStep;
use super::overlap::{Overlap, beyond_workspace_m, is_in_workspace, overlap};
use super::tool_loop::ToolLoop;
use crate::body::{BodyBuild, DeformableBody, SimulatedBody, SurfaceTrees};
use crate::fault::{FaultWriter, HapticFaultKind, NoForceCause};
use crate::layers::TouchLayers;
use crate::model_time::ModelStepCount;
use bevy::prelude::*;
use glam::DVec3;
use palpate_haptics::{BlackBoxTick, SafetyAction};

/// Share of the full body's force below which a force counts as none.
const NO_FORCE_SHARE: f64 = 0.01;

/// Mean force of the full body below which no force is expected, N.
const MIN_EXPECTED_N: f64 = 1e-3;

/// Depth of an overlap that needs a contact, as a share of the tool's radius.
const DEPTH_SHARE: f64 = 0.05;

/// Share of a point's weight on free nodes below which the surface counts as fixed: a contact does not start there.
const FIXED_SHARE: f64 = 0.3;

/// All bodies, simulated or not.
type Bodies<'w, 's> = Query<
    'w,
    's,
    (Entity, Option<&'static SimulatedBody>, Option<&'static BodyBuild>, Option<&'static TouchLayers>),
    With<DeformableBody>,
>;

/// Reports every tool without force for half a second, once for each cause.
pub(super) fn report_missing_force(
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop, Option<&TouchLayers>)>,
    bodies: Bodies<'_, '_>,
    mut trees: Local<SurfaceTrees>,
    steps: Res<ModelStepCount>,
    mut faults: FaultWriter,
) {
    trees.retain(|body| bodies.contains(body));
    for (entity, described, mut tool, layers) in &mut tools {
        let ticks = tool.path.len().saturating_sub(1) as u64;
        let Some(at_m) = tool.path.last().map(|point| point.position_m).filter(|_| ticks > 0) else {
            continue;
        };
        let step = if tool.handle.settings().paused || tool.rejected_body.is_some() {
            ForceStep::Unknown
        } else {
            match tool.body.and_then(|body| Some((body, bodies.get(body).ok()?.1?))) {
                None => ForceStep::Missing(missing_body(&bodies, described.body, layers)),
                Some(body) => tool.classify((described, layers), body, &bodies, (&mut trees, steps.0), at_m),
            }
        };
        if let Some(cause) = tool.force_watch.record(step, ticks) {
            faults.write(entity, HapticFaultKind::NoForce(cause));
        }
    }
}

/// The reason why there is no simulated body for a tool in `layers` that can touch only `only`, or any body.
fn missing_body(bodies: &Bodies<'_, '_>, only: Option<Entity>, layers: Option<&TouchLayers>) -> NoForceCause {
    let (mut rejected, mut excluded) = (None, None);
    for (body, simulated, build, of_body) in
        bodies.iter().filter(|(body, ..)| only.is_none_or(|only| only == *body))
    {
        if !TouchLayers::are_shared(layers, of_body) {
            excluded.get_or_insert(body);
            continue;
        }
        match build {
            // The tool selects the body at the next model step.
            _ if simulated.is_some() => return NoForceCause::BodyNotReady { body, waited_s: 0.0 },
            Some(BodyBuild::MeshLoading | BodyBuild::Running(_) | BodyBuild::Outdated) => {
                return NoForceCause::BodyNotReady { body, waited_s: 0.0 };
            }
            Some(BodyBuild::MeshFailed | BodyBuild::TransformRejected(_)) | None => {
                rejected.get_or_insert(body);
            }
        }
    }
    let excluded = excluded.map(|body| NoForceCause::OtherLayers { body });
    rejected.map(|body| NoForceCause::BodyRejected { body }).or(excluded).unwrap_or(NoForceCause::NoBody)
}

impl ToolLoop {
    /// Classifies the last model step of this tool at the body `on`, with its device at `at_m`.
    fn classify(
        &mut self,
        (described, layers): (&HapticTool, Option<&TouchLayers>),
        on: (Entity, &SimulatedBody),
        bodies: &Bodies<'_, '_>,
        (trees, model_step): (&mut SurfaceTrees, u64),
        at_m: DVec3,
    ) -> ForceStep {
        let (body, simulated) = on;
        let (now, is_clear) = ((body, simulated.contact_key()), self.contact.is_clear());
        let watch = &mut self.force_watch;
        let was_clear = std::mem::replace(&mut watch.clear_of, Some(now).filter(|_| is_clear)) == Some(now);
        watch.entered = watch.entered.filter(|(body, shape, _)| !is_clear && (*body, *shape) == now);
        if let Some(step) = self.compare_forces(described) {
            return step;
        }
        if self.is_in_contact() {
            return ForceStep::Quiet;
        }
        if let Some(overlap) = overlap(trees, (body, simulated, model_step), &self.contact, at_m) {
            return self.classify_overlap(now, overlap, was_clear);
        }
        let Some(radius_m) = self.contact.shape().map(|(shape, _)| shape.radius_m()) else {
            return ForceStep::Quiet;
        };
        let frame = self.handle.settings().frame;
        self.force_watch.left_workspace |= !is_in_workspace(&self.description, &frame, at_m);
        if self.force_watch.left_workspace {
            return ForceStep::Quiet;
        }
        let candidates = bodies.iter().filter(|(other, .., of_body)| {
            (described.body.is_none() || *other == body) && TouchLayers::are_shared(layers, *of_body)
        });
        let mut nearest: Option<(f64, Entity)> = None;
        for (other, simulated, ..) in candidates {
            let Some(simulated) = simulated else { continue };
            let Some(apart_m) = beyond_workspace_m(&self.description, &frame, simulated.body(), radius_m)
            else {
                return ForceStep::Quiet;
            };
            if nearest.is_none_or(|(nearest_m, _)| apart_m < nearest_m) {
                nearest = Some((apart_m, other));
            }
        }
        nearest.map_or(ForceStep::Quiet, |(distance_m, body)| {
            ForceStep::Missing(NoForceCause::OutOfWorkspace { body, distance_m })
        })
    }

    /// Determines why a tool that overlaps `body`, with the contact key `shape`, has no contact.
    fn classify_overlap(
        &mut self,
        (body, shape): (Entity, (u64, u64)),
        overlap: Overlap,
        was_clear: bool,
    ) -> ForceStep {
        let is_fixed = overlap.free_share < FIXED_SHARE;
        let point_m = overlap.point_m;
        if self.contact.is_clear() {
            return match (overlap.depth_m > DEPTH_SHARE * overlap.radius_m, is_fixed) {
                (false, _) => ForceStep::Quiet,
                (true, true) => ForceStep::Missing(NoForceCause::FixedSurface { body, point_m }),
                (true, false) => ForceStep::Missing(NoForceCause::NoContact { body, point_m }),
            };
        }
        // A tool that was outside the same body in the last step has entered through a surface that did not yield.
        if was_clear && is_fixed {
            self.force_watch.entered = Some((body, shape, point_m));
        }
        ForceStep::Missing(match self.force_watch.entered {
            Some((_, _, point_m)) => NoForceCause::FixedSurface { body, point_m },
            None => NoForceCause::Inside { body },
        })
    }

    /// Compares the force that reached the device over the last model step with that of the full body; `None` if the full body computes
    /// no force.
    fn compare_forces(&mut self, described: &HapticTool) -> Option<ForceStep> {
        let newest = self.consumed?;
        let full_n = mean(self.full_forces_n.iter().map(|force_n| force_n.length()));
        if full_n < MIN_EXPECTED_N {
            return None;
        }
        let before_first = newest.saturating_sub(self.full_forces_n.len() as u64);
        let (frame, safety) = (self.handle.settings().frame, self.handle.settings().safety);
        let ticks: Vec<BlackBoxTick> = self
            .handle
            .black_box()
            .ticks()
            .rev()
            .skip_while(|tick| tick.sequence > newest)
            .take_while(|tick| tick.sequence > before_first)
            .copied()
            .collect();
        let rendered = |tick: &BlackBoxTick| self.device_resolution * frame.force_to_device(tick.written_n);
        let is_none = |force_n: f64| force_n < NO_FORCE_SHARE * full_n;
        let after = |stage: fn(&BlackBoxTick) -> DVec3| mean(ticks.iter().map(|tick| stage(tick).length()));
        if ticks.is_empty() {
            return Some(ForceStep::Unknown);
        }
        if !is_none(mean(ticks.iter().map(|tick| rendered(tick).length()))) {
            return Some(ForceStep::Rendered);
        }
        let has_failed = |tick: &BlackBoxTick| {
            let others = [SafetyAction::Silent, SafetyAction::Stale, SafetyAction::NotFinite];
            tick.read_failed.is_some()
                || tick.write_failed.is_some()
                || others.into_iter().any(|action| tick.acted.contains(action))
        };
        if ticks.iter().any(has_failed) {
            return Some(ForceStep::Unknown);
        }
        let before_n = after(|tick| tick.before_n);
        let cause = if is_none(self.description.max_force_n) {
            NoForceCause::DeviceLimit { max_force_n: self.description.max_force_n }
        } else if is_none(safety.max_force_n) {
            NoForceCause::ForceLimit { max_force_n: safety.max_force_n }
        } else if is_none(before_n) {
            NoForceCause::LocalModel { scheme: described.scheme }
        } else if is_none(after(|tick| tick.after.gains_n)) {
            if ticks.iter().any(|tick| tick.acted.contains(SafetyAction::Waiting)) {
                NoForceCause::StartThreshold { force_n: before_n, arm_below_n: safety.arm_below_n }
            } else {
                NoForceCause::StartRamp { ramp_s: safety.ramp_s }
            }
        } else if is_none(after(|tick| tick.after.velocity_guard_n)) {
            NoForceCause::SafetyStage { stage: SafetyAction::VelocityGuard }
        } else if is_none(after(|tick| tick.after.passivity_n)) {
            NoForceCause::SafetyStage { stage: SafetyAction::Passivity }
        } else if is_none(after(|tick| tick.written_n)) {
            NoForceCause::GrowthLimit { max_slew_n_per_s: safety.max_slew_n_per_s }
        } else {
            let sum: DVec3 = ticks.iter().map(|tick| frame.force_to_device(tick.written_n)).sum();
            NoForceCause::MissingAxes { force_n: sum / ticks.len() as f64 }
        };
        Some(ForceStep::Missing(cause))
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    if count > 0 { sum / f64::from(count) } else { 0.0 }
}
