//! A whole device of any kind: its descriptor, what it answers and its reports are made up, and the driver neither panics nor gives a
//! reading that is not finite.

#![no_main]

use glam::DVec3;
use libfuzzer_sys::fuzz_target;
use palpate_haptics::HapticDevice;
use palpate_hid::simulated::{Firmware, SimulatedBus};
use palpate_hid::{BoardHoming, BoardOptions, HidDevice, HidInfo, HidOptions, HidSelector, Usage};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

/// Says what it finds in some bytes: a length, then as many.
struct Bytes(Vec<u8>, usize);

impl Bytes {
    fn take(&mut self, report: &mut [u8]) -> usize {
        let Some(&length) = self.0.get(self.1) else { return 0 };
        let from = self.1 + 1;
        let taken = self.0.get(from..).unwrap_or_default();
        let length = usize::from(length & 63).min(taken.len()).min(report.len());
        report[..length].copy_from_slice(&taken[..length]);
        self.1 = from + length;
        length
    }
}

impl Firmware for Bytes {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.take(report)
    }

    fn output(&mut self, report: &[u8]) -> bool {
        !report.is_empty()
    }

    fn feature(&mut self, report: &mut [u8]) -> usize {
        self.take(report)
    }

    fn set_feature(&mut self, _: &[u8]) -> bool {
        true
    }
}

const MOUSE: [Usage; 1] = [Usage::new(1, 8)];
const STICK: [Usage; 1] = [Usage::new(1, 4)];
const BOARD: [Usage; 1] = [Usage::new(0xFFAB, 0x0200)];

fuzz_target!(|bytes: &[u8]| {
    let [kind, length, rest @ ..] = bytes else { return };
    let (vendor, product, applications, own) = match kind % 3 {
        0 => (0x256F, 0xC635, MOUSE, &KNOWN[0]),
        1 => (0x1209, 0xFFB0, STICK, &KNOWN[1]),
        _ => (0x1234, 0x0006, BOARD, &KNOWN[2]),
    };
    // A descriptor that is made up, or one that is right so that the fuzzing comes further.
    let length = usize::from(*length).min(rest.len());
    let (descriptor, said) =
        if kind & 0x80 == 0 { (own.clone(), rest) } else { (rest[..length].to_vec(), &rest[length..]) };
    let bus = Arc::new(SimulatedBus::default());
    let info = HidInfo {
        path: "made up".into(),
        vendor,
        product,
        applications: applications.to_vec(),
        ..HidInfo::default()
    };
    bus.plug(info, descriptor, Bytes(said.to_vec(), 0));
    let board = BoardOptions { homing: BoardHoming::Kept, ..BoardOptions::default() };
    let options = HidOptions { board, ..HidOptions::default() };
    let Ok(mut device) = HidDevice::find(bus, &HidSelector::any(), &options) else { return };
    device.describe().validate().expect("a description that makes sense");
    let mut ms = 0;
    device = device.with_clock(move || {
        ms += 1;
        Duration::from_millis(ms)
    });
    if device.open().is_err() {
        return;
    }
    for tick in 0..20 {
        if let Ok(reading) = device.read(Duration::from_millis(1)) {
            assert!(reading.position_m.is_finite() && reading.orientation.is_normalized(), "{reading:?}");
        }
        let force = [DVec3::ZERO, DVec3::new(0.3, -0.2, 0.1), DVec3::splat(f64::NAN), DVec3::splat(1e300)];
        let _ = device.write(force[tick % 4]);
    }
    let _ = device.close();
});

/// Descriptors that are right: a cap needs none, a joystick, a board.
static KNOWN: LazyLock<[Vec<u8>; 3]> = LazyLock::new(|| {
    let hex = |text: &str| {
        let words = text.lines().flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace());
        words.map(|word| u8::from_str_radix(word, 16).expect("hexadecimal")).collect()
    };
    [
        Vec::new(),
        hex(include_str!("../../crates/palpate_hid/tests/data/openffboard_2axis.txt")),
        hex(include_str!("../../crates/palpate_hid/tests/data/board_mbed_14_descriptor.txt")),
    ]
});
