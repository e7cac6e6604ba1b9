//! Reports of force-feedback joysticks, byte by byte, on three published layouts.

use crate::hex;
use crate::joystick_bench::{Bench, calibrated, full_force, kinds, openffboard, renumbered};
use glam::DVec3;
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::time::Duration;

const NOW: Duration = Duration::ZERO;

/// Lines of a part, with the report IDs mapped by `number`.
fn expected(reports: &str, part: &str, number: impl Fn(u8) -> u8) -> Vec<String> {
    let renumber = |line: String| {
        let (verb, rest) = line.split_once(' ').unwrap();
        let mut bytes = hex::bytes(rest);
        bytes[0] = number(bytes[0]);
        hex::line(verb, &bytes)
    };
    hex::part(reports, part).into_iter().map(renumber).collect()
}

fn check_all_reports(number: impl Fn(u8) -> u8 + Copy) {
    for kind in kinds() {
        let bench = Bench::new(&renumbered(&kind.descriptor, number), SimulatedStick::default());
        let mut device = bench.device(full_force());
        let part = |name| expected(kind.reports, name, number);
        device.open().unwrap();
        assert_eq!(bench.log.take(), part("start"), "{}", kind.name);
        assert_eq!(bench.force_n(), [0.0, 0.0]);
        // Half of 50 N to the right and a quarter away from the user; the upward component is not displayed.
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
fn reports_match_the_data_files() {
    check_all_reports(|id| id);
}

/// The driver must not depend on report IDs: all of them change, also their order.
#[test]
fn report_ids_are_arbitrary() {
    check_all_reports(|id| 0xFF - id);
    check_all_reports(|id| id.rotate_left(3));
}

#[test]
fn published_descriptor_is_complete() {
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
fn unchanged_magnitude_is_sent_again_after_25_ms() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    device.write(DVec3::X).unwrap();
    bench.log.take();
    for ms in 1..=60 {
        bench.advance_ms(1);
        device.write(DVec3::X).unwrap();
        let again = bench.log.take();
        // Both axes at 25 ms and at 50 ms; y was last sent at the start, at the same time.
        assert_eq!(again.len(), if ms % 25 == 0 { 2 } else { 0 }, "{ms} ms: {again:?}");
    }
    // Less than half a count is not sent.
    device.write(DVec3::X * (1.0 + 1e-5)).unwrap();
    assert!(bench.log.take().is_empty());
    device.write(DVec3::X * 1.01).unwrap();
    assert_eq!(bench.log.take(), ["write 05 01 96 02"]);
    let counters = device.counters();
    // Forces with a report: at 0, 25, 50 and 60 ms.
    assert_eq!(counters.forces(), 4);
    assert!((counters.force_rate_hz().unwrap() - 3.0 / 0.06).abs() < 1e-9);
}

#[test]
fn decreasing_axis_is_sent_first() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    let mut order = |x: f64, z: f64| {
        bench.log.take();
        device.write(DVec3::new(x, 0.0, z)).unwrap();
        bench.log.take().iter().map(|line| line.as_bytes()[10]).collect::<Vec<u8>>()
    };
    assert_eq!(order(20.0, 1.0), b"21", "both increase: the smaller increase first");
    assert_eq!(order(1.0, 20.0), b"12");
    assert_eq!(order(-20.0, -1.0), b"21", "a change of sign is no increase");
    assert_eq!(order(2.0, 2.0), b"12");
}

/// After a rejected report, neither axis keeps an old force, and the force returns slowly, as the loop assumes that the device has the
/// last one.
#[test]
fn rejected_magnitude_zeroes_both_axes() {
    for rejected in [1, 2] {
        let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
        let mut device = bench.device(full_force());
        device.open().unwrap();
        let force_n = DVec3::new(20.0, 0.0, 20.0);
        device.write(force_n).unwrap();
        // The axis accepts only zero.
        let one = |count: i16| [&[5, rejected][..], &count.to_le_bytes()].concat();
        bench.log.reject(&[&one(6553), &one(13106)]);
        bench.advance_ms(1);
        assert_eq!(
            device.write(DVec3::new(10.0, 0.0, 10.0)),
            Err(DeviceError::Protocol("the device rejected an output report"))
        );
        assert_eq!(bench.force_n(), [0.0, 0.0], "axis {rejected} rejected");
        bench.log.reject(&[]);
        // When it accepts forces again, the force grows by a twentieth per millisecond.
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

/// An axis that rejects even zero: the actuators are off until it accepts reports.
#[test]
fn axis_that_rejects_zero_disables_the_actuators() {
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
fn device_stopped_by_another_thread_restarts_from_zero() {
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

/// Forces on the stick equal those in the device frame (+x to the right, +z towards the user, which is the joystick's +y), within a count
/// and the resolution of the device's directions.
#[test]
fn applied_force_is_the_written_force() {
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
fn force_is_projected_limited_and_reversed() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let applied = |options: JoystickOptions, force_n: DVec3| {
        let mut device = bench.device(options);
        device.open().unwrap();
        device.write(force_n).unwrap();
        let felt_n = bench.force_n();
        device.close().unwrap();
        felt_n
    };
    let near = |[x, y]: [f64; 2], [a, b]: [f64; 2]| (x - a).hypot(y - b) < 0.002;
    let max_5_n = calibrated();
    assert!(
        near(applied(max_5_n, DVec3::new(30.0, 100.0, -40.0)), [3.0, -4.0]),
        "limited to 5 N, same direction"
    );
    assert!(near(applied(max_5_n, DVec3::Y * 30.0), [0.0, 0.0]));
    let upright = JoystickOptions { plane: [DVec3::X, DVec3::Y], ..max_5_n };
    assert!(near(applied(upright, DVec3::new(1.0, 2.0, 3.0)), [1.0, 2.0]));
    let reversed = JoystickOptions { reverse: [true, false], ..max_5_n };
    assert!(near(applied(reversed, DVec3::new(1.0, 2.0, 3.0)), [-1.0, 3.0]));
    for force_n in [DVec3::NAN, DVec3::new(f64::INFINITY, 0.0, 1.0)] {
        assert_eq!(applied(max_5_n, force_n), [0.0, 0.0], "non-finite force");
    }
    let device = bench.device(upright);
    assert_eq!(device.displayable_force_n(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(1.0, 2.0, 0.0));
    let description = device.describe();
    assert_eq!(description.max_force_n, 5.0);
    assert_eq!(description.rate_hz, 500.0);
    assert_eq!(description.workspace_m[1], DVec3::new(0.06, 0.06, 0.0));
}

/// A game has paused the device: the driver resumes it, and ignores a rejected resume command.
#[test]
fn start_ends_a_pause() {
    let published = openffboard().descriptor;
    let pause = [0x0C, 0x10];
    let felt_n = |rejected: &[&[u8]]| {
        let bench = Bench::new(&published, SimulatedStick::default());
        assert!(bench.firmware.lock().unwrap().output(&pause));
        bench.log.reject(rejected);
        let mut device = bench.device(full_force());
        device.open().unwrap();
        device.write(DVec3::X * 10.0).unwrap();
        bench.force_n()[0]
    };
    assert!((felt_n(&[]) - 10.0).abs() < 0.002);
    assert_eq!(felt_n(&[&[0x0C, 0x20]]), 0.0);
}

/// By default 5 N are sent as a hundredth of the maximum, which is correct for a device of 500 N; one of 50 N displays a tenth.
#[test]
fn default_full_scale_limits_strong_devices() {
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

/// A wheel: one motor, and a pedal as y.
#[test]
fn wheel_has_one_axis() {
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
    assert_eq!(device.displayable_force_n(DVec3::ONE), DVec3::X);
}

#[test]
fn failed_effect_creation_is_an_error_and_undone() {
    let open_error = |stick: SimulatedStick, change: &dyn Fn(&Bench), descriptor: &[u8]| {
        let bench = Bench::new(descriptor, stick);
        change(&bench);
        let mut device = bench.device(full_force());
        let opened = device.open();
        let firmware = bench.firmware.lock().unwrap();
        assert!(firmware.effects() == 0 && !firmware.is_on(), "the partial start is undone");
        opened.unwrap_err()
    };
    let published = openffboard().descriptor;
    let small = SimulatedStick { max_effects: 1, ..SimulatedStick::default() };
    let protocol = DeviceError::Protocol;
    let fewer = protocol("the device plays fewer simultaneous effects than it has axes");
    assert_eq!(open_error(small, &|_| (), &published), fewer);
    // Without a pool report the second effect fails.
    let mut without_pool = published.clone();
    let at = published.windows(4).position(|items| items == [0x09, 0x7F, 0xA1, 0x02]).unwrap();
    without_pool[at + 1] = 0xF0;
    assert_eq!(
        open_error(small, &|_| (), &without_pool),
        protocol("the device has no memory for another effect")
    );
    let fail = |bench: &Bench| bench.firmware.lock().unwrap().break_effects();
    let stick = SimulatedStick::default();
    assert_eq!(
        open_error(stick, &fail, &published),
        protocol("the device failed to create a constant-force effect")
    );
    let reject_status = |bench: &Bench| bench.log.reject(&[&[0x12]]);
    assert_eq!(
        open_error(stick, &reject_status, &published),
        protocol("the device rejected a feature report")
    );
    let reject_creation = |bench: &Bench| bench.log.reject(&[&[0x11]]);
    assert_eq!(
        open_error(stick, &reject_creation, &published),
        protocol("the device rejected a feature report")
    );
    // The pool report is optional.
    let bench = Bench::new(&published, stick);
    bench.log.reject(&[&[0x13]]);
    bench.device(full_force()).open().unwrap();
}

#[test]
fn missing_usages_are_named() {
    let published = openffboard().descriptor;
    // The first occurrence of each usage in its report.
    for (old, missing) in [
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
        // Replace the usage, or the negative minimum.
        (descriptor[at + 1], descriptor[at + 2]) = match old[0] {
            0x16 => (0, 0),
            _ => (0xF0, old[2]),
        };
        let error = Bench::new(&descriptor, SimulatedStick::default()).try_find(full_force()).unwrap_err();
        let HidError::Unsupported { lacks, device } = error else { panic!("{error}") };
        assert_eq!(lacks, format!("its report descriptor has no {missing}"));
        assert_eq!(device, "Stick (1209:ffb0)");
    }
}

#[test]
fn rejects_invalid_options() {
    let good = JoystickOptions::default();
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let (length, cosine) = (
        "length of a direction of the joystick's plane",
        "cosine between the directions of the joystick's plane",
    );
    for (options, name, value) in [
        (JoystickOptions { full_scale_n: 0.0, ..good }, "full scale of the joystick, N", "0"),
        (JoystickOptions { full_scale_n: f64::NAN, ..good }, "full scale of the joystick, N", "NaN"),
        (JoystickOptions { max_force_n: 501.0, ..good }, "maximum force of the joystick, N", "501"),
        (JoystickOptions { max_force_n: -1.0, ..good }, "maximum force of the joystick, N", "-1"),
        (JoystickOptions { travel_m: [0.1, 0.0], ..good }, "travel of the joystick to either side, m", "0"),
        (JoystickOptions { plane: [DVec3::X, DVec3::X], ..good }, cosine, "1"),
        (JoystickOptions { plane: [DVec3::X * 2.0, DVec3::Y], ..good }, length, "2"),
        (JoystickOptions { plane: [DVec3::NAN, DVec3::Y], ..good }, length, "NaN"),
        (JoystickOptions { silent_after_s: Some(0.0), ..good }, "timeout of the joystick, s", "0"),
    ] {
        let error = bench.try_find(options).unwrap_err();
        let HidError::Option { what, found, .. } = &error else { panic!("{error}") };
        assert_eq!((*what, found.as_str()), (name, value));
    }
    good.validate().unwrap();
}
