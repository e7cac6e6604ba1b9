//! From the loops to the model side: samples, events, records.

use super::start::Driver;
use super::{HapticTool, TickRecording, ToolLoop};
use crate::body::SimulatedBody;
use crate::fault::{HapticFault, HapticFaultKind};
use crate::schedule::{MAX_TICKS, ModelRate};
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::ToolPoint;
use palpate_local::{Sample, SampleHistory};

/// In lock step turns the loops; then takes every tool's new samples, events and records.
pub(super) fn receive(
    mut tools: Query<(Entity, &mut ToolLoop, Option<&mut TickRecording>)>,
    rate: Res<ModelRate>,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, mut tool, mut recording) in &mut tools {
        let mut fault = |kind| {
            faults.write(HapticFault { entity: Some(entity), kind });
        };
        let tool = &mut *tool;
        let ended = match &mut tool.driver {
            Driver::Thread(thread) => !thread.is_running(),
            Driver::Lockstep(lockstep) => {
                lockstep.get().run(rate.ticks() as usize);
                false
            }
            Driver::Stopped => true,
        };
        if let Some(recording) = &mut recording {
            record_samples(tool.handle.samples(), &mut recording.samples);
        }
        let lost = take_path(tool.handle.samples(), &mut tool.consumed, &mut tool.path);
        if lost > 0 {
            fault(HapticFaultKind::SamplesLost { lost });
        }
        while let Some(event) = tool.handle.next_event() {
            if event.kind.is_fault() {
                fault(HapticFaultKind::Loop(event.kind));
            }
        }
        if ended && !std::mem::replace(&mut tool.said_ended, true) {
            fault(HapticFaultKind::LoopEnded);
        }
        if let Some(recording) = &mut recording {
            recording.records.extend(std::iter::from_fn(|| tool.handle.next_record()));
            recording.dropped = tool.handle.report().dropped_records;
        }
    }
}

/// Puts the samples after `consumed` into `path`, behind the one it begins at; returns how many are lost.
fn take_path(samples: &SampleHistory, consumed: &mut Option<u64>, path: &mut Vec<ToolPoint>) -> u64 {
    path.clear();
    let (Some(newest), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) else { return 0 };
    let reach = oldest.max(newest.sequence.saturating_sub(u64::from(MAX_TICKS)));
    let begin = consumed.map_or(reach, |consumed| consumed.max(reach));
    let lost = consumed.map_or(0, |consumed| begin - consumed.min(begin));
    path.extend((begin..=newest.sequence).filter_map(|sequence| samples.get(sequence)).map(tool_point));
    *consumed = Some(newest.sequence);
    lost
}

/// Adds to `recorded` the samples that are newer than its last one.
fn record_samples(samples: &SampleHistory, recorded: &mut Vec<Sample>) {
    let (Some(newest), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) else { return };
    let first = recorded.last().map_or(oldest, |last| oldest.max(last.sequence + 1));
    recorded.extend((first..=newest.sequence).filter_map(|sequence| samples.get(sequence)));
}

fn tool_point(sample: &Sample) -> ToolPoint {
    ToolPoint { position_m: sample.position_m, velocity_m_per_s: sample.velocity_m_per_s }
}

/// Gives every tool that has samples the body it asks for, or the nearest.
pub(super) fn choose_bodies(
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop)>,
    bodies: Query<(Entity, &SimulatedBody)>,
    mut faults: MessageWriter<HapticFault>,
) {
    let mut taken: Vec<Entity> = tools.iter().filter_map(|(.., tool)| tool.body).collect();
    for (entity, asked, mut tool) in &mut tools {
        let Some(at) = tool.path.last().map(|point| point.position_m) else { continue };
        let chosen = match (asked.body, tool.body) {
            (Some(body), _) => bodies.contains(body).then_some(body),
            (None, Some(body)) if bodies.contains(body) => Some(body),
            (None, _) => nearest(&bodies, at),
        };
        if chosen == tool.body {
            continue;
        }
        if let Some(body) = chosen.filter(|body| taken.contains(body)) {
            if tool.refused_body.replace(body) != Some(body) {
                faults.write(HapticFault { entity: Some(entity), kind: HapticFaultKind::BodyTaken { body } });
            }
            continue;
        }
        // Whatever was touched before is let go of.
        if let Ok(contact) = palpate_body::ToolContact::touch(asked.radius_m) {
            tool.contact = contact;
        }
        taken.extend(chosen);
        tool.body = chosen;
        tool.refused_body = None;
    }
}

/// The body with the surface node nearest to `at`; of several, the one that was spawned first.
fn nearest(bodies: &Query<(Entity, &SimulatedBody)>, at: DVec3) -> Option<Entity> {
    let distance = |simulated: &SimulatedBody| {
        let body = simulated.body();
        let nodes = body.surface().nodes.iter();
        nodes.map(|&node| body.positions_m()[node].distance_squared(at)).fold(f64::INFINITY, f64::min)
    };
    bodies
        .iter()
        .map(|(entity, simulated)| (distance(simulated), entity))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
        .map(|(_, entity)| entity)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history(sequences: std::ops::RangeInclusive<u64>) -> SampleHistory {
        let mut history = SampleHistory::with_capacity(512).unwrap();
        sequences.for_each(|sequence| {
            let position_m = DVec3::X * sequence as f64;
            history.push(Sample { sequence, position_m, ..Sample::default() });
        });
        history
    }

    fn taken(history: &SampleHistory, mut consumed: Option<u64>) -> (Vec<f64>, Option<u64>, u64) {
        let mut path = Vec::new();
        let lost = take_path(history, &mut consumed, &mut path);
        (path.iter().map(|p| p.position_m.x).collect(), consumed, lost)
    }

    #[test]
    fn a_path_begins_where_the_last_one_ended() {
        assert_eq!(taken(&history(1..=5), None), (vec![1.0, 2.0, 3.0, 4.0, 5.0], Some(5), 0));
        assert_eq!(taken(&history(1..=5), Some(3)), (vec![3.0, 4.0, 5.0], Some(5), 0));
        assert_eq!(taken(&history(1..=5), Some(5)), (vec![5.0], Some(5), 0));
    }

    #[test]
    fn at_most_200_ticks_are_consumed_and_the_lost_ones_counted() {
        let (path, consumed, lost) = taken(&history(1..=400), Some(100));
        assert_eq!((path.len(), path[0], consumed, lost), (201, 200.0, Some(400), 100));
        // The samples were begun anew after a gap.
        let (path, _, lost) = taken(&history(350..=360), Some(300));
        assert_eq!((path.len(), lost), (11, 50));
    }

    #[test]
    fn without_samples_there_is_no_path() {
        let none = SampleHistory::with_capacity(4).unwrap();
        assert_eq!(taken(&none, Some(3)), (vec![], Some(3), 0));
    }
}
