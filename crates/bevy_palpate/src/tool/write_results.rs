//! Writes the results of tools to their components.

use super::results::{ForceError, LoopTiming, ToolForce, TouchedBody};
use super::tool_loop::ToolLoop;
use bevy::prelude::*;
use glam::DVec3;
use palpate_haptics::TickRecord;

/// Writes force, timing and contact of every tool.
pub(super) fn write_results(
    mut tools: Query<(&mut ToolLoop, &mut ToolForce, &mut LoopTiming, &mut TouchedBody)>,
) {
    for (mut tool, mut force, mut timing, mut touched) in &mut tools {
        let body = tool.body.filter(|_| tool.is_in_contact_with_first());
        let second = tool.second.as_ref().filter(|second| second.is_touched()).map(|second| second.body);
        touched.set_if_neq(TouchedBody { body, second, state: tool.contact_state() });
        let tick_s = tool.handle.config().hand_over.tick_s;
        let mut now = ToolForce { contact: tool.contact_point, ..*force };
        if let Some(TickRecord { rendered, safety, force_n, sample, .. }) = tool.handle.latest_tick() {
            let (newest, device_position_m) =
                sample.map_or((0, DVec3::ZERO), |sample| (sample.sequence, sample.position_m));
            let age = rendered.model.map_or(0, |model| newest.saturating_sub(model.sequence));
            now = ToolForce {
                force_n,
                model_force_n: rendered.force_n,
                sample: newest,
                device_position_m,
                safety_limited: safety.acted(),
                model_age_s: age as f64 * tick_s,
                ..now
            };
        }
        let report = tool.handle.report();
        if let Some(swap) = report.last_swap {
            (now.swap_force_jump_n, now.swap_energy_jump_j) = (swap.force_jump_n, swap.energy_jump_j);
        }
        force.set_if_neq(now);
        timing.set_if_neq(LoopTiming {
            ticks: report.ticks,
            missed_deadlines: report.missed_deadlines,
            lateness_p50_us: report.lateness.quantile_us(0.5),
            lateness_p99_us: report.lateness.quantile_us(0.99),
            lateness_p999_us: report.lateness.quantile_us(0.999),
            lateness_max_us: report.lateness.max_us(),
            on_time_ratio_100: report.success.on_time_ratio_100(),
            on_time_ratio_1000: report.success.on_time_ratio_1000(),
            overruns: report.overruns,
            cost_p50_us: report.cost.quantile_us(0.5),
            cost_p99_us: report.cost.quantile_us(0.99),
            read_p99_us: report.read.quantile_us(0.99),
            write_p99_us: report.write.quantile_us(0.99),
            unconverged_ticks: report.unconverged_ticks,
            rejected_readings: report.rejected_readings,
            device_errors: report.device_errors,
            models_rejected: report.models_rejected,
            dropped_events: report.dropped_events,
        });
    }
}

/// Writes the force error of every tool.
pub(super) fn write_errors(mut tools: Query<(&ToolLoop, &mut ForceError)>) {
    for (tool, mut error) in &mut tools {
        error.set_if_neq(tool.error);
    }
}
