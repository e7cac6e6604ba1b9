//! From the loops to the model side: samples, events, records.

use super::start::Driver;
use super::{BlackBoxDump, ContactEnd, HapticTool, TickRecording, ToolLoop};
use crate::body::{DeformableBody, SimulatedBody};
use crate::fault::{HapticFault, HapticFaultKind};
use crate::schedule::ModelRate;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::ToolPoint;
use palpate_haptics::LoopEventKind;
use palpate_local::{Sample, SampleHistory};

/// In lock step turns the loops; then takes every tool's new samples.
pub(super) fn receive(
    mut tools: Query<(Entity, &mut ToolLoop)>,
    rate: Res<ModelRate>,
    mut ended: MessageWriter<ContactEnd>,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, mut tool) in &mut tools {
        let tool = &mut *tool;
        if let Driver::Lockstep(lockstep) = &mut tool.driver {
            lockstep.get().run(rate.ticks() as usize);
        }
        // In lock step no time passes in a pause.
        if std::mem::take(&mut tool.was_paused) && matches!(tool.driver, Driver::Thread(_)) {
            // What the hand did meanwhile is nobody's business; it begins anew where it is now.
            tool.consumed = tool.handle.samples().newest().map(|sample| sample.sequence);
            tool.forget_contact(entity).map(|message| ended.write(message));
        }
        let lost = take_path(tool.handle.samples(), &mut tool.consumed, &mut tool.path);
        if lost > 0 {
            // The tool is elsewhere without having moved there: a touched node must not be thrown.
            tool.forget_contact(entity).map(|message| ended.write(message));
            let kind = HapticFaultKind::SamplesLost { lost };
            faults.write(HapticFault { entity: Some(entity), kind });
        }
    }
}

/// Takes every loop's events and records, and notices loops that have ended by themselves.
pub(super) fn poll_loops(
    mut commands: Commands,
    mut tools: Query<(Entity, &mut ToolLoop, Option<&mut TickRecording>, Option<&mut BlackBoxDump>)>,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, mut tool, recording, black_box) in &mut tools {
        let tool = &mut *tool;
        let mut fault = |kind| {
            faults.write(HapticFault { entity: Some(entity), kind });
        };
        // Asked before the queues are emptied, so that its last words are among what is taken.
        let ended = matches!(&tool.driver, Driver::Thread(thread) if !thread.is_running());
        let mut worth_keeping = None;
        tool.take_faults(&mut |kind| {
            if !matches!(kind, HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(_))) {
                worth_keeping.get_or_insert_with(|| kind.report());
            }
            fault(kind);
        });
        if let Some(mut black_box) = black_box {
            black_box.keep(&mut tool.handle, worth_keeping).map(&mut fault);
        }
        if let Some(mut recording) = recording {
            tool.record(&mut recording);
        }
        if ended {
            fault(tool.driver.stop().unwrap_or(HapticFaultKind::LoopEnded));
            commands.entity(entity).remove::<ToolLoop>();
        }
    }
}

/// Longest path that a body is moved along at once, in samples: what the loop keeps, with a margin for ticks while it is read.
/// The body takes no more steps for a long path than for a short one ([`ModelSpan`](crate::schedule::ModelSpan)).
const LONGEST_PATH: u64 = 500;

/// Puts the samples after `consumed` into `path`, behind the one it begins at; returns how many are lost.
fn take_path(samples: &SampleHistory, consumed: &mut Option<u64>, path: &mut Vec<ToolPoint>) -> u64 {
    path.clear();
    let (Some(newest), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) else { return 0 };
    let reach = oldest.max(newest.sequence.saturating_sub(LONGEST_PATH));
    let begin = consumed.map_or(reach, |consumed| consumed.max(reach));
    let lost = consumed.map_or(0, |consumed| begin - consumed.min(begin));
    path.extend((begin..=newest.sequence).filter_map(|sequence| samples.get(sequence)).map(tool_point));
    *consumed = Some(newest.sequence);
    lost
}

impl ToolLoop {
    /// Takes the events there are and gives the faults among them to `fault`.
    pub(super) fn take_faults(&mut self, fault: &mut impl FnMut(HapticFaultKind)) {
        while let Some(event) = self.handle.next_event() {
            if event.kind.is_fault() {
                fault(HapticFaultKind::Loop(event.kind));
            } else if let LoopEventKind::RealTime(_) | LoopEventKind::NoEmergencyStop = event.kind {
                info!("haptic loop: {}", event.kind);
            }
        }
        // A loop that hangs cannot tell.
        if let Driver::Thread(thread) = &self.driver {
            let stops = thread.emergency_stops();
            if std::mem::replace(&mut self.emergency_stops, stops) < stops {
                fault(HapticFaultKind::EmergencyStopped);
            }
        }
        let dropped = self.handle.report().dropped_events;
        if dropped > self.dropped_events {
            self.dropped_events = dropped;
            fault(HapticFaultKind::EventsDropped { dropped });
        }
    }

    /// Adds to `recording` what it has not got yet.
    pub(super) fn record(&mut self, recording: &mut TickRecording) {
        let samples = self.handle.samples();
        if let (Some(newest), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) {
            let first = self.recorded_to.map_or(oldest, |last| oldest.max(last + 1));
            self.recorded_to = Some(newest.sequence);
            recording.samples.extend((first..=newest.sequence).filter_map(|sequence| samples.get(sequence)));
        }
        recording.records.extend(std::iter::from_fn(|| self.handle.next_record()));
        let dropped = self.handle.report().dropped_records;
        recording.dropped += dropped - std::mem::replace(&mut self.dropped_records, dropped);
        recording.forget();
    }
}

fn tool_point(sample: &Sample) -> ToolPoint {
    ToolPoint { position_m: sample.position_m, velocity_m_per_s: sample.velocity_m_per_s }
}

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
            tool.forget_contact(entity).map(|message| ended.write(message));
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
    fn at_most_500_ticks_are_consumed_and_the_lost_ones_counted() {
        let (path, consumed, lost) = taken(&history(1..=700), Some(100));
        assert_eq!((path.len(), path[0], consumed, lost), (501, 200.0, Some(700), 100));
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
