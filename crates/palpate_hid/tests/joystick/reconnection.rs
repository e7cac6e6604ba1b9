//! Reopening of an unplugged joystick, and never of another one.

use crate::joystick_bench::{Bench, PATH, full_force, info, openffboard, renumbered};
use glam::DVec3;
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::{Arc, Mutex};

/// The same device with other report IDs, as after a firmware update.
#[test]
fn rejects_a_changed_report_descriptor() {
    let published = openffboard().descriptor;
    let bench = Bench::new(&published, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    device.close().unwrap();
    let updated = renumbered(&published, |id| 0xFF - id);
    let firmware = JoystickFirmware::new(&updated, SimulatedStick::default()).unwrap();
    bench.bus.plug(info(), updated, firmware);
    let changed = HidError::Changed { device: String::new() }.for_loop();
    assert_eq!(device.open(), Err(changed));
    assert_eq!(device.open(), Err(changed));
    // The device was released, and the original one is accepted.
    drop(bench.bus.open(&info()).unwrap());
    bench.plug();
    device.open().unwrap();
    device.close().unwrap();
}

/// Plugs in a matching joystick at `path` with the serial number `serial`.
fn plug_matching(bench: &Bench, path: &str, serial: &str) -> Arc<Mutex<JoystickFirmware>> {
    let descriptor = openffboard().descriptor;
    let firmware =
        Arc::new(Mutex::new(JoystickFirmware::new(&descriptor, SimulatedStick::default()).unwrap()));
    let matching = HidInfo { path: path.into(), serial: serial.into(), ..info() };
    bench.bus.plug(matching, descriptor, Arc::clone(&firmware));
    firmware
}

/// Two matching devices without serial number: when one is unplugged the other, which was present before, is not used.
#[test]
fn matching_device_present_before_is_not_used() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let other = plug_matching(&bench, "simulated/other", "");
    let mut device = bench.device(full_force());
    // Also one plugged in between finding and opening.
    let later = plug_matching(&bench, "simulated/later", "");
    device.open().unwrap();
    assert_eq!(device.found().info.path, PATH);
    device.write(DVec3::X).unwrap();
    assert!(bench.bus.unplug(PATH));
    device.close().unwrap_err();
    for _ in 0..3 {
        assert_eq!(device.open(), Err(DeviceError::Disconnected));
    }
    for other in [&other, &later] {
        let other = other.lock().unwrap();
        assert_eq!((other.effects(), other.is_on()), (0, false));
    }
    // At another path it is the only new one.
    let moved = plug_matching(&bench, "simulated/moved", "");
    device.open().unwrap();
    assert_eq!(device.found().info.path, "simulated/moved");
    assert!(moved.lock().unwrap().is_on() && !other.lock().unwrap().is_on());
    // The others are still not used.
    bench.bus.unplug("simulated/moved");
    device.close().unwrap_err();
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
}

#[test]
fn several_new_matching_devices_are_unavailable() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    bench.bus.unplug(PATH);
    let new = ["simulated/one", "simulated/two"].map(|path| plug_matching(&bench, path, ""));
    let several = HidError::Several { requested: String::new(), found: Vec::new() }.for_loop();
    assert_eq!(device.open(), Err(several));
    assert!(new.iter().all(|new| !new.lock().unwrap().is_on()));
    bench.bus.unplug("simulated/two");
    device.open().unwrap();
    assert_eq!(device.found().info.path, "simulated/one");
}

/// Both are unplugged, and the device returns at the path of the other.
#[test]
fn accepts_a_device_at_a_freed_path() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    plug_matching(&bench, "simulated/other", "");
    let mut device = bench.device(full_force());
    bench.bus.unplug(PATH);
    bench.bus.unplug("simulated/other");
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    plug_matching(&bench, "simulated/other", "");
    device.open().unwrap();
}

/// The device has returned and another program has opened it first.
#[test]
fn device_in_use_is_unavailable_and_not_disconnected() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    bench.bus.unplug(PATH);
    device.close().unwrap_err();
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    bench.plug();
    let held = bench.bus.open(&info()).unwrap();
    let busy = HidError::Busy { device: String::new() }.for_loop();
    assert_eq!(device.open(), Err(busy));
    drop(held);
    device.open().unwrap();
}

/// A device with a serial number is found at any path, with others present that differ only in it.
#[test]
fn serial_number_identifies_the_device() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    bench.bus.unplug(PATH);
    plug_matching(&bench, "simulated/first", "7");
    let mut device = bench.device(full_force());
    let other = plug_matching(&bench, "simulated/other", "8");
    bench.bus.unplug("simulated/first");
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    plug_matching(&bench, "simulated/second", "7");
    device.open().unwrap();
    assert_eq!(device.found().info.path, "simulated/second");
    assert!(!other.lock().unwrap().is_on());
}
