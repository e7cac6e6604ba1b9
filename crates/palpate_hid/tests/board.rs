//! The driver of 3-DOF boards against a stand-in with an arm, a hand and the firmware's way of taking turns.

#[path = "board/bench.rs"]
mod bench;
#[path = "board/homing.rs"]
mod homing;
#[path = "board/polhem.rs"]
mod polhem;
#[path = "board/report_exchange.rs"]
mod report_exchange;
#[path = "board/shutdown.rs"]
mod shutdown;

use bench::*;
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::*;
use palpate_local::{Contact, Scheme};

#[test]
fn a_thousand_ticks_in_lock_step_and_the_force_felt_is_the_force_sent() {
    for form in BoardForm::ALL {
        let mut bench = Bench::new(moving(form), homed());
        let counters = bench.device().counters();
        let description = bench.device().describe();
        assert_eq!(description.max_force_n, 5.0);
        // A force that turns is no body's, and gives energy; here it is meant to come through as it is.
        let safety = SafetySettings { passivity_damping_ns_per_m: 0.0, ..description.safety(1e-3) };
        let (mut handle, haptic_loop) = haptic_loop(
            LoopConfig { device: description.limits(), ..LoopConfig::default() },
            LoopSettings { safety, record: true, ..LoopSettings::default() },
        )
        .unwrap();
        let device = bench.device.take().unwrap();
        let mut lockstep = Lockstep::new(haptic_loop, Box::new(device)).unwrap();
        let (mut shown, mut greatest_n) = (0, 0.0_f64);
        for tick in 0..1000 {
            if tick % 50 == 0 {
                let model = handle.model_slot();
                (model.scheme, model.contact) = (Scheme::Hold, Contact::Held);
                model.id.sequence = tick;
                // It begins with little, as the chain asks.
                let (size_n, turn) = ((tick as f64 / 100.0).min(2.2), 0.02 * tick as f64);
                model.force_n = size_n * DVec3::new(turn.cos(), turn.sin(), 0.5).normalize();
                handle.publish_model();
            }
            let before = bench.board(|it| it.exchanged());
            bench.pass_ms(1);
            lockstep.run(1);
            assert_eq!(bench.board(|it| it.exchanged()), before + 1, "one report for each, tick {tick}");
            let record = handle.next_record().unwrap();
            let off_n = bench.applied_force_n() - record.force_n;
            assert!(off_n.length() < ROUNDING_N, "{form:?} tick {tick}: {off_n} of {}", record.force_n);
            let off_m = record.reading.unwrap().position_m - bench.board(|it| it.tip_m());
            assert!(off_m.length() < 2e-3, "tick {tick}: {off_m}");
            shown += u32::from(record.force_n.length() > 0.5);
            greatest_n = greatest_n.max(record.force_n.length());
        }
        assert!(shown > 500 && greatest_n > 2.1, "{shown} {greatest_n}");
        assert_eq!((counters.malformed(), counters.skipped()), (0, 0));
        assert!(counters.read() >= 1000 && counters.forces() >= 990);
        drop(lockstep);
        assert_eq!(bench.board(|it| it.currents_ma()), [0; 3], "zero when it is closed");
    }
}

#[test]
fn the_hand_is_pushed_as_far_as_its_spring_gives() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14), homed());
    let force_n = DVec3::new(0.5, -1.0, 0.8);
    let before_m = bench.ticks(30, DVec3::ZERO).position_m;
    let after_m = bench.ticks(2000, force_n).position_m;
    // 400 N/m; the encoders' counts are 0.07 mm apart.
    assert!((after_m - before_m - force_n / 400.0).length() < 2e-4, "{}", after_m - before_m);
}

#[test]
fn the_button_and_the_encoders_noise_come_through() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes64).calibrated().with_noise(3), kept());
    assert_eq!(bench.tick(DVec3::ZERO).buttons, 0);
    bench.board(|it| it.press(true));
    bench.tick(DVec3::ZERO);
    assert_eq!(bench.tick(DVec3::ZERO).buttons, 1);
    bench.board(|it| it.press(false));
    bench.tick(DVec3::ZERO);
    let mut farthest_m = 0.0_f64;
    for _ in 0..200 {
        let reading = bench.tick(DVec3::ZERO);
        assert_eq!(reading.buttons, 0);
        farthest_m = farthest_m.max(reading.position_m.distance(bench.board(|it| it.tip_m())));
    }
    // Three counts and a half of each body: 0.92 mrad of B and C, 0.69 mrad of A.
    let most_m = 3.5 * DVec3::new(0.245 / 32e3, 0.205 / 24e3, 0.245 / 24e3).length() * std::f64::consts::TAU;
    assert!(farthest_m > 0.3 * most_m && farthest_m < 1.01 * most_m, "{farthest_m} {most_m}");
    // Force is as good as the pose is: 1 mrad.
    bench.ticks(40, DVec3::X);
    assert!((bench.applied_force_n() - DVec3::X).length() < 2.0 * ROUNDING_N, "{}", bench.applied_force_n());
}

#[test]
fn a_force_that_takes_too_much_current_is_made_smaller_and_keeps_its_direction() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    let direction = DVec3::new(0.3, 0.9, 0.2).normalize();
    bench.ticks(40, 100.0 * direction);
    let felt_n = bench.applied_force_n();
    let most_ma = bench.board(|it| it.currents_ma()).map(i16::abs).into_iter().max();
    assert_eq!(most_ma, Some(2000));
    assert!(felt_n.length() < 5.0 && felt_n.normalize().dot(direction) > 1.0 - 1e-5, "{felt_n}");
    // Where the motors can, the largest force of the device is the bound.
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
fn no_force_where_the_arm_is_out_of_reach_or_the_force_no_number() {
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
    // Back again it begins with little.
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
