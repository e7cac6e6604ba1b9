//! Description of a device, and the limits derived from it.

use crate::error::{check, check_positive};
use crate::{HapticsError, SafetySettings};
use glam::DVec3;

/// Name, workspace, maximum force and rate of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceDescription {
    /// Human-readable name.
    pub name: String,
    /// Lower and upper corner of the workspace box, m, device frame.
    pub workspace_m: [DVec3; 2],
    /// Maximum force, N; zero for a device without motors.
    pub max_force_n: f64,
    /// Nominal rate at which the device can be read and written, Hz. It is stated before the device is open, and not measured: a driver
    /// may infer it from the protocol. [`crate::LoopReport`] has measured times of reading and writing.
    pub rate_hz: f64,
}

impl DeviceDescription {
    /// The device's limits for the safety chain.
    #[must_use]
    pub fn limits(&self) -> DeviceLimits {
        DeviceLimits::of_force(self.max_force_n)
    }

    /// Safety settings for the device, with ticks of `tick_s`, s: the defaults, except for
    ///
    /// * the force limit, which is the device's maximum force, and the growth limit, which reaches that force in 20 ms at the
    ///   earliest. The device's limits apply whatever the settings are;
    /// * the arming force: a twentieth of the maximum force, if that is less than the default of 0.5 N, because 0.5 N is little
    ///   for an arm and all that a weak device has;
    /// * the device timeout: three periods of the device, if that is more than the default of 20 ticks.
    ///
    /// The description contains no speed limit and no damping; those keep their defaults.
    #[must_use]
    pub fn safety(&self, tick_s: f64) -> SafetySettings {
        let DeviceLimits { force_n, slew_n_per_s } = self.limits();
        let defaults = SafetySettings::default();
        SafetySettings {
            max_force_n: force_n,
            max_slew_n_per_s: if slew_n_per_s > 0.0 {
                defaults.max_slew_n_per_s.min(slew_n_per_s)
            } else {
                defaults.max_slew_n_per_s
            },
            arm_below_n: defaults.arm_below_n.min(force_n / 20.0),
            // The cast saturates: an infinite timeout becomes the largest integer.
            device_timeout_ticks: defaults
                .device_timeout_ticks
                .max((3.0 / (self.rate_hz * tick_s)).ceil() as u64),
            ..defaults
        }
    }

    /// Rejects an invalid description, so that a driver's mistake does not become a force limit.
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn validate(&self) -> Result<(), HapticsError> {
        let [low, high] = self.workspace_m;
        let size = (high - low).min_element();
        let ok = low.is_finite() && high.is_finite() && size >= 0.0;
        check("smallest side of the device's workspace, m", size, ok, "finite and at least 0")?;
        let force = self.max_force_n;
        let ok = force.is_finite() && force >= 0.0;
        check("largest force of the device, N", force, ok, "finite and at least 0")?;
        check_positive("rate of the device, Hz", self.rate_hz)
    }
}

/// Limits of a device that the safety chain enforces in addition to the user's settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceLimits {
    /// Maximum force, N; zero for a device without motors.
    pub force_n: f64,
    /// Maximum growth of the force, N/s.
    pub slew_n_per_s: f64,
}

impl DeviceLimits {
    /// Limits of a device with the maximum force `force_n`, N, which may be reached in 20 ms.
    #[must_use]
    pub fn of_force(force_n: f64) -> Self {
        Self { force_n, slew_n_per_s: force_n / 0.02 }
    }

    /// Rejects limits that are negative or not finite.
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn validate(&self) -> Result<(), HapticsError> {
        for (what, value) in [
            ("largest force of the device, N", self.force_n),
            ("largest growth of the device's force, N/s", self.slew_n_per_s),
        ] {
            check(what, value, value.is_finite() && value >= 0.0, "finite and at least 0")?;
        }
        Ok(())
    }
}
