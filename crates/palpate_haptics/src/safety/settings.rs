//! Limits and times of the safety chain.

use crate::HapticsError;
use crate::error::{check, check_positive};

/// Limits and times of the safety chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetySettings {
    /// Rendered force below which the start-up ramp begins, N: at the start, after a device timeout, and after a jump of the hand.
    /// With `f64::MAX` the ramp begins at once.
    pub arm_below_n: f64,
    /// Duration of the start-up ramp, s. With zero the full force is applied at once.
    pub ramp_s: f64,
    /// Age above which a local model is stale, in model periods. With a larger value an old force lasts longer.
    pub stale_after_periods: f64,
    /// Consecutive ticks without a reading or write after which the force fades.
    pub device_timeout_ticks: u64,
    /// Duration of the fade to zero for a stale model, a silent device or a pause, s.
    pub fade_s: f64,
    /// Speed of the hand above which the accelerating component of the force fades, m/s; it is zero at twice this speed. With
    /// `f64::MAX` the velocity guard is off.
    pub max_speed_m_per_s: f64,
    /// Maximum damping of the passivity stage, N s/m. With zero the stage only observes.
    pub passivity_damping_ns_per_m: f64,
    /// Energy given to the hand beyond that received at which the passivity stage starts to damp, J.
    pub passivity_tolerance_j: f64,
    /// Maximum force, N; the device's own limit also applies.
    pub max_force_n: f64,
    /// Maximum growth of the force, N/s; the device's own limit also applies. With a larger value hard contacts feel crisper, and
    /// errors hit harder.
    pub max_slew_n_per_s: f64,
}

impl Default for SafetySettings {
    /// 0.5 N, 0.5 s, 3 model periods, 20 ticks, 0.1 s, 2 m/s, 5 N s/m, 1 mJ, no force limit besides the device's, 500 N/s.
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
    /// Checks all ranges.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for the first value out of range.
    pub fn validate(&self) -> Result<(), HapticsError> {
        let at_least_0 = |v: f64| v.is_finite() && v >= 0.0;
        let start = self.arm_below_n;
        check(
            "largest force at the start (arm_below_n), N",
            start,
            at_least_0(start),
            "finite and at least 0",
        )?;
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
