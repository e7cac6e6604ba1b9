//! Reads the events and records of the loops, and detects loops that have ended.

use super::black_box::BlackBoxDump;
use super::results::TickRecording;
use super::tool_loop::{Driver, ToolLoop};
use crate::fault::{FaultWriter, HapticFaultKind};
use bevy::prelude::*;
use palpate_haptics::LoopEventKind;

/// Reads the events and records of every loop, and detects loops that have ended by themselves.
pub(super) fn poll_loops(
    mut commands: Commands,
    mut tools: Query<(Entity, &mut ToolLoop, Option<&mut TickRecording>, Option<&mut BlackBoxDump>)>,
    mut faults: FaultWriter,
) {
    for (entity, mut tool, recording, black_box) in &mut tools {
        let tool = &mut *tool;
        let mut fault = |kind| {
            faults.write(entity, kind);
        };
        // Checked before the queues are read, which then contain the last events of an ended loop.
        let has_ended = matches!(&tool.driver, Driver::Thread(thread) if !thread.is_running());
        let mut dump_reason = None;
        tool.take_faults(entity, &mut |kind| {
            if !matches!(kind, HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(_))) {
                dump_reason.get_or_insert_with(|| kind.report());
            }
            fault(kind);
        });
        if let Some(mut black_box) = black_box {
            black_box.write(&mut tool.handle, dump_reason).map(&mut fault);
        }
        if let Some(mut recording) = recording {
            tool.record(&mut recording);
        }
        if has_ended {
            fault(tool.driver.stop().unwrap_or(HapticFaultKind::LoopEnded));
            commands.entity(entity).remove::<ToolLoop>();
        }
    }
}
