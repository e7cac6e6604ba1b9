//! Tools: the components that describe them, their loops, and their results.

mod black_box;
mod body_selection;
mod components;
mod convergence;
mod convergence_watch;
mod force_slots;
mod force_watch;
mod grasp;
mod local_models;
mod loop_events;
mod model;
mod no_force;
mod observers;
mod overlap;
mod results;
mod safety;
mod samples;
mod second_contact;
mod settings;
mod size;
mod start;
mod tool_loop;
mod trajectories;
mod transform;
mod write_results;

pub use black_box::BlackBoxDump;
pub use components::{
    ContactEnd, ContactStart, GraspEnd, GraspStart, GraspedPoint, HapticTool, ToolCoupling, ToolGrasp,
    ToolSettings,
};
pub use results::{
    ContactState, ForceError, LocalModelStats, LoopTiming, TickRecording, ToolContactPoint, ToolForce,
    TouchedBody,
};
pub use safety::SafetyOverrides;
pub use tool_loop::ToolLoop;

use crate::cost::FrameCost;
use crate::device::{HapticDevices, TrajectoryAsset, add_trajectory_assets};
use crate::fault::{FaultSeverity, HapticFault, add_faults};
use crate::model_time::{LoopMode, ModelRate};
use crate::schedule::{HapticSchedulePlugin, HapticSystems, HapticUpdateSystems, ModelSchedule};
use crate::step_times::StepTimes;
use crate::suture::SutureSystems;
use bevy::prelude::*;

/// Runs the tools: devices, loops, steps of the bodies along the tools' samples, local models, results.
///
/// Adds [`HapticSchedulePlugin`] with its defaults if the app does not have it.
#[derive(Clone, Copy, Debug, Default)]
pub struct ToolPlugin;

impl Plugin for ToolPlugin {
    fn build(&self, app: &mut App) {
        add_faults(app);
        let cost = FrameCost::of(app);
        let times = StepTimes::of(app);
        add_trajectory_assets(app);
        app.init_resource::<HapticDevices>()
            .init_resource::<force_slots::ForceSlots>()
            .register_type::<HapticTool>()
            .register_type::<ToolSettings>()
            .register_type::<crate::layers::TouchLayers>()
            .register_type::<ToolGrasp>()
            .register_type::<GraspedPoint>()
            .register_type::<ToolForce>()
            .register_type::<LocalModelStats>()
            .register_type::<ForceError>()
            .register_type::<LoopTiming>()
            .register_type::<TouchedBody>()
            .register_type::<ContactState>()
            .register_type::<TickRecording>()
            .register_type::<ContactStart>()
            .register_type::<ContactEnd>()
            .register_type::<HapticFault>()
            .register_type::<FaultSeverity>()
            .register_type::<GraspStart>()
            .register_type::<GraspEnd>()
            .register_type::<ToolContactPoint>()
            .register_type::<TrajectoryAsset>()
            .add_message::<ContactStart>()
            .add_message::<ContactEnd>()
            .add_message::<GraspStart>()
            .add_message::<GraspEnd>()
            .add_systems(
                PreUpdate,
                (
                    cost.timed(start::start_loops),
                    cost.timed(loop_events::poll_loops),
                    cost.timed(settings::validate_settings),
                    cost.timed(settings::apply_settings),
                    cost.timed(write_results::write_results),
                )
                    .chain()
                    .in_set(HapticUpdateSystems::Tools),
            )
            .add_systems(
                ModelSchedule,
                (
                    (samples::receive, body_selection::select_bodies, settings::apply_settings)
                        .chain()
                        .in_set(HapticSystems::ReceiveSamples),
                    (times.bodies.timed(model::step_bodies), model::measure_force_error, grasp::grasp)
                        .chain()
                        .in_set(HapticSystems::StepBodies)
                        .after(SutureSystems::Sew)
                        .before(SutureSystems::Report),
                    times
                        .local_models
                        .timed(local_models::build_local_models)
                        .in_set(HapticSystems::BuildLocalModels),
                    local_models::publish_local_models.in_set(HapticSystems::PublishLocalModels),
                    (
                        loop_events::poll_loops,
                        write_results::write_results,
                        transform::record_poses,
                        write_results::write_errors,
                        no_force::report_missing_force,
                        convergence::report_unconverged,
                        size::report_sizes,
                    )
                        .chain()
                        .in_set(HapticSystems::Writeback),
                ),
            )
            .add_systems(FixedLast, crate::slow_steps::report_slow_step)
            .add_systems(Last, observers::trigger_observers)
            .add_observer(start::remove_loop)
            .add_systems(
                PostUpdate,
                cost.timed(transform::interpolate_tool_transforms).before(TransformSystems::Propagate),
            );
    }

    fn finish(&self, app: &mut App) {
        // AssetPlugin may have been added later.
        add_trajectory_assets(app);
        // Without the plugin the schedule, its rate and its mode take their defaults.
        if !app.world().contains_resource::<ModelRate>() || !app.world().contains_resource::<LoopMode>() {
            app.add_plugins(HapticSchedulePlugin::default());
        }
        assert!(
            app.world().contains_resource::<Time<Virtual>>(),
            "palpate's ToolPlugin needs Bevy's TimePlugin, which is part of MinimalPlugins and DefaultPlugins"
        );
    }
}
