//! Motion of a device under the pushes of a test: which axes move, and in which direction.

use glam::DVec3;
use serde::Serialize;
use std::collections::VecDeque;

/// Ticks before a push over which the position at its beginning is averaged.
const BEFORE: usize = 100;
/// Smallest motion that counts, m.
const MIN_MOTION_M: f64 = 5e-5;
/// Smallest ratio of the motion to the one without force.
const MIN_RATIO: f64 = 3.0;

/// Motion of a device when it is pushed along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Motion {
    /// Along the force.
    Along,
    /// Against the force.
    Reversed,
    /// Along the axis with this index.
    Across(usize),
    /// Not more than without force.
    None,
}

/// Response to the pushes along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Response {
    /// Index of the axis in the device's frame.
    pub(super) axis: usize,
    /// Mean displacement, m, under a positive force.
    pub(super) moved_m: [f64; 3],
    pub(super) motion: Motion,
}

/// Positions under the pushes of a test. A push is the first half of a sine along one axis, in which the force is positive: then every
/// stick, with a hand or without, moves along a force of the right sign.
#[derive(Debug, Default)]
pub(super) struct Responses {
    /// Newest positions, m.
    before: VecDeque<DVec3>,
    push: Option<Push>,
    /// Weighted displacements, m N, weights, N, and motion before, m, of each axis.
    sums: [(DVec3, f64, f64); 3],
}

#[derive(Clone, Copy, Debug)]
struct Push {
    axis: usize,
    begin_m: DVec3,
    /// Largest distance from the mean position in the ticks before, m.
    noise_m: f64,
}

impl Responses {
    /// Takes the force of a tick, N, and the position, m, that was read in it.
    pub(super) fn take(&mut self, force_n: DVec3, position_m: DVec3) {
        let axis = (0..3).find(|&axis| force_n[axis] > 0.0);
        if axis != self.push.map(|push| push.axis) {
            self.push = axis.and_then(|axis| self.begin(axis));
        }
        if let (Some(push), Some(axis)) = (self.push, axis) {
            let (moved, weight, noise_m) = &mut self.sums[axis];
            *moved += force_n[axis] * (position_m - push.begin_m);
            *weight += force_n[axis];
            *noise_m = noise_m.max(push.noise_m);
        }
        if self.before.len() == BEFORE {
            self.before.pop_front();
        }
        self.before.push_back(position_m);
    }

    fn begin(&self, axis: usize) -> Option<Push> {
        let count = self.before.len();
        let begin_m = self.before.iter().sum::<DVec3>() / count as f64;
        let noise_m = self.before.iter().map(|at| at.distance(begin_m)).fold(0.0, f64::max);
        (count > 0).then_some(Push { axis, begin_m, noise_m })
    }

    /// Responses to the axes that were pushed.
    pub(super) fn all(&self) -> Vec<Response> {
        let pushed = self.sums.iter().enumerate().filter(|(_, (_, weight, _))| *weight > 0.0);
        pushed
            .map(|(axis, &(moved, weight, noise_m))| {
                let moved_m = moved / weight;
                let threshold_m = MIN_MOTION_M.max(MIN_RATIO * noise_m);
                let largest =
                    (0..3).max_by(|&a, &b| moved_m[a].abs().total_cmp(&moved_m[b].abs())).unwrap_or(axis);
                let motion = match moved_m[largest] {
                    moved_m if moved_m.abs() < threshold_m => Motion::None,
                    moved_m if largest == axis && moved_m > 0.0 => Motion::Along,
                    _ if largest == axis => Motion::Reversed,
                    _ => Motion::Across(largest),
                };
                Response { axis, moved_m: moved_m.to_array(), motion }
            })
            .collect()
    }
}

/// Names of the axes of the device's frame.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// Settings to change after the responses of a joystick with the axes x and z, whose motors are reversed by `reverse`.
pub(super) fn joystick_advice(responses: &[Response], reverse: [bool; 2]) -> Vec<String> {
    let of = |axis| responses.iter().find(|response| response.axis == axis).map(|response| response.motion);
    let motions = [of(0), of(2)];
    let is_reversed = motions.map(|motion| motion == Some(Motion::Reversed));
    let mut advice = Vec::new();
    if is_reversed.contains(&true) {
        let [x, y] = [reverse[0] != is_reversed[0], reverse[1] != is_reversed[1]];
        let flag = match [x, y] {
            [true, true] => " (--reverse xy)",
            [true, false] => " (--reverse x)",
            [false, true] => " (--reverse y)",
            [false, false] => " (without --reverse)",
        };
        let which = match is_reversed {
            [true, true] => "x and its y move",
            [true, false] => "x moves",
            _ => "y moves",
        };
        advice.push(format!(
            "its {which} against the force; set `JoystickOptions::reverse` to [{x}, {y}]{flag}"
        ));
    }
    match motions {
        [_, Some(Motion::Across(0))] => advice.push(
            "a force along its y moves x, as in a wheel with one motor; set `JoystickOptions::use_y` to false (--no-y)".into(),
        ),
        [Some(Motion::Along | Motion::Reversed), Some(Motion::None)] => advice.push(
            "a force along its y moves nothing; for a wheel with one motor set `JoystickOptions::use_y` to false (--no-y), otherwise test with more force (--force-n, or the true maximum force with --full-scale-n)"
                .into(),
        ),
        [Some(Motion::Across(2)), _] => advice.push(
            "a force along its x moves y; exchange the directions of `JoystickOptions::plane`".into(),
        ),
        [Some(Motion::None), None | Some(Motion::None)] => advice.push(
            "no force moves it; hold it more loosely, and test with more force (--force-n, or the true maximum force with --full-scale-n)"
                .into(),
        ),
        _ => {}
    }
    advice
}

/// Settings to change after the responses of a board.
pub(super) fn board_advice(responses: &[Response]) -> Vec<String> {
    let wrong =
        responses.iter().filter(|response| matches!(response.motion, Motion::Reversed | Motion::Across(_)));
    let advice = wrong.map(|response| {
        format!(
            "a force along {} moves it another way; check the arm (--board), and `is_reversed` and `home_counts` of `BoardKinematics`",
            AXES[response.axis]
        )
    });
    advice.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Responses to half a second at rest and a sine along x and z each, with `moved` as the motion by a force.
    fn responses(moved: impl Fn(DVec3) -> DVec3, noise_m: f64) -> Vec<Response> {
        let mut responses = Responses::default();
        for tick in 0..4500_u32 {
            let time_s = 1e-3 * f64::from(tick);
            let axis = if time_s < 2.5 { DVec3::X } else { DVec3::Z };
            let force_n = if time_s < 0.5 { 0.0 } else { 0.3 * (TAU * (time_s - 0.5) / 2.0).sin() };
            let noise = DVec3::splat(noise_m * f64::from(tick * 37 % 11) / 11.0);
            responses.take(force_n * axis, moved(force_n * axis) + noise);
        }
        responses.all()
    }

    fn advice(moved: impl Fn(DVec3) -> DVec3) -> Vec<String> {
        joystick_advice(&responses(moved, 1e-5), [false; 2])
    }

    #[test]
    fn motion_along_the_force_needs_no_change() {
        let found = responses(|force_n| force_n / 150.0, 1e-5);
        let motions: Vec<(usize, Motion)> = found.iter().map(|it| (it.axis, it.motion)).collect();
        assert_eq!(motions, [(0, Motion::Along), (2, Motion::Along)]);
        // The mean of sin² over that of sin, times 0.3 N / 150 N/m.
        let expected_m = 0.3 / 150.0 * std::f64::consts::FRAC_PI_4;
        assert!((found[0].moved_m[0] - expected_m).abs() < 2e-5, "{found:?}");
        assert!(advice(|force_n| force_n / 150.0).is_empty());
    }

    #[test]
    fn reversed_axes_name_reverse() {
        let advice = |x: f64, y: f64, set| {
            let moved = move |force_n: DVec3| DVec3::new(x * force_n.x, 0.0, y * force_n.z) / 150.0;
            let [text] = &joystick_advice(&responses(moved, 1e-5), set)[..] else { panic!("no advice") };
            text.clone()
        };
        let option = |text: &str| text.split("reverse` to ").nth(1).unwrap().to_owned();
        assert_eq!(option(&advice(-1.0, 1.0, [false, false])), "[true, false] (--reverse x)");
        assert_eq!(option(&advice(1.0, -1.0, [false, false])), "[false, true] (--reverse y)");
        assert_eq!(option(&advice(-1.0, -1.0, [false, false])), "[true, true] (--reverse xy)");
        // It was set, and is wrong.
        assert_eq!(option(&advice(-1.0, 1.0, [true, false])), "[false, false] (without --reverse)");
    }

    #[test]
    fn one_motor_names_use_y() {
        let across = advice(|force_n| DVec3::X * (force_n.x + force_n.z) / 150.0);
        assert!(
            across.len() == 1 && across[0].contains("`JoystickOptions::use_y` to false (--no-y)"),
            "{across:?}"
        );
        let lost = advice(|force_n| DVec3::X * force_n.x / 150.0);
        assert!(lost.len() == 1 && lost[0].contains("moves nothing; for a wheel"), "{lost:?}");
    }

    #[test]
    fn weak_or_disturbed_motion_is_none() {
        let dead = advice(|_| DVec3::ZERO);
        assert!(dead.len() == 1 && dead[0].starts_with("no force moves it"), "{dead:?}");
        let disturbed = responses(|force_n| force_n / 150.0, 0.01);
        assert!(disturbed.iter().all(|it| it.motion == Motion::None), "{disturbed:?}");
    }

    /// A stick without a hand moves on after the push.
    #[test]
    fn free_stick_of_the_right_sign_moves_along() {
        let (mut responses, mut x, mut v) = (Responses::default(), 0.0_f64, 0.0);
        for tick in 0..2500_u32 {
            let time_s = 1e-3 * f64::from(tick);
            let force_n = if time_s < 0.5 { 0.0 } else { 0.3 * (TAU * (time_s - 0.5) / 2.0).sin() };
            v += 1e-3 * force_n / 0.2;
            x = (x + 1e-3 * v).clamp(-0.06, 0.06);
            responses.take(DVec3::X * force_n, DVec3::X * x);
        }
        assert_eq!(responses.all()[0].motion, Motion::Along);
    }
}
