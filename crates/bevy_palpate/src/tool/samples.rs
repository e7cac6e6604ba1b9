//! Takes the samples of the loops: the paths along which bodies are stepped.

use super::components::ContactEnd;
use super::tool_loop::{Driver, ToolLoop};
use crate::fault::{HapticFault, HapticFaultKind};
use crate::schedule::ModelRate;
use bevy::prelude::*;
use palpate_body::ToolPoint;
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
            tool.reset_contact(entity).map(|message| ended.write(message));
        }
        let lost = take_path(tool.handle.samples(), &mut tool.consumed, &mut tool.path);
        if lost > 0 {
            // The tool is elsewhere without having moved there: a touched node must not be thrown.
            tool.reset_contact(entity).map(|message| ended.write(message));
            let kind = HapticFaultKind::SamplesLost { lost };
            faults.write(HapticFault { entity: Some(entity), kind });
        }
    }
}

/// Longest path that a body is moved along at once, in samples: what the loop keeps, with a margin for ticks while it is read.
/// The body takes no more steps for a long path than for a short one ([`ModelSpan`](crate::schedule::ModelSpan)).
const MAX_PATH: u64 = 500;

/// Puts the samples after `consumed` into `path`, behind the one it begins at; returns how many are lost.
fn take_path(samples: &SampleHistory, consumed: &mut Option<u64>, path: &mut Vec<ToolPoint>) -> u64 {
    path.clear();
    let (Some(newest), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) else { return 0 };
    let reach = oldest.max(newest.sequence.saturating_sub(MAX_PATH));
    let begin = consumed.map_or(reach, |consumed| consumed.max(reach));
    let lost = consumed.map_or(0, |consumed| begin - consumed.min(begin));
    path.extend((begin..=newest.sequence).filter_map(|sequence| samples.get(sequence)).map(tool_point));
    *consumed = Some(newest.sequence);
    lost
}

fn tool_point(sample: &Sample) -> ToolPoint {
    ToolPoint { position_m: sample.position_m, velocity_m_per_s: sample.velocity_m_per_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

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
