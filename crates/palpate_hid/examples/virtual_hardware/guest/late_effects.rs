//! A joystick that needs time to create an effect: the driver waits for the status, also after a stalled request.

use super::check::{Outcome, ensure, wait_until};
use super::joystick::{self, Joystick};
use super::uhid::Identity;
use super::virtual_device::{Pace, VirtualDevice};
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::simulated::{Firmware, JoystickFirmware, SimulatedStick};
use std::error::Error;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Report ID of the status.
const STATUS: u8 = 6;

/// Firmware whose status is ready after a time. The first request stalls.
struct Late {
    firmware: Joystick,
    ready_after: Duration,
    created_at: Option<Instant>,
    has_stalled: bool,
}

impl Firmware for Late {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.firmware.input(report)
    }

    fn output(&mut self, report: &[u8]) -> bool {
        self.firmware.output(report)
    }

    fn feature(&mut self, report: &mut [u8]) -> usize {
        let is_ready = self.created_at.is_none_or(|at| at.elapsed() >= self.ready_after);
        if report.first() != Some(&STATUS) || is_ready {
            return self.firmware.feature(report);
        }
        if !std::mem::replace(&mut self.has_stalled, true) {
            return 0;
        }
        let Some(status) = report.get_mut(..5) else { return 0 };
        status.copy_from_slice(&[STATUS, 0, 0, 0, 0]);
        5
    }

    #[expect(clippy::disallowed_methods, reason = "the firmware runs in real time")]
    fn set_feature(&mut self, report: &[u8]) -> bool {
        (self.created_at, self.has_stalled) = (Some(Instant::now()), false);
        self.firmware.set_feature(report)
    }
}

fn plug(serial: &str, ready_after: Duration) -> Result<(VirtualDevice, Joystick), Box<dyn Error>> {
    let descriptor = joystick::bytes(joystick::ARDUINO.descriptor)?;
    let firmware = Arc::new(Mutex::new(JoystickFirmware::new(&descriptor, SimulatedStick::default())?));
    let late = Late { firmware: firmware.clone(), ready_after, created_at: None, has_stalled: false };
    let identity =
        Identity { name: "Virtual joystick", serial: serial.into(), vendor: 0x2341, product: 0x8036 };
    let plugged = VirtualDevice::plug(&identity, &descriptor, Arc::new(Mutex::new(late)), Pace::Manual)?;
    Ok((plugged, firmware))
}

pub fn run() -> Outcome {
    let (plugged, stick) = plug("late", Duration::from_millis(50))?;
    let mut device = joystick::find("late")?;
    device.open()?;
    device.write(joystick::FORCE_N)?;
    wait_until("its motors apply the force", || {
        joystick::applied_force_n(&stick).distance(joystick::FORCE_N) < 0.005
    })?;
    device.close()?;
    plugged.unplug();
    let (plugged, stick) = plug("never", Duration::from_secs(3600))?;
    let mut device = joystick::find("never")?;
    let error = device.open().err();
    ensure(matches!(error, Some(DeviceError::Protocol(text)) if text.ends_with("200 ms")), || {
        format!("without a status the opening gives {error:?}")
    })?;
    wait_until("its actuators are off", || joystick::of(&stick, |stick| !stick.is_on()))?;
    plugged.unplug();
    Ok("opened with a status after a stall and 50 ms; rejected without one, and off".into())
}
