//! A joystick that was unplugged is opened again, and nothing else instead of it.

use crate::stick::{Bench, info, openffboard, renumbered, whole_force};
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::*;

/// The same device by all that it says of itself, with other report numbers, as after an update of its firmware.
#[test]
fn another_report_descriptor_is_refused() {
    let published = openffboard().descriptor;
    let bench = Bench::new(&published, HeldStick::default());
    let mut device = bench.device(whole_force());
    device.open().unwrap();
    device.close().unwrap();
    let updated = renumbered(&published, |id| 0xFF - id);
    let firmware = JoystickFirmware::new(&updated, HeldStick::default()).unwrap();
    bench.bus.plug(info(), updated, firmware);
    let changed =
        DeviceError::Protocol("its report descriptor is not the one it was found with; choose it anew");
    assert_eq!(device.open(), Err(changed));
    assert_eq!(device.open(), Err(changed));
    // Nothing was held, and the old one is welcome.
    drop(bench.bus.open(&info()).unwrap());
    bench.plug();
    device.open().unwrap();
    device.close().unwrap();
}
