//! The time of the model steps: their rate, the mode of the loops, and the clock that decides when a step is due.

use crate::step_times::StepTimes;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use palpate_haptics::HapticsError;
use std::time::Duration;

/// Mode of the loops: on threads or in lock step. A loop keeps the mode in which it was started; set it with
/// [`HapticSchedulePlugin`](crate::HapticSchedulePlugin).
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

    pub(crate) fn period(self) -> Duration {
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
    /// Time of the fixed main loop after the end of the present model step.
    #[cfg_attr(not(feature = "avian"), expect(dead_code, reason = "used with the feature `avian`"))]
    pub(crate) fn ahead(&self) -> Duration {
        self.time
    }

    /// Notes that a frame begins.
    pub(crate) fn start_frame(&mut self) {
        self.has_stepped = false;
    }

    /// In lock step: adds `delta`.
    pub(crate) fn add(&mut self, delta: Duration) {
        self.time += delta;
    }

    /// In lock step: subtracts a period, and returns whether a whole one had passed.
    pub(crate) fn take_period(&mut self, period: Duration) -> bool {
        let is_due = self.time >= period;
        if is_due {
            self.time -= period;
        }
        is_due
    }

    /// With loops on threads: adds `delta`. Returns the number of periods that have passed if a model step is due, at most once in a frame.
    /// A second step in a frame would have no samples and would make a slow frame slower.
    pub(crate) fn take_periods(&mut self, delta: Duration, period: Duration) -> Option<u32> {
        self.time += delta;
        if self.time < period || self.has_stepped {
            return None;
        }
        let periods = (self.time.as_nanos() / period.as_nanos()) as u32;
        self.time -= period * periods;
        self.has_stepped = true;
        Some(periods)
    }
}

/// Context of [`Time<Model>`](Time): the time of the model steps.
///
/// Within [`ModelSchedule`](crate::ModelSchedule), `Res<Time>` is this time: its `delta` is the time that the step simulates. It stands
/// still during a pause, and while an app cannot hold [`ModelRate`] it is slower than real time. Outside of the schedule it is
/// `Res<Time<Model>>`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Debug, Default, PartialEq, Clone)]
pub struct Model;

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

/// Maximum number of periods of a model step with loops on threads, after a step that took `last`: two, to catch up one period after a
/// delay, but one after a slow step, which would otherwise slow the next one. Steps cannot be more frequent than the fixed main loop; with a
/// higher rate a step covers all periods of one of its own steps (`fixed`).
pub(crate) fn max_periods(rate: ModelRate, fixed: Duration, last: Duration) -> u32 {
    let period = rate.period();
    let of_fixed = fixed.as_nanos().div_ceil(period.as_nanos()).max(1) as u32;
    if last > period.max(fixed) { of_fixed } else { 2 * of_fixed }
}

/// Number of ticks in the present model step.
#[derive(SystemParam)]
pub(crate) struct ModelSpan<'w> {
    rate: Res<'w, ModelRate>,
    mode: Res<'w, LoopMode>,
    model: Res<'w, Time<Model>>,
    fixed: Option<Res<'w, Time<Fixed>>>,
    times: Option<Res<'w, StepTimes>>,
}

impl ModelSpan<'_> {
    /// Ticks of a body without samples: the time that the step simulates.
    pub(crate) fn ticks(&self) -> usize {
        self.model.delta().as_millis() as usize
    }

    /// Maximum number of ticks of a body with samples; see [`max_periods`]. Unlimited in lock step.
    pub(crate) fn max_ticks(&self) -> usize {
        if *self.mode == LoopMode::Lockstep {
            return usize::MAX;
        }
        let fixed = self.fixed.as_ref().map_or(Duration::ZERO, |fixed| fixed.timestep());
        let last = self.times.as_ref().map_or(Duration::ZERO, |times| times.last);
        (max_periods(*self.rate, fixed, last) * self.rate.ticks()) as usize
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

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::ecs::system::RunSystemOnce;

    #[test]
    fn threaded_frame_runs_at_most_one_step() {
        let (mut clock, period) = (ModelClock::default(), Duration::from_millis(50));
        let mut frame = |fixed_steps: usize| {
            clock.start_frame();
            let due = |_: usize| clock.take_periods(Duration::from_millis(16), period);
            (0..fixed_steps).filter_map(due).collect::<Vec<_>>()
        };
        let frames = [1, 1, 1, 1, 1, 1, 1].map(&mut frame);
        assert_eq!(frames, [vec![], vec![], vec![], vec![1], vec![], vec![], vec![1]]);
        // A frame of a quarter of a second: one step, and the rest in the next frame.
        assert_eq!([16, 1, 1, 1, 1].map(&mut frame), [vec![1], vec![4], vec![1], vec![], vec![]]);
    }

    #[test]
    fn threaded_step_catches_up_one_period_but_none_after_a_slow_step() {
        let ms = Duration::from_millis;
        let of = |hz: f64, fixed_ms: u64, last_ms: u64| {
            max_periods(ModelRate::from_hz(hz), ms(fixed_ms), ms(last_ms))
        };
        assert_eq!([of(20.0, 16, 10), of(20.0, 16, 60)], [2, 1]);
        // A step covers all periods of a step of the fixed main loop, which may be longer.
        assert_eq!([of(1000.0, 16, 10), of(1000.0, 16, 20)], [32, 16]);
    }

    #[test]
    fn lockstep_does_not_limit_the_ticks_of_a_step() {
        let mut world = World::new();
        world.insert_resource(ModelRate::default());
        world.init_resource::<Time<Model>>();
        let mut max_ticks = |mode: LoopMode| {
            world.insert_resource(mode);
            world.run_system_once(|span: ModelSpan| span.max_ticks()).unwrap()
        };
        assert_eq!([LoopMode::Threaded, LoopMode::Lockstep].map(&mut max_ticks), [100, usize::MAX]);
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
