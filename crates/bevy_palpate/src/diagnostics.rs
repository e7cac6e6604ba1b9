//! Durations, deadlines, forces and errors in Bevy's [`DiagnosticsStore`].

use crate::cost::FrameCost;
use crate::schedule::{HapticSystems, ModelSchedule};
use crate::step_times::StepTimes;
use crate::tool::{ForceError, LocalModelStats, LoopTiming, ToolForce};
use bevy::diagnostic::{
    Diagnostic, DiagnosticMeasurement, DiagnosticPath, Diagnostics, DiagnosticsStore, RegisterDiagnostic,
};
use bevy::prelude::*;

/// Registers the diagnostics of the table and measures them.
///
/// | path | unit | measured | quantity |
/// | --- | --- | --- | --- |
/// | [`FRAME_COST`](Self::FRAME_COST) | ms | every frame | time in palpate's systems, model steps included |
/// | [`MODEL_STEP_COST`](Self::MODEL_STEP_COST) | ms | every model step | duration of the schedule [`ModelSchedule`] |
/// | [`LOCAL_MODEL_BUILD`](Self::LOCAL_MODEL_BUILD) | ms | every model step | time to build a local model |
/// | [`MISSED_DEADLINES`](Self::MISSED_DEADLINES) | | every model step | missed deadlines of all loops since their starts |
/// | [`LATENESS_P99`](Self::LATENESS_P99) | µs | every model step | time from deadline to tick, 99th percentile |
/// | [`TICK_COST_P99`](Self::TICK_COST_P99) | µs | every model step | duration of a tick, 99th percentile |
/// | [`FORCE`](Self::FORCE) | N | every model step | force written to the device |
/// | [`FORCE_ERROR`](Self::FORCE_ERROR) | N | every model step | RMS error of the force against the full body |
/// | [`FORCE_JND_RATIO`](Self::FORCE_JND_RATIO) | % | every model step | relative error divided by the just noticeable difference |
///
/// With several tools each value is the maximum, except the missed deadlines. `HapticPanelPlugin::COST` and `HapticGizmosPlugin::COST`
/// measure panel and gizmos, which are not part of the frame's cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct HapticDiagnosticsPlugin;

impl HapticDiagnosticsPlugin {
    /// Time in palpate's systems in a frame, model steps included, ms; the sum over all threads.
    pub const FRAME_COST: DiagnosticPath = DiagnosticPath::const_new("palpate/frame_cost");
    /// Duration of a model step on the main thread, the app's own systems in it included, ms.
    pub const MODEL_STEP_COST: DiagnosticPath = DiagnosticPath::const_new("palpate/model_step_cost");
    /// Time to build a local model, a part of the model step, ms.
    pub const LOCAL_MODEL_BUILD: DiagnosticPath = DiagnosticPath::const_new("palpate/local_model_build");
    /// Number of deadlines that passed without a tick.
    pub const MISSED_DEADLINES: DiagnosticPath = DiagnosticPath::const_new("palpate/missed_deadlines");
    /// Time from a deadline to its tick, 99th percentile, µs.
    pub const LATENESS_P99: DiagnosticPath = DiagnosticPath::const_new("palpate/lateness_p99");
    /// Duration of a tick, device included, 99th percentile, µs.
    pub const TICK_COST_P99: DiagnosticPath = DiagnosticPath::const_new("palpate/tick_cost_p99");
    /// Force written to the device, N.
    pub const FORCE: DiagnosticPath = DiagnosticPath::const_new("palpate/force");
    /// RMS error of the local model's force over the last model step, N.
    pub const FORCE_ERROR: DiagnosticPath = DiagnosticPath::const_new("palpate/force_error");
    /// Relative error of the local model's force divided by [`ForceError::FORCE_JND`], %.
    pub const FORCE_JND_RATIO: DiagnosticPath = DiagnosticPath::const_new("palpate/force_jnd_ratio");
}

impl Plugin for HapticDiagnosticsPlugin {
    fn build(&self, app: &mut App) {
        for (path, suffix) in [
            (Self::FRAME_COST, " ms"),
            (Self::MODEL_STEP_COST, " ms"),
            (Self::LOCAL_MODEL_BUILD, " ms"),
            (Self::MISSED_DEADLINES, ""),
            (Self::LATENESS_P99, " µs"),
            (Self::TICK_COST_P99, " µs"),
            (Self::FORCE, " N"),
            (Self::FORCE_ERROR, " N"),
            (Self::FORCE_JND_RATIO, " %"),
        ] {
            app.register_diagnostic(Diagnostic::new(path).with_suffix(suffix));
        }
        app.init_resource::<FrameCost>()
            .add_systems(
                ModelSchedule,
                measure_step.after(HapticSystems::Writeback).before(HapticSystems::Last),
            )
            .add_systems(Last, (measure_frame, measure_model_steps));
    }
}

/// Adds the results of a model step.
fn measure_step(
    tools: Query<(Ref<LocalModelStats>, &ForceError, &LoopTiming, &ToolForce)>,
    mut diagnostics: Diagnostics,
) {
    type Plugin = HapticDiagnosticsPlugin;
    let largest = |values: &mut dyn Iterator<Item = f64>| values.reduce(f64::max);
    let mut add = |path: DiagnosticPath, value: Option<f64>| {
        if let Some(value) = value {
            diagnostics.add_measurement(&path, || value);
        }
    };
    let built = tools.iter().filter(|(build, ..)| build.is_changed()).map(|(build, ..)| 1e3 * build.time_s);
    add(Plugin::LOCAL_MODEL_BUILD, largest(&mut built.filter(|ms| *ms > 0.0)));
    let running = || tools.iter().filter(|(_, _, timing, _)| timing.ticks > 0);
    if running().next().is_some() {
        let missed: u64 = running().map(|(_, _, timing, _)| timing.missed_deadlines).sum();
        add(Plugin::MISSED_DEADLINES, Some(missed as f64));
    }
    add(Plugin::LATENESS_P99, largest(&mut running().map(|(_, _, timing, _)| timing.lateness_p99_us)));
    add(Plugin::TICK_COST_P99, largest(&mut running().map(|(_, _, timing, _)| timing.cost_p99_us)));
    add(Plugin::FORCE, largest(&mut tools.iter().map(|(.., force)| force.force_n.length())));
    let errors = tools.iter().map(|(_, error, ..)| error).filter(|error| error.ticks > 0);
    if let Some(worst) = errors.max_by(|a, b| a.rms_n.total_cmp(&b.rms_n)) {
        add(Plugin::FORCE_ERROR, Some(worst.rms_n));
        add(Plugin::FORCE_JND_RATIO, worst.jnd_ratio.map(|share| 100.0 * share));
    }
}

/// Adds the cost of the frame.
fn measure_frame(cost: Res<FrameCost>, mut diagnostics: Diagnostics) {
    diagnostics.add_measurement(&HapticDiagnosticsPlugin::FRAME_COST, || cost.take_ms());
}

/// Adds the durations of the model steps since the last frame.
fn measure_model_steps(times: Option<ResMut<StepTimes>>, store: Option<ResMut<DiagnosticsStore>>) {
    let (Some(mut times), Some(mut store)) = (times, store) else { return };
    let steps = times.take_steps();
    let enabled = store.get_mut(&HapticDiagnosticsPlugin::MODEL_STEP_COST).filter(|step| step.is_enabled);
    let Some(diagnostic) = enabled else { return };
    for (time, cost) in steps {
        diagnostic.add_measurement(DiagnosticMeasurement { time, value: 1e3 * cost.as_secs_f64() });
    }
}
