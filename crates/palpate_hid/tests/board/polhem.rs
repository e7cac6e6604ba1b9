//! Driver with the arm of a Polhem; the simulated arm solves the linkage by other means.

use super::bench::*;
use glam::DVec3;
use palpate_hid::simulated::*;
use palpate_hid::*;

fn kinematics() -> BoardKinematics {
    BoardKinematics::polhem_v3()
}

fn polhem(homing: BoardHoming) -> BoardOptions {
    BoardOptions { kinematics: kinematics(), homing, ..BoardOptions::default() }
}

fn folded(form: BoardForm) -> BoardFirmware {
    BoardFirmware::at_home(form, &kinematics())
}

/// A board whose arm is pulled out to the workspace centre.
fn pulled_out(form: BoardForm, options: BoardOptions) -> Bench {
    let mut bench = Bench::open(folded(form), options);
    bench.ticks(3, DVec3::ZERO);
    // On a path that avoids A's axis.
    for at_m in [DVec3::new(0.15, 0.02, -0.15), DVec3::ZERO] {
        bench.board(|it| it.hold_at(at_m));
        bench.ticks(500, DVec3::ZERO);
    }
    bench
}

#[test]
fn applied_force_is_the_sent_force_in_every_form() {
    for form in BoardForm::ALL {
        let mut bench = pulled_out(form, polhem(BoardHoming::AtOpen));
        let reading = bench.tick(DVec3::ZERO);
        assert!(reading.position_m.length() < 1e-3, "{}", reading.position_m);
        for force_n in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(-1.0, 0.5, -0.7)] {
            bench.ticks(600, force_n);
            assert!(
                (bench.applied_force_n() - force_n).length() < 2.0 * ROUNDING_N,
                "{form:?}: {}",
                bench.applied_force_n()
            );
            let off_m = bench.tick(force_n).position_m - bench.board(|it| it.tip_m());
            assert!(off_m.length() < 3e-4, "{off_m}");
        }
    }
}

#[test]
fn folded_arm_has_zero_force_that_grows_when_pulled_out() {
    let mut bench = Bench::open(folded(BoardForm::Bytes14), polhem(BoardHoming::AtOpen));
    bench.ticks(50, DVec3::Y);
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
    bench.board(|it| it.hold_at(DVec3::new(0.15, 0.02, -0.15)));
    let mut last_n = 0.0;
    for _ in 0..500 {
        bench.tick(DVec3::Y);
        let now_n = bench.applied_force_n().length();
        // A twentieth of 5 N, and the change of the pose between two reports.
        assert!(now_n.is_finite() && now_n - last_n < 0.27, "{last_n} {now_n}");
        last_n = now_n;
    }
    assert!((bench.applied_force_n() - DVec3::Y).length() < 2.0 * ROUNDING_N, "{}", bench.applied_force_n());
}

#[test]
fn force_above_the_current_limit_is_scaled_and_keeps_its_direction() {
    // At the centre a lateral force of 1 N takes ρ d_a / (D_a k_a) = 0.559 A of motor A, so 2 A are 3.58 N.
    let mut bench = pulled_out(BoardForm::Bytes14, polhem(BoardHoming::AtOpen));
    bench.ticks(40, 100.0 * DVec3::X);
    assert_eq!(bench.board(|it| it.currents_ma())[0], 2000);
    let expected_n = 2.0 * 0.0603 * 0.175 / (0.028_853_4 * 0.2045);
    assert!((bench.applied_force_n() - expected_n * DVec3::X).length() < 0.03, "{}", bench.applied_force_n());
    for direction in [DVec3::Y, DVec3::Z, DVec3::new(1.0, -2.0, 1.0).normalize()] {
        let options = BoardOptions { max_current_a: 0.3, ..polhem(BoardHoming::AtOpen) };
        let mut bench = pulled_out(BoardForm::Bytes14, options);
        bench.ticks(40, 100.0 * direction);
        let max_ma = bench.board(|it| it.currents_ma()).map(i16::abs).into_iter().max();
        assert_eq!(max_ma, Some(300));
        let felt_n = bench.applied_force_n();
        assert!(felt_n.length() < 3.0 && felt_n.normalize().dot(direction) > 1.0 - 1e-4, "{felt_n}");
    }
    // With sufficient current the maximum force of the device is the limit.
    let weak = BoardKinematics { max_force_n: 1.5, ..kinematics() };
    let options = BoardOptions { kinematics: weak, max_current_a: 3.0, ..polhem(BoardHoming::AtOpen) };
    let mut bench = pulled_out(BoardForm::Bytes14, options);
    bench.ticks(40, 100.0 * DVec3::X);
    assert!(
        (bench.applied_force_n() - 1.5 * DVec3::X).length() < 2.0 * ROUNDING_N,
        "{}",
        bench.applied_force_n()
    );
}

#[test]
fn force_is_zero_out_of_reach() {
    let options = BoardOptions { reach_m: 0.05, ..polhem(BoardHoming::AtOpen) };
    let mut bench = pulled_out(BoardForm::Bytes14, options);
    bench.ticks(40, DVec3::X);
    assert!((bench.applied_force_n() - DVec3::X).length() < 2.0 * ROUNDING_N);
    bench.board(|it| it.hold_at(DVec3::new(0.0, 0.0, 0.07)));
    bench.ticks(500, DVec3::X);
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
}

#[test]
fn uncalibrated_arm_has_finite_positions_and_zero_force() {
    let mut bench = Bench::open(folded(BoardForm::Bytes14), polhem(BoardHoming::Awaited));
    for _ in 0..50 {
        assert!(bench.tick(DVec3::ONE).is_usable());
    }
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
    bench.device().board_calibration().unwrap().request();
    bench.ticks(20, DVec3::ZERO);
    let home_m = bench.tick(DVec3::ZERO).position_m;
    assert!(home_m.distance(bench.board(|it| it.tip_m())) < 3e-4 && home_m.length() > 0.2, "{home_m}");
}
