//! The check of measured motion against written force: motors that are wired the other way, or to one axis, in a closed loop with a
//! virtual plane and a hand.

use crate::hex;
use crate::joystick_bench;
use crate::joystick_bench::{Bench, calibrated};
use glam::{DMat3, DVec3};
use palpate_haptics::*;
use palpate_hid::JoystickOptions;
use palpate_hid::simulated::*;
use palpate_local::{Contact, Scheme};
use std::sync::Arc;
use std::time::Duration;

/// Motors by direction: as the driver expects, and others.
const RIGHT: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
const X_REVERSED: [[f64; 2]; 2] = [[-1.0, 0.0], [0.0, 1.0]];
const Y_REVERSED: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, -1.0]];
const DEAD: [[f64; 2]; 2] = [[0.0, 0.0], [0.0, 0.0]];
/// One motor, which takes every effect: a wheel.
const ONE_MOTOR: [[f64; 2]; 2] = [[1.0, 1.0], [0.0, 0.0]];

/// A plane at 5 mm along a direction, and a hand.
#[derive(Clone, Copy)]
struct Press {
    wiring: [[f64; 2]; 2],
    options: JoystickOptions,
    along: DVec3,
    stiffness_n_per_m: f64,
    stick: SimulatedStick,
    /// Position of the hand along the direction, m, at a time, s.
    hand_m: fn(f64) -> f64,
    bump_m_per_s: f64,
}

/// The hand goes to 15 mm in half a second and stays.
fn to_15_mm(time_s: f64) -> f64 {
    0.015 * (2.0 * time_s).min(1.0)
}

impl Press {
    fn new(wiring: [[f64; 2]; 2], stiffness_n_per_m: f64) -> Self {
        Self {
            wiring,
            options: calibrated(),
            along: DVec3::X,
            stiffness_n_per_m,
            stick: SimulatedStick::default(),
            hand_m: to_15_mm,
            bump_m_per_s: 0.0,
        }
    }

    /// Runs for 6 s: a loop of 1 kHz in lock step, whose model is a tangent that is published at 50 Hz.
    fn run(self) -> Outcome {
        let descriptor = hex::bytes(include_str!("data/arduino_ffb.txt"));
        let bench = Bench::new(&descriptor, self.stick);
        bench.firmware.lock().unwrap().wire_motors(self.wiring);
        let device = bench.device(self.options);
        let config = LoopConfig {
            device: device.describe().limits(),
            real_time: RealTimeRequest::NONE,
            ..LoopConfig::default()
        };
        let safety = device.describe().safety(1e-3);
        let (mut handle, haptic_loop) =
            haptic_loop(config, LoopSettings { safety, record: true, ..LoopSettings::default() }).unwrap();
        let mut lockstep = Lockstep::new(haptic_loop, Box::new(device)).unwrap();
        let mut outcome = Outcome::default();
        for tick in 0..6000_u32 {
            let time_s = 1e-3 * f64::from(tick);
            let hand = self.along * (self.hand_m)(time_s);
            let mut firmware = bench.firmware.lock().unwrap();
            firmware.move_hand([hand.x, hand.z]);
            // The loop's start stage has ended.
            if tick == 1000 && self.bump_m_per_s > 0.0 {
                let bump = self.along * self.bump_m_per_s;
                firmware.bump([bump.x, bump.z]);
            }
            drop(firmware);
            if tick % 20 == 0 {
                let sample = handle.samples().newest().copied();
                let depth_m = sample.map_or(0.0, |sample| sample.position_m.dot(self.along) - 0.005);
                let model = handle.model_slot();
                (model.scheme, model.contact) = (Scheme::Tangent, Contact::Held);
                (model.force_n, model.position_m) = (DVec3::ZERO, 0.005 * self.along);
                let stiffness = if depth_m > 0.0 { self.stiffness_n_per_m } else { 0.0 };
                let along = self.along.to_array().map(|part| DVec3::splat(part) * self.along);
                model.stiffness_n_per_m = stiffness * DMat3::from_cols(along[0], along[1], along[2]);
                model.id.sequence = sample.map_or(0, |sample| sample.sequence);
                handle.publish_model();
            }
            bench.advance_ms(1);
            lockstep.run(1);
            let written_n = handle.next_record().unwrap().force_n;
            let firmware = bench.firmware.lock().unwrap();
            let ([x, y], [at_x, at_y]) = (firmware.force_n(), firmware.position_m());
            let (applied_n, at_m) = (DVec3::new(x, 0.0, y), DVec3::new(at_x, 0.0, at_y));
            outcome.max_n = outcome.max_n.max(applied_n.length());
            outcome.applied_n = applied_n.dot(self.along);
            outcome.applied_x_n = applied_n.x;
            outcome.at_m = at_m.dot(self.along);
            outcome.written_n = written_n.dot(self.along);
            outcome.is_on = firmware.is_on();
            outcome.excess_n = outcome.excess_n.max(applied_n.length() - written_n.length());
            if (applied_n.length() - written_n.length()).abs() > 0.02 {
                outcome.altered_ticks += 1;
            }
            drop(firmware);
            while let Some(event) = handle.next_event() {
                if let LoopEventKind::DeviceFailed(error) = event.kind {
                    outcome.failures.push((tick, error.to_string()));
                }
            }
        }
        outcome
    }
}

#[derive(Default, Debug)]
struct Outcome {
    /// At the end: force of the motors along the direction and along x, N; force of the loop, N; position, m; actuators.
    applied_n: f64,
    applied_x_n: f64,
    written_n: f64,
    at_m: f64,
    is_on: bool,
    /// Largest force of the motors, N, and largest excess over that of the loop, N.
    max_n: f64,
    excess_n: f64,
    /// Ticks in which the motors had another force than that of the loop.
    altered_ticks: u32,
    /// Ticks and texts of the device's failures.
    failures: Vec<(u32, String)>,
}

impl Outcome {
    /// Tick of the only failure, whose text contains `remedy`.
    #[track_caller]
    fn failed(&self, remedy: &str) -> u32 {
        let [(tick, text)] = &self.failures[..] else { panic!("{self:?}") };
        assert!(text.contains(remedy), "{text}");
        *tick
    }
}

#[test]
fn reversed_motor_is_faded_out_and_reported() {
    for stiffness_n_per_m in [400.0, 100.0] {
        let outcome = Press::new(X_REVERSED, stiffness_n_per_m).run();
        let tick = outcome.failed("invert the first value of `JoystickOptions::reverse`");
        assert!(tick < 1500, "reported at {tick} ms");
        assert_eq!((outcome.applied_n, outcome.is_on), (0.0, false));
        // The hand takes the stick to its own place again.
        assert!(
            (outcome.at_m - 0.015).abs() < 1e-4 && outcome.max_n <= 5.01 && outcome.excess_n < 0.02,
            "{outcome:?}"
        );
    }
    let along_z = Press { along: DVec3::Z, ..Press::new(Y_REVERSED, 400.0) };
    let outcome = along_z.run();
    outcome.failed("invert the second value of `JoystickOptions::reverse`");
    assert_eq!((outcome.applied_n, outcome.is_on), (0.0, false));
    // The other axis has the right sign.
    let outcome = Press { along: DVec3::Z, ..Press::new(X_REVERSED, 400.0) }.run();
    assert!(outcome.failures.is_empty(), "{outcome:?}");
}

#[test]
fn reversed_option_makes_a_reversed_motor_right() {
    let reverse = [true, false];
    for (wiring, options) in
        [(X_REVERSED, JoystickOptions { reverse, ..calibrated() }), (RIGHT, calibrated())]
    {
        for (stiffness_n_per_m, at_m) in [(400.0, 0.00773), (100.0, 0.011)] {
            let outcome = Press { options, ..Press::new(wiring, stiffness_n_per_m) }.run();
            assert!(outcome.failures.is_empty(), "{outcome:?}");
            assert!((outcome.at_m - at_m).abs() < 1e-4, "{outcome:?}");
            assert!((outcome.applied_n + stiffness_n_per_m * (at_m - 0.005)).abs() < 0.02, "{outcome:?}");
        }
    }
    // The option is set and the motor is not reversed.
    let outcome =
        Press { options: JoystickOptions { reverse, ..calibrated() }, ..Press::new(RIGHT, 400.0) }.run();
    outcome.failed("invert the first value of `JoystickOptions::reverse`");
}

/// A stick that nobody holds is drawn to its end in less than a tenth of a second. It rests there without force.
#[test]
fn released_stick_rests_at_its_end_without_force() {
    let stick = SimulatedStick { hand_n_per_m: 0.0, hand_ns_per_m: 0.0, ..SimulatedStick::default() };
    let press = Press { stick, bump_m_per_s: 0.1, hand_m: |_| 0.0, ..Press::new(X_REVERSED, 400.0) };
    let outcome = press.run();
    let tick = outcome.failed("`JoystickOptions::reverse`");
    assert!(tick < 4000, "reported at {tick} ms");
    assert!(
        outcome.applied_n == 0.0 && outcome.max_n <= 5.01 && (outcome.at_m - 0.06).abs() < 1e-9,
        "{outcome:?}"
    );
    // With the right sign it comes back from the plane.
    let outcome = Press { wiring: RIGHT, ..press }.run();
    assert!(outcome.failures.is_empty() && outcome.at_m < 0.005, "{outcome:?}");
}

/// A wheel that declares y: the force of a plane along z moves x.
#[test]
fn force_across_is_reported_with_use_y() {
    let press = Press { along: DVec3::Z, ..Press::new(ONE_MOTOR, 400.0) };
    let outcome = press.run();
    outcome.failed("set `JoystickOptions::use_y` to false");
    assert_eq!((outcome.applied_x_n, outcome.is_on), (0.0, false));
    let options = JoystickOptions { use_y: false, ..calibrated() };
    let outcome = Press { options, ..press }.run();
    assert!(outcome.failures.is_empty() && outcome.applied_x_n == 0.0, "{outcome:?}");
}

/// Motors without force, and a hand that presses: nothing moves with the force, so nothing is reported.
#[test]
fn dead_motors_are_not_reported_as_reversed() {
    for stiffness_n_per_m in [100.0, 400.0] {
        let outcome = Press::new(DEAD, stiffness_n_per_m).run();
        assert!(outcome.failures.is_empty(), "{outcome:?}");
        assert!((outcome.at_m - 0.015).abs() < 1e-4);
    }
}

/// The force alternates for at most a second in the first firm press, and never again.
#[test]
fn right_motor_is_checked_once() {
    fn presses(time_s: f64) -> f64 {
        0.02 * (1.0 - (std::f64::consts::TAU * time_s / 2.0).cos())
    }
    let outcome = Press { hand_m: presses, ..Press::new(RIGHT, 400.0) }.run();
    assert!(outcome.failures.is_empty() && outcome.excess_n < 0.02, "{outcome:?}");
    assert!((100..1000).contains(&outcome.altered_ticks), "{outcome:?}");
    let options = JoystickOptions { check_direction: false, ..calibrated() };
    let outcome = Press { hand_m: presses, options, ..Press::new(RIGHT, 400.0) }.run();
    assert!(outcome.failures.is_empty() && outcome.altered_ticks == 0, "{outcome:?}");
}

/// A hand presses the stick to its end: the force there is removed, and is back after it has left the end.
#[test]
fn force_returns_after_the_stick_has_left_its_end() {
    fn hand_m(time_s: f64) -> f64 {
        if time_s < 0.3 {
            0.2 * time_s / 0.3
        } else if time_s < 4.0 {
            0.2
        } else {
            // Out of the plane, where the loop starts again, and in.
            0.015 * ((time_s - 4.5) / 0.5).clamp(0.0, 1.0)
        }
    }
    let outcome = Press { hand_m, ..Press::new(RIGHT, 400.0) }.run();
    for (_, text) in &outcome.failures {
        assert!(text.contains("until it leaves the end"), "{text}");
    }
    assert!((outcome.applied_n + 1.09).abs() < 0.02 && outcome.is_on, "{outcome:?}");
}

/// Hands that move at will, for several seconds, without a loop: a motor of the right sign and one without force are never reported.
#[test]
fn moving_hands_give_no_false_report() {
    let descriptor = hex::bytes(include_str!("data/arduino_ffb.txt"));
    let mut reversed = 0;
    for seed in 0..60_u32 {
        for wiring in [RIGHT, DEAD, X_REVERSED] {
            // Three sines along each axis, up to 3 Hz and 15 mm; the mass and the hand differ.
            let number = |i: u32| f64::from((seed * 31 + i * 17 + seed * i * 7) % 97) / 97.0;
            let stick = SimulatedStick {
                mass_kg: 0.1 + number(20),
                hand_n_per_m: 50.0 + 400.0 * number(21),
                hand_ns_per_m: 2.0 + 10.0 * number(22),
                ..SimulatedStick::default()
            };
            let bench = Bench::new(&descriptor, stick);
            bench.firmware.lock().unwrap().wire_motors(wiring);
            let mut device = bench.device(calibrated());
            device.open().unwrap();
            let stiffness = 50.0 + 600.0 * number(23);
            let hand = |time_s: f64, axis: u32| {
                let sine = |i: u32| {
                    let hz = 0.2 + 2.8 * number(10 * axis + 2 * i);
                    0.015
                        * number(10 * axis + 2 * i + 1)
                        * (std::f64::consts::TAU * (hz * time_s + number(i))).sin()
                };
                (0..3).map(sine).sum::<f64>()
            };
            let mut result = Ok(());
            for tick in 0..8000_u32 {
                let time_s = 1e-3 * f64::from(tick);
                bench.firmware.lock().unwrap().move_hand([0.01 + hand(time_s, 0), hand(time_s, 1)]);
                bench.advance_ms(1);
                let at_m = device.read(Duration::ZERO).unwrap().position_m;
                let force_n = (-stiffness * (at_m.x - 0.005)).clamp(-5.0, 0.0);
                result = device.write(DVec3::X * force_n);
                if result.is_err() {
                    break;
                }
            }
            match result {
                Err(error) if wiring == X_REVERSED => {
                    assert!(error.to_string().contains("`JoystickOptions::reverse`"), "{error}");
                    reversed += 1;
                }
                Err(error) => panic!("seed {seed}, {wiring:?}: {error}"),
                Ok(()) => {}
            }
        }
    }
    // In the others the hand is stiff, and 2 mJ never come together in a touch.
    assert!(reversed >= 40, "{reversed} of 60 reversed motors are reported");
}

#[test]
fn check_does_not_allocate() {
    let descriptor = hex::bytes(include_str!("data/arduino_ffb.txt"));
    let bench = Bench::new(&descriptor, SimulatedStick::default());
    bench.firmware.lock().unwrap().wire_motors(X_REVERSED);
    // Without a log.
    bench.bus.plug(joystick_bench::info(), descriptor, Arc::clone(&bench.firmware));
    let mut device = bench.device(calibrated());
    device.open().unwrap();
    bench.firmware.lock().unwrap().move_hand([0.03, 0.0]);
    let mut failed = 0;
    let allocations = allocation_counter::measure(|| {
        for _ in 0..3000 {
            bench.advance_ms(1);
            let at_m = device.read(Duration::ZERO).unwrap().position_m;
            failed +=
                u32::from(device.write(DVec3::X * (-400.0 * (at_m.x - 0.005)).clamp(-5.0, 0.0)).is_err());
        }
    });
    assert!(failed > 1000, "{failed}");
    assert_eq!(allocations.count_total, 0, "{allocations:?}");
}
