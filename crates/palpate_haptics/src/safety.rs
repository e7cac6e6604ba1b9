//! The safety chain: the last computation before the device. Every force passes all stages, in this order.
//!
//! 1. **Finite.** Replaces a force that is not finite, or beyond 1e150 N, by zero: invalid numbers must not reach a motor, and later
//!    sums must not overflow. Always on.
//! 2. **Start.** Holds zero force until a local model renders a small force, at the start and after every interruption: a hand that
//!    starts inside a body, or reappears elsewhere, must not be thrown out. Default 0.5 N; with a higher value a loop that starts under
//!    load may strike a blow.
//! 3. **Gains.** Start-up ramp × fade of a stale model × fade of a silent device × fade of a pause: forces appear and disappear slowly,
//!    and none outlives its basis. Default ramp 0.5 s; fade 0.1 s, from 3 model periods or 20 silent ticks on. With longer times an old
//!    force lasts longer.
//! 4. **Velocity guard.** Fades the component that accelerates a hand above the speed limit, to zero at twice the limit; braking forces
//!    stay. It stops a device that runs away under its own force. Default 2 m/s; with a higher value the device runs away for longer.
//! 5. **Passivity.** Adds damping along the force while the loop has given the hand more energy than it received since the touch began
//!    (Hannaford and Ryu 2002): an active loop can become unstable in a loose grip (Colgate and Schenkel 1997). Default up to 5 N s/m,
//!    tolerance 1 mJ. With less damping, schemes with delay buzz and drift; with more, they feel sluggish.
//! 6. **Magnitude.** Shortens the force to the smaller of the user's and the device's limit. Default: the device's limit. With a lower
//!    value stiff bodies feel soft under high load.
//! 7. **Slew.** Limits the growth per tick to the smaller of the user's and the device's limit, after missed deadlines for at most
//!    4 ticks; the decrease is unlimited. A jump in force is a blow, a release is not. Default 500 N/s; for the device its whole force in
//!    20 ms. With a higher value contacts feel crisper, and errors hit harder.
//! 8. **Finite.** As the first stage, because no later code checks the force. Always on.
//!
//! Growth counts from the force that the device currently applies. A force that it rejected ([`SafetyChain::write_failed`]) does
//! not count, nor does any force before an emergency stop or reopening ([`SafetyChain::reset_output`]).
//!
//! Sources: B. Hannaford, J.-H. Ryu, Time-domain passivity control of haptic interfaces, IEEE Trans. Robot. Autom. 18 (2002) 1–10;
//! J. E. Colgate, G. G. Schenkel, Passivity of a class of sampled-data systems, J. Robotic Systems 14 (1997) 37–47.

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

/// Input of the safety chain at one tick. Force, displacement and velocity are in the scene's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SafetyInput {
    /// Rendered force and external force, N.
    pub force_n: DVec3,
    /// The external part of it, N. The start stage ramps it up without waiting for it to be small.
    pub external_n: DVec3,
    /// Whether a local model rendered the force.
    pub has_model: bool,
    /// Age of that local model, in model periods.
    pub model_age_periods: f64,
    /// Consecutive ticks without a reading, or with a failed write.
    pub silent_ticks: u64,
    /// Whether the app is paused.
    pub paused: bool,
    /// Whether there is a sample; the start stage waits for one.
    pub sampled: bool,
    /// Whether to arm the start stage again, because the hand's path was not observed or the device was stopped.
    pub has_jumped: bool,
    /// Displacement of the hand since the last tick, m, in the hand's own scale.
    pub moved_m: DVec3,
    /// Velocity of the hand, m/s, in the hand's own scale.
    pub velocity_m_per_s: DVec3,
    /// Ticks since the last call: 1 plus the number of missed deadlines.
    pub elapsed: u64,
}

/// Actions of each stage at one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SafetyReport {
    /// Whether the force was not finite.
    pub not_finite: bool,
    /// Whether the start stage waits for a small force.
    pub waiting: bool,
    /// Product of the gains, 0 to 1.
    pub gain: f64,
    /// Whether the local model is stale.
    pub stale: bool,
    /// Whether the device timeout has passed.
    pub silent: bool,
    /// Whether the velocity guard reduced the force.
    pub speed_guarded: bool,
    /// Damping added by the passivity stage, N s/m.
    pub damping_ns_per_m: f64,
    /// Energy received from the hand minus energy given to it since the touch began, J.
    pub observed_energy_j: f64,
    /// Whether the magnitude limit reduced the force.
    pub magnitude_limited: bool,
    /// Whether the growth limit reduced the force.
    pub slew_limited: bool,
    /// Force after each stage; the last one is written.
    pub after: StageForces,
}

/// Force after each stage of a tick, N, scene frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageForces {
    /// Force after start and gains, N.
    pub gains_n: DVec3,
    /// Force after the velocity guard, N.
    pub velocity_guard_n: DVec3,
    /// Force after the passivity stage, N.
    pub passivity_n: DVec3,
    /// Force after the magnitude limit, N.
    pub magnitude_n: DVec3,
    /// Force after the growth limit, N.
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

/// The safety chain with its state.
#[derive(Clone, Debug)]
pub struct SafetyChain {
    tick_s: f64,
    device: DeviceLimits,
    has_started: bool,
    ramp_gain: f64,
    model_gain: f64,
    reading_gain: f64,
    pause_gain: f64,
    passivity: PassivityObserver,
    /// Last force, which the device applies unless writing it failed, N.
    last_n: DVec3,
    /// Force before the last, N.
    previous_n: DVec3,
}

impl SafetyChain {
    /// A chain for ticks of `tick_s`, s, and a device with limits `device`.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for a value out of range.
    pub fn new(tick_s: f64, device: DeviceLimits) -> Result<Self, HapticsError> {
        check_positive("tick, s", tick_s)?;
        device.validate()?;
        Ok(Self {
            tick_s,
            device,
            has_started: false,
            ramp_gain: 0.0,
            model_gain: 1.0,
            reading_gain: 1.0,
            pause_gain: 1.0,
            passivity: PassivityObserver::default(),
            last_n: DVec3::ZERO,
            previous_n: DVec3::ZERO,
        })
    }

    /// Returns the force to be written, N, scene frame, and the actions of the stages.
    pub fn apply(&mut self, settings: &SafetySettings, input: &SafetyInput) -> (DVec3, SafetyReport) {
        let mut report = SafetyReport { not_finite: !has_length(input.force_n), ..SafetyReport::default() };
        let mut force = if report.not_finite { DVec3::ZERO } else { input.force_n };
        self.passivity.record(self.last_n, input.moved_m, input.elapsed);

        self.start(settings, input, force, &mut report);
        force *= self.gain(settings, input, &mut report);
        report.after.gains_n = force;

        force = guard_speed(settings, input, force, &mut report);
        report.after.velocity_guard_n = force;

        let (tolerance_j, max_damping) =
            (settings.passivity_tolerance_j, settings.passivity_damping_ns_per_m);
        report.observed_energy_j = self.passivity.observed_energy_j();
        // Only along the force: its direction stays, and a surface never pulls.
        if let Some(along) = force.try_normalize() {
            let speed = input.velocity_m_per_s.dot(along);
            let damping = self.passivity.damping(speed, self.tick_s, tolerance_j, max_damping);
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
        force =
            self.limit_growth(force, slew * self.tick_s * growth_ticks(input.elapsed) as f64, &mut report);

        if !has_length(force) {
            (force, report.not_finite) = (DVec3::ZERO, true);
        }
        report.after.slew_n = force;
        (self.previous_n, self.last_n) = (self.last_n, force);
        (force, report)
    }

    /// Notes that writing the last force failed: the device keeps the previous one.
    pub fn write_failed(&mut self) {
        self.last_n = self.previous_n;
    }

    /// Notes a rotation of the scene's frame: the force at the device, formerly `force`, is now `rotation * force`.
    pub fn rotate_frame(&mut self, rotation: DQuat) {
        (self.previous_n, self.last_n) = (rotation * self.previous_n, rotation * self.last_n);
    }

    /// Notes that the device is at zero force, because it was stopped by the watchdog or opened again.
    pub fn reset_output(&mut self) {
        (self.previous_n, self.last_n) = (DVec3::ZERO, DVec3::ZERO);
    }

    /// The start stage: waits for a small force, at the start and after an interruption.
    fn start(
        &mut self,
        settings: &SafetySettings,
        input: &SafetyInput,
        force: DVec3,
        report: &mut SafetyReport,
    ) {
        // A force that has faded out completely starts as at the beginning.
        if input.has_jumped || self.reading_gain == 0.0 {
            (self.has_started, self.ramp_gain) = (false, 0.0);
        }
        let is_small = (force - input.external_n).length() <= settings.arm_below_n;
        self.has_started |= input.sampled && input.has_model && is_small;
        report.waiting = !self.has_started;
    }

    fn gain(&mut self, settings: &SafetySettings, input: &SafetyInput, report: &mut SafetyReport) -> f64 {
        let tick_s = self.tick_s;
        let fraction = |ticks: u64, duration_s: f64| {
            if duration_s > 0.0 { tick_s * ticks as f64 / duration_s } else { 1.0 }
        };
        let (down_by, up_by) = (
            fraction(input.elapsed, settings.fade_s),
            fraction(growth_ticks(input.elapsed), settings.fade_s),
        );
        if self.has_started {
            self.ramp_gain =
                (self.ramp_gain + fraction(growth_ticks(input.elapsed), settings.ramp_s)).min(1.0);
        }
        report.stale = input.model_age_periods > settings.stale_after_periods;
        report.silent = input.silent_ticks > settings.device_timeout_ticks;
        for (gain, fades_out) in [
            (&mut self.model_gain, report.stale),
            (&mut self.reading_gain, report.silent),
            (&mut self.pause_gain, input.paused),
        ] {
            *gain = if fades_out { (*gain - down_by).max(0.0) } else { (*gain + up_by).min(1.0) };
        }
        report.gain = self.ramp_gain * self.model_gain * self.reading_gain * self.pause_gain;
        report.gain
    }

    /// Limits the growth of `force` relative to the last force's component along it. A force that reverses its direction grows from
    /// zero.
    fn limit_growth(&self, force: DVec3, growth_n: f64, report: &mut SafetyReport) -> DVec3 {
        let length = force.length();
        if length == 0.0 {
            return force;
        }
        // Not `clamp`, which panics for a bound that is NaN.
        let present_n = (self.last_n.dot(force) / length).max(0.0).min(length);
        let allowed = present_n + growth_n;
        if length <= allowed {
            return force;
        }
        report.slew_limited = true;
        force * (allowed / length)
    }
}

/// The velocity guard: fades the component of `force` that accelerates a hand above the speed limit.
fn guard_speed(
    settings: &SafetySettings,
    input: &SafetyInput,
    force: DVec3,
    report: &mut SafetyReport,
) -> DVec3 {
    if !has_length(input.velocity_m_per_s) {
        // The direction of motion is undefined.
        report.speed_guarded = true;
        return DVec3::ZERO;
    }
    let speed = input.velocity_m_per_s.length();
    let Some(along) = input.velocity_m_per_s.try_normalize() else { return force };
    let accelerating_n = force.dot(along);
    if speed <= settings.max_speed_m_per_s || accelerating_n <= 0.0 {
        return force;
    }
    report.speed_guarded = true;
    let kept = (2.0 - speed / settings.max_speed_m_per_s).max(0.0);
    force - (1.0 - kept) * accelerating_n * along
}

/// Whether `vector`, its length and its products with similar vectors are finite.
fn has_length(vector: DVec3) -> bool {
    // The comparison is false for NaN.
    vector.to_array().iter().all(|c| c.abs() <= 1e150)
}

/// Number of ticks for which the force may grow after `elapsed` ticks. While deadlines were missed the device applied an old force,
/// and that time must not allow a large step.
fn growth_ticks(elapsed: u64) -> u64 {
    elapsed.clamp(1, 4)
}

#[cfg(test)]
mod tests;
