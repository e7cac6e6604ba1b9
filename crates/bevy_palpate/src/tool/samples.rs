//! Reads the samples of the loops: the paths along which bodies are stepped.

use super::components::ContactEnd;
use super::tool_loop::{Driver, ToolLoop};
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::model_time::ModelRate;
use bevy::prelude::*;
use palpate_body::ToolPoint;
use palpate_local::{Sample, SampleHistory};

/// In lock step runs the loops; then reads the new samples of every tool.
pub(super) fn receive(
    mut tools: Query<(Entity, &mut ToolLoop)>,
    rate: Res<ModelRate>,
    mut ends: MessageWriter<ContactEnd>,
    mut faults: FaultWriter,
) {
    // Tick by tick, because the loops read each other's forces.
    let mut in_order: Vec<(Entity, Mut<ToolLoop>)> = tools.iter_mut().collect();
    in_order.sort_unstable_by_key(|(tool, _)| *tool);
    for _ in 0..rate.ticks() {
        for (_, tool) in &mut in_order {
            if let Driver::Lockstep(lockstep) = &mut tool.driver {
                lockstep.get().run(1);
            }
        }
    }
    for (entity, mut tool) in &mut tools {
        let tool = &mut *tool;
        // In lock step no time passes during a pause.
        if std::mem::take(&mut tool.was_paused) && matches!(tool.driver, Driver::Thread(_)) {
            // Discard motion during the pause; restart from the newest sample.
            tool.consumed = tool.handle.samples().newest().map(|sample| sample.sequence);
            ends.write_batch(tool.reset_contacts(entity));
        }
        let lost = take_path(tool.handle.samples(), &mut tool.consumed, &mut tool.path);
        if lost > 0 {
            // The tool jumps along the missing path; a contact would accelerate the touched nodes.
            ends.write_batch(tool.reset_contacts(entity));
            let kind = HapticFaultKind::SamplesLost { lost };
            faults.write(entity, kind);
        }
    }
}

/// Maximum length of a path, samples: the capacity of the loop's history minus a margin for ticks while it is read. The number of the
/// body's steps has a limit of its own ([`ModelSpan`](crate::model_time::ModelSpan)).
const MAX_PATH: u64 = 500;

/// Writes the sample `consumed` and all later ones to `path`; returns the number of lost samples.
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

    fn path_of(history: &SampleHistory, mut consumed: Option<u64>) -> (Vec<f64>, Option<u64>, u64) {
        let mut path = Vec::new();
        let lost = take_path(history, &mut consumed, &mut path);
        (path.iter().map(|p| p.position_m.x).collect(), consumed, lost)
    }

    #[test]
    fn path_starts_at_the_end_of_the_previous_one() {
        assert_eq!(path_of(&history(1..=5), None), (vec![1.0, 2.0, 3.0, 4.0, 5.0], Some(5), 0));
        assert_eq!(path_of(&history(1..=5), Some(3)), (vec![3.0, 4.0, 5.0], Some(5), 0));
        assert_eq!(path_of(&history(1..=5), Some(5)), (vec![5.0], Some(5), 0));
    }

    #[test]
    fn path_has_at_most_500_ticks_and_counts_lost_ones() {
        let (path, consumed, lost) = path_of(&history(1..=700), Some(100));
        assert_eq!((path.len(), path[0], consumed, lost), (501, 200.0, Some(700), 100));
        // The history was restarted after a gap.
        let (path, _, lost) = path_of(&history(350..=360), Some(300));
        assert_eq!((path.len(), lost), (11, 50));
    }

    #[test]
    fn path_is_empty_without_samples() {
        let none = SampleHistory::with_capacity(4).unwrap();
        assert_eq!(path_of(&none, Some(3)), (vec![], Some(3), 0));
    }
}
