//! A device whose hand follows a place that an app sets at its own pace, for a mouse for instance.

use super::{DeviceDescription, DeviceError, HapticDevice, Reading};
use crate::HapticsError;
use crate::error::{check, check_positive};
use glam::DVec3;
use std::time::Duration;
use triple_buffer::{Input, Output, triple_buffer};

/// How a hand follows.
///
/// It is a mass on a critically damped spring, so that it goes without steps in position and velocity wherever the place
/// jumps, and is pushed back by the force that is written: x'' = ω² (place − x) − 2ω x' + F/m, no faster than a largest speed.
/// So it lags behind an even motion by 2/ω, and rests F/(m ω²) beside a place at which it is pushed with F.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowerSettings {
    /// Where it is when the device is opened, m.
    pub start_m: DVec3,
    /// Corners of the box that it never leaves, m.
    pub workspace_m: [DVec3; 2],
    /// ω, 1/s. A picture comes every 1/60 s: well below 60 its steps are not felt.
    pub rate_per_s: f64,
    /// m, kg.
    pub mass_kg: f64,
    /// Its largest speed, m/s.
    pub max_speed_m_per_s: f64,
    /// The largest force that it is to be shown, N.
    pub max_force_n: f64,
}

impl Default for FollowerSettings {
    /// In the middle of a box of 40 cm; 40 s⁻¹ and 0.2 kg, so 320 N/m and 50 ms behind; 0.5 m/s; 10 N.
    fn default() -> Self {
        Self {
            start_m: DVec3::ZERO,
            workspace_m: [DVec3::splat(-0.2), DVec3::splat(0.2)],
            rate_per_s: 40.0,
            mass_kg: 0.2,
            max_speed_m_per_s: 0.5,
            max_force_n: 10.0,
        }
    }
}

/// The place that a [`FollowingDevice`] follows: the app's end. Setting it never makes the loop wait.
#[derive(Debug)]
pub struct FollowerTarget(Input<Followed>);

/// A hand without hardware that follows a [`FollowedPlace`]. Reading it neither blocks nor allocates.
#[derive(Debug)]
pub struct FollowerDevice {
    hand: FollowerSettings,
    place: Output<Followed>,
    /// e^(−ω T).
    decay: f64,
    open: bool,
    position_m: DVec3,
    velocity_m_per_s: DVec3,
    force_n: DVec3,
}

#[derive(Clone, Copy, Debug)]
struct Followed {
    place_m: DVec3,
    buttons: u32,
}

/// Time from one reading to the next, s: that of a tick.
const TICK_S: f64 = 1e-3;

impl FollowerSettings {
    /// The two ends: the place goes with the app, the device to the loop.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] when a number makes no sense.
    pub fn follow(self) -> Result<(FollowerTarget, FollowerDevice), HapticsError> {
        let [low, high] = self.workspace_m;
        let size = (high - low).min_element();
        let ok = low.is_finite() && high.is_finite() && size >= 0.0;
        check("smallest side of a hand's workspace, m", size, ok, "finite and at least 0")?;
        let start = self.start_m;
        check("start of a hand, m", start.abs().max_element(), start.is_finite(), "finite")?;
        let rate = self.rate_per_s;
        check("rate at which a hand follows, 1/s", rate, (1.0..=500.0).contains(&rate), "1 to 500")?;
        check_positive("mass of a hand, kg", self.mass_kg)?;
        check_positive("largest speed of a hand, m/s", self.max_speed_m_per_s)?;
        let force = self.max_force_n;
        check(
            "largest force on a hand, N",
            force,
            force.is_finite() && force >= 0.0,
            "finite and at least 0",
        )?;
        let start_m = start.clamp(low, high);
        let (input, output) = triple_buffer(&Followed { place_m: start_m, buttons: 0 });
        let device = FollowerDevice {
            hand: self,
            place: output,
            decay: (-rate * TICK_S).exp(),
            open: false,
            position_m: start_m,
            velocity_m_per_s: DVec3::ZERO,
            force_n: DVec3::ZERO,
        };
        Ok((FollowerTarget(input), device))
    }
}

impl FollowerTarget {
    /// The hand is to go to `place_m`, in the device's frame, and bit i of `buttons` says whether button i is pressed. What is
    /// outside of the workspace, or not finite, is taken back into it or ignored.
    pub fn set(&mut self, place_m: DVec3, buttons: u32) {
        self.0.write(Followed { place_m, buttons });
    }
}

impl FollowerDevice {
    /// One tick, exactly as the spring has it while place and force stay what they are; the largest speed and the walls of the
    /// workspace then take their part.
    fn follow(&mut self) -> u32 {
        let Followed { place_m, buttons } = *self.place.read();
        let FollowerSettings { workspace_m: [low, high], rate_per_s, mass_kg, max_speed_m_per_s, .. } =
            self.hand;
        let place_m = if place_m.is_finite() { place_m.clamp(low, high) } else { self.position_m };
        let rest_m = place_m + self.force_n / (mass_kg * rate_per_s * rate_per_s);
        let apart_m = self.position_m - rest_m;
        let drift_m = TICK_S * (self.velocity_m_per_s + rate_per_s * apart_m);
        let way_m = rest_m + (apart_m + drift_m) * self.decay - self.position_m;
        self.velocity_m_per_s = (self.velocity_m_per_s - rate_per_s * drift_m) * self.decay;
        let to_m = (self.position_m + way_m.clamp_length_max(TICK_S * max_speed_m_per_s)).clamp(low, high);
        if to_m != self.position_m + way_m {
            self.velocity_m_per_s = (to_m - self.position_m) / TICK_S;
        }
        self.position_m = to_m;
        buttons
    }
}

impl HapticDevice for FollowerDevice {
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: "hand that follows".into(),
            workspace_m: self.hand.workspace_m,
            max_force_n: self.hand.max_force_n,
            rate_hz: 1.0 / TICK_S,
        }
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        if self.open {
            return Err(DeviceError::AlreadyOpen);
        }
        let [low, high] = self.hand.workspace_m;
        self.open = true;
        self.position_m = self.hand.start_m.clamp(low, high);
        (self.velocity_m_per_s, self.force_n) = (DVec3::ZERO, DVec3::ZERO);
        Ok(())
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        if !self.open {
            return Err(DeviceError::NotOpen);
        }
        let buttons = self.follow();
        let velocity_m_per_s = Some(self.velocity_m_per_s);
        Ok(Reading { buttons, velocity_m_per_s, ..Reading::at(self.position_m) })
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        if !self.open {
            return Err(DeviceError::NotOpen);
        }
        self.force_n = force_n;
        Ok(())
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        (self.open, self.force_n) = (false, DVec3::ZERO);
        Ok(())
    }
}
