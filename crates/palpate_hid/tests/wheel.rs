//! A wheel that declares y: one motor, and a pedal as the second axis. Nothing in its descriptor distinguishes it from a joystick.

use crate::hex;
use crate::joystick_bench::{Bench, full_force, info};
use glam::DVec3;
use palpate_haptics::{HapticDevice, Lockstep, LoopConfig, LoopEventKind, LoopSettings, haptic_loop};
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::{Arc, Mutex};

/// X and Y in the input report and in Axes Enable, effect indices 1 to 14, two directions of 0 to 255.
fn descriptor() -> Vec<u8> {
    let mut text = hex::bytes(include_str!("data/arduino_ffb.txt"));
    let mut replace = |old: &str, new: &str| {
        let (old, new) = (hex::bytes(old), hex::bytes(new));
        let mut count = 0;
        while let Some(at) = text.windows(old.len()).position(|items| items == old) {
            text.splice(at..at + old.len(), new.iter().copied());
            count += 1;
        }
        count
    };
    assert_eq!(replace("09 22 15 01 25 28 35 01 45 28", "09 22 15 01 25 0e 35 01 45 0e"), 11);
    assert_eq!(replace("09 22 25 28 15 01 35 01 45 28", "09 22 25 0e 15 01 35 01 45 0e"), 1);
    // Two axes to enable, and one more bit of padding.
    assert_eq!(
        replace(
            "09 30 09 31 09 32 15 00 25 01 75 01 95 03 91 02",
            "09 30 09 31 15 00 25 01 75 01 95 02 91 02"
        ),
        1
    );
    assert_eq!(replace("09 56 95 01 91 03 95 04 91 03", "09 56 95 01 91 03 95 05 91 03"), 1);
    assert_eq!(replace("0b 02 00 0a 00 0b 03 00 0a 00 66 14 00", "0b 02 00 0a 00 66 14 00"), 1);
    assert_eq!(replace("75 08 95 03 91 02 55 00 66 00 00 c0", "75 08 95 02 91 02 55 00 66 00 00 c0"), 1);
    text
}

/// Firmware with one motor, which takes the magnitude of every effect for it, whatever its direction.
struct OneMotor {
    firmware: Arc<Mutex<JoystickFirmware>>,
    /// Magnitudes of the effects 1 and 2.
    magnitudes: Arc<Mutex<[i16; 2]>>,
}

impl Firmware for OneMotor {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.firmware.input(report)
    }
    fn output(&mut self, report: &[u8]) -> bool {
        if let &[5, index, low, high] = report {
            self.magnitudes.lock().unwrap()[usize::from(index) - 1] = i16::from_le_bytes([low, high]);
        }
        self.firmware.output(report)
    }
    fn feature(&mut self, report: &mut [u8]) -> usize {
        self.firmware.feature(report)
    }
    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.firmware.set_feature(report)
    }
}

/// A wheel, and its force along x, N, for firmware that follows directions and for firmware that ignores them.
fn wheel() -> (Bench, impl Fn() -> [f64; 2]) {
    let bench = Bench::new(&descriptor(), SimulatedStick::default());
    let magnitudes = Arc::<Mutex<[i16; 2]>>::default();
    let firmware = OneMotor { firmware: Arc::clone(&bench.firmware), magnitudes: Arc::clone(&magnitudes) };
    bench.bus.plug(info(), descriptor(), firmware);
    let firmware = Arc::clone(&bench.firmware);
    let force_n = move || {
        let sum: f64 = magnitudes.lock().unwrap().map(f64::from).iter().sum();
        [firmware.lock().unwrap().force_n()[0], 50.0 * sum / 10_000.0]
    };
    (bench, force_n)
}

/// Events of a loop with the device, as texts.
fn notices(device: HidDevice) -> Vec<LoopEventKind> {
    let config = LoopConfig { device: device.describe().limits(), ..LoopConfig::default() };
    let (mut handle, haptic_loop) = haptic_loop(config, LoopSettings::default()).unwrap();
    let mut lockstep = Lockstep::new(haptic_loop, Box::new(device)).unwrap();
    lockstep.run(10);
    let events = std::iter::from_fn(|| handle.next_event()).map(|event| event.kind);
    events.filter(|kind| matches!(kind, LoopEventKind::DeviceNotice(_))).collect()
}

/// With the default options a force along z is lost, or acts along x. The loop reports the setting, once and not as a fault.
#[test]
fn declared_y_is_reported_with_the_setting() {
    let (bench, force_n) = wheel();
    let mut device = bench.device(full_force());
    device.open().unwrap();
    device.write(DVec3::Z).unwrap();
    let [by_direction, by_magnitude] = force_n();
    assert!(
        by_direction.abs() < 1e-9 && (by_magnitude - 1.0).abs() < 0.0025,
        "{by_direction} {by_magnitude}"
    );
    device.close().unwrap();
    let reported = notices(bench.device(full_force()));
    let [LoopEventKind::DeviceNotice(text)] = reported[..] else { panic!("{reported:?}") };
    assert!(text.contains("`JoystickOptions::use_y` to false"), "{text}");
    assert!(!reported[0].is_fault());
    assert_eq!(device.notice(), Some(text));
}

#[test]
fn without_y_only_x_has_force_and_nothing_is_reported() {
    let (bench, force_n) = wheel();
    let options = JoystickOptions { use_y: false, ..full_force() };
    let mut device = bench.device(options);
    device.open().unwrap();
    device.write(DVec3::Z).unwrap();
    assert_eq!(force_n().map(f64::abs), [0.0, 0.0]);
    device.write(DVec3::new(1.0, 0.0, 1.0)).unwrap();
    assert!(force_n().iter().all(|force_n| (force_n - 1.0).abs() < 0.0025), "{:?}", force_n());
    let described = device.describe();
    assert_eq!((described.rate_hz, described.workspace_m[1]), (1000.0, DVec3::X * 0.06));
    device.close().unwrap();
    assert_eq!(notices(bench.device(options)), []);
}
