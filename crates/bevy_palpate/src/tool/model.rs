//! The model side of a step: steps the bodies along the paths of the tools.

use super::components::{ContactEnd, ContactStart};
use super::results::{ForceError, ToolContactPoint};
use super::tool_loop::ToolLoop;
use crate::body::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::model_time::ModelSpan;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{
    Body, JointStepError, SemiImplicitEuler, SharedTool, StepReport, ToolPoint, advance_bodies,
};

/// Steps every body: along the samples of the tools that can touch it, or by the model period without samples. Bodies that share a tool
/// are stepped together.
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
    let groups = groups(
        bodies.iter().map(|(body, _)| body),
        tools
            .iter()
            .filter(|(_, tool)| !tool.path.is_empty())
            .map(|(_, tool)| tool.contacts().map(|(body, _)| body)),
    );
    for group in groups {
        let mut group: Vec<(Entity, Mut<SimulatedBody>)> =
            bodies.iter_mut().filter(|(body, _)| group.contains(body)).collect();
        let mut own_tools: Vec<(Entity, Mut<ToolLoop>)> = tools
            .iter_mut()
            .filter(|(_, tool)| {
                !tool.path.is_empty() && tool.body.is_some_and(|body| place(&group, body).is_some())
            })
            .collect();
        own_tools.sort_unstable_by_key(|(tool, _)| *tool);
        for (tool_entity, tool) in &mut own_tools {
            let key = |body: Entity| place(&group, body).map_or((0, 0), |place| group[place].1.contact_key());
            let first = tool.body.map_or((0, 0), key);
            if std::mem::replace(&mut tool.contact_key, first) != first {
                tool.reset_first(*tool_entity).map(|message| ends.write(message));
            }
            let second = tool.second.as_ref().map(|second| key(second.body));
            if let (Some(of), Some(now)) = (&mut tool.second, second)
                && std::mem::replace(&mut of.contact_key, now) != now
            {
                tool.reset_second(*tool_entity).map(|message| ends.write(message));
            }
        }
        for (_, simulated) in &mut group {
            let simulated = &mut **simulated;
            simulated.drawn.start_step(&simulated.body);
        }
        let is_touching = |tool: &ToolLoop| -> Vec<(Entity, bool)> {
            tool.contacts().map(|(body, contact)| (body, contact.normal().is_some())).collect()
        };
        let before: Vec<Vec<(Entity, bool)>> = own_tools.iter().map(|(_, tool)| is_touching(tool)).collect();
        let stepped = step(&mut group, &mut own_tools, (span.ticks(), span.max_ticks()));
        for ((tool_entity, tool), before) in own_tools.iter_mut().zip(before) {
            let simulated = |body: Entity| place(&group, body).map(|place| &*group[place].1);
            tool.contact_point = tool.body.and_then(simulated).and_then(|simulated| {
                let (normal, touched) = tool.contact.normal().zip(tool.contact.touched().first())?;
                let point_m = touched.point_m(&simulated.body);
                let depth_m = (simulated.undeformed_m(&touched.body_point()) - point_m).dot(normal);
                Some(ToolContactPoint { point_m, normal, depth_m })
            });
            for ((body, contact), (_, was_touching)) in tool.contacts().zip(before) {
                let Some(simulated) = simulated(body) else { continue };
                match (was_touching, contact.normal().zip(contact.touched().first())) {
                    (true, None) => {
                        ends.write(ContactEnd { tool: *tool_entity, body });
                    }
                    (false, Some((normal, touched))) => {
                        let point_m = touched.point_m(&simulated.body);
                        starts.write(ContactStart { tool: *tool_entity, body, point_m, normal });
                    }
                    _ => {}
                }
            }
        }
        match stepped {
            Ok(reports) => {
                for ((entity, simulated), report) in group.iter_mut().zip(reports) {
                    (simulated.last_step, simulated.failed) = (report, None);
                    let kinds = simulated.watch.record(&report);
                    kinds.into_iter().for_each(|kind| faults.write(*entity, kind));
                }
            }
            Err(JointStepError { body, error }) => {
                let Some((entity, simulated)) = group.get_mut(body) else { continue };
                bring_to_rest(simulated);
                let kind = std::mem::discriminant(&error);
                if simulated.failed.replace(kind) != Some(kind) {
                    let kind = HapticFaultKind::StepBody(error);
                    faults.write(*entity, kind);
                }
            }
        }
    }
}

/// Groups `bodies` that are connected by tools; `tools` holds the bodies of each.
fn groups(
    bodies: impl Iterator<Item = Entity>,
    tools: impl Iterator<Item = impl Iterator<Item = Entity>>,
) -> Vec<Vec<Entity>> {
    let mut groups: Vec<Vec<Entity>> = bodies.map(|body| vec![body]).collect();
    for mut tool in tools {
        let (Some(first), Some(second)) = (tool.next(), tool.next()) else { continue };
        let of = |body: Entity| groups.iter().position(|group| group.contains(&body));
        if let (Some(a), Some(b)) = (of(first), of(second))
            && a != b
        {
            let joined = groups.remove(a.max(b));
            groups[a.min(b)].extend(joined);
        }
    }
    groups
}

/// Index of `body` in `group`.
fn place(group: &[(Entity, Mut<SimulatedBody>)], body: Entity) -> Option<usize> {
    group.iter().position(|(entity, _)| *entity == body)
}

/// Steps the bodies of `group` along the paths of `tools` in at most `max_ticks` ticks, or by `period` ticks without tools, and records the
/// force on each tool.
fn step(
    group: &mut [(Entity, Mut<SimulatedBody>)],
    tools: &mut [(Entity, Mut<ToolLoop>)],
    (period, max_ticks): (usize, usize),
) -> Result<Vec<StepReport>, JointStepError> {
    let due = tools.first().map_or(period, |(_, tool)| tool.path.len() - 1);
    let ticks = due.min(max_ticks);
    let pace = |tool: &ToolLoop| Pace::new(tool.path.len() - 1, ticks, due > max_ticks);
    let resampled: Vec<Option<Vec<ToolPoint>>> = tools
        .iter()
        .map(|(_, tool)| (tool.path.len() != ticks + 1).then(|| resample(&tool.path, pace(tool))))
        .collect();
    let mut forces: Vec<Vec<DVec3>> = vec![Vec::with_capacity(ticks); tools.len()];
    let mut shared = Vec::with_capacity(tools.len());
    for ((_, tool), resampled) in tools.iter_mut().zip(&resampled) {
        let ToolLoop { contact, path, body, second, .. } = &mut **tool;
        let second = second.as_mut().map(|second| (second.body, &mut second.contact));
        let all = body.map(|body| (body, contact)).into_iter().chain(second);
        let contacts = all.filter_map(|(body, contact)| Some((place(group, body)?, contact))).collect();
        shared.push(SharedTool { contacts, path: resampled.as_ref().unwrap_or(path) });
    }
    let mut bodies: Vec<&mut Body> = group.iter_mut().map(|(_, simulated)| &mut simulated.body).collect();
    let integrator = SemiImplicitEuler::default();
    let stepped = advance_bodies(&mut bodies, &mut shared, ticks, integrator, |_, now_n| {
        forces.iter_mut().zip(now_n).for_each(|(forces, now)| forces.push(*now));
    });
    for ((_, tool), forces) in tools.iter_mut().zip(forces) {
        if stepped.is_err() {
            tool.contact.release();
            tool.second.iter_mut().for_each(|second| {
                second.contact.release();
            });
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
