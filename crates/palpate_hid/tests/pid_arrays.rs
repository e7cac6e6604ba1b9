//! PID arrays whose Logical Minimum is 0: firmware numbers their usages from 0, as HID 1.11 has it, or from 1, as Linux does.

use crate::hex;
use crate::joystick_bench;
use crate::joystick_bench::{Bench, full_force, info};
use crate::report_log::RecordedFirmware;
use glam::DVec3;
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::Arc;

/// Force of the tests, N, and the tolerance: half a count of 50 N.
const FORCE_N: DVec3 = DVec3::new(0.4, 0.0, -0.2);
const TOLERANCE_N: f64 = 0.0025;

/// The published descriptor of the Arduino library.
fn published() -> Vec<u8> {
    hex::bytes(include_str!("data/arduino_ffb.txt"))
}

/// `descriptor` with the only occurrence of `old` replaced by `new`.
fn replaced(descriptor: &[u8], old: &str, new: &str) -> Vec<u8> {
    let (old, new) = (hex::bytes(old), hex::bytes(new));
    let mut found = descriptor.windows(old.len()).enumerate().filter(|(_, items)| *items == old);
    let (at, _) = found.next().unwrap();
    assert!(found.next().is_none(), "{old:02x?} occurs twice");
    [&descriptor[..at], &new, &descriptor[at + old.len()..]].concat()
}

/// Six commands: enable, disable, stop all, reset, pause, continue.
fn control_from_0(descriptor: &[u8], range: &str) -> Vec<u8> {
    replaced(descriptor, "09 9b 09 9c 15 01 25 06", &format!("09 9b 09 9c {range}"))
}

/// Four commands, without pause and continue.
fn control_of_four(descriptor: &[u8]) -> Vec<u8> {
    replaced(descriptor, "09 9a 09 9b 09 9c 15 01 25 06", "09 9a 15 00 25 03")
}

fn operation_from_0(descriptor: &[u8]) -> Vec<u8> {
    replaced(descriptor, "09 7b 15 01 25 03", "09 7b 15 00 25 02")
}

fn effect_type_from_0(descriptor: &[u8]) -> Vec<u8> {
    let set_effect = replaced(descriptor, "09 28 15 01 25 0c", "09 28 15 00 25 0b");
    replaced(&set_effect, "25 0c 15 01 35 01 45 0c", "25 0b 15 00 35 00 45 0b")
}

fn load_status_from_0(descriptor: &[u8]) -> Vec<u8> {
    replaced(descriptor, "09 8e 25 03 15 01 35 01 45 03", "09 8e 25 02 15 00 35 00 45 02")
}

/// Descriptors with ambiguous arrays, and the reports with these arrays.
fn ambiguous() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let own = published();
    let (control, operation) = ("PID Device Control (000F:0096)", "Effect Operation Report (000F:0077)");
    let effect_type = "Set Effect Report (000F:0021), Create New Effect Report (000F:00AB)";
    let all = "PID Device Control (000F:0096), Effect Operation Report (000F:0077), Set Effect Report (000F:0021), \
               Create New Effect Report (000F:00AB), PID Block Load Report (000F:0089)";
    let control_and_operation = "PID Device Control (000F:0096), Effect Operation Report (000F:0077)";
    let from_0 = control_from_0(&own, "15 00 25 05");
    vec![
        ("control", from_0.clone(), control),
        ("control, range one too long", control_from_0(&own, "15 00 25 06"), control),
        ("control of four commands", control_of_four(&own), control),
        ("operation", operation_from_0(&own), operation),
        ("effect type", effect_type_from_0(&own), effect_type),
        ("load status", load_status_from_0(&own), "PID Block Load Report (000F:0089)"),
        ("control and operation", operation_from_0(&from_0), control_and_operation),
        ("all", load_status_from_0(&effect_type_from_0(&operation_from_0(&from_0))), all),
    ]
}

const BOTH: [PidArrayBase; 2] = [PidArrayBase::LogicalMinimum, PidArrayBase::One];

/// A bench with firmware of the base `base` whose actuators are on, as a driver of the operating system may leave them.
fn bench(descriptor: &[u8], base: PidArrayBase) -> Bench {
    let bench = Bench::new(descriptor, SimulatedStick::default());
    let mut firmware = bench.firmware.lock().unwrap();
    firmware.number_arrays(PidArrayBases::all(base));
    firmware.switch_on();
    drop(firmware);
    bench
}

/// Plugs the firmware of `bench` in so that it accepts every output report, as an endpoint does, except rejected magnitudes.
fn accept_all_reports(bench: &Bench, descriptor: &[u8]) {
    struct Accepting(RecordedFirmware);
    impl Firmware for Accepting {
        fn input(&mut self, report: &mut [u8]) -> usize {
            self.0.input(report)
        }
        fn output(&mut self, report: &[u8]) -> bool {
            self.0.output(report) || report[0] != 5
        }
        fn feature(&mut self, report: &mut [u8]) -> usize {
            self.0.feature(report)
        }
        fn set_feature(&mut self, report: &[u8]) -> bool {
            self.0.set_feature(report)
        }
    }
    let recorded = RecordedFirmware { firmware: Arc::clone(&bench.firmware), log: bench.log.clone() };
    bench.bus.plug(info(), descriptor.to_vec(), Accepting(recorded));
}

fn options(pid_arrays: PidArrayBases) -> JoystickOptions {
    JoystickOptions { pid_arrays, ..full_force() }
}

fn is_applied(bench: &Bench) -> bool {
    let [x, y] = bench.force_n();
    (x - FORCE_N.x).abs() <= TOLERANCE_N && (y - FORCE_N.z).abs() <= TOLERANCE_N
}

fn is_off(bench: &Bench) -> bool {
    let firmware = bench.firmware.lock().unwrap();
    !firmware.is_on() && firmware.force_n() == [0.0; 2]
}

#[test]
fn ambiguous_array_is_rejected_by_default() {
    for (name, descriptor, arrays) in ambiguous() {
        for base in BOTH {
            let error = bench(&descriptor, base).try_find(full_force()).unwrap_err();
            assert!(matches!(error, HidError::AmbiguousArrays { .. }), "{name}: {error}");
            assert_eq!(
                error.for_loop(),
                HidError::AmbiguousArrays { device: String::new(), arrays: vec![] }.for_loop()
            );
            let text = error.to_string();
            let ending = if arrays.contains(", ") { ("s", "") } else { ("", "s") };
            let expected = format!(
                "Stick (1209:ffb0): the array{} of {arrays} begin{} with Logical Minimum 0, which firmware numbers from 0 or from 1; \
                 set `JoystickOptions::pid_arrays` ",
                ending.0, ending.1
            );
            assert!(text.starts_with(&expected), "{name}: {text}");
        }
    }
    bench(&published(), PidArrayBase::One).try_find(full_force()).unwrap();
}

/// One option for all arrays, or one for each.
#[test]
fn unsettled_arrays_are_named() {
    let [.., (_, all, _)] = &ambiguous()[..] else { panic!("no descriptors") };
    let settled = PidArrayBases { load_status: None, ..PidArrayBases::all(PidArrayBase::One) };
    let error = bench(all, PidArrayBase::One).try_find(options(settled)).unwrap_err();
    let HidError::AmbiguousArrays { arrays, .. } = error else { panic!("{error}") };
    assert_eq!(arrays, ["PID Block Load Report (000F:0089)"]);
}

#[test]
fn settled_arrays_give_the_force_and_switch_off() {
    for base in BOTH {
        for (name, descriptor, _) in ambiguous() {
            for accepts_all in [false, true] {
                let bench = bench(&descriptor, base);
                if accepts_all {
                    accept_all_reports(&bench, &descriptor);
                }
                for ends in ["close", "drop", "emergency stop"] {
                    let case = format!("{name} from {base:?}, {ends}, accepts all: {accepts_all}");
                    let mut device = bench.device(options(PidArrayBases::all(base)));
                    device.open().unwrap();
                    device.write(FORCE_N).unwrap();
                    assert!(is_applied(&bench), "{case}: {:?}", bench.force_n());
                    match ends {
                        "close" => device.close().unwrap(),
                        "drop" => drop(device),
                        _ => {
                            device.emergency_stop().unwrap().stop().unwrap();
                            assert!(is_off(&bench), "{case}");
                            // The loop's next force starts the effects again.
                            bench.advance_ms(60);
                            device.write(FORCE_N).unwrap();
                            for _ in 0..25 {
                                bench.advance_ms(1);
                                device.write(FORCE_N).unwrap();
                            }
                            assert!(is_applied(&bench), "{case}: {:?} after the stop", bench.force_n());
                            device.close().unwrap();
                        }
                    }
                    assert!(is_off(&bench), "{case}");
                    assert_eq!(bench.firmware.lock().unwrap().effects(), 0, "{case}");
                }
            }
        }
    }
}

/// The other base than that of the firmware: the force is missing or wrong, and the device is off after every end.
#[test]
fn wrong_base_leaves_the_device_off() {
    for (base, wrong) in [(BOTH[0], BOTH[1]), (BOTH[1], BOTH[0])] {
        for (name, descriptor, _) in ambiguous() {
            for accepts_all in [false, true] {
                for ends in ["close", "drop", "emergency stop"] {
                    let case = format!("{name} from {base:?}, {ends}, accepts all: {accepts_all}");
                    let bench = bench(&descriptor, base);
                    if accepts_all {
                        accept_all_reports(&bench, &descriptor);
                    }
                    let mut device = bench.device(options(PidArrayBases::all(wrong)));
                    let Ok(()) = device.open() else {
                        assert!(is_off(&bench), "{case}, not opened");
                        continue;
                    };
                    let _ = device.write(FORCE_N);
                    match ends {
                        "close" => drop(device.close()),
                        "drop" => drop(device),
                        _ => drop(device.emergency_stop().unwrap().stop()),
                    }
                    assert!(is_off(&bench), "{case}: {:?}", bench.force_n());
                }
            }
        }
    }
}

/// The last defence: the device rejects magnitudes, and the actuators are switched off. In one reading the reports of this enable them
/// for a moment, so they are sent once.
#[test]
fn rejected_magnitudes_switch_the_actuators_off_once() {
    for (base, set) in [(BOTH[0], BOTH[0]), (BOTH[1], BOTH[1]), (BOTH[1], BOTH[0])] {
        let descriptor = control_of_four(&published());
        let bench = bench(&descriptor, base);
        accept_all_reports(&bench, &descriptor);
        let mut device = bench.device(options(PidArrayBases::all(set)));
        device.open().unwrap();
        device.write(DVec3::X * 10.0).unwrap();
        assert!((bench.force_n()[0] - 10.0).abs() <= TOLERANCE_N, "{base:?}");
        bench.log.reject(&[&[5]]);
        bench.log.take();
        for _ in 0..5 {
            bench.advance_ms(1);
            assert!(device.write(DVec3::X * 9.0).is_err());
            assert!(is_off(&bench), "{base:?} with {set:?}");
        }
        let control: Vec<_> =
            bench.log.take().into_iter().filter(|line| line.starts_with("write 0c")).collect();
        assert_eq!(control, ["write 0c 01", "write 0c 02"], "{base:?} with {set:?}");
        let _ = device.close();
        assert!(is_off(&bench));
        // Once it accepts magnitudes, another opening gives the force.
        bench.log.reject(&[]);
        let mut device = bench.device(options(PidArrayBases::all(base)));
        device.open().unwrap();
        device.write(FORCE_N).unwrap();
        assert!(is_applied(&bench));
    }
}

/// Reports for the array `09 97 09 98 09 99 09 9a 09 9b 09 9c 15 00 25 05`.
#[test]
fn control_reports_of_each_base() {
    let descriptor = control_from_0(&published(), "15 00 25 05");
    for (base, start, end, emergency) in [
        (BOTH[0], ["03", "05", "00"], ["01", "02"], ["02", "01", "02"]),
        (BOTH[1], ["04", "06", "01"], ["01", "02"], ["03", "01", "02"]),
    ] {
        let bench = bench(&descriptor, base);
        let mut device = bench.device(options(PidArrayBases::all(base)));
        let control = || -> Vec<String> {
            let lines = bench.log.take().into_iter();
            lines.filter_map(|line| line.strip_prefix("write 0c ").map(str::to_owned)).collect()
        };
        device.open().unwrap();
        assert_eq!(control(), start, "{base:?}");
        device.emergency_stop().unwrap().stop().unwrap();
        assert_eq!(control(), emergency, "{base:?}");
        device.close().unwrap();
        assert_eq!(control(), end, "{base:?}");
    }
}

/// Disable comes before enable: here the number that disables in one reading enables in the other, in the other order.
#[test]
fn off_in_both_readings_for_any_order_of_commands() {
    for commands in [
        "09 98 09 97 09 99 09 9a",
        "09 97 09 98 09 9a 09 99",
        "09 9a 09 99 09 98 09 97",
        "09 99 09 97 09 9a 09 98",
    ] {
        let new = format!("{commands} 15 00 25 03");
        let old = "09 97 09 98 09 99 09 9a 09 9b 09 9c 15 01 25 06";
        let descriptor = replaced(&published(), old, &new);
        for base in BOTH {
            for set in BOTH {
                let bench = bench(&descriptor, base);
                accept_all_reports(&bench, &descriptor);
                let mut device = bench.device(options(PidArrayBases::all(set)));
                device.open().unwrap();
                device.write(FORCE_N).unwrap();
                assert!(base != set || is_applied(&bench), "{commands} from {base:?}");
                let mut stop = device.emergency_stop().unwrap();
                stop.stop().unwrap();
                assert!(is_off(&bench), "{commands} from {base:?} with {set:?}");
                let _ = device.close();
                assert!(is_off(&bench), "{commands} from {base:?} with {set:?}");
            }
        }
    }
}

/// Commands are numbered from 1 and operations from 0.
#[test]
fn arrays_of_one_device_may_have_different_bases() {
    let descriptor = operation_from_0(&control_from_0(&published(), "15 00 25 05"));
    let bases = PidArrayBases {
        control: Some(PidArrayBase::One),
        operation: Some(PidArrayBase::LogicalMinimum),
        ..PidArrayBases::default()
    };
    let bench = Bench::new(&descriptor, SimulatedStick::default());
    bench.firmware.lock().unwrap().number_arrays(bases);
    let mut device = bench.device(options(bases));
    device.open().unwrap();
    device.write(FORCE_N).unwrap();
    assert!(is_applied(&bench));
    device.close().unwrap();
    assert!(is_off(&bench));
}

#[test]
fn failed_opening_leaves_the_device_off() {
    for base in BOTH {
        for set in BOTH {
            let bench = bench(&control_from_0(&published(), "15 00 25 05"), base);
            bench.firmware.lock().unwrap().break_effects();
            let mut device = bench.device(options(PidArrayBases::all(set)));
            assert!(matches!(device.open(), Err(DeviceError::Protocol(_))));
            assert!(is_off(&bench), "{base:?} with {set:?}");
            assert_eq!(device.close(), Err(DeviceError::NotOpen));
        }
    }
}

/// A device that was unplugged while it had a force, and returns with its actuators on.
#[test]
fn replugged_device_keeps_its_base() {
    for base in BOTH {
        let bench = bench(&control_of_four(&published()), base);
        let mut device = bench.device(options(PidArrayBases::all(base)));
        device.open().unwrap();
        device.write(FORCE_N).unwrap();
        bench.bus.unplug(joystick_bench::PATH);
        assert_eq!(device.write(2.0 * FORCE_N), Err(DeviceError::Disconnected));
        let _ = device.close();
        bench.plug();
        device.open().unwrap();
        device.write(FORCE_N).unwrap();
        assert!(is_applied(&bench), "{base:?}");
        drop(device);
        assert!(is_off(&bench), "{base:?}");
    }
}

/// Optional parts that are missing, and unusual ranges of bits, do not make a device ambiguous.
#[test]
fn other_deviations_are_accepted() {
    let own = published();
    let without_delay = replaced(&own, "09 51 09 a7", "09 51");
    let without_delay = replaced(
        &without_delay,
        "66 03 10 55 fd 75 10 95 04 91 02 55 00 66 00 00 09 52",
        "66 03 10 55 fd 75 10 95 03 91 02 55 00 66 00 00 09 52",
    );
    let without_offset = replaced(&own, "09 23 15 00 25 03 35 00 45 03 75 04 95 01 91 02", "");
    for descriptor in [without_delay, without_offset] {
        let bench = bench(&descriptor, PidArrayBase::One);
        let mut device = bench.device(full_force());
        device.open().unwrap();
        device.write(FORCE_N).unwrap();
        assert!(is_applied(&bench));
        device.close().unwrap();
        assert!(is_off(&bench));
    }
    // OpenFFBoard's commands are bits of a declared range that has no meaning.
    let openffboard = joystick_bench::openffboard().descriptor;
    let bits = "09 97 09 98 09 99 09 9a 09 9b 09 9c";
    let commands = hex::bytes(bits);
    let at =
        openffboard.windows(commands.len()).position(|items| items == commands).unwrap() + commands.len();
    assert_eq!((openffboard[at], openffboard[at + 2]), (0x15, 0x25), "logical minimum and maximum");
    for range in [[1, 6], [0, 1], [0, 5]] {
        let mut descriptor = openffboard.clone();
        (descriptor[at + 1], descriptor[at + 3]) = (range[0], range[1]);
        let bench = bench(&descriptor, PidArrayBase::One);
        let mut device = bench.device(full_force());
        device.open().unwrap();
        device.write(FORCE_N).unwrap();
        assert!(is_applied(&bench), "{range:?}");
        device.close().unwrap();
        assert!(is_off(&bench), "{range:?}");
    }
}
