//! Limits of force and current.

use super::BoardOptions;
use glam::DVec3;

/// Leverage below which the arm is treated as singular, where currents would display a wrong force.
const MIN_LEVERAGE: f64 = 0.05;
/// Number of forces over which the limit grows from zero to the maximum force.
const FORCES_TO_FULL: f64 = 20.0;

/// Current force limit. It starts at zero, and restarts there after events unknown to the loop's force: silence, calibration, a
/// position out of reach. With each force accepted by the board it grows by a twentieth of the maximum force, which is as fast as the
/// loop lets a force grow by the device description ([`DeviceLimits`](palpate_haptics::DeviceLimits)).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ForceLimits {
    allowed_n: f64,
}

impl ForceLimits {
    /// Sets the limit to zero.
    pub(super) fn reset(&mut self) {
        self.allowed_n = 0.0;
    }

    /// Currents that display `force_n` in the pose `angles_rad`, mA. Force and currents are scaled down to their limits as a whole,
    /// which keeps the direction of the force. Zero for a force that is not finite, a tip out of reach, or a singular arm.
    pub(super) fn currents(&self, options: &BoardOptions, angles_rad: DVec3, force_n: DVec3) -> [i16; 3] {
        let BoardOptions { kinematics, max_current_a, reach_m, .. } = options;
        let is_near = kinematics.position_m(angles_rad).length() <= *reach_m;
        let is_regular = kinematics.leverage(angles_rad) >= MIN_LEVERAGE;
        if !(force_n.is_finite() && is_near && is_regular) {
            return [0; 3];
        }
        let limited_n = force_n.clamp_length_max(self.allowed_n.min(kinematics.max_force_n));
        let currents_a = kinematics.currents_a(angles_rad, limited_n);
        let most_a = currents_a.abs().max_element();
        let share = if most_a > *max_current_a { max_current_a / most_a } else { 1.0 };
        (share * currents_a).to_array().map(milliamperes)
    }

    /// Raises the limit after the board has accepted the currents of a force, or zero currents in place of it.
    pub(super) fn force_accepted(&mut self, options: &BoardOptions, angles_rad: DVec3) {
        let BoardOptions { kinematics, reach_m, .. } = options;
        if kinematics.position_m(angles_rad).length() > *reach_m
            || kinematics.leverage(angles_rad) < MIN_LEVERAGE
        {
            self.reset();
        } else {
            let most_n = kinematics.max_force_n;
            self.allowed_n = (self.allowed_n + most_n / FORCES_TO_FULL).min(most_n);
        }
    }
}

/// Rounds to whole milliamperes, saturated to 16 bits; NaN becomes 0.
fn milliamperes(current_a: f64) -> i16 {
    // `as` saturates and maps NaN to 0.
    (1e3 * current_a).round() as i16
}

/// Whether the norm of `new` is less than half that of `displayed`: the driver sends it without waiting for a report.
pub(super) fn is_less_than_half(new: [i16; 3], displayed: [i16; 3]) -> bool {
    let square = |currents: [i16; 3]| -> i64 {
        currents.iter().map(|&current| i64::from(current) * i64::from(current)).sum()
    };
    4 * square(new) < square(displayed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Limits at the maximum force.
    fn grown(options: &BoardOptions, angles_rad: DVec3) -> ForceLimits {
        let mut limits = ForceLimits::default();
        (0..20).for_each(|_| limits.force_accepted(options, angles_rad));
        limits
    }

    #[test]
    fn stretched_arm_has_zero_currents_and_resets_the_limit() {
        let options = BoardOptions { reach_m: 10.0, ..BoardOptions::default() };
        let home = options.kinematics.home_rad();
        let mut limits = grown(&options, home);
        assert_ne!(limits.currents(&options, home, DVec3::X), [0; 3]);
        // θ_B + θ_C is π − 0.01.
        let stretched = DVec3::new(0.0, 1.0, std::f64::consts::PI - 1.01);
        assert_eq!(limits.currents(&options, stretched, DVec3::X), [0; 3]);
        limits.force_accepted(&options, stretched);
        assert_eq!(limits.currents(&options, home, DVec3::X), [0; 3]);
        limits.force_accepted(&options, home);
        let little = grown(&options, home).currents(&options, home, 0.25 * DVec3::X);
        assert_eq!(limits.currents(&options, home, 3.0 * DVec3::X), little);
    }

    #[test]
    fn milliamperes_are_rounded_and_saturated() {
        assert_eq!([0.0004, 0.0006, -0.0006, -1.2].map(milliamperes), [0, 1, -1, -1200]);
        assert_eq!([1e9, -1e9, f64::INFINITY, f64::NAN].map(milliamperes), [i16::MAX, i16::MIN, i16::MAX, 0]);
    }

    #[test]
    fn excessive_force_is_limited_to_the_maximum() {
        let options = BoardOptions { max_current_a: 3.0, ..BoardOptions::default() };
        let home = options.kinematics.home_rad();
        let limits = grown(&options, home);
        let max = limits.currents(&options, home, 5.0 * DVec3::X);
        assert_eq!(limits.currents(&options, home, 1e3 * DVec3::X), max);
    }
}
