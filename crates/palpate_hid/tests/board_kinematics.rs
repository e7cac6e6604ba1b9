//! Kinematics of a WoodenHaptics: finite differences, a published pose, and inverse.

use crate::every_arm::*;
use glam::{DVec3, Vec3Swizzles};
use palpate_hid::*;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

fn arm() -> BoardKinematics {
    BoardKinematics::woodenhaptics_v2015()
}

fn links(length_m: [f64; 3]) -> BoardLinkage {
    BoardLinkage::WoodenHaptics { length_m }
}

/// Both signs, and different links, capstans, bodies, motors and encoders.
fn other_arm() -> BoardKinematics {
    BoardKinematics {
        linkage: links([0.058, 0.174, 0.133]),
        capstan_m: [0.011, 0.010, 0.009],
        body_m: [0.180, 0.100, 0.105],
        is_reversed: [true, false, true],
        counts_per_turn: [2000.0, 4096.0, 1000.0],
        torque_nm_per_a: [0.0538, 0.0259, 0.0163],
        origin_m: DVec3::new(0.140, 0.01, 0.100),
        ..arm()
    }
}

/// Angles of an arm in use, away from singularities.
fn poses() -> impl Strategy<Value = DVec3> {
    (-1.2..1.2, 0.0..1.0, 0.4..1.6).prop_map(|(a, b, c)| DVec3::new(a, b, c))
}

#[test]
fn home_position_is_the_published_one() {
    // 6000 of 2000 counts are three turns of the motor, a quarter of one of body C: 3 · 0.010/0.120.
    let angles = arm().angles_rad([0, 0, 6000]);
    assert!((angles - DVec3::new(0.0, 0.0, FRAC_PI_2)).length() < 1e-15, "{angles}");
    assert_eq!(angles, arm().home_rad());
    // In the formulas' frame: L_c - o_x to the front, L_n + L_b - o_z up.
    let formulas_m = DVec3::new(0.245 - 0.220, 0.0, 0.080 + 0.205 - 0.080);
    assert!((arm().position_m(angles) - formulas_m.yzx()).length() < 1e-15);
    assert!((arm().position_m(angles) - DVec3::new(0.0, 0.205, 0.025)).length() < 1e-15);
}

#[test]
fn axes_point_right_up_and_towards_the_user() {
    let home = arm().home_rad();
    let moved = |turn: DVec3| arm().position_m(home + 0.01 * turn) - arm().position_m(home);
    // A turns about the vertical axis by the right hand: seen from above, from the front to the user's right.
    assert!(moved(DVec3::X).x > 0.002 && moved(DVec3::X).y.abs() < 1e-15);
    // B tips to the front, C rises.
    assert!(moved(DVec3::Y).z > 0.002);
    assert!(moved(DVec3::Z).y > 0.002);
}

#[test]
fn workspace_centre_is_reachable_and_regular() {
    // ρ = 0.22 and the height of the shoulder: two equations for B and C, by Newton's method.
    let mut angles = DVec3::new(0.0, 0.3, 0.7);
    for _ in 0..20 {
        angles -= arm().jacobian(angles).inverse() * arm().position_m(angles);
    }
    assert!(arm().position_m(angles).length() < 1e-14);
    let [l_b, l_c] = [0.205, 0.245];
    assert!((l_b * angles.y.cos() - l_c * angles.z.cos()).abs() < 1e-14);
    assert!((l_b * angles.y.sin() + l_c * angles.z.sin() - 0.220).abs() < 1e-14);
    assert!((arm().leverage(angles) - 0.220 / 0.450 * (angles.y + angles.z).sin()).abs() < 1e-15);
    // The weakest direction is that in which body C moves: lever L_c, and only its motor.
    let along_c = arm().jacobian(angles).col(2).normalize();
    let weakest_n = 2.0 / arm().currents_a(angles, along_c).abs().max_element();
    assert!((weakest_n - 2.0 * 0.0259 * 12.0 / 0.245).abs() < 1e-12, "{weakest_n}");
    for direction in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE.normalize()] {
        assert!(2.0 / arm().currents_a(angles, direction).abs().max_element() > weakest_n);
    }
}

#[test]
fn counts_are_unwrapped_from_16_bit_counters() {
    let arm = arm();
    assert_eq!(arm.counts([0, 0, 6000]), [0, 0, 6000]);
    assert_eq!(arm.counts([-1, i16::MAX, i16::MIN]), [-1, 32767, 32768]);
    // A body that keeps turning: the counter wraps at 32,767, the counts, nearest to home at 6000, only at 38,767.
    for count in -26_768..=38_767 {
        assert_eq!(arm.counts([0, 0, count as i16])[2], count);
    }
    // The range of a WoodenHaptics is far within: half a turn to either side of home is 12,000 counts of C.
    let counts_per_turn = std::f64::consts::TAU / arm.angles_rad([0, 0, 1]).z;
    assert!((counts_per_turn - 24_000.0).abs() < 1e-9);
}

#[test]
fn singular_poses_have_zero_leverage_and_no_force() {
    let arm = arm();
    // B and C in one line: θ_B + θ_C = π; folded: 0. The tip above the shoulder: ρ = 0.
    let below = -(0.205_f64 * 0.5_f64.sin() / 0.245).asin();
    for angles in [[0.0, 1.0, PI - 1.0], [0.3, 0.5, -0.5], [0.3, 0.5, below]] {
        let angles = DVec3::from(angles);
        assert!(arm.leverage(angles) < 1e-15, "{angles}");
        assert!(arm.jacobian(angles).determinant().abs() < 1e-15);
        assert_eq!(arm.force_n(angles, DVec3::ONE), None);
    }
}

#[test]
fn rejects_invalid_kinematics_and_options() {
    let good = arm();
    good.validate().unwrap();
    other_arm().validate().unwrap();
    for bad in [
        BoardKinematics { linkage: links([0.08, 0.0, 0.245]), ..good },
        BoardKinematics { linkage: links([f64::NAN, 0.205, 0.245]), ..good },
        BoardKinematics { capstan_m: [0.01, 0.0, 0.01], ..good },
        BoardKinematics { body_m: [0.16, 0.12, f64::INFINITY], ..good },
        BoardKinematics { counts_per_turn: [2000.0, -2000.0, 2000.0], ..good },
        // 66,000 counts for a turn of body A.
        BoardKinematics { counts_per_turn: [4125.0, 2000.0, 2000.0], ..good },
        BoardKinematics { torque_nm_per_a: [0.0259, 0.0259, 0.0], ..good },
        BoardKinematics { origin_m: DVec3::NAN, ..good },
        BoardKinematics { workspace_radius_m: 0.0, ..good },
        BoardKinematics { max_force_n: -1.0, ..good },
    ] {
        assert!(matches!(bad.validate(), Err(HidError::Option { .. })), "{bad:?}");
    }
    for bad in [
        BoardOptions { max_current_a: 3.1, ..BoardOptions::default() },
        BoardOptions { max_current_a: f64::NAN, ..BoardOptions::default() },
        BoardOptions { reach_m: 0.0, ..BoardOptions::default() },
        BoardOptions {
            kinematics: BoardKinematics { capstan_m: [0.0; 3], ..good },
            ..BoardOptions::default()
        },
    ] {
        assert!(matches!(bad.validate(), Err(HidError::Option { .. })), "{bad:?}");
    }
}

proptest! {
    #[test]
    fn jacobian_matches_finite_differences(angles in poses()) {
        for arm in [arm(), other_arm()] {
            check_jacobian(&arm, angles, 1e-3, 1e-12)?;
        }
    }

    #[test]
    fn force_is_recovered_from_its_currents(angles in poses(), force in forces()) {
        for arm in [arm(), other_arm()] {
            check_force_inverse(&arm, angles, force)?;
        }
    }

    #[test]
    fn motor_power_equals_tip_power(angles in poses(), force in forces(), speed in forces()) {
        for arm in [arm(), other_arm()] {
            check_power_balance(&arm, angles, force, speed, 1e-4)?;
        }
    }
}
