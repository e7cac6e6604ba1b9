//! The schedule of the model steps: its system sets and its plugin.

use crate::cost::{FrameCost, timed};
use crate::fault::{FaultWriter, HapticFaultKind, add_faults};
use crate::model_time::{LoopMode, Model, ModelClock, ModelRate, ModelStepCount, max_periods};
use crate::step_times::StepTimes;
use bevy::app::{RunFixedMainLoop, RunFixedMainLoopSystems};
use bevy::ecs::schedule::{InternedScheduleLabel, ScheduleLabel};
use bevy::prelude::*;
use std::time::Duration;

/// The schedule of a model step: reads samples, steps the bodies, builds and publishes the local models. Runs at [`ModelRate`] within
/// Bevy's fixed main loop, by default in [`FixedPostUpdate`] ([`HapticSchedulePlugin::in_schedule`]). The app's `Time<Fixed>` is not
/// changed. Within the schedule `Res<Time>` is the time of the model ([`Model`]).
///
/// A system of the app belongs into [`HapticSystems::First`] or [`HapticSystems::Last`]. In another place it needs an order relative to the
/// sets with whose data it works; without one it runs before or after them, as Bevy decides.
#[derive(ScheduleLabel, Clone, Debug, PartialEq, Eq, Hash, Default)]
pub struct ModelSchedule;

/// The system sets of [`ModelSchedule`], in order of execution.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum HapticSystems {
    /// For apps: before all other systems of a model step.
    First,
    /// Reads the samples of every tool's loop; in lock step, runs the loops first.
    ReceiveSamples,
    /// Steps every body along the samples of its tools.
    StepBodies,
    /// Builds a local model for every tool.
    BuildLocalModels,
    /// Publishes the local models to the loops.
    PublishLocalModels,
    /// Writes results and messages.
    Writeback,
    /// For apps: after all other systems of a model step.
    Last,
}

/// The sets of the systems in [`PreUpdate`] that handle new or changed components, in order of execution.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum HapticUpdateSystems {
    /// Builds bodies.
    Bodies,
    /// Starts loops and applies their settings.
    Tools,
}

/// Within the schedule of the app that runs the model steps.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct RunModelSteps;

/// Adds the schedule [`ModelSchedule`] and the resources [`ModelRate`], [`LoopMode`] and [`ModelStepCount`].
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{HapticSchedulePlugin, ModelRate, prelude::*};
/// # let mut app = App::new();
/// let schedule = HapticSchedulePlugin::default().with_rate(ModelRate::from_hz(25.0)).in_schedule(FixedUpdate);
/// app.add_plugins((MinimalPlugins, PalpatePlugins.set(schedule)));
/// ```
#[derive(Clone, Debug)]
pub struct HapticSchedulePlugin {
    /// Rate of the model steps.
    pub rate: ModelRate,
    /// Mode of the loops.
    pub mode: LoopMode,
    /// Schedule of Bevy's fixed main loop in which the model steps run.
    pub schedule: InternedScheduleLabel,
}

impl Default for HapticSchedulePlugin {
    /// 20 Hz, loops on threads, in [`FixedPostUpdate`].
    fn default() -> Self {
        Self { rate: ModelRate::default(), mode: LoopMode::default(), schedule: FixedPostUpdate.intern() }
    }
}

impl HapticSchedulePlugin {
    /// Returns the plugin with another rate.
    #[must_use]
    pub fn with_rate(self, rate: ModelRate) -> Self {
        Self { rate, ..self }
    }

    /// Returns the plugin with another mode.
    #[must_use]
    pub fn with_mode(self, mode: LoopMode) -> Self {
        Self { mode, ..self }
    }

    /// Returns the plugin with its model steps in another schedule of the fixed main loop: [`FixedPreUpdate`], [`FixedUpdate`] or
    /// [`FixedPostUpdate`]. This orders them before or after the app's own fixed systems.
    #[must_use]
    pub fn in_schedule(self, schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern(), ..self }
    }
}

impl Plugin for HapticSchedulePlugin {
    fn build(&self, app: &mut App) {
        add_faults(app);
        // Keeps systems that have already been added to the schedule.
        app.edit_schedule(ModelSchedule, |schedule| {
            schedule.configure_sets(
                (
                    HapticSystems::First,
                    HapticSystems::ReceiveSamples,
                    HapticSystems::StepBodies,
                    HapticSystems::BuildLocalModels,
                    HapticSystems::PublishLocalModels,
                    HapticSystems::Writeback,
                    HapticSystems::Last,
                )
                    .chain(),
            );
        });
        // A model step moves avian's bodies with the tick that has just ended.
        #[cfg(feature = "avian")]
        app.configure_sets(self.schedule, RunModelSteps.after(avian3d::prelude::PhysicsSystems::Last));
        let cost = FrameCost::of(app);
        app.insert_resource(self.rate)
            .insert_resource(self.mode)
            .init_resource::<ModelClock>()
            .init_resource::<ModelStepCount>()
            .init_resource::<StepTimes>()
            .init_resource::<Time<Model>>()
            .register_type::<Time<Model>>()
            .register_type::<ModelRate>()
            .register_type::<LoopMode>()
            .register_type::<ModelStepCount>()
            .add_systems(RunFixedMainLoop, start_frame.in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop))
            .add_systems(self.schedule, cost.timed(run_model_steps).in_set(RunModelSteps))
            .configure_sets(PreUpdate, (HapticUpdateSystems::Bodies, HapticUpdateSystems::Tools).chain())
            .add_systems(
                PreUpdate,
                (report_time_scale, report_rates).chain().before(HapticUpdateSystems::Bodies),
            );
    }
}

fn start_frame(mut clock: ResMut<ModelClock>) {
    clock.start_frame();
}

/// Runs [`ModelSchedule`] when it is due. In lock step every due step runs; with loops on threads at most one in a frame, which reads all
/// samples.
fn run_model_steps(world: &mut World) {
    let (rate, mode) = (*world.resource::<ModelRate>(), *world.resource::<LoopMode>());
    let fixed = world.resource::<Time<Fixed>>();
    let (delta, timestep) = (fixed.delta(), fixed.timestep());
    if mode == LoopMode::Threaded {
        let periods = world.resource_mut::<ModelClock>().take_periods(delta, rate.period());
        if let Some(periods) = periods {
            // Whole periods beyond the limit are dropped.
            let last = world.resource::<StepTimes>().last;
            run_model_step(world, rate.period() * periods.min(max_periods(rate, timestep, last)));
        }
        return;
    }
    world.resource_mut::<ModelClock>().add(delta);
    while world.resource_mut::<ModelClock>().take_period(rate.period()) {
        run_model_step(world, rate.period());
    }
}

/// Runs a model step that simulates `span`.
fn run_model_step(world: &mut World, span: Duration) {
    world.resource_mut::<ModelStepCount>().0 += 1;
    world.resource_mut::<Time<Model>>().advance_by(span);
    let model = world.resource::<Time<Model>>().as_generic();
    let of_app = std::mem::replace(&mut *world.resource_mut::<Time>(), model);
    let ((), cost) = timed(|| world.run_schedule(ModelSchedule));
    *world.resource_mut::<Time>() = of_app;
    world.resource_mut::<StepTimes>().record(cost);
}

/// Reports a model rate above the rate of Bevy's fixed main loop with loops on threads, once for each pair of rates.
fn report_rates(
    rate: Res<ModelRate>,
    mode: Res<LoopMode>,
    fixed: Res<Time<Fixed>>,
    mut last: Local<Option<(ModelRate, Duration)>>,
    mut faults: FaultWriter,
) {
    let rates = (*rate, fixed.timestep());
    let is_limited = *mode == LoopMode::Threaded && rate.period() < fixed.timestep();
    if !is_limited {
        *last = None;
    } else if last.replace(rates) != Some(rates) {
        let (model_hz, fixed_hz) = (1.0 / rate.period_s(), 1.0 / fixed.timestep().as_secs_f64());
        faults.write(None, HapticFaultKind::ModelRateLimited { model_hz, fixed_hz });
    }
}

/// Reports a relative speed of the app's clock other than 1 with loops on threads, which run in real time. Their force fades as in a pause
/// (`tool::settings::apply_settings`).
fn report_time_scale(
    time: Res<Time<Virtual>>,
    mode: Res<LoopMode>,
    mut last: Local<Option<f64>>,
    mut faults: FaultWriter,
) {
    let speed = time.relative_speed_f64();
    if last.replace(speed) != Some(speed) && speed != 1.0 && *mode == LoopMode::Threaded {
        faults.write(None, HapticFaultKind::UnsupportedTimeScale { speed });
    }
}
