//! Driver of 3-DOF boards with a simulated board: its arm, a hand, and the firmware's report exchange.

mod bench;
mod homing;
mod polhem;
mod report_exchange;
mod shutdown;

use bench::*;
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::*;
use palpate_local::{Contact, Scheme};

#[test]
fn applied_force_is_the_sent_force_in_a_thousand_lockstep_ticks() {
    for form in BoardForm::ALL {
        let mut bench = Bench::new(moving(form), homed());
        let counters = bench.device().counters();
        let description = bench.device().describe();
        assert_eq!(description.max_force_n, 5.0);
        // A rotating force is not conservative and would be damped; passivity is off so that it is sent unchanged.
        let safety = SafetySettings { passivity_damping_ns_per_m: 0.0, ..description.safety(1e-3) };
        let (mut handle, haptic_loop) = haptic_loop(
            LoopConfig { device: description.limits(), ..LoopConfig::default() },
            LoopSettings { safety, record: true, ..LoopSettings::default() },
        )
        .unwrap();
        let device = bench.device.take().unwrap();
        let mut lockstep = Lockstep::new(haptic_loop, Box::new(device)).unwrap();
        let (mut displayed, mut max_n) = (0, 0.0_f64);
        for tick in 0..1000 {
            if tick % 50 == 0 {
                let model = handle.model_slot();
                (model.scheme, model.contact) = (Scheme::Hold, Contact::Held);
                model.id.sequence = tick;
                // Start with a small force, which the safety chain requires.
                let (size_n, turn) = ((tick as f64 / 100.0).min(2.2), 0.02 * tick as f64);
                model.force_n = size_n * DVec3::new(turn.cos(), turn.sin(), 0.5).normalize();
                handle.publish_model();
            }
            let before = bench.board(|it| it.exchanged());
            bench.advance_ms(1);
            lockstep.run(1);
            assert_eq!(bench.board(|it| it.exchanged()), before + 1, "one report for each, tick {tick}");
            let record = handle.next_record().unwrap();
            let off_n = bench.applied_force_n() - record.force_n;
            assert!(off_n.length() < ROUNDING_N, "{form:?} tick {tick}: {off_n} of {}", record.force_n);
            let off_m = record.reading.unwrap().position_m - bench.board(|it| it.tip_m());
            assert!(off_m.length() < 2e-3, "tick {tick}: {off_m}");
            displayed += u32::from(record.force_n.length() > 0.5);
            max_n = max_n.max(record.force_n.length());
        }
        assert!(displayed > 500 && max_n > 2.1, "{displayed} {max_n}");
        assert_eq!((counters.malformed(), counters.skipped()), (0, 0));
        assert!(counters.read() >= 1000 && counters.forces() >= 990);
        drop(lockstep);
        assert_eq!(bench.board(|it| it.currents_ma()), [0; 3], "zero when it is closed");
    }
}

#[test]
fn hand_is_displaced_by_force_over_stiffness() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14), homed());
    let force_n = DVec3::new(0.5, -1.0, 0.8);
    let before_m = bench.ticks(30, DVec3::ZERO).position_m;
    let after_m = bench.ticks(2000, force_n).position_m;
    // 400 N/m; the encoder resolution is 0.07 mm.
    assert!((after_m - before_m - force_n / 400.0).length() < 2e-4, "{}", after_m - before_m);
}

#[test]
fn reading_contains_button_and_encoder_noise() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes64).calibrated().with_noise(3), kept());
    assert_eq!(bench.tick(DVec3::ZERO).buttons, 0);
    bench.board(|it| it.press(true));
    bench.tick(DVec3::ZERO);
    assert_eq!(bench.tick(DVec3::ZERO).buttons, 1);
    bench.board(|it| it.press(false));
    bench.tick(DVec3::ZERO);
    let mut max_error_m = 0.0_f64;
    for _ in 0..200 {
        let reading = bench.tick(DVec3::ZERO);
        assert_eq!(reading.buttons, 0);
        max_error_m = max_error_m.max(reading.position_m.distance(bench.board(|it| it.tip_m())));
    }
    // 3.5 counts of each body: 0.92 mrad of B and C, 0.69 mrad of A.
    let bound_m = 3.5 * DVec3::new(0.245 / 32e3, 0.205 / 24e3, 0.245 / 24e3).length() * std::f64::consts::TAU;
    assert!(max_error_m > 0.3 * bound_m && max_error_m < 1.01 * bound_m, "{max_error_m} {bound_m}");
    // The error of the force follows from that of the pose: 1 mrad.
    bench.ticks(40, DVec3::X);
    assert!((bench.applied_force_n() - DVec3::X).length() < 2.0 * ROUNDING_N, "{}", bench.applied_force_n());
}

#[test]
fn force_above_the_current_limit_is_scaled_and_keeps_its_direction() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    let direction = DVec3::new(0.3, 0.9, 0.2).normalize();
    bench.ticks(40, 100.0 * direction);
    let felt_n = bench.applied_force_n();
    let max_ma = bench.board(|it| it.currents_ma()).map(i16::abs).into_iter().max();
    assert_eq!(max_ma, Some(2000));
    assert!(felt_n.length() < 5.0 && felt_n.normalize().dot(direction) > 1.0 - 1e-5, "{felt_n}");
    // With sufficient current the maximum force of the device is the limit.
    let options = BoardOptions {
        kinematics: BoardKinematics { max_force_n: 1.5, ..kinematics() },
        max_current_a: 3.0,
        ..kept()
    };
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), options);
    bench.ticks(40, 100.0 * direction);
    assert!((bench.applied_force_n() - 1.5 * direction).length() < ROUNDING_N, "{}", bench.applied_force_n());
}

#[test]
fn force_is_zero_out_of_reach_and_for_non_finite_input() {
    let options = BoardOptions { reach_m: 0.21, ..kept() };
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), options);
    bench.ticks(40, DVec3::X);
    assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N);
    for bad in [DVec3::NAN, DVec3::new(f64::INFINITY, 0.0, 0.0), DVec3::new(0.0, f64::NAN, 1.0)] {
        bench.tick(bad);
        assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
    }
    bench.ticks(40, DVec3::X);
    let home_m = bench.board(|it| it.tip_m());
    bench.board(|it| it.hold_at(1.05 * home_m));
    bench.ticks(500, DVec3::X);
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
    // After the return the force grows from zero.
    bench.board(|it| it.hold_at(home_m));
    let mut last_n = 0.0;
    for _ in 0..500 {
        bench.tick(DVec3::X);
        let now_n = bench.applied_force_n().length();
        assert!(now_n - last_n < 0.25 + ROUNDING_N, "{last_n} {now_n}");
        last_n = now_n;
    }
    assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N);
}
