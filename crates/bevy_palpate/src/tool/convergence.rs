//! Reports loops whose contact solver does not converge.

use super::tool_loop::ToolLoop;
use crate::fault::{FaultWriter, HapticFaultKind};
use bevy::prelude::*;
use glam::DVec3;

/// Reports every tool whose loop did not converge in more than 1 % of a second's ticks in contact.
pub(super) fn report_unconverged(mut tools: Query<(Entity, &mut ToolLoop)>, mut faults: FaultWriter) {
    for (entity, mut tool) in &mut tools {
        let ToolLoop { handle, path, consumed, convergence, .. } = &mut *tool;
        let (Some(newest), ticks) = (*consumed, path.len().saturating_sub(1) as u64) else { continue };
        let rendered = handle.displayed();
        let first = (newest + 1).saturating_sub(ticks);
        let has_force =
            |sequence: &u64| rendered.get(*sequence).is_some_and(|force_n| force_n != DVec3::ZERO);
        let touching = (first..=newest).filter(has_force).count() as u64;
        let counter = handle.report().unconverged_ticks;
        if let Some((ticks, touching)) = convergence.record(ticks, touching, counter) {
            let kind = HapticFaultKind::Unconverged { ticks, touching };
            faults.write(entity, kind);
        }
    }
}
