//! Kinematics of a Polhem: poses with closed-form solutions, lengths of the bars, the formula of the source, finite differences, and
//! inverse.

use crate::every_arm::*;
use glam::{DVec2, DVec3, Vec3Swizzles};
use palpate_hid::*;
use proptest::prelude::*;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Published lengths, m: distance of the axes of B and C, upper arm, crank, rod, rear and front of the outer link.
const L0: f64 = 0.034;
const L1: f64 = 0.165;
const L2: f64 = 0.025;
const L3: f64 = 0.190;
const L4: f64 = 0.034;
const L5: f64 = 0.1308;
const AXIS_B: DVec2 = DVec2::new(L0 / 2.0, 0.0);
const AXIS_C: DVec2 = DVec2::new(-L0 / 2.0, 0.0);

fn arms() -> [BoardKinematics; 2] {
    [BoardKinematics::polhem_v2(), BoardKinematics::polhem_v3()]
}

/// Both signs, and different bars, capstans, bodies, motors and encoders.
fn other_arm() -> BoardKinematics {
    BoardKinematics {
        linkage: BoardLinkage::Polhem { length_m: [0.030, 0.180, 0.030, 0.200, 0.040, 0.150] },
        is_reversed: [true, false, true],
        counts_per_turn: [2000.0, 4096.0, 1000.0],
        torque_nm_per_a: [0.0538, 0.0259, 0.0163],
        origin_m: DVec3::new(0.140, 0.01, 0.100),
        ..BoardKinematics::polhem_v3()
    }
}

/// Converts from the plane of the linkage (out, up) to the device frame, with A turned by `a`.
fn in_device(arm: &BoardKinematics, a: f64, tip: DVec2) -> DVec3 {
    (DVec3::new(a.cos() * tip.x, a.sin() * tip.x, tip.y) - arm.origin_m).yzx()
}

/// Inverse of [`in_device`].
fn in_plane(arm: &BoardKinematics, a: f64, position_m: DVec3) -> DVec2 {
    let formulas_m = position_m.zxy() + arm.origin_m;
    DVec2::new(formulas_m.x * a.cos() + formulas_m.y * a.sin(), formulas_m.z)
}

/// Angle between the sides `a` and `b` of a triangle, opposite the third side (law of cosines).
fn angle(a: f64, b: f64, opposite: f64) -> f64 {
    ((a * a + b * b - opposite * opposite) / (2.0 * a * b)).acos()
}

/// Angles of B and C for a tip in the plane, with the elbow up and the crank on its home side: two triangles, from the tip to the base.
fn inverse(tip: DVec2) -> [f64; 2] {
    let to_tip = tip - AXIS_B;
    let b = to_tip.to_angle() + angle(L1, to_tip.length(), L5);
    let elbow = AXIS_B + L1 * DVec2::from_angle(b);
    let rear = elbow - L4 / L5 * (tip - elbow);
    let to_rear = rear - AXIS_C;
    [b, to_rear.to_angle() + angle(L2, to_rear.length(), L3)]
}

/// Angles of an arm in use, away from singularities, and the tip in the plane from which they were computed.
fn places() -> impl Strategy<Value = (DVec3, DVec2)> {
    let place = (-1.5..1.5, 0.08..0.29, -0.1..0.15);
    place.prop_filter_map("within reach and regular", |(a, out, up)| {
        let tip = DVec2::new(out, up);
        let [b, c] = inverse(tip);
        let angles = DVec3::new(a, b, c);
        let is_regular = angles.is_finite() && BoardKinematics::polhem_v3().leverage(angles) > 0.05;
        is_regular.then_some((angles, tip))
    })
}

fn poses() -> impl Strategy<Value = DVec3> {
    places().prop_map(|(angles, _)| angles)
}

#[test]
fn parallelogram_keeps_the_outer_link_level() {
    // L4 = L0 and L3 = L1 + L2. With the crank opposite to the upper arm, θ_C = θ_B + π, the axes, the elbow and the rear end form a
    // parallelogram of L1 and L0, and λ = 0.
    for arm in arms() {
        for step in 0..=20 {
            let (a, b) = (0.1 * f64::from(step) - 1.0, 0.15 * f64::from(step) + 0.05);
            let angles = DVec3::new(a, b, b + PI);
            let tip = AXIS_B + L1 * DVec2::from_angle(b) + DVec2::new(L5, 0.0);
            let off_m = arm.position_m(angles) - in_device(&arm, a, tip);
            assert!(off_m.length() < 1e-14, "{off_m}");
            // Crank and rod are collinear: a dead centre, where motor C moves nothing.
            assert!(arm.leverage(angles) < 1e-13 && arm.jacobian(angles).col(2).length() < 1e-13);
        }
    }
}

#[test]
fn right_angle_at_the_elbow_matches_two_triangles_and_statics() {
    let arm = BoardKinematics::polhem_v3();
    // θ_B = 45°, λ = −45°: the rear end is at (L0/2, 0) + ((L1 − L4), (L1 + L4)) / √2, seen from C's axis (L0, 0) farther out.
    let rear = DVec2::new(L0 + (L1 - L4) * FRAC_1_SQRT_2, (L1 + L4) * FRAC_1_SQRT_2);
    let c = (rear.y / rear.x).atan() + angle(L2, rear.length(), L3);
    let angles = DVec3::new(0.0, FRAC_PI_4, c);
    let formulas_m =
        DVec3::new(L0 / 2.0 + (L1 + L5) * FRAC_1_SQRT_2 - 0.2045, 0.0, (L1 - L5) * FRAC_1_SQRT_2 - 0.0325);
    let off_m = arm.position_m(angles) - formulas_m.yzx();
    assert!(off_m.length() < 1e-15, "{off_m}");
    // Levers: A has the whole distance ρ.
    let newton = arm.currents_a(angles, DVec3::X);
    let out = L0 / 2.0 + (L1 + L5) * FRAC_1_SQRT_2;
    assert!((newton - DVec3::new(out * 0.028_853_4 / 0.175 / 0.0603, 0.0, 0.0)).length() < 1e-14);
    // Statics without a Jacobian, for 1 N on the hand along the upper arm, 45° out and up. The outer link is at a right angle to that
    // force. Two forces turn it against each other: the hand's reaction at the tip, at L5 from the elbow, and the push of the rod at the
    // rear end, at L4 on the other side. The rod pushes the crank in the opposite direction. The bearing of the elbow carries both
    // forces; only the push of the rod has a moment about the axis of B. The motors balance these moments; that of B is reversed.
    let up_the_arm = DVec2::splat(FRAC_1_SQRT_2);
    let along_crank = DVec2::from_angle(c);
    let along_rod = (rear - L2 * along_crank) / L3;
    let push_n = -L5 / (L4 * along_rod.dot(up_the_arm)) * along_rod;
    let c_nm = L2 * along_crank.perp_dot(push_n);
    let b_nm = -L1 * up_the_arm.perp_dot(push_n);
    let currents = arm.currents_a(angles, DVec3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2));
    let expected = DVec3::new(0.0, -b_nm * 0.136_981 / 0.0538, c_nm * 0.137_281 / 0.0538);
    assert!((currents - expected).length() < 1e-13, "{currents} {expected}");
}

#[test]
fn home_is_the_same_folded_pose_for_both_versions() {
    for arm in arms() {
        let home = arm.home_rad();
        let [a, b, c] = home.to_array().map(f64::to_degrees);
        assert!((a - 120.4).abs() < 0.1 && (b - 124.8).abs() < 0.1 && (c - 238.5).abs() < 0.1, "{home}");
        let tip = in_plane(&arm, home.x, arm.position_m(home));
        let back = inverse(tip);
        assert!((back[0] - home.y).abs() < 1e-12 && (back[1] - home.z).abs() < 1e-12);
        assert!((tip - DVec2::new(0.036, 0.070)).length() < 1e-3 && arm.leverage(home) < 0.05, "{tip}");
        // The home pose is within the default reach.
        assert!(arm.position_m(home).length() < BoardOptions::default().reach_m);
        arm.validate().unwrap();
    }
    // 4096 counts are a turn of a motor; B rises with falling counts, as its motor is reversed in the source.
    let turn = BoardKinematics::polhem_v3().angles_rad([4096, -4096, 4096]) / TAU;
    assert!((turn - DVec3::new(0.028_853_4 / 0.175, 0.136_981, 0.137_281)).length() < 1e-15);
}

#[test]
fn axes_point_right_up_and_towards_the_user() {
    let arm = BoardKinematics::polhem_v3();
    let [b, c] = inverse(DVec2::new(0.2045, 0.0325));
    let middle = DVec3::new(0.0, b, c);
    assert!(arm.position_m(middle).length() < 1e-15);
    let moved = |turn: DVec3| arm.position_m(middle + 0.01 * turn) - arm.position_m(middle);
    assert!(moved(DVec3::X).x > 0.002 && moved(DVec3::X).y.abs() < 1e-15);
    // B leans back; the outer link rises with C.
    assert!(moved(DVec3::Y).z < -0.001);
    assert!(moved(DVec3::Z).y > 0.0005);
    assert!(arm.leverage(middle) > 0.6);
}

#[test]
fn collinear_or_open_bars_have_no_force_and_no_nan() {
    let arm = BoardKinematics::polhem_v3();
    let evaluate = |angles: DVec3| {
        let currents = arm.currents_a(angles, DVec3::ONE);
        assert!(
            arm.position_m(angles).is_finite() && arm.jacobian(angles).is_finite() && currents.is_finite()
        );
        (arm.leverage(angles), arm.force_n(angles, DVec3::ONE))
    };
    // Upper arm and outer link collinear: folded, with the tip below the elbow; and stretched.
    let rear = DVec2::new(L0, L1 + L4);
    let c = rear.to_angle() + angle(L2, rear.length(), L3);
    assert!(evaluate(DVec3::new(0.0, FRAC_PI_2, c)).0 < 1e-15);
    // Rod and outer link collinear: the elbow is L3 − L4 from the crank's end.
    let elbow = DVec2::new(L0, L1);
    let c = elbow.to_angle() + angle(L2, elbow.length(), L3 - L4);
    assert!(evaluate(DVec3::new(0.3, FRAC_PI_2, c)).0 < 1e-6);
    assert_eq!(
        evaluate(DVec3::new(0.3, FRAC_PI_2, c - 0.01)),
        (0.0, None),
        "the bars cannot close at a smaller distance"
    );
    assert!(evaluate(DVec3::new(0.3, FRAC_PI_2, c + 0.1)).1.is_some());
    // The pose of uncalibrated counters.
    evaluate(DVec3::ZERO);
    // The elbow on the crank's end, with a rod as long as the rear of the outer link: the direction is undefined.
    let degenerate = BoardKinematics {
        linkage: BoardLinkage::Polhem { length_m: [0.0, 0.1, 0.1, 0.05, 0.05, 0.1] },
        ..arm
    };
    let angles = DVec3::new(0.0, 1.0, 1.0);
    assert!(degenerate.position_m(angles).is_finite() && degenerate.jacobian(angles).is_finite());
    assert_eq!((degenerate.leverage(angles), degenerate.force_n(angles, DVec3::ONE)), (0.0, None));
    assert!(matches!(degenerate.validate(), Ok(()) | Err(HidError::Option { .. })));
}

#[test]
fn rejects_invalid_lengths_and_open_home() {
    let good = BoardKinematics::polhem_v3();
    other_arm().validate().unwrap();
    let links = |at: usize, length: f64| {
        let mut length_m = [L0, L1, L2, L3, L4, L5];
        length_m[at] = length;
        BoardKinematics { linkage: BoardLinkage::Polhem { length_m }, ..good }
    };
    for at in 0..6 {
        for length in [-0.1, f64::NAN, f64::INFINITY, 11.0] {
            assert!(matches!(links(at, length).validate(), Err(HidError::Option { .. })), "{at} {length}");
        }
        assert!(at == 0 || links(at, 0.0).validate().is_err());
    }
    // Bars that do not close at home.
    for bad in [links(3, 0.1), BoardKinematics { home_counts: [8312, 10_366, 19_764, 0, 30, 0], ..good }] {
        let error = bad.validate().unwrap_err();
        assert!(matches!(&error, HidError::Option { what: "home counters of a board", .. }), "{error}");
    }
}

proptest! {
    #[test]
    fn bars_keep_their_lengths(angles in poses()) {
        for arm in arms() {
            let tip = in_plane(&arm, angles.x, arm.position_m(angles));
            let elbow = AXIS_B + L1 * DVec2::from_angle(angles.y);
            let crank = AXIS_C + L2 * DVec2::from_angle(angles.z);
            let rear = elbow - L4 / L5 * (tip - elbow);
            prop_assert!(((tip - elbow).length() - L5).abs() < 1e-14);
            prop_assert!(((rear - crank).length() - L3).abs() < 1e-14);
            // Assembled on the correct side: the rear end is clockwise from the crank.
            prop_assert!((crank - elbow).perp_dot(rear - elbow) < 0.0);
        }
    }

    #[test]
    fn position_matches_the_inverse((angles, tip) in places()) {
        for arm in arms() {
            let off_m = arm.position_m(angles) - in_device(&arm, angles.x, tip);
            prop_assert!(off_m.length() < 1e-12, "{off_m}");
        }
    }

    /// hfab_polhem.h: λ is θ_B minus the unsigned angles at the elbow in three triangles.
    #[test]
    fn position_matches_the_source(angles in poses()) {
        let arm = BoardKinematics::polhem_v3();
        let elbow = AXIS_B + L1 * DVec2::from_angle(angles.y);
        let crank = AXIS_C + L2 * DVec2::from_angle(angles.z);
        let (to_c, to_crank) = ((elbow - AXIS_C).length(), (elbow - crank).length());
        // Assumptions of the source.
        let is_in_range = elbow.y > 0.0 && (AXIS_C - elbow).perp_dot(crank - elbow) < 0.0;
        prop_assert!(is_in_range || elbow.y < 0.0 || arm.leverage(angles) < 0.1);
        if is_in_range {
            let in_three = [angle(L1, to_c, L0), angle(L4, to_crank, L3), angle(to_c, to_crank, L2)];
            let lambda = angles.y - in_three.iter().sum::<f64>();
            let tip = elbow + L5 * DVec2::from_angle(lambda);
            let off_m = arm.position_m(angles) - in_device(&arm, angles.x, tip);
            prop_assert!(off_m.length() < 1e-8, "{off_m}");
        }
    }

    #[test]
    fn jacobian_matches_finite_differences(angles in poses()) {
        for arm in arms().into_iter().chain([other_arm()]) {
            if arm.leverage(angles) > 0.05 {
                check_jacobian(&arm, angles, 2e-4, 1e-8)?;
            }
        }
    }

    #[test]
    fn force_is_recovered_from_its_currents(angles in poses(), force in forces()) {
        for arm in arms().into_iter().chain([other_arm()]) {
            if arm.leverage(angles) > 0.05 {
                check_force_inverse(&arm, angles, force)?;
            }
        }
    }

    #[test]
    fn motor_power_equals_tip_power(angles in poses(), force in forces(), speed in forces()) {
        for arm in arms() {
            check_power_balance(&arm, angles, force, speed, 2e-5)?;
        }
    }

    #[test]
    fn arbitrary_counters_give_finite_values(counters in any::<[i16; 3]>(), force in forces()) {
        for arm in arms().into_iter().chain([other_arm()]) {
            let angles = arm.angles_rad(arm.counts(counters));
            prop_assert!(arm.position_m(angles).is_finite() && arm.jacobian(angles).is_finite());
            prop_assert!((0.0..=1.0).contains(&arm.leverage(angles)));
            prop_assert!(arm.currents_a(angles, force).is_finite());
            prop_assert!(arm.force_n(angles, force).is_none_or(DVec3::is_finite));
        }
    }
}
