//! The model's own schedule, its rate and its clock.

use crate::body::HapticSetupSystems;
use crate::diagnostics::{FrameCost, note_model_step, timed};
use crate::fault::{HapticFault, HapticFaultKind};
use bevy::ecs::schedule::{LogLevel, ScheduleBuildSettings, ScheduleLabel};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use palpate_haptics::HapticsError;
use std::time::Duration;

/// The schedule of a model step: one turn of the ring, at the rate of [`ModelRate`], inside Bevy's fixed main
/// loop (in [`FixedUpdate`]). The app's own `Time<Fixed>` is left as it is.
#[derive(ScheduleLabel, Clone, Debug, PartialEq, Eq, Hash, Default)]
pub struct ModelStep;

/// The sets of [`ModelStep`], in the order of the ring: each runs after the one before.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum HapticSystems {
    /// For users: before anything else in a model step.
    First,
    /// Takes the samples of every tool's loop; in lock step, turns the loops first.
    Receive,
    /// Steps every body along the samples of the tool that touches it.
    StepBody,
    /// Builds a local model for every tool.
    BuildLocalModel,
    /// Hands the local models over to the loops.
    Publish,
    /// Writes meshes, results and messages.
    Writeback,
    /// For users: after everything else in a model step.
    Last,
}

/// What makes the loops tick. A loop has the clock that is set when it starts: choose it with the plugin and leave it.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq, Clone)]
pub enum HapticClock {
    /// Each loop on a thread of its own, at 1 kHz of real time: for use.
    #[default]
    Thread,
    /// No threads: each model step turns every loop by as many ticks as it is long. The same scene gives the
    /// same bits: for tests, and for other speeds than that of real time.
    Lockstep,
}

/// How often the bodies are stepped. With loops on threads not more often than Bevy's fixed main loop runs, 64 times a second unless
/// it is set (`Time::<Fixed>::from_hz`); in lock step always as often as this says.
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
    /// A model step every `ticks` ticks of 1 ms.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] unless 1 to 200.
    pub fn every_ticks(ticks: u32) -> Result<Self, HapticsError> {
        if (1..=MAX_TICKS).contains(&ticks) {
            Ok(Self { ticks })
        } else {
            let (what, allowed) = ("ticks between two model steps", "1 to 200");
            Err(HapticsError::Setting { what, value: f64::from(ticks), allowed })
        }
    }

    /// A model step `hz` times a second.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] unless 1000/hz is a whole number of ticks from 1 to 200: 20, 25, 50, 100 Hz
    /// are such rates.
    pub fn hz(hz: f64) -> Result<Self, HapticsError> {
        let ticks = 1000.0 / hz;
        let whole = (ticks - ticks.round()).abs() < 1e-9 * ticks;
        if whole && (1.0..=f64::from(MAX_TICKS)).contains(&ticks) {
            Ok(Self { ticks: ticks.round() as u32 })
        } else {
            let allowed = "5 to 1000, with a whole number of milliseconds between two steps";
            Err(HapticsError::Setting { what: "model rate, Hz", value: hz, allowed })
        }
    }

    /// Ticks of 1 ms between two model steps.
    #[must_use]
    pub fn ticks(self) -> u32 {
        self.ticks
    }

    /// Time between two model steps, s.
    #[must_use]
    pub fn period_s(self) -> f64 {
        f64::from(self.ticks) * 1e-3
    }

    fn period(self) -> Duration {
        Duration::from_millis(u64::from(self.ticks))
    }
}

/// The longest model step, in ticks: the samples that a body can consume at once.
pub(crate) const MAX_TICKS: u32 = 200;

/// How many model steps have been run.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq, Clone)]
pub struct ModelStepCount(pub u64);

/// Time that has passed in the fixed main loop since the last model step.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub(crate) struct Accumulated(Duration);

/// Adds the schedule [`ModelStep`], its rate and its clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct HapticSchedulePlugin {
    /// How often the bodies are stepped.
    pub rate: ModelRate,
    /// What makes the loops tick. A loop has the clock that is set when it starts: choose it with the plugin and leave it.
    pub clock: HapticClock,
}

/// The time that really passes between two model steps.
#[derive(SystemParam)]
pub(crate) struct ModelPeriod<'w> {
    rate: Res<'w, ModelRate>,
    clock: Res<'w, HapticClock>,
    fixed: Option<Res<'w, Time<Fixed>>>,
}

impl ModelPeriod<'_> {
    /// s.
    pub(crate) fn s(&self) -> f64 {
        let fixed_s = self.fixed.as_ref().map_or(0.0, |fixed| fixed.timestep().as_secs_f64());
        match *self.clock {
            HapticClock::Thread => self.rate.period_s().max(fixed_s),
            HapticClock::Lockstep => self.rate.period_s(),
        }
    }
}

/// How far the app's clock is past the last model step.
#[derive(SystemParam)]
pub(crate) struct ModelOverstep<'w> {
    rate: Option<Res<'w, ModelRate>>,
    accumulated: Option<Res<'w, Accumulated>>,
    fixed: Option<Res<'w, Time<Fixed>>>,
}

impl ModelOverstep<'_> {
    /// As a share of the time between two model steps, 0 to 1.
    pub(crate) fn share(&self) -> f64 {
        let (Some(rate), Some(accumulated)) = (&self.rate, &self.accumulated) else { return 1.0 };
        let since = accumulated.0 + self.fixed.as_ref().map_or(Duration::ZERO, |fixed| fixed.overstep());
        (since.as_secs_f64() / rate.period_s()).min(1.0)
    }
}

impl Plugin for HapticSchedulePlugin {
    fn build(&self, app: &mut App) {
        // A schedule that somebody has added systems to already keeps them.
        app.edit_schedule(ModelStep, |schedule| {
            schedule.set_build_settings(ScheduleBuildSettings {
                ambiguity_detection: LogLevel::Error,
                ..ScheduleBuildSettings::default()
            });
            schedule.configure_sets(
                (
                    HapticSystems::First,
                    HapticSystems::Receive,
                    HapticSystems::StepBody,
                    HapticSystems::BuildLocalModel,
                    HapticSystems::Publish,
                    HapticSystems::Writeback,
                    HapticSystems::Last,
                )
                    .chain(),
            );
        });
        let cost = FrameCost::of(app);
        app.insert_resource(self.rate)
            .insert_resource(self.clock)
            .init_resource::<Accumulated>()
            .init_resource::<ModelStepCount>()
            .register_type::<ModelRate>()
            .register_type::<HapticClock>()
            .register_type::<ModelStepCount>()
            .add_message::<HapticFault>()
            .add_systems(FixedUpdate, cost.timed(run_model_steps))
            .add_systems(PreUpdate, watch_speed.before(HapticSetupSystems::Bodies));
    }
}

/// Runs [`ModelStep`] when it is due. In lock step every due step is run; on threads at most one at a time,
/// because one step consumes all samples there are: a step longer than its period makes the local model older,
/// and the next one longer.
fn run_model_steps(world: &mut World) {
    let (rate, clock) = (*world.resource::<ModelRate>(), *world.resource::<HapticClock>());
    let delta = world.resource::<Time<Fixed>>().delta();
    world.resource_mut::<Accumulated>().0 += delta;
    while world.resource::<Accumulated>().0 >= rate.period() {
        let mut accumulated = world.resource_mut::<Accumulated>();
        accumulated.0 -= rate.period();
        if clock == HapticClock::Thread {
            let periods = (accumulated.0.as_nanos() / rate.period().as_nanos()) as u32;
            accumulated.0 -= rate.period() * periods;
        }
        world.resource_mut::<ModelStepCount>().0 += 1;
        let ((), cost) = timed(|| world.run_schedule(ModelStep));
        note_model_step(world, cost);
    }
}

/// A loop on a thread runs in real time, whatever the speed of the app's clock. At another speed its force is faded
/// as in a pause (`set_loops`).
fn watch_speed(
    time: Res<Time<Virtual>>,
    clock: Res<HapticClock>,
    mut last: Local<Option<f64>>,
    mut faults: MessageWriter<HapticFault>,
) {
    let speed = time.relative_speed_f64();
    if last.replace(speed) != Some(speed) && speed != 1.0 && *clock == HapticClock::Thread {
        faults.write(HapticFault { entity: None, kind: HapticFaultKind::Speed { speed } });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::ecs::system::RunSystemOnce;

    #[test]
    fn on_threads_models_come_no_more_often_than_the_fixed_main_loop() {
        let mut world = World::new();
        world.insert_resource(Time::<Fixed>::from_hz(50.0));
        for (ticks, clock, expected_s) in [
            (5, HapticClock::Thread, 0.02),
            (50, HapticClock::Thread, 0.05),
            (5, HapticClock::Lockstep, 0.005),
        ] {
            world.insert_resource(ModelRate::every_ticks(ticks).unwrap());
            world.insert_resource(clock);
            let period_s = world.run_system_once(|period: ModelPeriod| period.s()).unwrap();
            assert!((period_s - expected_s).abs() < 1e-12, "{period_s}");
        }
    }
}
