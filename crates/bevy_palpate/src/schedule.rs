//! The schedule of the model steps, its rate and the mode of the loops.

use crate::cost::{FrameCost, timed};
use crate::fault::{FaultWriter, HapticFaultKind, add_faults};
use crate::step_times::StepTimes;
use bevy::app::{RunFixedMainLoop, RunFixedMainLoopSystems};
use bevy::ecs::schedule::{InternedScheduleLabel, LogLevel, ScheduleBuildSettings, ScheduleLabel};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use palpate_haptics::HapticsError;
use std::time::Duration;

/// The schedule of a model step: reads samples, steps the bodies, builds and publishes the local models. Runs at [`ModelRate`] within
/// Bevy's fixed main loop, by default in [`FixedUpdate`] ([`HapticSchedulePlugin::in_schedule`]). The app's `Time<Fixed>` is not changed.
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

/// Mode of the loops: on threads or in lock step. A loop keeps the mode in which it was started; set it with [`HapticSchedulePlugin`].
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq, Clone)]
pub enum LoopMode {
    /// Each loop runs on a thread of its own, at 1 kHz of real time.
    #[default]
    Threaded,
    /// Each model step runs every loop by its own number of ticks, without threads. The same scene gives the same bits. For tests, and for
    /// speeds other than real time.
    Lockstep,
}

/// Rate of the model steps. With loops on threads, steps run at most once in a frame and at most as often as Bevy's fixed main loop, 64 Hz
/// unless set (`Time::<Fixed>::from_hz`). In lock step every due step runs.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Debug, Default, PartialEq, Clone)]
pub struct ModelRate {
    ticks: u32,
}

impl Default for ModelRate {
    /// 20 Hz.
    fn default() -> Self {
        Self { ticks: 50 }
    }
}

impl ModelRate {
    /// Returns the rate of a model step every `ticks` ticks of 1 ms.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] unless `ticks` is 1 to 200.
    pub fn every_ticks(ticks: u32) -> Result<Self, HapticsError> {
        if (1..=MAX_TICKS).contains(&ticks) {
            Ok(Self { ticks })
        } else {
            let (what, allowed) = ("ticks between two model steps", "1 to 200");
            Err(HapticsError::Setting { what, value: f64::from(ticks), allowed })
        }
    }

    /// Returns the rate of `hz` model steps per second.
    ///
    /// # Panics
    /// If [`Self::try_from_hz`] returns an error.
    #[must_use]
    pub fn from_hz(hz: f64) -> Self {
        Self::try_from_hz(hz).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Returns the rate of `hz` model steps per second.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] unless 1000 / `hz` is a whole number of ticks from 1 to 200, for example at 20, 25, 50 or 100 Hz.
    pub fn try_from_hz(hz: f64) -> Result<Self, HapticsError> {
        let ticks = 1000.0 / hz;
        let whole = (ticks - ticks.round()).abs() < 1e-9 * ticks;
        if whole && (1.0..=f64::from(MAX_TICKS)).contains(&ticks) {
            Ok(Self { ticks: ticks.round() as u32 })
        } else {
            let allowed = "5 to 1000, with a whole number of milliseconds between two steps";
            Err(HapticsError::Setting { what: "model rate, Hz", value: hz, allowed })
        }
    }

    /// Returns the number of ticks of 1 ms between two model steps.
    #[must_use]
    pub fn ticks(self) -> u32 {
        self.ticks
    }

    /// Returns the time between two model steps, s.
    #[must_use]
    pub fn period_s(self) -> f64 {
        f64::from(self.ticks) * 1e-3
    }

    fn period(self) -> Duration {
        Duration::from_millis(u64::from(self.ticks))
    }
}

/// Maximum time between two model steps, ticks.
pub(crate) const MAX_TICKS: u32 = 200;

/// Number of model steps that have run.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq, Clone)]
pub struct ModelStepCount(pub u64);

/// Time of the fixed main loop since the last model step.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub(crate) struct ModelClock {
    time: Duration,
    /// Whether a model step has run in this frame.
    has_stepped: bool,
}

impl ModelClock {
    /// Adds `delta` with loops on threads; returns whether a model step is due, at most once in a frame. A second step in a frame would
    /// have no samples and would make a slow frame slower. Whole periods beyond the first are dropped.
    fn is_due(&mut self, delta: Duration, period: Duration) -> bool {
        self.time += delta;
        let is_due = self.time >= period && !self.has_stepped;
        if is_due {
            let periods = (self.time.as_nanos() / period.as_nanos()) as u32;
            self.time -= period * periods;
            self.has_stepped = true;
        }
        is_due
    }
}

/// Adds the schedule [`ModelSchedule`] and the resources [`ModelRate`], [`LoopMode`] and [`ModelStepCount`].
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{HapticSchedulePlugin, ModelRate, prelude::*};
/// # let mut app = App::new();
/// let schedule = HapticSchedulePlugin::default().with_rate(ModelRate::from_hz(25.0)).in_schedule(FixedPostUpdate);
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
    /// 20 Hz, loops on threads, in [`FixedUpdate`].
    fn default() -> Self {
        Self { rate: ModelRate::default(), mode: LoopMode::default(), schedule: FixedUpdate.intern() }
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

/// Actual time between two model steps.
#[derive(SystemParam)]
pub(crate) struct ModelPeriod<'w> {
    rate: Res<'w, ModelRate>,
    mode: Res<'w, LoopMode>,
    fixed: Option<Res<'w, Time<Fixed>>>,
}

impl ModelPeriod<'_> {
    /// The time, s.
    pub(crate) fn s(&self) -> f64 {
        let fixed_s = self.fixed.as_ref().map_or(0.0, |fixed| fixed.timestep().as_secs_f64());
        match *self.mode {
            LoopMode::Threaded => self.rate.period_s().max(fixed_s),
            LoopMode::Lockstep => self.rate.period_s(),
        }
    }
}

/// Number of ticks in a model step.
#[derive(SystemParam)]
pub(crate) struct ModelSpan<'w> {
    rate: Res<'w, ModelRate>,
    mode: Res<'w, LoopMode>,
    times: Option<Res<'w, StepTimes>>,
}

impl ModelSpan<'_> {
    /// Ticks of a step without delay.
    pub(crate) fn ticks(&self) -> usize {
        self.rate.ticks() as usize
    }

    /// Maximum number of ticks of a step. With loops on threads it is two periods, to catch up one period after a delay, but one period
    /// after a slow step, which would otherwise slow the next one. Unlimited in lock step.
    pub(crate) fn max_ticks(&self) -> usize {
        let was_slow = self.times.as_ref().is_some_and(|times| times.last > self.rate.period());
        match (*self.mode, was_slow) {
            (LoopMode::Lockstep, _) => usize::MAX,
            (LoopMode::Threaded, false) => 2 * self.ticks(),
            (LoopMode::Threaded, true) => self.ticks(),
        }
    }
}

/// Time of the app since the last model step.
#[derive(SystemParam)]
pub(crate) struct ModelOverstep<'w> {
    rate: Option<Res<'w, ModelRate>>,
    accumulated: Option<Res<'w, ModelClock>>,
    fixed: Option<Res<'w, Time<Fixed>>>,
}

impl ModelOverstep<'_> {
    /// The time as a share of the time between two model steps, 0 to 1.
    pub(crate) fn share(&self) -> f64 {
        let (Some(rate), Some(accumulated)) = (&self.rate, &self.accumulated) else { return 1.0 };
        let since = accumulated.time + self.fixed.as_ref().map_or(Duration::ZERO, |fixed| fixed.overstep());
        (since.as_secs_f64() / rate.period_s()).min(1.0)
    }
}

impl Plugin for HapticSchedulePlugin {
    fn build(&self, app: &mut App) {
        add_faults(app);
        // Keeps systems that have already been added to the schedule.
        app.edit_schedule(ModelSchedule, |schedule| {
            schedule.set_build_settings(ScheduleBuildSettings {
                ambiguity_detection: LogLevel::Error,
                ..ScheduleBuildSettings::default()
            });
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
        let cost = FrameCost::of(app);
        app.insert_resource(self.rate)
            .insert_resource(self.mode)
            .init_resource::<ModelClock>()
            .init_resource::<ModelStepCount>()
            .init_resource::<StepTimes>()
            .register_type::<ModelRate>()
            .register_type::<LoopMode>()
            .register_type::<ModelStepCount>()
            .add_systems(RunFixedMainLoop, start_frame.in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop))
            .add_systems(self.schedule, cost.timed(run_model_steps))
            .configure_sets(PreUpdate, (HapticUpdateSystems::Bodies, HapticUpdateSystems::Tools).chain())
            .add_systems(PreUpdate, report_time_scale.before(HapticUpdateSystems::Bodies));
    }
}

fn start_frame(mut accumulated: ResMut<ModelClock>) {
    accumulated.has_stepped = false;
}

/// Runs [`ModelSchedule`] when it is due. In lock step every due step runs; with loops on threads at most one in a frame, which reads all
/// samples.
fn run_model_steps(world: &mut World) {
    let (rate, mode) = (*world.resource::<ModelRate>(), *world.resource::<LoopMode>());
    let delta = world.resource::<Time<Fixed>>().delta();
    if mode == LoopMode::Threaded {
        if world.resource_mut::<ModelClock>().is_due(delta, rate.period()) {
            run_model_step(world);
        }
        return;
    }
    world.resource_mut::<ModelClock>().time += delta;
    while world.resource::<ModelClock>().time >= rate.period() {
        world.resource_mut::<ModelClock>().time -= rate.period();
        run_model_step(world);
    }
}

fn run_model_step(world: &mut World) {
    world.resource_mut::<ModelStepCount>().0 += 1;
    let ((), cost) = timed(|| world.run_schedule(ModelSchedule));
    world.resource_mut::<StepTimes>().record(cost);
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

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::ecs::system::RunSystemOnce;

    #[test]
    fn threaded_frame_runs_at_most_one_step() {
        let (mut accumulated, period) = (ModelClock::default(), Duration::from_millis(50));
        let mut frame = |fixed_steps: usize| {
            accumulated.has_stepped = false;
            let due = |_: &usize| accumulated.is_due(Duration::from_millis(16), period);
            (0..fixed_steps).filter(due).count()
        };
        assert_eq!([1, 1, 1, 1, 1, 1, 1].map(&mut frame), [0, 0, 0, 1, 0, 0, 1]);
        // A frame of a quarter of a second: one step, and another in the next frame.
        assert_eq!([16, 1, 1, 1, 1].map(&mut frame), [1, 1, 1, 0, 0]);
    }

    #[test]
    fn threaded_step_catches_up_one_period_but_none_after_a_slow_step() {
        let mut world = World::new();
        world.insert_resource(ModelRate::default());
        let mut max_ticks = |mode: LoopMode, last_ms: u64| {
            world.insert_resource(mode);
            world.init_resource::<StepTimes>();
            world.resource_mut::<StepTimes>().record(Duration::from_millis(last_ms));
            world.run_system_once(|span: ModelSpan| span.max_ticks()).unwrap()
        };
        assert_eq!(max_ticks(LoopMode::Threaded, 10), 100);
        assert_eq!(max_ticks(LoopMode::Threaded, 60), 50);
        assert_eq!([10, 60].map(|ms| max_ticks(LoopMode::Lockstep, ms)), [usize::MAX; 2]);
    }

    #[test]
    fn threaded_period_is_at_least_that_of_the_fixed_main_loop() {
        let mut world = World::new();
        world.insert_resource(Time::<Fixed>::from_hz(50.0));
        for (ticks, mode, expected_s) in
            [(5, LoopMode::Threaded, 0.02), (50, LoopMode::Threaded, 0.05), (5, LoopMode::Lockstep, 0.005)]
        {
            world.insert_resource(ModelRate::every_ticks(ticks).unwrap());
            world.insert_resource(mode);
            let period_s = world.run_system_once(|period: ModelPeriod| period.s()).unwrap();
            assert!((period_s - expected_s).abs() < 1e-12, "{period_s}");
        }
    }
}
