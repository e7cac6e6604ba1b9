//! The safety chain: the last lines before the device. Every force passes it, always in this order.
//!
//! | stage | what it does | why | default | what is lost by changing it |
//! | --- | --- | --- | --- | --- |
//! | finite | a force that is not finite, or beyond 1e150 N, becomes zero | one bad number must not reach a motor, nor a sum overflow on the way to it | always on | cannot be changed |
//! | start | waits until a local model has spoken of a small force, at the start and after every interruption | a hand that begins in a body, or came back elsewhere, must not be thrown out | 0.5 N | higher: a blow when a loop starts under load |
//! | gains | start-up ramp × fade of a stale model × fade of a silent device × pause | a force appears and disappears slowly, and none outlives what it is based on | 0.5 s ramp; fade over 0.1 s, from 3 model periods or 20 silent ticks on | longer: an old force lasts longer |
//! | velocity guard | fades what pushes a hand that is too fast on its way, to nothing at twice the limit; what brakes it stays | a device that runs away runs because of the force | 2 m/s | higher: a device that runs away does so longer |
//! | passivity | damps while the loop has given the hand more energy than it got since the touch began | a loop that gives energy can be unstable in a loosened grip | up to 5 N s/m, 1 mJ of tolerance | less damping: late schemes buzz and drift; more: they feel sluggish |
//! | magnitude | shortens the force to the smaller of the user's and the device's limit | motors and hands have limits | the device's limit | lower: stiff bodies feel soft where they are pressed hard; higher than the device's: not possible |
//! | slew | growth per tick is bounded by the smaller of the user's and the device's (after missed deadlines, for 4 ticks at most); falling is free | a jump of force is a blow, letting go never is | 500 N/s; for the device its whole force in 20 ms | higher: contacts feel crisper, and errors hit harder |
//! | finite | as the first | nothing after this line looks at the force again | always on | cannot be changed |
//!
//! Growth is counted from what the device shows. A force that it did not take ([`SafetyChain::not_written`]) is not that, nor is
//! any after it was let go beside the loop ([`SafetyChain::released`]).

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod passivity;
mod settings;

pub use settings::SafetySettings;

use crate::error::check_positive;
use crate::{DeviceLimits, HapticsError};
use glam::{DQuat, DVec3};
use passivity::PassivityObserver;

/// What the chain has to know of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SafetyInput {
    /// The force to be made safe, N.
    pub force_n: DVec3,
    /// Whether a local model made it.
    pub has_model: bool,
    /// Age of the local model that made it, in model periods.
    pub model_age_periods: f64,
    /// Ticks in a row without a reading, or in which the device took no force.
    pub silent_ticks: u64,
    /// Whether the app is paused.
    pub paused: bool,
    /// Whether there has been a sample; the start waits for it.
    pub sampled: bool,
    /// Whether the hand came back elsewhere than where it was lost: the start begins anew.
    pub has_jumped: bool,
    /// How far the hand has moved since the last tick, m, in the hand's own size and the force's frame.
    pub moved_m: DVec3,
    /// Its velocity, m/s, likewise.
    pub velocity_m_per_s: DVec3,
    /// Ticks since the last call: 1, more where deadlines were missed.
    pub elapsed: u64,
}

/// What each stage did at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SafetyReport {
    /// A force that was not finite came in.
    pub not_finite: bool,
    /// The start waits for a small force.
    pub waiting: bool,
    /// The product of the gains, 0 to 1.
    pub gain: f64,
    /// The local model is stale.
    pub stale: bool,
    /// The device is silent.
    pub silent: bool,
    /// The hand was too fast to be pushed along.
    pub speed_guarded: bool,
    /// The damping that the passivity stage added, N s/m.
    pub damping_ns_per_m: f64,
    /// What the hand has given since the touch began, minus what it got, J.
    pub observed_energy_j: f64,
    /// The force was longer than the limit.
    pub magnitude_limited: bool,
    /// The force grew faster than the limit.
    pub slew_limited: bool,
    /// The force after each stage; the one written is that after the last.
    pub after: StageForces,
}

/// The force after each stage of a tick, N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageForces {
    /// After start and gains.
    pub gains_n: DVec3,
    /// After the velocity guard.
    pub velocity_guard_n: DVec3,
    /// After the passivity stage.
    pub passivity_n: DVec3,
    /// After the limit of magnitude.
    pub magnitude_n: DVec3,
    /// After that of growth.
    pub slew_n: DVec3,
}

impl SafetyReport {
    /// Whether any stage changed the force.
    #[must_use]
    pub fn acted(&self) -> bool {
        self.not_finite
            || self.gain < 1.0
            || self.speed_guarded
            || self.damping_ns_per_m > 0.0
            || self.magnitude_limited
            || self.slew_limited
    }
}

/// The chain with its memory.
#[derive(Clone, Debug)]
pub struct SafetyChain {
    tick_s: f64,
    device: DeviceLimits,
    has_started: bool,
    ramp: f64,
    model: f64,
    reading: f64,
    pause: f64,
    passivity: PassivityObserver,
    /// The force that the device shows, N, and the one that it showed before.
    last_n: DVec3,
    before_n: DVec3,
}

impl SafetyChain {
    /// A chain for ticks of `tick_s` and a device with limits `device`.
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn new(tick_s: f64, device: DeviceLimits) -> Result<Self, HapticsError> {
        check_positive("tick, s", tick_s)?;
        device.validate()?;
        Ok(Self {
            tick_s,
            device,
            has_started: false,
            ramp: 0.0,
            model: 1.0,
            reading: 1.0,
            pause: 1.0,
            passivity: PassivityObserver::default(),
            last_n: DVec3::ZERO,
            before_n: DVec3::ZERO,
        })
    }

    /// The force that may be written, N, and what was done to it.
    pub fn apply(&mut self, settings: &SafetySettings, input: &SafetyInput) -> (DVec3, SafetyReport) {
        let mut report = SafetyReport { not_finite: !has_length(input.force_n), ..SafetyReport::default() };
        let mut force = if report.not_finite { DVec3::ZERO } else { input.force_n };
        self.passivity.record(self.last_n, input.moved_m, input.elapsed);

        self.start(settings, input, force, &mut report);
        force *= self.gain(settings, input, &mut report);
        report.after.gains_n = force;

        force = guard_speed(settings, input, force, &mut report);
        report.after.velocity_guard_n = force;

        let (tolerance_j, most) = (settings.passivity_tolerance_j, settings.passivity_damping_ns_per_m);
        report.observed_energy_j = self.passivity.observed_energy_j();
        // Along the force only, so that its direction stays and no surface comes to pull.
        if let Some(along) = force.try_normalize() {
            let speed = input.velocity_m_per_s.dot(along);
            let damping = self.passivity.damping(speed, self.tick_s, tolerance_j, most);
            if damping > 0.0 {
                report.damping_ns_per_m = damping;
                force = (force.length() - damping * speed).max(0.0) * along;
            }
        }
        report.after.passivity_n = force;

        let limit = settings.max_force_n.min(self.device.force_n).max(0.0);
        let length = force.length();
        if length > limit {
            force *= limit / length;
            report.magnitude_limited = true;
        }
        report.after.magnitude_n = force;

        let slew = settings.max_slew_n_per_s.min(self.device.slew_n_per_s);
        force = self.limit_growth(force, slew * self.tick_s * gaining(input.elapsed) as f64, &mut report);

        if !has_length(force) {
            (force, report.not_finite) = (DVec3::ZERO, true);
        }
        report.after.slew_n = force;
        (self.before_n, self.last_n) = (self.last_n, force);
        (force, report)
    }

    /// The device did not take the last force: it goes on with the one before.
    pub fn write_failed(&mut self) {
        self.last_n = self.before_n;
    }

    /// The frame of forces has turned, and what the device shows with it: what was `force` is `by * force` now.
    pub fn rotate_frame(&mut self, by: DQuat) {
        (self.before_n, self.last_n) = (by * self.before_n, by * self.last_n);
    }

    /// The device shows no force any more, whatever was written: it was stopped beside the loop, or opened anew.
    pub fn reset_output(&mut self) {
        (self.before_n, self.last_n) = (DVec3::ZERO, DVec3::ZERO);
    }

    /// Waits for a small force, at the start and anew where the hand was lost.
    fn start(
        &mut self,
        settings: &SafetySettings,
        input: &SafetyInput,
        force: DVec3,
        report: &mut SafetyReport,
    ) {
        // What has faded out altogether begins again like the first time.
        if input.has_jumped || self.reading == 0.0 {
            (self.has_started, self.ramp) = (false, 0.0);
        }
        let is_small = force.length() <= settings.arm_below_n;
        self.has_started |= input.sampled && input.has_model && is_small;
        report.waiting = !self.has_started;
    }

    fn gain(&mut self, settings: &SafetySettings, input: &SafetyInput, report: &mut SafetyReport) -> f64 {
        let tick_s = self.tick_s;
        let part = |ticks: u64, duration_s: f64| {
            if duration_s > 0.0 { tick_s * ticks as f64 / duration_s } else { 1.0 }
        };
        let (down_by, up_by) =
            (part(input.elapsed, settings.fade_s), part(gaining(input.elapsed), settings.fade_s));
        if self.has_started {
            self.ramp = (self.ramp + part(gaining(input.elapsed), settings.ramp_s)).min(1.0);
        }
        report.stale = input.model_age_periods > settings.stale_after_periods;
        report.silent = input.silent_ticks > settings.device_timeout_ticks;
        for (gain, down) in [
            (&mut self.model, report.stale),
            (&mut self.reading, report.silent),
            (&mut self.pause, input.paused),
        ] {
            *gain = if down { (*gain - down_by).max(0.0) } else { (*gain + up_by).min(1.0) };
        }
        report.gain = self.ramp * self.model * self.reading * self.pause;
        report.gain
    }

    /// Bounds how much of `force` was not there at the last tick. What was there is the last force's part along
    /// the new direction, so a force that turns round has to grow from zero again.
    fn limit_growth(&self, force: DVec3, growth_n: f64, report: &mut SafetyReport) -> DVec3 {
        let length = force.length();
        if length == 0.0 {
            return force;
        }
        // Not `clamp`, which panics where a bound is not a number.
        let there = (self.last_n.dot(force) / length).max(0.0).min(length);
        let allowed = there + growth_n;
        if length <= allowed {
            return force;
        }
        report.slew_limited = true;
        force * (allowed / length)
    }
}

/// Fades what pushes a hand along that is too fast already.
fn guard_speed(
    settings: &SafetySettings,
    input: &SafetyInput,
    force: DVec3,
    report: &mut SafetyReport,
) -> DVec3 {
    if !has_length(input.velocity_m_per_s) {
        // Which way it goes nobody knows.
        report.speed_guarded = true;
        return DVec3::ZERO;
    }
    let speed = input.velocity_m_per_s.length();
    let Some(along) = input.velocity_m_per_s.try_normalize() else { return force };
    let pushes = force.dot(along);
    if speed <= settings.max_speed_m_per_s || pushes <= 0.0 {
        return force;
    }
    report.speed_guarded = true;
    let kept = (2.0 - speed / settings.max_speed_m_per_s).max(0.0);
    force - (1.0 - kept) * pushes * along
}

/// Whether `vector` is finite, and so are its length and its products with its like.
fn has_length(vector: DVec3) -> bool {
    // Not a number is not at most anything.
    vector.to_array().iter().all(|c| c.abs() <= 1e150)
}

/// Ticks for which force may grow after `elapsed` of them: while deadlines were missed the hand felt an old force,
/// and time that it could not follow is no licence for a blow.
fn gaining(elapsed: u64) -> u64 {
    elapsed.clamp(1, 4)
}

#[cfg(test)]
mod tests;
