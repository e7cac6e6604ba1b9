//! A joystick that was unplugged is opened again, and nothing else instead of it.

use crate::joystick_bench::{Bench, PATH, info, openffboard, renumbered, whole_force};
use glam::DVec3;
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::{Arc, Mutex};

/// The same device by all that it says of itself, with other report numbers, as after an update of its firmware.
#[test]
fn another_report_descriptor_is_refused() {
    let published = openffboard().descriptor;
    let bench = Bench::new(&published, SimulatedStick::default());
    let mut device = bench.device(whole_force());
    device.open().unwrap();
    device.close().unwrap();
    let updated = renumbered(&published, |id| 0xFF - id);
    let firmware = JoystickFirmware::new(&updated, SimulatedStick::default()).unwrap();
    bench.bus.plug(info(), updated, firmware);
    let changed =
        DeviceError::Unavailable("its report descriptor is not the one it was found with; choose it anew");
    assert_eq!(device.open(), Err(changed));
    assert_eq!(device.open(), Err(changed));
    // Nothing was held, and the old one is welcome.
    drop(bench.bus.open(&info()).unwrap());
    bench.plug();
    device.open().unwrap();
    device.close().unwrap();
}

/// Plugs one in at `path` that is like the bench's but for its serial number.
fn plug_alike(bench: &Bench, path: &str, serial: &str) -> Arc<Mutex<JoystickFirmware>> {
    let descriptor = openffboard().descriptor;
    let firmware =
        Arc::new(Mutex::new(JoystickFirmware::new(&descriptor, SimulatedStick::default()).unwrap()));
    let alike = HidInfo { path: path.into(), serial: serial.into(), ..info() };
    bench.bus.plug(alike, descriptor, Arc::clone(&firmware));
    firmware
}

/// Two that are alike and have no serial number: when one is unplugged the other, which was there all along, is not pushed.
#[test]
fn an_alike_one_that_was_there_is_not_taken_for_it() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let other = plug_alike(&bench, "stand-in/other", "");
    let mut device = bench.device(whole_force());
    // Also one that came after it was found and before it was opened.
    let later = plug_alike(&bench, "stand-in/later", "");
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
    // At another socket it is the only new one.
    let moved = plug_alike(&bench, "stand-in/moved", "");
    device.open().unwrap();
    assert_eq!(device.found().info.path, "stand-in/moved");
    assert!(moved.lock().unwrap().is_on() && !other.lock().unwrap().is_on());
    // And the others are still none of it.
    bench.bus.unplug("stand-in/moved");
    device.close().unwrap_err();
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
}

#[test]
fn where_several_may_be_it_none_is_taken() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(whole_force());
    bench.bus.unplug(PATH);
    let new = ["stand-in/one", "stand-in/two"].map(|path| plug_alike(&bench, path, ""));
    let Err(DeviceError::Unavailable(several)) = device.open() else { panic!("one was taken") };
    assert!(several.contains("unplug all but one"), "{several}");
    assert!(new.iter().all(|new| !new.lock().unwrap().is_on()));
    bench.bus.unplug("stand-in/two");
    device.open().unwrap();
    assert_eq!(device.found().info.path, "stand-in/one");
}

/// The other is unplugged too, and the device comes back where the other was.
#[test]
fn a_path_that_was_left_may_be_its_own() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    plug_alike(&bench, "stand-in/other", "");
    let mut device = bench.device(whole_force());
    bench.bus.unplug(PATH);
    bench.bus.unplug("stand-in/other");
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    plug_alike(&bench, "stand-in/other", "");
    device.open().unwrap();
}

/// It is back, and another program is faster: that is told, and not that it is unplugged.
#[test]
fn what_another_program_has_is_not_disconnected() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(whole_force());
    device.open().unwrap();
    bench.bus.unplug(PATH);
    device.close().unwrap_err();
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    bench.plug();
    let held = bench.bus.open(&info()).unwrap();
    let Err(DeviceError::Unavailable(busy)) = device.open() else { panic!("it was taken") };
    assert!(busy.contains("another program"), "{busy}");
    drop(held);
    device.open().unwrap();
}

/// With a serial number it is found at any path, beside whatever is alike but for that number.
#[test]
fn a_serial_number_tells_which_it_is() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    bench.bus.unplug(PATH);
    plug_alike(&bench, "stand-in/first", "7");
    let mut device = bench.device(whole_force());
    let other = plug_alike(&bench, "stand-in/other", "8");
    bench.bus.unplug("stand-in/first");
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    plug_alike(&bench, "stand-in/second", "7");
    device.open().unwrap();
    assert_eq!(device.found().info.path, "stand-in/second");
    assert!(!other.lock().unwrap().is_on());
}
