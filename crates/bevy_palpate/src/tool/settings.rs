//! Validates and applies the settings of running loops.

use super::components::ToolSettings;
use super::results::TickRecording;
use super::tool_loop::ToolLoop;
use crate::body::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::model_time::{LoopMode, ModelPeriod};
use crate::surroundings::ExternalForce;
use bevy::prelude::*;
use glam::DVec3;
use palpate_haptics::{LoopSettings, SafetySettings};
use palpate_local::ModelId;

/// Accepts changed settings if they are valid; otherwise reports a fault and keeps the previous ones.
pub(super) fn validate_settings(
    mut tools: Query<
        (Entity, &ToolSettings, Option<&ExternalForce>, &mut ToolLoop),
        Or<(Changed<ToolSettings>, Changed<ExternalForce>)>,
    >,
    period: ModelPeriod,
    mut faults: FaultWriter,
) {
    for (entity, settings, external, mut tool) in &mut tools {
        let of_loop = loop_settings(settings, tool.device_safety, period.s());
        let external_force_n = external.map_or(DVec3::ZERO, ExternalForce::total_n);
        match (LoopSettings { external_force_n, ..of_loop }).validate() {
            Ok(()) => {
                if tool.settings != *settings {
                    tool.settings = *settings;
                }
            }
            Err(error) => {
                faults.write(entity, HapticFaultKind::Settings(error.into()));
            }
        }
    }
}

/// Applies the tool's settings, its bodies and the app's pause to every loop.
pub(super) fn apply_settings(
    mut tools: Query<(&mut ToolLoop, Option<&ExternalForce>, Has<TickRecording>)>,
    bodies: Query<(), With<SimulatedBody>>,
    time: Res<Time<Virtual>>,
    mode: Res<LoopMode>,
    period: ModelPeriod,
) {
    // A loop on a thread runs in real time only.
    let paused = time.is_paused() || *mode == LoopMode::Threaded && time.relative_speed_f64() != 1.0;
    for (mut tool, external, record) in &mut tools {
        tool.was_paused |= paused;
        let of = |body: Option<Entity>| body.filter(|&body| bodies.contains(body)).map(Entity::to_bits);
        let (first, second_body) = (of(tool.body), of(tool.second.as_ref().map(|second| second.body)));
        let before = tool.handle.settings();
        let before = [before.body.filter(|body| *body != ModelId::NO_BODY), before.second_body];
        let is_kept = |before: &u64| [first, second_body].contains(&Some(*before));
        if before.iter().flatten().next().is_some() && !before.iter().flatten().any(is_kept) {
            // An empty model replaces one of the old bodies that may wait in the exchange.
            let sequence = tool.consumed.unwrap_or(0);
            tool.handle.model_slot().clear(sequence);
            tool.handle.publish_model();
        }
        let settings = LoopSettings {
            body: Some(first.unwrap_or(ModelId::NO_BODY)),
            second_body,
            other: tool.followed,
            paused,
            record,
            // One that is not finite has been reported.
            external_force_n: external
                .map(ExternalForce::total_n)
                .filter(|force_n| force_n.is_finite())
                .unwrap_or_default(),
            ..loop_settings(&tool.settings, tool.device_safety, period.s())
        };
        if settings != *tool.handle.settings() {
            // Cannot fail: the settings have been validated.
            let _ = tool.handle.set_settings(settings);
        }
    }
}

/// The settings of a loop that receives a local model every `model_period_s` seconds. `device_safety` are the safety settings that follow
/// from the device's description.
pub(super) fn loop_settings(
    tool: &ToolSettings,
    device_safety: SafetySettings,
    model_period_s: f64,
) -> LoopSettings {
    let ToolSettings { frame, safety, velocity } = *tool;
    let safety = safety.apply_to(device_safety);
    LoopSettings { frame, safety, velocity, model_period_s, ..LoopSettings::default() }
}
