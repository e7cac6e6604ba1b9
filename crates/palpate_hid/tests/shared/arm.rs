//! Checks for the arms of boards, for any linkage.

use glam::{DMat3, DVec3};
use palpate_hid::*;
use proptest::prelude::*;
use std::f64::consts::TAU;

pub fn forces() -> impl Strategy<Value = DVec3> {
    (-3.0..3.0, -3.0..3.0, -3.0..3.0).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

/// Jacobian by central differences with Richardson extrapolation, steps `h` and `2 h`, rad: an error of fifth order.
pub fn differences(arm: &BoardKinematics, angles: DVec3, h: f64) -> DMat3 {
    let along = |axis: DVec3| {
        let slope =
            |h: f64| (arm.position_m(angles + h * axis) - arm.position_m(angles - h * axis)) / (2.0 * h);
        (4.0 * slope(h) - slope(2.0 * h)) / 3.0
    };
    DMat3::from_cols(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

pub fn check_jacobian(
    arm: &BoardKinematics,
    angles: DVec3,
    h: f64,
    allowed: f64,
) -> Result<(), TestCaseError> {
    let off = arm.jacobian(angles) - differences(arm, angles, h);
    let worst = off.to_cols_array().into_iter().fold(0.0_f64, |max, entry| max.max(entry.abs()));
    prop_assert!(worst < allowed, "{worst}");
    Ok(())
}

pub fn check_force_inverse(arm: &BoardKinematics, angles: DVec3, force: DVec3) -> Result<(), TestCaseError> {
    let currents = arm.currents_a(angles, force);
    let back = arm.force_n(angles, currents).unwrap();
    prop_assert!((back - force).length() < 1e-12, "{}", (back - force).length());
    // After rounding to milliamperes the error is at most half of one for each motor.
    let rounded = (1e3 * currents).round() * 1e-3;
    let again = arm.currents_a(angles, arm.force_n(angles, rounded).unwrap());
    prop_assert!((1e3 * (again - rounded)).abs().max_element() < 1e-9);
    prop_assert!((1e3 * (again - currents)).abs().max_element() <= 0.5 + 1e-9);
    Ok(())
}

/// Power balance FᵀẊ = τᵀθ̇ of motors and tip. The motors turn as their encoders do.
pub fn check_power_balance(
    arm: &BoardKinematics,
    angles: DVec3,
    force: DVec3,
    speed: DVec3,
    h: f64,
) -> Result<(), TestCaseError> {
    let place = |at: f64| arm.position_m(angles + at * speed);
    let velocity = (8.0 * (place(h) - place(-h)) - (place(2.0 * h) - place(-2.0 * h))) / (12.0 * h);
    let out_w = force.dot(velocity);
    // Angles of the motors from their encoder counts, independent of the driver's transmission.
    let count = arm.angles_rad([1, 1, 1]);
    let motor_rad_per_s = speed / count * TAU / DVec3::from(arm.counts_per_turn);
    let torque_nm = arm.currents_a(angles, force) * DVec3::from(arm.torque_nm_per_a);
    let in_w = torque_nm.dot(motor_rad_per_s);
    prop_assert!((in_w - out_w).abs() < 1e-9 * (1.0 + out_w.abs()), "{in_w} {out_w}");
    Ok(())
}
