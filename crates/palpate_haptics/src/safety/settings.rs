//! Limits and times of the safety chain.

use crate::HapticsError;
use crate::error::{check, check_positive};

/// Limits and times of the safety chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetySettings {
    /// The force that a local model must not exceed before the ramp begins, N: at the start, and after the device was silent or
    /// its hand came back elsewhere. `f64::MAX`: the ramp begins at once.
    pub arm_below_n: f64,
    /// Time from that to full force, s. Zero: the first touch comes at once.
    pub ramp_s: f64,
    /// Model periods after which a local model counts as stale. More: an old force lasts longer.
    pub stale_after_periods: f64,
    /// Ticks in a row without a reading after which the device counts as silent.
    pub device_timeout_ticks: u64,
    /// Time in which a force fades to zero once model or device is too old, or on a pause, s.
    pub fade_s: f64,
    /// Speed of the hand from which on what pushes it along fades, m/s, to nothing at twice that. `f64::MAX`: never.
    pub max_speed_m_per_s: f64,
    /// The largest damping with which the passivity stage takes energy back, N s/m. Zero: it only counts.
    pub passivity_damping_ns_per_m: f64,
    /// Energy that may have been given beyond what was got before it does, J.
    pub passivity_tolerance_j: f64,
    /// Largest force, N; the device's own limit applies besides.
    pub max_force_n: f64,
    /// Largest growth of the force, N/s; the device's own limit applies besides. More: harder contacts feel crisper, and errors hit harder.
    pub max_slew_n_per_s: f64,
}

impl Default for SafetySettings {
    /// The table above; no limit of magnitude but the device's.
    fn default() -> Self {
        Self {
            arm_below_n: 0.5,
            ramp_s: 0.5,
            stale_after_periods: 3.0,
            device_timeout_ticks: 20,
            fade_s: 0.1,
            max_speed_m_per_s: 2.0,
            passivity_damping_ns_per_m: 5.0,
            passivity_tolerance_j: 1e-3,
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
        let start = self.arm_below_n;
        check("largest force at the start, N", start, at_least_0(start), "finite and at least 0")?;
        check("start-up ramp, s", self.ramp_s, at_least_0(self.ramp_s), "finite and at least 0")?;
        check("fade, s", self.fade_s, at_least_0(self.fade_s), "finite and at least 0")?;
        let periods = self.stale_after_periods;
        check(
            "model periods before the fade",
            periods,
            periods.is_finite() && periods >= 1.0,
            "finite and at least 1",
        )?;
        for (what, value) in [
            ("damping of the passivity stage, N s/m", self.passivity_damping_ns_per_m),
            ("tolerance of the passivity stage, J", self.passivity_tolerance_j),
        ] {
            check(what, value, at_least_0(value), "finite and at least 0")?;
        }
        check_positive("largest speed of the hand, m/s", self.max_speed_m_per_s)?;
        check("largest force, N", self.max_force_n, at_least_0(self.max_force_n), "finite and at least 0")?;
        check_positive("largest growth of the force, N/s", self.max_slew_n_per_s)
    }
}
