//! Differences between the models of SpaceMouse: axes of the oldest caps, and buttons of the Enterprise.

use glam::DVec3;
use palpate_haptics::HapticDevice;
use palpate_hid::simulated::{Firmware, SimulatedBus};
use palpate_hid::{HidDevice, HidInfo, HidKind, HidOptions, HidSelector, SpaceMouseOptions, Usage};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[derive(Clone, Default)]
struct Cap(Arc<Mutex<VecDeque<Vec<u8>>>>);

impl Firmware for Cap {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let Some(next) = self.0.lock().unwrap().pop_front() else { return 0 };
        report[..next.len()].copy_from_slice(&next);
        next.len()
    }
    fn output(&mut self, _: &[u8]) -> bool {
        true
    }
}

/// An open cap of the model, which reads each report 1 ms after the last.
fn open(vendor: u16, product: u16) -> (HidDevice, Cap) {
    let (bus, cap, time) = (SimulatedBus::default(), Cap::default(), AtomicU64::default());
    let info = HidInfo {
        path: "cap".into(),
        vendor,
        product,
        applications: vec![Usage::new(1, 8)],
        ..HidInfo::default()
    };
    bus.plug(info, Vec::new(), cap.clone());
    let space_mouse =
        SpaceMouseOptions { dead_zone: 0.0, full_turn_rad_per_s: 1.0, ..SpaceMouseOptions::default() };
    let options = HidOptions { space_mouse, ..HidOptions::default() };
    let device = HidDevice::find(Arc::new(bus), &HidSelector::first(HidKind::SpaceMouse), &options).unwrap();
    let mut device = device.with_clock(move || Duration::from_millis(time.fetch_add(1, Ordering::Relaxed)));
    device.open().unwrap();
    device.read(Duration::ZERO).unwrap();
    (device, cap)
}

/// Velocity, m/s, and rotation in the first reading, as a vector, rad, after a report.
fn motion((device, cap): &mut (HidDevice, Cap), report: &[u8]) -> (DVec3, DVec3) {
    cap.0.lock().unwrap().push_back(report.to_vec());
    let before = device.read(Duration::ZERO).unwrap();
    let after = device.read(Duration::ZERO).unwrap();
    let turned = after.orientation * before.orientation.inverse();
    (after.velocity_m_per_s.unwrap(), turned.to_scaled_axis())
}

/// Full deflection along one axis of the cap: report 1 or 2 with 350 = 0x015e.
fn deflected(report: u8, axis: usize) -> Vec<u8> {
    let mut bytes = vec![report, 0, 0, 0, 0, 0, 0];
    bytes[1 + 2 * axis..3 + 2 * axis].copy_from_slice(&[0x5E, 0x01]);
    bytes
}

/// SpaceMouse Plus XT and Classic: y is up and z is away from the user. All others: y is towards the user and z is down. The same for
/// rotations.
#[test]
fn axes_of_each_model_point_as_in_the_table_of_spacenavd() {
    let oldest = [DVec3::X, DVec3::Y, DVec3::NEG_Z];
    let other = [DVec3::X, DVec3::Z, DVec3::NEG_Y];
    for (vendor, product, axes) in [
        (0x046D, 0xC603, oldest),
        (0x046D, 0xC606, oldest),
        (0x046D, 0xC605, other),
        (0x046D, 0xC621, other),
        (0x046D, 0xC623, other),
        (0x046D, 0xC626, other),
        (0x046D, 0xC62B, other),
        (0x256F, 0xC633, other),
        (0x256F, 0xC635, other),
        (0x256F, 0xC652, other),
    ] {
        for (axis, direction) in axes.into_iter().enumerate() {
            let (velocity, _) = motion(&mut open(vendor, product), &deflected(1, axis));
            assert!((velocity - 0.1 * direction).length() < 1e-9, "{product:04x}, axis {axis}: {velocity}");
            let (_, turned) = motion(&mut open(vendor, product), &deflected(2, axis));
            assert!(
                (turned - 1e-3 * direction).length() < 1e-9,
                "{product:04x}, about axis {axis}: {turned}"
            );
        }
    }
    // The bytes of the reported case.
    let (velocity, _) = motion(&mut open(0x046D, 0xC603), &[1, 0, 0, 0x5E, 1, 0, 0]);
    assert!((velocity - DVec3::Y * 0.1).length() < 1e-9);
    let (velocity, _) = motion(&mut open(0x046D, 0xC603), &[1, 0, 0, 0, 0, 0x5E, 1]);
    assert!((velocity - DVec3::NEG_Z * 0.1).length() < 1e-9);
}

/// All 31 keys of the Enterprise have a bit of their own.
#[test]
fn buttons_above_31_of_the_enterprise_have_bits() {
    let (mut device, cap) = open(0x256F, 0xC633);
    let mut read = |report: &[u8]| {
        cap.0.lock().unwrap().push_back(report.to_vec());
        device.read(Duration::ZERO).unwrap().buttons
    };
    // Enter, Delete, 11, 12, V1, V2, V3, Tab, Space.
    let keys = [36_u16, 37, 77, 78, 103, 104, 105, 175, 176];
    let bits = keys.map(|key| {
        let [low, high] = key.to_le_bytes();
        let pressed = read(&[0x1C, low, high, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(pressed.count_ones(), 1, "{key}");
        pressed.trailing_zeros()
    });
    assert_eq!(bits, [27, 28, 29, 30, 31, 3, 6, 7, 9]);
    // The keys of report 3, from menu to rotation lock, have others.
    let of_report_3 = [0, 1, 2, 4, 5, 8, 10].into_iter().chain(12..=26);
    assert_eq!(of_report_3.clone().count() + bits.len(), 31);
    assert!(of_report_3.clone().all(|bit| !bits.contains(&bit)));
    // Several at a time, with a key of report 3; each report replaces the keys of its own.
    assert_eq!(read(&[0x1C, 36, 0, 176, 0, 1, 0, 0, 0, 0, 0, 0, 0]), 1 << 27 | 1 << 9 | 1);
    assert_eq!(read(&[3, 0, 0, 0, 1]), 1 << 27 | 1 << 9 | 1 | 1 << 24);
    assert_eq!(read(&[0x1D, 104, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]), 1 << 27 | 1 << 9 | 1 | 1 << 24 | 1 << 3);
    assert_eq!(read(&[0x1C, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]), 1 << 24 | 1 << 3);
    assert_eq!(read(&[3, 0, 0, 0, 0]), 1 << 3);
    // Unknown numbers are ignored, as are short reports.
    assert_eq!(read(&[0x1D, 40, 0, 0, 1, 255, 255, 0, 0, 0, 0, 0, 0]), 0);
    assert_eq!(read(&[0x1C, 36, 0]), 0);
    assert_eq!((device.counters().malformed(), device.counters().skipped()), (1, 0));
}
