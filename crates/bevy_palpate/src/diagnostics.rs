//! What palpate costs and how well it does, in Bevy's [`DiagnosticsStore`].

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
/// | path | unit | measured | what it is |
/// | --- | --- | --- | --- |
/// | [`FRAME_COST`](Self::FRAME_COST) | ms | every frame | time in palpate's own systems, model steps included |
/// | [`MODEL_STEP_COST`](Self::MODEL_STEP_COST) | ms | every model step | time of the schedule [`ModelSchedule`] |
/// | [`LOCAL_MODEL_BUILD`](Self::LOCAL_MODEL_BUILD) | ms | every model step | time to build a local model |
/// | [`MISSED_DEADLINES`](Self::MISSED_DEADLINES) | | every model step | since the loops' starts, of all loops |
/// | [`LATENESS_P99`](Self::LATENESS_P99) | µs | every model step | 99th percentile from deadline to tick |
/// | [`TICK_COST_P99`](Self::TICK_COST_P99) | µs | every model step | 99th percentile of the time that a tick takes |
/// | [`FORCE`](Self::FORCE) | N | every model step | written to the device |
/// | [`LOCAL_MODEL_ERROR`](Self::LOCAL_MODEL_ERROR) | N | every model step | RMS against the full body |
/// | [`LOCAL_MODEL_ERROR_NOTICEABLE`](Self::LOCAL_MODEL_ERROR_NOTICEABLE) | % | every model step | the same as a share of what a person just notices |
///
/// Of several tools the largest counts. Panel and gizmos are not in the frame's cost: see `HapticPanelPlugin::COST` and
/// `HapticGizmosPlugin::COST`.
#[derive(Clone, Copy, Debug, Default)]
pub struct HapticDiagnosticsPlugin;

impl HapticDiagnosticsPlugin {
    /// Time that palpate's own systems took in a frame, model steps included, ms. On several threads it is the sum.
    pub const FRAME_COST: DiagnosticPath = DiagnosticPath::const_new("palpate/frame_cost");
    /// Time that a model step took on the main thread, users' systems in it included, ms.
    pub const MODEL_STEP_COST: DiagnosticPath = DiagnosticPath::const_new("palpate/model_step_cost");
    /// Time that building a local model took, a part of the model step, ms.
    pub const LOCAL_MODEL_BUILD: DiagnosticPath = DiagnosticPath::const_new("palpate/local_model_build");
    /// Deadlines that passed without a tick.
    pub const MISSED_DEADLINES: DiagnosticPath = DiagnosticPath::const_new("palpate/missed_deadlines");
    /// 99th percentile of the time from a deadline to its tick, µs.
    pub const LATENESS_P99: DiagnosticPath = DiagnosticPath::const_new("palpate/lateness_p99");
    /// 99th percentile of the time that a tick takes, device included, µs.
    pub const TICK_COST_P99: DiagnosticPath = DiagnosticPath::const_new("palpate/tick_cost_p99");
    /// Force written to the device, N.
    pub const FORCE: DiagnosticPath = DiagnosticPath::const_new("palpate/force");
    /// Error of the local models over the last model step, N.
    pub const LOCAL_MODEL_ERROR: DiagnosticPath = DiagnosticPath::const_new("palpate/local_model_error");
    /// The same as a share of what a person just notices, %.
    pub const LOCAL_MODEL_ERROR_NOTICEABLE: DiagnosticPath =
        DiagnosticPath::const_new("palpate/local_model_error_noticeable");
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
            (Self::LOCAL_MODEL_ERROR, " N"),
            (Self::LOCAL_MODEL_ERROR_NOTICEABLE, " %"),
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

/// Measures what is new after a model step.
fn measure_step(
    tools: Query<(Ref<LocalModelStats>, &ForceError, &LoopTiming, &ToolForce)>,
    mut diagnostics: Diagnostics,
) {
    type Plugin = HapticDiagnosticsPlugin;
    let largest = |values: &mut dyn Iterator<Item = f64>| values.reduce(f64::max);
    let mut tell = |path: DiagnosticPath, value: Option<f64>| {
        if let Some(value) = value {
            diagnostics.add_measurement(&path, || value);
        }
    };
    let built = tools.iter().filter(|(build, ..)| build.is_changed()).map(|(build, ..)| 1e3 * build.time_s);
    tell(Plugin::LOCAL_MODEL_BUILD, largest(&mut built.filter(|ms| *ms > 0.0)));
    let running = || tools.iter().filter(|(_, _, timing, _)| timing.ticks > 0);
    if running().next().is_some() {
        let missed: u64 = running().map(|(_, _, timing, _)| timing.missed_deadlines).sum();
        tell(Plugin::MISSED_DEADLINES, Some(missed as f64));
    }
    tell(Plugin::LATENESS_P99, largest(&mut running().map(|(_, _, timing, _)| timing.lateness_p99_us)));
    tell(Plugin::TICK_COST_P99, largest(&mut running().map(|(_, _, timing, _)| timing.cost_p99_us)));
    tell(Plugin::FORCE, largest(&mut tools.iter().map(|(.., force)| force.force_n.length())));
    let judged = tools.iter().map(|(_, error, ..)| error).filter(|error| error.ticks > 0);
    if let Some(worst) = judged.max_by(|a, b| a.rms_n.total_cmp(&b.rms_n)) {
        tell(Plugin::LOCAL_MODEL_ERROR, Some(worst.rms_n));
        tell(Plugin::LOCAL_MODEL_ERROR_NOTICEABLE, worst.jnd_ratio.map(|share| 100.0 * share));
    }
}

/// Measures what the frame has cost.
fn measure_frame(cost: Res<FrameCost>, mut diagnostics: Diagnostics) {
    diagnostics.add_measurement(&HapticDiagnosticsPlugin::FRAME_COST, || cost.take_ms());
}

/// Records what every model step since the last frame has cost.
fn measure_model_steps(times: Option<ResMut<StepTimes>>, store: Option<ResMut<DiagnosticsStore>>) {
    let (Some(mut times), Some(mut store)) = (times, store) else { return };
    let steps = times.take_steps();
    let enabled = store.get_mut(&HapticDiagnosticsPlugin::MODEL_STEP_COST).filter(|step| step.is_enabled);
    let Some(diagnostic) = enabled else { return };
    for (time, cost) in steps {
        diagnostic.add_measurement(DiagnosticMeasurement { time, value: 1e3 * cost.as_secs_f64() });
    }
}
