//! Force-feedback joysticks to the byte, on three published layouts.

use crate::hex;
use crate::joystick_bench::{Bench, calibrated, full_force, kinds, openffboard, renumbered};
use glam::DVec3;
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::time::Duration;

const NOW: Duration = Duration::ZERO;

/// The lines of a part, their reports renumbered.
fn expected(reports: &str, part: &str, number: impl Fn(u8) -> u8) -> Vec<String> {
    let renumber = |line: String| {
        let (verb, rest) = line.split_once(' ').unwrap();
        let mut bytes = hex::bytes(rest);
        bytes[0] = number(bytes[0]);
        hex::line(verb, &bytes)
    };
    hex::part(reports, part).into_iter().map(renumber).collect()
}

fn passes_to_the_byte(number: impl Fn(u8) -> u8 + Copy) {
    for kind in kinds() {
        let bench = Bench::new(&renumbered(&kind.descriptor, number), SimulatedStick::default());
        let mut device = bench.device(full_force());
        let part = |name| expected(kind.reports, name, number);
        device.open().unwrap();
        assert_eq!(bench.log.take(), part("start"), "{}", kind.name);
        assert_eq!(bench.force_n(), [0.0, 0.0]);
        // Half of 50 N to the right and a quarter away from the hand's owner; what is upwards is not shown.
        device.write(DVec3::new(25.0, 7.0, -12.5)).unwrap();
        assert_eq!(bench.log.take(), part("half to the right and a quarter away"), "{}", kind.name);
        let mut stop = device.emergency_stop().unwrap();
        stop.stop().unwrap();
        assert_eq!(bench.log.take(), part("emergency"), "{}", kind.name);
        assert!(!bench.firmware.lock().unwrap().is_on());
        device.close().unwrap();
        assert_eq!(bench.log.take(), part("stop"), "{}", kind.name);
        assert_eq!(bench.firmware.lock().unwrap().effects(), 0);
    }
}

#[test]
fn every_report_is_as_published() {
    passes_to_the_byte(|id| id);
}

/// Nothing may depend on a report's number: all of them are others, and in another order.
#[test]
fn numbers_of_reports_mean_nothing() {
    passes_to_the_byte(|id| 0xFF - id);
    passes_to_the_byte(|id| id.rotate_left(3));
}

#[test]
fn the_published_descriptor_is_complete() {
    let descriptor = openffboard().descriptor;
    // USB_HID_2FFB_REPORT_DESC_SIZE of the firmware: 51 + 118 + 806 + 7 + 108 + 125.
    assert_eq!(descriptor.len(), 1215);
    let read = ReportDescriptor::parse(&descriptor).unwrap();
    let bytes = |kind, id| read.report(kind, id).unwrap().bytes();
    assert_eq!(bytes(ReportKind::Input, 1), 24);
    assert_eq!([1, 5, 0x0A, 0x0C].map(|id| bytes(ReportKind::Output, id)), [21, 3, 3, 1]);
    assert_eq!([0x11, 0x12, 0x13].map(|id| bytes(ReportKind::Feature, id)), [3, 4, 4]);
}

#[test]
fn what_has_not_changed_is_said_again_after_25_ms_and_not_before() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    device.write(DVec3::X).unwrap();
    bench.log.take();
    for ms in 1..=60 {
        bench.advance_ms(1);
        device.write(DVec3::X).unwrap();
        let again = bench.log.take();
        // Both at 25 ms and at 50 ms; y was last written when it was set to zero, at the same time.
        assert_eq!(again.len(), if ms % 25 == 0 { 2 } else { 0 }, "{ms} ms: {again:?}");
    }
    // Less than half a count is no change.
    device.write(DVec3::X * (1.0 + 1e-5)).unwrap();
    assert!(bench.log.take().is_empty());
    device.write(DVec3::X * 1.01).unwrap();
    assert_eq!(bench.log.take(), ["write 05 01 96 02"]);
    let counters = device.counters();
    // Those at 0, 25, 50 and 60 ms, of which a report went out.
    assert_eq!(counters.forces(), 4);
    assert!((counters.force_rate_hz().unwrap() - 3.0 / 0.06).abs() < 1e-9);
}

#[test]
fn the_axis_that_gets_smaller_goes_first() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    let mut order = |x: f64, z: f64| {
        bench.log.take();
        device.write(DVec3::new(x, 0.0, z)).unwrap();
        bench.log.take().iter().map(|line| line.as_bytes()[10]).collect::<Vec<u8>>()
    };
    assert_eq!(order(20.0, 1.0), b"21", "both grow: the smaller growth first");
    assert_eq!(order(1.0, 20.0), b"12");
    assert_eq!(order(-20.0, -1.0), b"21", "a change of sign is no growth");
    assert_eq!(order(2.0, 2.0), b"12");
}

/// A report is refused. Neither axis goes on with an old force, and what comes back comes slowly: the loop believes that the device
/// has what it had.
#[test]
fn half_a_force_is_no_force() {
    for refused in [1, 2] {
        let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
        let mut device = bench.device(full_force());
        device.open().unwrap();
        let force_n = DVec3::new(20.0, 0.0, 20.0);
        device.write(force_n).unwrap();
        // That axis takes nothing but zero.
        let one = |count: i16| [&[5, refused][..], &count.to_le_bytes()].concat();
        bench.log.reject(&[&one(6553), &one(13106)]);
        bench.advance_ms(1);
        assert_eq!(
            device.write(DVec3::new(10.0, 0.0, 10.0)),
            Err(DeviceError::Protocol("it refused an output report"))
        );
        assert_eq!(bench.force_n(), [0.0, 0.0], "axis {refused} refused");
        bench.log.reject(&[]);
        // Once it takes forces again, a twentieth of the force more every millisecond.
        let mut felt_n = Vec::new();
        for _ in 0..25 {
            bench.advance_ms(1);
            device.write(force_n).unwrap();
            felt_n.push(bench.force_n());
        }
        assert_eq!(felt_n[0], [0.0, 0.0]);
        for pair in felt_n.windows(2) {
            let growth = pair[1][0] - pair[0][0];
            assert!((0.0..=2.01).contains(&growth), "{growth} N in a millisecond");
            assert!((pair[1][1] - pair[1][0]).abs() < 1e-9);
        }
        assert!((felt_n[24][0] - 20.0).abs() < 50.0 / 32767.0);
    }
}

/// An axis that takes nothing at all, not even zero: the actuators are off until it does.
#[test]
fn an_axis_that_is_deaf_switches_the_actuators_off() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    let force_n = DVec3::new(20.0, 0.0, 10.0);
    device.write(force_n).unwrap();
    bench.log.reject(&[&[5, 1]]);
    for _ in 0..5 {
        bench.advance_ms(1);
        assert!(device.write(DVec3::new(1.0, 0.0, 30.0)).is_err());
        assert!(!bench.firmware.lock().unwrap().is_on());
    }
    bench.log.reject(&[]);
    for _ in 0..25 {
        bench.advance_ms(1);
        device.write(force_n).unwrap();
    }
    assert!(bench.firmware.lock().unwrap().is_on());
    assert!((bench.force_n()[0] - 20.0).abs() < 50.0 / 32767.0);
}

#[test]
fn a_device_that_was_stopped_beside_is_started_anew_from_zero() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    device.write(DVec3::X * 10.0).unwrap();
    let mut stop = device.emergency_stop().unwrap();
    bench.advance_ms(60);
    stop.stop().unwrap();
    assert_eq!(bench.force_n(), [0.0, 0.0]);
    bench.log.take();
    device.write(DVec3::X * 10.0).unwrap();
    let begun = ["05 01 00 00", "05 02 00 00", "0c 01", "0a 01 01 01", "0a 02 01 01"];
    assert_eq!(bench.log.take(), begun.map(|bytes| format!("write {bytes}")));
    for _ in 0..20 {
        bench.advance_ms(1);
        device.write(DVec3::X * 10.0).unwrap();
    }
    assert!((bench.force_n()[0] - 10.0).abs() < 50.0 / 32767.0);
}

/// Forces are on the stick what they are in the frame: +x to the right, +z towards the hand's owner, which is +y of a joystick; within
/// a count of the device, and what its directions are coarse by.
#[test]
fn force_felt_is_force_written() {
    for kind in kinds() {
        let bench = Bench::new(&kind.descriptor, SimulatedStick::default());
        let mut device = bench.device(full_force());
        device.open().unwrap();
        for step in 0..200 {
            let angle = 0.1 * f64::from(step);
            let force_n = 0.2 * f64::from(step) * DVec3::new(angle.cos(), 0.0, angle.sin());
            bench.advance_ms(1);
            device.write(force_n).unwrap();
            let [x, y] = bench.force_n();
            let count_n = 50.0 / kind.full;
            assert!((x - force_n.x).abs() <= count_n + 1e-4 * force_n.x.abs(), "{}: {x} N", kind.name);
            let crossed_n = kind.crossed * force_n.x.abs();
            assert!((y - force_n.z).abs() <= count_n + crossed_n, "{}: {y} N", kind.name);
        }
        device.write(DVec3::ZERO).unwrap();
        assert_eq!(bench.force_n(), [0.0, 0.0], "zero is exactly zero");
    }
}

#[test]
fn force_is_projected_limited_and_turned_round() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let felt = |options: JoystickOptions, force_n: DVec3| {
        let mut device = bench.device(options);
        device.open().unwrap();
        device.write(force_n).unwrap();
        let felt_n = bench.force_n();
        device.close().unwrap();
        felt_n
    };
    let near = |[x, y]: [f64; 2], [a, b]: [f64; 2]| (x - a).hypot(y - b) < 0.002;
    let five = calibrated();
    assert!(near(felt(five, DVec3::new(30.0, 100.0, -40.0)), [3.0, -4.0]), "shortened to 5 N, not bent");
    assert!(near(felt(five, DVec3::Y * 30.0), [0.0, 0.0]));
    let upright = JoystickOptions { plane: [DVec3::X, DVec3::Y], ..five };
    assert!(near(felt(upright, DVec3::new(1.0, 2.0, 3.0)), [1.0, 2.0]));
    let reversed = JoystickOptions { reverse: [true, false], ..five };
    assert!(near(felt(reversed, DVec3::new(1.0, 2.0, 3.0)), [-1.0, 3.0]));
    for force_n in [DVec3::NAN, DVec3::new(f64::INFINITY, 0.0, 1.0)] {
        assert_eq!(felt(five, force_n), [0.0, 0.0], "what is not a number is no force");
    }
    let device = bench.device(upright);
    assert_eq!(device.quantized_force_n(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(1.0, 2.0, 0.0));
    let description = device.describe();
    assert_eq!(description.max_force_n, 5.0);
    assert_eq!(description.rate_hz, 500.0);
    assert_eq!(description.workspace_m[1], DVec3::new(0.06, 0.06, 0.0));
}

/// A game has paused it and ended: it is felt all the same, also where the pause cannot be ended because nobody listens to that.
#[test]
fn a_pause_that_a_game_has_left_is_ended() {
    let published = openffboard().descriptor;
    let pause = [0x0C, 0x10];
    let felt_n = |refused: &[&[u8]]| {
        let bench = Bench::new(&published, SimulatedStick::default());
        assert!(bench.firmware.lock().unwrap().output(&pause));
        bench.log.reject(refused);
        let mut device = bench.device(full_force());
        device.open().unwrap();
        device.write(DVec3::X * 10.0).unwrap();
        bench.force_n()[0]
    };
    assert!((felt_n(&[]) - 10.0).abs() < 0.002);
    assert_eq!(felt_n(&[&[0x0C, 0x20]]), 0.0);
}

/// By default 5 N are asked for as a hundredth of the greatest force, so that a device of 500 N is within its limit; one of 50 N shows
/// a tenth.
#[test]
fn the_default_is_careful_with_strong_devices() {
    for (full_scale_n, felt_n) in [(500.0, 5.0), (150.0, 1.5), (50.0, 0.5)] {
        let bench = Bench::new(
            &openffboard().descriptor,
            SimulatedStick { full_scale_n, ..SimulatedStick::default() },
        );
        let mut device = bench.device(JoystickOptions::default());
        device.open().unwrap();
        device.write(DVec3::X * 100.0).unwrap();
        assert!((bench.force_n()[0] - felt_n).abs() <= full_scale_n / 32767.0, "{:?}", bench.force_n());
    }
}

/// A wheel: one motor, and a pedal that is called y.
#[test]
fn a_wheel_has_one_axis() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(JoystickOptions { use_y: false, ..full_force() });
    device.open().unwrap();
    assert_eq!(bench.firmware.lock().unwrap().effects(), 1);
    device.write(DVec3::new(1.0, 0.0, 30.0)).unwrap();
    assert!(bench.force_n()[1].abs() < 1e-12);
    bench.firmware.lock().unwrap().move_hand([0.03, 0.05]);
    for _ in 0..2000 {
        assert!(device.read(NOW).is_ok());
        bench.advance_ms(1);
        device.write(DVec3::new(1.0, 0.0, 30.0)).unwrap();
    }
    let position_m = device.read(NOW).unwrap().position_m;
    assert!(position_m.x > 0.03 && position_m.z == 0.0);
    assert_eq!((device.describe().rate_hz, device.describe().workspace_m[1].z), (1000.0, 0.0));
    assert_eq!(device.quantized_force_n(DVec3::ONE), DVec3::X);
}

#[test]
fn a_new_effect_is_asked_for_and_its_answer_believed() {
    let said = |stick: SimulatedStick, change: &dyn Fn(&Bench), descriptor: &[u8]| {
        let bench = Bench::new(descriptor, stick);
        change(&bench);
        let mut device = bench.device(full_force());
        let opened = device.open();
        let firmware = bench.firmware.lock().unwrap();
        assert!(firmware.effects() == 0 && !firmware.is_on(), "what was begun is ended");
        opened.unwrap_err()
    };
    let published = openffboard().descriptor;
    let small = SimulatedStick { max_effects: 1, ..SimulatedStick::default() };
    let protocol = DeviceError::Protocol;
    let fewer = protocol("it plays fewer effects at once than it has axes");
    assert_eq!(said(small, &|_| (), &published), fewer);
    // Without a pool report it is noticed when there is no room for the second.
    let mut without_pool = published.clone();
    let at = published.windows(4).position(|items| items == [0x09, 0x7F, 0xA1, 0x02]).unwrap();
    without_pool[at + 1] = 0xF0;
    assert_eq!(said(small, &|_| (), &without_pool), protocol("it has no room for another effect"));
    let fail = |bench: &Bench| bench.firmware.lock().unwrap().break_effects();
    let stick = SimulatedStick::default();
    assert_eq!(said(stick, &fail, &published), protocol("it could not make a constant force"));
    let mute = |bench: &Bench| bench.log.reject(&[&[0x12]]);
    assert_eq!(said(stick, &mute, &published), protocol("it refused a feature report"));
    let unwilling = |bench: &Bench| bench.log.reject(&[&[0x11]]);
    assert_eq!(said(stick, &unwilling, &published), protocol("it refused a feature report"));
    // A pool that is not told is not needed.
    let bench = Bench::new(&published, stick);
    bench.log.reject(&[&[0x13]]);
    bench.device(full_force()).open().unwrap();
}

#[test]
fn what_is_missing_is_named() {
    let published = openffboard().descriptor;
    // Each usage as it first stands in its report.
    for (old, told) in [
        (
            &[0x09, 0x21, 0xA1, 0x02][..],
            "ET Constant Force (000F:0026) in an output report of Set Effect Report (000F:0021)",
        ),
        (
            &[0x09, 0x79, 0x09, 0x7A],
            "Op Effect Start (000F:0079) in an output report of Effect Operation Report (000F:0077)",
        ),
        (
            &[0x09, 0x96, 0xA1, 0x02],
            "DC Device Reset (000F:009A) in an output report of PID Device Control (000F:0096)",
        ),
        (
            &[0x09, 0x98, 0x09, 0x99],
            "DC Disable Actuators (000F:0098) in an output report of PID Device Control (000F:0096)",
        ),
        (
            &[0x09, 0xAB, 0xA1, 0x02],
            "ET Constant Force (000F:0026) in a feature report of Create New Effect Report (000F:00AB)",
        ),
        (
            &[0x09, 0x8C, 0x09, 0x8D],
            "Block Load Success (000F:008C) in a feature report of PID Block Load Report (000F:0089)",
        ),
        (
            &[0x09, 0x30, 0x09, 0x31, 0x09, 0x32],
            "X (0001:0030) in an input report of Joystick (0001:0004) or Game Pad (0001:0005)",
        ),
        (
            &[0x16, 0x01, 0x80, 0x26, 0xFF, 0x7F, 0x36],
            "Magnitude (000F:0070) of a constant force that can be negative",
        ),
    ] {
        let mut descriptor = published.clone();
        let at = published.windows(old.len()).position(|items| items == old).unwrap();
        // Another usage; a least value that is not negative.
        (descriptor[at + 1], descriptor[at + 2]) = match old[0] {
            0x16 => (0, 0),
            _ => (0xF0, old[2]),
        };
        let error = Bench::new(&descriptor, SimulatedStick::default()).try_find(full_force()).unwrap_err();
        let HidError::Unsupported { lacks, device } = error else { panic!("{error}") };
        assert_eq!(lacks, format!("its report descriptor has no {told}"));
        assert_eq!(device, "Stick (1209:ffb0)");
    }
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let good = JoystickOptions::default();
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    for (options, what) in [
        (
            JoystickOptions { full_scale_n: 0.0, ..good },
            "full scale of the joystick, N is 0; it must be above 0",
        ),
        (JoystickOptions { full_scale_n: f64::NAN, ..good }, "full scale of the joystick, N is NaN"),
        (
            JoystickOptions { max_force_n: 501.0, ..good },
            "largest force of the joystick, N is 501; it must be 0 to its",
        ),
        (JoystickOptions { max_force_n: -1.0, ..good }, "largest force of the joystick, N is -1"),
        (JoystickOptions { travel_m: [0.1, 0.0], ..good }, "travel of the joystick to either side, m is 0"),
        (
            JoystickOptions { plane: [DVec3::X, DVec3::X], ..good },
            "cosine between the directions of the joystick's plane is 1",
        ),
        (
            JoystickOptions { plane: [DVec3::X * 2.0, DVec3::Y], ..good },
            "length of a direction of the joystick's plane is 2",
        ),
        (
            JoystickOptions { plane: [DVec3::NAN, DVec3::Y], ..good },
            "length of a direction of the joystick's plane is NaN",
        ),
        (
            JoystickOptions { silent_after_s: Some(0.0), ..good },
            "silence of the joystick that counts as timed out, s is 0",
        ),
    ] {
        let told = bench.try_find(options).unwrap_err().to_string();
        assert!(told.starts_with(what), "{told}");
    }
    good.validate().unwrap();
}
