//! What is set of a tool's loop while it runs.

use super::components::ToolSettings;
use super::results::TickRecording;
use super::tool_loop::ToolLoop;
use crate::body::SimulatedBody;
use crate::fault::{HapticFault, HapticFaultKind};
use crate::schedule::{LoopMode, ModelPeriod};
use bevy::prelude::*;
use palpate_haptics::{LoopSettings, SafetySettings};
use palpate_local::ModelId;

/// Takes changed settings if they make sense; if not, says so once and keeps the old ones.
pub(super) fn validate_settings(
    mut tools: Query<(Entity, &ToolSettings, &mut ToolLoop), Changed<ToolSettings>>,
    period: ModelPeriod,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, settings, mut tool) in &mut tools {
        match loop_settings(settings, tool.device_safety, period.s()).validate() {
            Ok(()) => tool.settings = *settings,
            Err(error) => {
                faults.write(HapticFault {
                    entity: Some(entity),
                    kind: HapticFaultKind::Settings(error.into()),
                });
            }
        }
    }
}

/// Sets every loop to what its tool's settings and the app ask for.
pub(super) fn apply_settings(
    mut tools: Query<(&mut ToolLoop, Has<TickRecording>)>,
    bodies: Query<(), With<SimulatedBody>>,
    time: Res<Time<Virtual>>,
    clock: Res<LoopMode>,
    period: ModelPeriod,
) {
    // At another speed than that of real time a thread cannot follow.
    let paused = time.is_paused() || *clock == LoopMode::Threaded && time.relative_speed_f64() != 1.0;
    for (mut tool, record) in &mut tools {
        tool.was_paused |= paused;
        let body = tool.body.filter(|&body| bodies.contains(body)).map_or(ModelId::NO_BODY, Entity::to_bits);
        let before = tool.handle.settings().body.unwrap_or(ModelId::NO_BODY);
        if ![body, ModelId::NO_BODY].contains(&before) {
            // A model of the old body may wait in the exchange; this one takes its place.
            let sequence = tool.consumed.unwrap_or(0);
            tool.handle.model_slot().clear(sequence);
            tool.handle.publish_model();
        }
        let asked = LoopSettings {
            body: Some(body),
            paused,
            record,
            ..loop_settings(&tool.settings, tool.device_safety, period.s())
        };
        if asked != *tool.handle.settings() {
            // They have been checked; the loop would keep its old ones.
            let _ = tool.handle.set_settings(asked);
        }
    }
}

/// The settings of a loop that gets a local model every `model_period_s` seconds. A safety chain of which nothing was set is set as the device asks for.
pub(super) fn loop_settings(
    tool: &ToolSettings,
    of_device: SafetySettings,
    model_period_s: f64,
) -> LoopSettings {
    let ToolSettings { frame, safety, velocity } = *tool;
    let safety = if safety == SafetySettings::default() { of_device } else { safety };
    LoopSettings { frame, safety, velocity, model_period_s, ..LoopSettings::default() }
}
