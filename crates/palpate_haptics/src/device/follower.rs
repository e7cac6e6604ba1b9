//! A simulated device that follows a target set by the app, for example by a mouse.

use super::open_state::OpenState;
use super::{DeviceDescription, DeviceError, HapticDevice, Reading};
use crate::HapticsError;
use crate::error::{check, check_positive};
use glam::DVec3;
use std::time::Duration;
use triple_buffer::{Input, Output, triple_buffer};

/// Parameters of a [`FollowerDevice`].
///
/// The follower is a mass on a critically damped spring with limited speed: x'' = ω² (target − x) − 2ω x' + F/m, where F is the
/// written force. Position and velocity stay continuous when the target jumps. At constant target speed v the position lags by
/// 2v/ω; under a constant force F it rests F/(m ω²) away from the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowerSettings {
    /// Position when the device is opened, m, device frame.
    pub start_m: DVec3,
    /// Lower and upper corner of the workspace box, m; the position never leaves it.
    pub workspace_m: [DVec3; 2],
    /// Natural frequency ω, 1/s. The target usually changes once a frame, every 1/60 s: with ω well below 60 its steps are
    /// not perceptible.
    pub rate_per_s: f64,
    /// Mass m, kg.
    pub mass_kg: f64,
    /// Maximum speed, m/s.
    pub max_speed_m_per_s: f64,
    /// Maximum force in the device's description, N.
    pub max_force_n: f64,
}

impl Default for FollowerSettings {
    /// Start in the middle of a 40 cm box; 40 s⁻¹ and 0.2 kg, hence 320 N/m and a lag of 50 ms; 0.5 m/s; 10 N.
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

/// Sets the target of a [`FollowerDevice`]; the app's end. It never blocks the loop.
#[derive(Debug)]
pub struct FollowerTarget(Input<Target>);

/// A simulated device that follows a [`FollowerTarget`]. Its `read` neither blocks nor allocates.
#[derive(Debug)]
pub struct FollowerDevice {
    settings: FollowerSettings,
    target: Output<Target>,
    /// e^(−ω T).
    decay: f64,
    open: OpenState,
    position_m: DVec3,
    velocity_m_per_s: DVec3,
    force_n: DVec3,
}

#[derive(Clone, Copy, Debug)]
struct Target {
    position_m: DVec3,
    buttons: u32,
}

/// Time between two readings, s: one tick.
const TICK_S: f64 = 1e-3;

impl FollowerSettings {
    /// Creates the target, for the app, and the device, for the loop.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for a number out of range.
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
        let (input, output) = triple_buffer(&Target { position_m: start_m, buttons: 0 });
        let device = FollowerDevice {
            settings: self,
            target: output,
            decay: (-rate * TICK_S).exp(),
            open: OpenState::default(),
            position_m: start_m,
            velocity_m_per_s: DVec3::ZERO,
            force_n: DVec3::ZERO,
        };
        Ok((FollowerTarget(input), device))
    }
}

impl FollowerTarget {
    /// Sets the target position, m, device frame, and the buttons: bit i of `buttons` is set while button i is pressed.
    /// A position outside of the workspace is clamped to it; one that is not finite is ignored.
    pub fn set(&mut self, position_m: DVec3, buttons: u32) {
        self.0.write(Target { position_m, buttons });
    }
}

impl FollowerDevice {
    /// Advances by one tick and returns the buttons. The step is exact for constant target and force; the speed limit and the
    /// workspace are applied afterwards.
    fn advance(&mut self) -> u32 {
        let Target { position_m: target_m, buttons } = *self.target.read();
        let FollowerSettings { workspace_m: [low, high], rate_per_s, mass_kg, max_speed_m_per_s, .. } =
            self.settings;
        let target_m = if target_m.is_finite() { target_m.clamp(low, high) } else { self.position_m };
        let rest_m = target_m + self.force_n / (mass_kg * rate_per_s * rate_per_s);
        let offset_m = self.position_m - rest_m;
        let drift_m = TICK_S * (self.velocity_m_per_s + rate_per_s * offset_m);
        let step_m = rest_m + (offset_m + drift_m) * self.decay - self.position_m;
        self.velocity_m_per_s = (self.velocity_m_per_s - rate_per_s * drift_m) * self.decay;
        let next_m = (self.position_m + step_m.clamp_length_max(TICK_S * max_speed_m_per_s)).clamp(low, high);
        if next_m != self.position_m + step_m {
            self.velocity_m_per_s = (next_m - self.position_m) / TICK_S;
        }
        self.position_m = next_m;
        buttons
    }
}

impl HapticDevice for FollowerDevice {
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: "hand that follows".into(),
            workspace_m: self.settings.workspace_m,
            max_force_n: self.settings.max_force_n,
            rate_hz: 1.0 / TICK_S,
        }
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        self.open.open()?;
        let [low, high] = self.settings.workspace_m;
        self.position_m = self.settings.start_m.clamp(low, high);
        (self.velocity_m_per_s, self.force_n) = (DVec3::ZERO, DVec3::ZERO);
        Ok(())
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        self.open.check()?;
        let buttons = self.advance();
        let velocity_m_per_s = Some(self.velocity_m_per_s);
        Ok(Reading { buttons, velocity_m_per_s, ..Reading::at(self.position_m) })
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        self.open.check()?;
        self.force_n = force_n;
        Ok(())
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        self.open.close();
        self.force_n = DVec3::ZERO;
        Ok(())
    }
}
