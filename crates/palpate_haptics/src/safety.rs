//! The safety chain: the last lines before the device. Every force passes it, always in this order.
//!
//! | stage | what it does | why | default |
//! | --- | --- | --- | --- |
//! | finite | a force that is not finite becomes zero | one bad number must not reach a motor | always on |
//! | gains | start-up ramp × fade of a stale model × fade of a silent device × pause | a force appears and disappears slowly, and none outlives what it is based on | 0.5 s ramp; fade over 0.1 s, from 3 model periods or 20 silent ticks on |
//! | magnitude | shortens the force to the smaller of the user's and the device's limit | motors and hands have limits | the device's limit |
//! | slew | growth per tick is bounded (after missed deadlines, for 4 ticks at most), falling is free | a jump of force is a blow, letting go never is | 500 N/s |
//! | finite | as the first | nothing after this line looks at the force again | always on |
//!
//! Between gains and magnitude is the place of the velocity guard and the passivity stage.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::HapticsError;
use crate::error::{check, check_positive};
use glam::DVec3;

/// Limits and times of the safety chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetySettings {
    /// Time from the first sample to full force, s. Zero: the first touch comes at once.
    pub ramp_s: f64,
    /// Model periods after which a local model counts as stale. More: an old force lasts longer.
    pub stale_after_periods: f64,
    /// Ticks in a row without a reading after which the device counts as silent.
    pub silent_after_ticks: u64,
    /// Time in which a force fades to zero once model or device is too old, or on a pause, s.
    pub fade_s: f64,
    /// Largest force, N; the device's own limit applies besides.
    pub max_force_n: f64,
    /// Largest growth of the force, N/s. More: harder contacts feel crisper, and errors hit harder.
    pub max_slew_n_per_s: f64,
}

impl Default for SafetySettings {
    /// The table above; no limit of magnitude but the device's.
    fn default() -> Self {
        Self {
            ramp_s: 0.5,
            stale_after_periods: 3.0,
            silent_after_ticks: 20,
            fade_s: 0.1,
            max_force_n: f64::MAX,
            max_slew_n_per_s: 500.0,
        }
    }
}

impl SafetySettings {
    /// Refuses limits that limit nothing or make no sense.
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn validate(&self) -> Result<(), HapticsError> {
        let at_least_0 = |v: f64| v.is_finite() && v >= 0.0;
        check("start-up ramp, s", self.ramp_s, at_least_0(self.ramp_s), "finite and at least 0")?;
        check("fade, s", self.fade_s, at_least_0(self.fade_s), "finite and at least 0")?;
        let periods = self.stale_after_periods;
        check(
            "model periods before the fade",
            periods,
            periods.is_finite() && periods >= 1.0,
            "finite and at least 1",
        )?;
        check("largest force, N", self.max_force_n, at_least_0(self.max_force_n), "finite and at least 0")?;
        check_positive("largest growth of the force, N/s", self.max_slew_n_per_s)
    }
}

/// What the chain has to know of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SafetyInput {
    /// The force to be made safe, N.
    pub force_n: DVec3,
    /// Age of the local model that made it, in model periods.
    pub model_age_periods: f64,
    /// Ticks in a row without a reading.
    pub silent_ticks: u64,
    /// Whether the app is paused.
    pub paused: bool,
    /// Whether there has been a sample; the start-up ramp waits for it.
    pub sampled: bool,
    /// Ticks since the last call: 1, more where deadlines were missed.
    pub elapsed: u64,
}

/// What each stage did at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SafetyReport {
    /// A force that was not finite came in.
    pub not_finite: bool,
    /// The product of the gains, 0 to 1.
    pub gain: f64,
    /// The local model is stale.
    pub stale: bool,
    /// The device is silent.
    pub silent: bool,
    /// The force was longer than the limit.
    pub magnitude_limited: bool,
    /// The force grew faster than the limit.
    pub slew_limited: bool,
}

impl SafetyReport {
    /// Whether any stage changed the force.
    #[must_use]
    pub fn acted(&self) -> bool {
        self.not_finite || self.gain < 1.0 || self.magnitude_limited || self.slew_limited
    }
}

/// The chain with its memory.
#[derive(Clone, Debug)]
pub struct SafetyChain {
    tick_s: f64,
    device_limit_n: f64,
    ramp: f64,
    model: f64,
    device: f64,
    pause: f64,
    last_n: DVec3,
}

impl SafetyChain {
    /// A chain for ticks of `tick_s` and a device that can show `device_limit_n` (zero for one without motors).
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn new(tick_s: f64, device_limit_n: f64) -> Result<Self, HapticsError> {
        check_positive("tick, s", tick_s)?;
        let ok = device_limit_n.is_finite() && device_limit_n >= 0.0;
        check("largest force of the device, N", device_limit_n, ok, "finite and at least 0")?;
        Ok(Self {
            tick_s,
            device_limit_n,
            ramp: 0.0,
            model: 1.0,
            device: 1.0,
            pause: 1.0,
            last_n: DVec3::ZERO,
        })
    }

    /// The force that may be written, N, and what was done to it.
    pub fn apply(&mut self, settings: &SafetySettings, input: &SafetyInput) -> (DVec3, SafetyReport) {
        let mut report = SafetyReport { not_finite: !input.force_n.is_finite(), ..SafetyReport::default() };
        let mut force = if report.not_finite { DVec3::ZERO } else { input.force_n };

        force *= self.gain(settings, input, &mut report);

        let limit = settings.max_force_n.min(self.device_limit_n).max(0.0);
        let length = force.length();
        if length > limit {
            force *= limit / length;
            report.magnitude_limited = true;
        }

        let growth = settings.max_slew_n_per_s * self.tick_s * gaining(input.elapsed) as f64;
        force = self.limit_growth(force, growth, &mut report);

        if !force.is_finite() {
            (force, report.not_finite) = (DVec3::ZERO, true);
        }
        self.last_n = force;
        (force, report)
    }

    fn gain(&mut self, settings: &SafetySettings, input: &SafetyInput, report: &mut SafetyReport) -> f64 {
        let tick_s = self.tick_s;
        let part = |ticks: u64, duration_s: f64| {
            if duration_s > 0.0 { tick_s * ticks as f64 / duration_s } else { 1.0 }
        };
        let (down_by, up_by) =
            (part(input.elapsed, settings.fade_s), part(gaining(input.elapsed), settings.fade_s));
        if input.sampled {
            self.ramp = (self.ramp + part(gaining(input.elapsed), settings.ramp_s)).min(1.0);
        }
        report.stale = input.model_age_periods > settings.stale_after_periods;
        report.silent = input.silent_ticks > settings.silent_after_ticks;
        for (gain, down) in [
            (&mut self.model, report.stale),
            (&mut self.device, report.silent),
            (&mut self.pause, input.paused),
        ] {
            *gain = if down { (*gain - down_by).max(0.0) } else { (*gain + up_by).min(1.0) };
        }
        report.gain = self.ramp * self.model * self.device * self.pause;
        report.gain
    }

    /// Bounds how much of `force` was not there at the last tick. What was there is the last force's part along
    /// the new direction, so a force that turns round has to grow from zero again.
    fn limit_growth(&self, force: DVec3, growth_n: f64, report: &mut SafetyReport) -> DVec3 {
        let length = force.length();
        if length == 0.0 {
            return force;
        }
        let there = (self.last_n.dot(force) / length).clamp(0.0, length);
        let allowed = there + growth_n;
        if length <= allowed {
            return force;
        }
        report.slew_limited = true;
        force * (allowed / length)
    }
}

/// Ticks for which force may grow after `elapsed` of them: while deadlines were missed the hand felt an old force,
/// and time that it could not follow is no licence for a blow.
fn gaining(elapsed: u64) -> u64 {
    elapsed.clamp(1, 4)
}

#[cfg(test)]
mod tests;
