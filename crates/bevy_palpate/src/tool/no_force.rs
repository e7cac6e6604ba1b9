//! Reports a tool that renders no force where there should be one, with the cause.
//!
//! A model step is without force when the mean force that reaches the device is below 1 % of that which the full body
//! computes, when the tool overlaps the body without a contact, or when no body is within reach. What lasts for half a second is
//! reported. The pause of an app, a device that fails and a local model that is too old are left out: other faults report them.

use super::overlap::{Overlap, Surfaces, beyond_workspace_m, is_in_workspace};
use super::{HapticTool, ToolLoop};
use crate::body::{BodyBuild, DeformableBody, SimulatedBody};
use crate::fault::{HapticFault, HapticFaultKind, NoForceCause};
use bevy::prelude::*;
use glam::DVec3;
use palpate_haptics::{BlackBoxTick, SafetyAction};

/// Ticks without force after which the cause is reported.
const REPORTED_AFTER_TICKS: u64 = 500;

/// The same where the body is still to be built, which takes its time.
const BUILT_WITHIN_TICKS: u64 = 5000;

/// Share of the full body's force below which a force counts as none.
const NO_FORCE_SHARE: f64 = 0.01;

/// Mean force of the full body below which nothing has to be felt, N.
const NOTHING_N: f64 = 1e-3;

/// Depth of an overlap that needs a contact, as a share of the tool's radius.
const DEPTH_SHARE: f64 = 0.05;

/// Share of a point's weight on free nodes below which the surface counts as fixed: what contact needs to begin.
const FIXED_SHARE: f64 = 0.3;

/// How long a tool has been without force, and what has been reported.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ForceWatch {
    /// The present cause and its ticks.
    present: Option<(NoForceCause, u64)>,
    reported: Option<NoForceCause>,
    /// The body, and its shape and place, of which the tool was clear at the last model step.
    clear_of: Option<(Entity, (u64, u64))>,
    /// The tool went into that body through a fixed surface, there, m.
    entered: Option<(Entity, (u64, u64), DVec3)>,
    /// The device has been where its description says that it cannot be.
    left_workspace: bool,
}

/// What a model step shows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// A force is missing.
    Missing(NoForceCause),
    /// A force reaches the device.
    Rendered,
    /// No force is expected.
    Quiet,
    /// Neither: what is missing is another fault's affair.
    Unknown,
}

impl ForceWatch {
    /// Adds a step of `ticks` ticks; returns the cause that has to be reported.
    fn note(&mut self, step: Step, ticks: u64) -> Option<NoForceCause> {
        let Step::Missing(cause) = step else {
            self.present = None;
            let is_over = |reported: &NoForceCause| reported.is_about_reach() || step == Step::Rendered;
            self.reported = self.reported.filter(|reported| step == Step::Unknown || !is_over(reported));
            return None;
        };
        let before = self.present.filter(|(before, _)| before.is_same(&cause)).map_or(0, |(_, ticks)| ticks);
        let lasted = before + ticks;
        self.present = Some((cause, lasted));
        let (cause, limit) = match cause {
            NoForceCause::BodyNotReady { body, .. } => {
                (NoForceCause::BodyNotReady { body, waited_s: 1e-3 * lasted as f64 }, BUILT_WITHIN_TICKS)
            }
            cause => (cause, REPORTED_AFTER_TICKS),
        };
        let is_new = !self.reported.is_some_and(|reported| reported.is_same(&cause));
        (lasted >= limit && is_new).then(|| *self.reported.insert(cause))
    }
}

/// All bodies that are asked for, simulated or not.
type Bodies<'w, 's> =
    Query<'w, 's, (Entity, Option<&'static SimulatedBody>, Option<&'static BodyBuild>), With<DeformableBody>>;

/// Reports every tool that has been without force for half a second, once for each cause.
pub(super) fn report_missing_force(
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop)>,
    bodies: Bodies<'_, '_>,
    mut surfaces: Local<Surfaces>,
    mut faults: MessageWriter<HapticFault>,
) {
    surfaces.retain(|body| bodies.contains(body));
    for (entity, asked, mut tool) in &mut tools {
        let ticks = tool.path.len().saturating_sub(1) as u64;
        let Some(at_m) = tool.path.last().map(|point| point.position_m).filter(|_| ticks > 0) else {
            continue;
        };
        let step = if tool.handle.settings().paused || tool.refused_body.is_some() {
            Step::Unknown
        } else {
            match tool.body.and_then(|body| Some((body, bodies.get(body).ok()?.1?))) {
                None => Step::Missing(unreachable(&bodies, asked.body)),
                Some(body) => tool.look(asked, body, &bodies, &mut surfaces, at_m),
            }
        };
        if let Some(cause) = tool.force_watch.note(step, ticks) {
            faults.write(HapticFault { entity: Some(entity), kind: HapticFaultKind::NoForce(cause) });
        }
    }
}

/// Why there is no simulated body, for a tool that may touch `only` or any.
fn unreachable(bodies: &Bodies<'_, '_>, only: Option<Entity>) -> NoForceCause {
    let mut rejected = None;
    for (body, simulated, build) in bodies.iter().filter(|(body, ..)| only.is_none_or(|only| only == *body)) {
        match build {
            // It is simulated from the next model step on.
            _ if simulated.is_some() => return NoForceCause::BodyNotReady { body, waited_s: 0.0 },
            Some(BodyBuild::AwaitsMesh | BodyBuild::Making(_) | BodyBuild::Outdated) => {
                return NoForceCause::BodyNotReady { body, waited_s: 0.0 };
            }
            Some(BodyBuild::MissesMesh | BodyBuild::AwaitsPlace(_)) | None => {
                rejected.get_or_insert(body);
            }
        }
    }
    rejected.map_or(NoForceCause::NoBody, |body| NoForceCause::BodyRejected { body })
}

impl ToolLoop {
    /// What the last model step shows of this tool at the body `on`, its device at `at_m`.
    fn look(
        &mut self,
        asked: &HapticTool,
        on: (Entity, &SimulatedBody),
        bodies: &Bodies<'_, '_>,
        surfaces: &mut Surfaces,
        at_m: DVec3,
    ) -> Step {
        let (body, simulated) = on;
        let (now, is_clear) = ((body, simulated.touched_as()), self.contact.is_clear());
        let watch = &mut self.force_watch;
        let was_clear = std::mem::replace(&mut watch.clear_of, Some(now).filter(|_| is_clear)) == Some(now);
        watch.entered = watch.entered.filter(|(body, shape, _)| !is_clear && (*body, *shape) == now);
        if let Some(step) = self.compare_forces(asked) {
            return step;
        }
        if self.is_in_contact() {
            return Step::Quiet;
        }
        if let Some(overlap) = surfaces.overlap(on, &self.contact, at_m) {
            return self.explain(now, overlap, was_clear);
        }
        let Some(radius_m) = self.contact.shape().map(|(shape, _)| shape.radius_m()) else {
            return Step::Quiet;
        };
        let frame = self.handle.settings().frame;
        self.force_watch.left_workspace |= !is_in_workspace(&self.description, &frame, at_m);
        if self.force_watch.left_workspace {
            return Step::Quiet;
        }
        let reachable = bodies.iter().filter(|(other, ..)| asked.body.is_none() || *other == body);
        let mut nearest: Option<(f64, Entity)> = None;
        for (other, simulated, _) in reachable {
            let Some(simulated) = simulated else { continue };
            let Some(apart_m) = beyond_workspace_m(&self.description, &frame, simulated.body(), radius_m)
            else {
                return Step::Quiet;
            };
            if nearest.is_none_or(|(nearest_m, _)| apart_m < nearest_m) {
                nearest = Some((apart_m, other));
            }
        }
        nearest.map_or(Step::Quiet, |(distance_m, body)| {
            Step::Missing(NoForceCause::OutOfWorkspace { body, distance_m })
        })
    }

    /// Why a tool that overlaps a body, of that shape and place, has no contact.
    fn explain(&mut self, (body, shape): (Entity, (u64, u64)), overlap: Overlap, was_clear: bool) -> Step {
        let is_fixed = overlap.free_share < FIXED_SHARE;
        let point_m = overlap.point_m;
        if self.contact.is_clear() {
            return match (overlap.depth_m > DEPTH_SHARE * overlap.radius_m, is_fixed) {
                (false, _) => Step::Quiet,
                (true, true) => Step::Missing(NoForceCause::FixedSurface { body, point_m }),
                (true, false) => Step::Missing(NoForceCause::NoContact { body, point_m }),
            };
        }
        // What was outside of the same body in the last step has gone in through a surface that did not yield.
        if was_clear && is_fixed {
            self.force_watch.entered = Some((body, shape, point_m));
        }
        Step::Missing(match self.force_watch.entered {
            Some((_, _, point_m)) => NoForceCause::FixedSurface { body, point_m },
            None => NoForceCause::Inside { body },
        })
    }

    /// Compares the force that reached the device over the last model step with that of the full body; `None` where the full body
    /// computes none.
    fn compare_forces(&mut self, asked: &HapticTool) -> Option<Step> {
        let newest = self.consumed?;
        let full_n = mean(self.full_n.iter().map(|force_n| force_n.length()));
        if full_n < NOTHING_N {
            return None;
        }
        let before_first = newest.saturating_sub(self.full_n.len() as u64);
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
        let shown = |tick: &BlackBoxTick| self.shown * frame.force_to_device(tick.written_n);
        let is_none = |force_n: f64| force_n < NO_FORCE_SHARE * full_n;
        let after = |stage: fn(&BlackBoxTick) -> DVec3| mean(ticks.iter().map(|tick| stage(tick).length()));
        if ticks.is_empty() {
            return Some(Step::Unknown);
        }
        if !is_none(mean(ticks.iter().map(|tick| shown(tick).length()))) {
            return Some(Step::Rendered);
        }
        let has_failed = |tick: &BlackBoxTick| {
            let others = [SafetyAction::Silent, SafetyAction::Stale, SafetyAction::NotFinite];
            tick.read_failed.is_some()
                || tick.write_failed.is_some()
                || others.into_iter().any(|action| tick.acted.contains(action))
        };
        if ticks.iter().any(has_failed) {
            return Some(Step::Unknown);
        }
        let before_n = after(|tick| tick.before_n);
        let cause = if is_none(self.description.max_force_n) {
            NoForceCause::DeviceLimit { max_force_n: self.description.max_force_n }
        } else if is_none(safety.max_force_n) {
            NoForceCause::ForceLimit { max_force_n: safety.max_force_n }
        } else if is_none(before_n) {
            NoForceCause::LocalModel { scheme: asked.scheme }
        } else if is_none(after(|tick| tick.after.gains_n)) {
            if ticks.iter().any(|tick| tick.acted.contains(SafetyAction::Waiting)) {
                NoForceCause::StartThreshold { force_n: before_n, start_below_n: safety.arm_below_n }
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
        Some(Step::Missing(cause))
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    if count > 0 { sum / f64::from(count) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Step = Step::Missing(NoForceCause::ForceLimit { max_force_n: 0.0 });
    const RAMP: Step = Step::Missing(NoForceCause::StartRamp { ramp_s: 1e9 });
    const NO_BODY: Step = Step::Missing(NoForceCause::NoBody);

    /// Numbers of those of `steps`, of 50 ticks each, after which a cause is reported.
    fn reported(steps: &[(Step, usize)]) -> Vec<usize> {
        let mut watch = ForceWatch::default();
        let all = steps.iter().flat_map(|(step, times)| std::iter::repeat_n(*step, *times));
        all.enumerate().filter_map(|(i, step)| watch.note(step, 50).map(|_| i + 1)).collect()
    }

    #[test]
    fn a_cause_is_reported_once_after_half_a_second_without_a_break() {
        assert_eq!(reported(&[(LIMIT, 40)]), [10]);
        assert_eq!(reported(&[(LIMIT, 9), (Step::Quiet, 1), (LIMIT, 9)]), [0; 0]);
        assert_eq!(reported(&[(LIMIT, 9), (RAMP, 9)]), [0; 0]);
    }

    #[test]
    fn another_cause_is_reported_too() {
        assert_eq!(reported(&[(LIMIT, 20), (RAMP, 20)]), [10, 30]);
    }

    #[test]
    fn a_missing_force_is_reported_again_once_there_was_force() {
        assert_eq!(reported(&[(LIMIT, 20), (Step::Quiet, 20), (LIMIT, 20)]), [10]);
        assert_eq!(reported(&[(LIMIT, 20), (Step::Rendered, 1), (LIMIT, 20)]), [10, 31]);
        assert_eq!(reported(&[(LIMIT, 20), (Step::Unknown, 20), (LIMIT, 20)]), [10]);
    }

    #[test]
    fn a_missing_body_is_reported_again_once_there_was_one() {
        assert_eq!(reported(&[(NO_BODY, 20), (Step::Quiet, 1), (NO_BODY, 20)]), [10, 31]);
        assert_eq!(reported(&[(NO_BODY, 20), (Step::Unknown, 1), (NO_BODY, 20)]), [10]);
    }

    #[test]
    fn a_body_that_is_being_built_has_five_seconds() {
        let body = Entity::PLACEHOLDER;
        let waits = Step::Missing(NoForceCause::BodyNotReady { body, waited_s: 0.0 });
        assert_eq!(reported(&[(waits, 99)]), [0; 0]);
        assert_eq!(reported(&[(waits, 200)]), [100]);
    }
}
