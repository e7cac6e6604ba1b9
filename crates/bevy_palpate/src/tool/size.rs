//! Compares the size of a tool with the body it touches.

use super::components::HapticTool;
use super::tool_loop::{ComparedSizes, ToolLoop};
use crate::body::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind, ToolSizeFault};
use bevy::prelude::*;

/// Minimum radius of a tool as a share of a cell.
const MIN_SHARE_OF_CELL: f64 = 0.1;

/// Reports a tool in contact that is too small or too large for its body, once for each pair.
pub(super) fn report_sizes(
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop)>,
    bodies: Query<&SimulatedBody>,
    mut faults: FaultWriter,
) {
    for (entity, described, mut tool) in &mut tools {
        let Some(body) = tool.body.filter(|_| !tool.contact.touched().is_empty()) else { continue };
        let Ok(simulated) = bodies.get(body) else { continue };
        let now = ComparedSizes { body, shape: simulated.shape, tool: described.shape };
        if tool.compared_sizes.replace(now) == Some(now) {
            continue;
        }
        let (radius_m, cell_m) = (described.shape.radius_m(), simulated.cell_m());
        let side_m = simulated.longest_side_m();
        let fault = if radius_m < MIN_SHARE_OF_CELL * cell_m {
            ToolSizeFault::TooSmall { radius_m, cell_m, body }
        } else if radius_m > 0.5 * side_m {
            ToolSizeFault::TooLarge { radius_m, side_m, body }
        } else {
            continue;
        };
        faults.write(entity, HapticFaultKind::ToolSize(fault));
    }
}
