//! A SpaceMouse moves a point, and its light is on while it is open.

use super::check::{Outcome, ensure, wait_until};
use super::touch::Touch;
use super::uhid::Identity;
use super::virtual_device::{Pace, VirtualDevice};
use glam::DVec3;
use palpate_hid::simulated::{SpaceMouseFirmware, SpaceMouseLayout};
use palpate_hid::{HidDevice, HidKind, HidOptions, HidSelector, SystemBus};
use std::error::Error;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A simulated SpaceMouse.
pub type Cap = Arc<Mutex<SpaceMouseFirmware>>;

/// Identity of the cap with this serial number.
pub fn identity(serial: &str) -> Identity {
    Identity { name: "Virtual cap", serial: serial.into(), vendor: 0x256F, product: 0xC635 }
}

/// Plugs a cap in.
pub fn plug(
    serial: &str,
    layout: SpaceMouseLayout,
    pace: Pace,
) -> Result<(VirtualDevice, Cap), Box<dyn Error>> {
    let cap = SpaceMouseFirmware::new(layout);
    let descriptor = cap.descriptor();
    let cap = Arc::new(Mutex::new(cap));
    Ok((VirtualDevice::plug(&identity(serial), &descriptor, cap.clone(), pace)?, cap))
}

/// Finds the cap with this serial number.
pub fn find(serial: &str) -> Result<HidDevice, Box<dyn Error>> {
    let selector = HidSelector {
        kind: Some(HidKind::SpaceMouse),
        serial: Some(serial.into()),
        ..HidSelector::default()
    };
    Ok(HidDevice::find(Arc::new(SystemBus::new()?), &selector, &HidOptions::default())?)
}

/// Accesses the firmware.
pub fn of<T>(cap: &Cap, operation: impl FnOnce(&mut SpaceMouseFirmware) -> T) -> T {
    operation(&mut cap.lock().unwrap_or_else(PoisonError::into_inner))
}

pub fn wired() -> Outcome {
    run("cable", SpaceMouseLayout::Separate)
}

pub fn wireless() -> Outcome {
    run("radio", SpaceMouseLayout::Combined)
}

/// Pushes the cap to the left and up, and turns it; one report every 8 ms, as a real one.
fn run(serial: &str, layout: SpaceMouseLayout) -> Outcome {
    let (plugged, cap) = plug(serial, layout, Pace::Every(Duration::from_millis(8)))?;
    let device = find(serial)?;
    let counters = device.counters();
    ensure(!of(&cap, |cap| cap.is_lit()), || "its light is on before it is used".into())?;
    let mut touch = Touch::begin(device, DVec3::X)?;
    touch.until("its light goes on", |_| of(&cap, |cap| cap.is_lit()))?;

    of(&cap, |cap| {
        (0..40).for_each(|_| cap.push([-350, 0, -175], [0, 0, 350]));
        cap.press(0b10);
    });
    touch.until("all queued reports are sent", |_| of(&cap, |cap| cap.pending() == 0))?;
    touch.until("its button is pressed", |touch| touch.buttons() == 0b10)?;
    let mut before = None;
    let mut same = 0;
    touch.until("the point rests after the last report", |touch| {
        let here = touch.position_m();
        same = if std::mem::replace(&mut before, here) == here { same + 1 } else { 0 };
        same > 20
    })?;
    let at = touch.position_m().ok_or("no reading")?;
    // To the left and up: by the dead zone, half the deflection gives less than half the speed.
    let slope = (0.5 - 0.02) / (1.0 - 0.02);
    ensure(at.x < -0.005 && at.z == 0.0, || format!("the point went to {at}"))?;
    // At the wall x is constant, and y moves on to its own wall.
    let is_at_wall = at.x <= -0.1;
    let along_m = -slope * at.x;
    let is_on_line =
        if is_at_wall { (along_m - 1e-9..=0.1).contains(&at.y) } else { (at.y - along_m).abs() < 1e-9 };
    ensure(is_on_line, || format!("the point went to {at}, off its line"))?;
    ensure(touch.force_n() == DVec3::ZERO, || "a device without motors was sent a force".into())?;
    ensure(counters.malformed() == 0, || format!("{} reports were malformed", counters.malformed()))?;
    ensure(of(&cap, |cap| cap.is_lit()), || "its light went off too early".into())?;
    touch.end()?;
    wait_until("its light goes off", || of(&cap, |cap| !cap.is_lit()))?;
    let lit = of(&cap, |cap| cap.times_lit());
    ensure(lit == 1, || format!("its light went on {lit} times"))?;
    plugged.unplug();
    Ok(format!(
        "{} reports moved the point by {:.1} mm, light on and off",
        counters.read(),
        at.length() * 1e3
    ))
}
