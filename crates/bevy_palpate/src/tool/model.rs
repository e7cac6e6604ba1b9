//! The model side of a step: steps the bodies, builds and publishes the local models.

use super::components::{ContactEnd, ContactStart, HapticTool};
use super::results::{ForceError, LocalModelStats, ToolContactPoint};
use super::tool_loop::ToolLoop;
use crate::body::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::model_time::{ModelPeriod, ModelSpan};
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{Body, BodyError, SemiImplicitEuler, StepReport, ToolContact, ToolPoint, ToolRun};
use palpate_local::{ModelId, Scheme};
use palpate_reduce::BuilderOptions;

/// Steps every body: along the samples of the tools that can touch it, or by the model period without samples.
///
/// The first of several tools determines the number of ticks. The loops of the others run on threads of their own and may differ by a few
/// ticks: their paths are resampled to the same number. A path longer than the limit of a step ([`ModelSpan`]) is resampled to the limit:
/// its newer half tick by tick, its older half faster.
pub(super) fn step_bodies(
    mut bodies: Query<(Entity, &mut SimulatedBody)>,
    mut tools: Query<(Entity, &mut ToolLoop)>,
    span: ModelSpan,
    mut starts: MessageWriter<ContactStart>,
    mut ends: MessageWriter<ContactEnd>,
    mut faults: FaultWriter,
) {
    for (_, mut tool) in &mut tools {
        tool.full_forces_n.clear();
    }
    for (entity, mut simulated) in &mut bodies {
        let simulated = &mut *simulated;
        let mut own_tools: Vec<(Entity, Mut<ToolLoop>)> =
            tools.iter_mut().filter(|(_, tool)| tool.body == Some(entity) && !tool.path.is_empty()).collect();
        own_tools.sort_unstable_by_key(|(tool, _)| *tool);
        for (tool_entity, tool) in &mut own_tools {
            if std::mem::replace(&mut tool.contact_key, simulated.contact_key()) != simulated.contact_key() {
                tool.reset_contact(*tool_entity).map(|message| ends.write(message));
            }
        }
        simulated.drawn.start_step(&simulated.body);
        let before: Vec<bool> = own_tools.iter().map(|(_, tool)| tool.contact.normal().is_some()).collect();
        let stepped = step(&mut simulated.body, &mut own_tools, (span.ticks(), span.max_ticks()));
        for ((tool_entity, tool), was_touching) in own_tools.iter_mut().zip(before) {
            let touched = tool.contact.normal().zip(tool.contact.touched().first());
            tool.contact_point = touched.map(|(normal, touched)| {
                let point_m = touched.point_m(&simulated.body);
                let depth_m = (simulated.undeformed_m(&touched.body_point()) - point_m).dot(normal);
                ToolContactPoint { point_m, normal, depth_m }
            });
            let (tool_entity, contact) = (*tool_entity, &tool.contact);
            match (was_touching, contact.normal().zip(contact.touched().first())) {
                (true, None) => {
                    ends.write(ContactEnd { tool: tool_entity, body: entity });
                }
                (false, Some((normal, touched))) => {
                    let point_m = touched.point_m(&simulated.body);
                    starts.write(ContactStart { tool: tool_entity, body: entity, point_m, normal });
                }
                _ => {}
            }
        }
        match stepped {
            Ok(report) => {
                (simulated.last_step, simulated.failed) = (report, None);
                let kinds = simulated.watch.record(&report);
                kinds.into_iter().for_each(|kind| faults.write(entity, kind));
            }
            Err(error) => {
                bring_to_rest(simulated);
                let kind = std::mem::discriminant(&error);
                if simulated.failed.replace(kind) != Some(kind) {
                    let kind = HapticFaultKind::StepBody(error);
                    faults.write(entity, kind);
                }
            }
        }
    }
}

/// Steps `body` along the paths of `tools` in at most `max_ticks` ticks, or by `period` ticks without tools, and records the force on
/// each tool.
fn step(
    body: &mut Body,
    tools: &mut [(Entity, Mut<ToolLoop>)],
    (period, max_ticks): (usize, usize),
) -> Result<StepReport, BodyError> {
    let due = tools.first().map_or(period, |(_, tool)| tool.path.len() - 1);
    let ticks = due.min(max_ticks);
    let pace = |tool: &ToolLoop| Pace::new(tool.path.len() - 1, ticks, due > max_ticks);
    let resampled: Vec<Option<Vec<ToolPoint>>> = tools
        .iter()
        .map(|(_, tool)| (tool.path.len() != ticks + 1).then(|| resample(&tool.path, pace(tool))))
        .collect();
    let mut forces: Vec<Vec<DVec3>> = vec![Vec::with_capacity(ticks); tools.len()];
    let mut runs = Vec::with_capacity(tools.len());
    for ((_, tool), resampled) in tools.iter_mut().zip(&resampled) {
        let ToolLoop { contact, path, .. } = &mut **tool;
        runs.push(ToolRun { contact, path: resampled.as_ref().unwrap_or(path) });
    }
    let stepped = body.advance_tools(&mut runs, ticks, SemiImplicitEuler::default(), |_, now_n| {
        forces.iter_mut().zip(now_n).for_each(|(forces, now)| forces.push(*now));
    });
    for ((_, tool), forces) in tools.iter_mut().zip(forces) {
        if stepped.is_err() {
            tool.contact.release();
        } else {
            // One force for each sample of the tool's own path.
            let pace = pace(tool);
            tool.full_forces_n.extend((1..=pace.samples).filter_map(|i| forces.get(pace.tick_of(i) - 1)));
        }
    }
    stepped
}

/// Distribution of a path of `samples` samples after the first over `ticks` ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pace {
    samples: usize,
    ticks: usize,
    /// Number of ticks at the end with one sample each; the samples before are distributed evenly.
    single: usize,
}

impl Pace {
    /// The distribution; a path that is too long (`is_late`) has one sample per tick in the newer half of the ticks.
    fn new(samples: usize, ticks: usize, is_late: bool) -> Self {
        Self { samples, ticks, single: if is_late { (ticks / 2).min(samples) } else { 0 } }
    }

    /// Position on the path after `tick`, in samples.
    fn place(self, tick: usize) -> f64 {
        let (ticks, samples) = (self.ticks - self.single, self.samples - self.single);
        if ticks == 0 && self.single == 0 {
            samples as f64
        } else if tick <= ticks {
            samples as f64 * tick as f64 / ticks as f64
        } else {
            (samples + tick - ticks) as f64
        }
    }

    /// The tick, from 1, in which `sample`, from 1, is reached.
    fn tick_of(self, sample: usize) -> usize {
        let (ticks, samples) = (self.ticks - self.single, self.samples - self.single);
        if sample <= samples { (sample * ticks).div_ceil(samples).max(1) } else { ticks + sample - samples }
    }
}

/// Resamples `path`, of at least one point, at `pace`.
fn resample(path: &[ToolPoint], pace: Pace) -> Vec<ToolPoint> {
    let last = path.len() - 1;
    let at = |tick: usize| {
        let place = pace.place(tick);
        let (from, share) = ((place as usize).min(last), place.fract());
        let (a, b) = (path[from], path[(from + 1).min(last)]);
        ToolPoint {
            position_m: a.position_m.lerp(b.position_m, share),
            velocity_m_per_s: a.velocity_m_per_s.lerp(b.velocity_m_per_s, share),
        }
    };
    (0..=pace.ticks).map(at).collect()
}

/// Compares the rendered force of every loop with the full body's force at the same samples.
pub(super) fn measure_force_error(mut tools: Query<&mut ToolLoop>) {
    for mut tool in &mut tools {
        let ToolLoop { handle, full_forces_n: full_n, consumed, error, .. } = &mut *tool;
        let rendered = handle.displayed();
        let first = consumed.and_then(|newest| newest.checked_sub(full_n.len() as u64));
        let pair = |(i, full): (usize, &DVec3)| Some((rendered.get(first? + 1 + i as u64)?, *full));
        *error = ForceError::of(full_n.iter().enumerate().filter_map(pair));
    }
}

/// Sets all velocities to zero, from which the next step may succeed.
fn bring_to_rest(simulated: &mut SimulatedBody) {
    let x = simulated.body.positions_m().to_vec();
    // Cannot fail: the positions are the body's own.
    let _ = simulated.body.set_state(&x, &vec![DVec3::ZERO; x.len()]);
}

/// Builds a local model for every tool with new samples, in the slot of the exchange.
pub(super) fn build_local_models(
    mut bodies: Query<&mut SimulatedBody>,
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop, &mut LocalModelStats)>,
    period: ModelPeriod,
    mut faults: FaultWriter,
) {
    // A local model is active for one period, after a period in which it is built.
    let default_s = BuilderOptions::default().horizon_s;
    let horizon_s = (2.0 * period.s()).clamp(default_s, 10.0);
    // The contacts of all tools, for the local models of the others.
    let all: Vec<(Entity, Entity, ToolContact)> = tools
        .iter()
        .filter_map(|(entity, _, tool, _)| Some((entity, tool.body?, tool.contact.clone())))
        .collect();
    for (entity, described, mut tool, mut stats) in &mut tools {
        let ToolLoop {
            handle,
            contact,
            path,
            consumed,
            body,
            built,
            support,
            has_support,
            reported_beyond_support: was_beyond,
            ..
        } = &mut *tool;
        *built = false;
        let (Some(&point), Some(sequence)) = (path.last().filter(|_| path.len() > 1), *consumed) else {
            continue;
        };
        let model = handle.model_slot();
        let simulated = body.and_then(|body| Some((body, bodies.get_mut(body).ok()?)));
        let Some((body, mut simulated)) = simulated else {
            // An empty model replaces the previous one, which would render force until it is stale.
            model.clear(sequence);
            *built = true;
            continue;
        };
        let SimulatedBody { body: full, builder, epoch, .. } = &mut *simulated;
        // Contact outside the support set of the previous local model.
        let is_beyond = *has_support && contact.touched_nodes().iter().any(|node| !support.contains(node));
        if is_beyond && !std::mem::replace(was_beyond, true) {
            let nodes = support.len();
            faults.write(entity, HapticFaultKind::BeyondSupport { nodes });
        }
        *was_beyond = is_beyond;
        support.clear();
        *has_support = false;
        let id = ModelId { body: body.to_bits(), epoch: *epoch, sequence };
        let is_other = |other: &&(Entity, Entity, ToolContact)| other.0 != entity && other.1 == body;
        let others: Vec<&ToolContact> = all
            .iter()
            .filter(is_other)
            .map(|(_, _, contact)| contact)
            .filter(|c| c.validate(full).is_ok())
            .collect();
        // Cannot fail: the value is clamped.
        let _ = builder.set_horizon_s(horizon_s);
        match builder.build_with_other_tools(described.scheme, full, (contact, point), &others, id, model) {
            Ok(report) => {
                (*built, *stats) = (true, report.into());
                if described.scheme == Scheme::NearFieldExact {
                    support.extend(builder.support());
                    *has_support = true;
                }
            }
            Err(error) => {
                faults.write(entity, HapticFaultKind::LocalModel(error));
            }
        }
    }
}

/// Publishes the local models that have been built.
pub(super) fn publish_local_models(mut tools: Query<&mut ToolLoop>) {
    for mut tool in &mut tools {
        if std::mem::take(&mut tool.built) {
            tool.handle.publish_model();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resampled_path_keeps_start_and_end() {
        let at = |x: f64| ToolPoint { position_m: DVec3::X * x, velocity_m_per_s: DVec3::Y * x };
        let path: Vec<ToolPoint> = (0..=4).map(|i| at(f64::from(i))).collect();
        let resample =
            |path: &[ToolPoint], ticks: usize| resample(path, Pace::new(path.len() - 1, ticks, false));
        assert_eq!(resample(&path, 4), path);
        let longer = resample(&path, 5);
        assert_eq!((longer.len(), longer[0], longer[5]), (6, at(0.0), at(4.0)));
        assert!((longer[1].position_m.x - 0.8).abs() < 1e-15);
        assert_eq!(resample(&path, 2), [at(0.0), at(2.0), at(4.0)]);
        // A path without new samples stays at its point.
        assert_eq!(resample(&path[..1], 3), [at(0.0); 4]);
        assert_eq!(resample(&path, 0), [at(4.0)]);
    }

    #[test]
    fn late_path_has_one_sample_per_tick_in_its_newer_half() {
        let at = |x: f64| ToolPoint { position_m: DVec3::X * x, velocity_m_per_s: DVec3::ZERO };
        let path: Vec<ToolPoint> = (0..=10).map(|i| at(f64::from(i))).collect();
        let pace = Pace::new(10, 4, true);
        assert_eq!(resample(&path, pace), [0.0, 4.0, 8.0, 9.0, 10.0].map(at));
        assert_eq!([1, 4, 5, 8, 9, 10].map(|sample| pace.tick_of(sample)), [1, 1, 2, 2, 3, 4]);
        assert_eq!(resample(&path, Pace::new(10, 1, true)), [0.0, 10.0].map(at));
    }
}
