//! How much force, and how much current for it.

use super::BoardOptions;
use glam::DVec3;

/// Leverage below which an arm counts as singular: there currents show another force than the one that was asked for.
const MIN_LEVERAGE: f64 = 0.05;
/// Forces in which what may be shown grows from nothing to all.
const FORCES_TO_FULL: f64 = 20.0;

/// What may be shown now. It begins with nothing, and does so again after anything that the loop's force knows nothing of: a
/// silence, a calibration, a way outside the arm's reach. From there it grows by a twentieth of the largest force with each force
/// that the board takes, as fast as the description of the device allows ([`DeviceLimits`](palpate_haptics::DeviceLimits)).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    allowed_n: f64,
}

impl Limits {
    /// Begins with nothing again.
    pub(super) fn reset(&mut self) {
        self.allowed_n = 0.0;
    }

    /// The currents that show `force_n` with the arm at `angles_rad`. What is more than may be shown, and what would take more
    /// current than a motor may have, is made smaller as a whole: the force keeps its direction. Zero where the force is not
    /// finite, the tip is out of reach, or the arm is singular.
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

    /// The board has taken the currents of a force, or zero in its place.
    pub(super) fn taken(&mut self, options: &BoardOptions, angles_rad: DVec3) {
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

/// The nearest whole number of milliamperes, held at the ends of 16 bits; zero for what is no number.
fn milliamperes(current_a: f64) -> i16 {
    // A cast does that.
    (1e3 * current_a).round() as i16
}

/// Whether `new` is zero, or less than half of what is shown: then it does not wait until the board asks.
pub(super) fn is_less_than_half(new: [i16; 3], shown: [i16; 3]) -> bool {
    let square = |currents: [i16; 3]| -> i64 {
        currents.iter().map(|&current| i64::from(current) * i64::from(current)).sum()
    };
    4 * square(new) < square(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Limits that have grown to all.
    fn grown(options: &BoardOptions, angles_rad: DVec3) -> Limits {
        let mut limits = Limits::default();
        (0..20).for_each(|_| limits.taken(options, angles_rad));
        limits
    }

    #[test]
    fn a_stretched_arm_shows_nothing_and_begins_with_little_when_it_bends_again() {
        let options = BoardOptions { reach_m: 10.0, ..BoardOptions::default() };
        let home = options.kinematics.home_rad();
        let mut limits = grown(&options, home);
        assert_ne!(limits.currents(&options, home, DVec3::X), [0; 3]);
        // θ_B + θ_C is π but for a hundredth.
        let stretched = DVec3::new(0.0, 1.0, std::f64::consts::PI - 1.01);
        assert_eq!(limits.currents(&options, stretched, DVec3::X), [0; 3]);
        limits.taken(&options, stretched);
        assert_eq!(limits.currents(&options, home, DVec3::X), [0; 3]);
        limits.taken(&options, home);
        let little = grown(&options, home).currents(&options, home, 0.25 * DVec3::X);
        assert_eq!(limits.currents(&options, home, 3.0 * DVec3::X), little);
    }

    #[test]
    fn milliamperes_are_rounded_and_held_at_the_ends() {
        assert_eq!([0.0004, 0.0006, -0.0006, -1.2].map(milliamperes), [0, 1, -1, -1200]);
        assert_eq!([1e9, -1e9, f64::INFINITY, f64::NAN].map(milliamperes), [i16::MAX, i16::MIN, i16::MAX, 0]);
    }

    #[test]
    fn a_force_beyond_all_bounds_is_the_largest_there_is() {
        let options = BoardOptions { max_current_a: 3.0, ..BoardOptions::default() };
        let home = options.kinematics.home_rad();
        let limits = grown(&options, home);
        let most = limits.currents(&options, home, 5.0 * DVec3::X);
        assert_eq!(limits.currents(&options, home, 1e3 * DVec3::X), most);
    }
}
