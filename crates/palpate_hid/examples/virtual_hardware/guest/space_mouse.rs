//! A SpaceMouse moves a point, and its light is on while it is used.

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

/// A cap that is pushed by whoever has it.
pub type Cap = Arc<Mutex<SpaceMouseFirmware>>;

/// What goes for the cap with this serial number.
pub fn identity(serial: &str) -> Identity {
    Identity { name: "Virtual cap", serial: serial.into(), vendor: 0x256F, product: 0xC635 }
}

/// Plugs one in.
pub fn plug(
    serial: &str,
    form: SpaceMouseLayout,
    pace: Pace,
) -> Result<(VirtualDevice, Cap), Box<dyn Error>> {
    let cap = SpaceMouseFirmware::new(form);
    let descriptor = cap.descriptor();
    let cap = Arc::new(Mutex::new(cap));
    Ok((VirtualDevice::plug(&identity(serial), &descriptor, cap.clone(), pace)?, cap))
}

/// Finds the one with this serial number.
pub fn find(serial: &str) -> Result<HidDevice, Box<dyn Error>> {
    let selector = HidSelector {
        kind: Some(HidKind::SpaceMouse),
        serial: Some(serial.into()),
        ..HidSelector::default()
    };
    Ok(HidDevice::find(Arc::new(SystemBus::new()?), &selector, &HidOptions::default())?)
}

/// What is inside it.
pub fn of<T>(cap: &Cap, ask: impl FnOnce(&mut SpaceMouseFirmware) -> T) -> T {
    ask(&mut cap.lock().unwrap_or_else(PoisonError::into_inner))
}

pub fn with_a_cable() -> Outcome {
    run("cable", SpaceMouseLayout::Separate)
}

pub fn without() -> Outcome {
    run("radio", SpaceMouseLayout::Combined)
}

/// It is pushed to the left and up, and turned; a report every 8 ms, as of a real one.
fn run(serial: &str, form: SpaceMouseLayout) -> Outcome {
    let (plugged, cap) = plug(serial, form, Pace::Every(Duration::from_millis(8)))?;
    let device = find(serial)?;
    let counters = device.counters();
    ensure(!of(&cap, |cap| cap.is_lit()), || "its light is on before it is used".into())?;
    let mut touch = Touch::begin(device, DVec3::X)?;
    touch.until("its light goes on", |_| of(&cap, |cap| cap.is_lit()))?;

    of(&cap, |cap| {
        (0..40).for_each(|_| cap.push([-350, 0, -175], [0, 0, 350]));
        cap.press(0b10);
    });
    touch.until("it has said everything and the point rests", |_| of(&cap, |cap| cap.pending() == 0))?;
    touch.until("its button is pressed", |touch| touch.buttons() == 0b10)?;
    let mut before = None;
    let mut same = 0;
    touch.until("the point rests once the cap is silent", |touch| {
        let here = touch.position_m();
        same = if std::mem::replace(&mut before, here) == here { same + 1 } else { 0 };
        same > 20
    })?;
    let at = touch.position_m().ok_or("no reading has come")?;
    // To the left and up: half the push gives less than half the speed, by the dead zone.
    let slope = (0.5 - 0.02) / (1.0 - 0.02);
    ensure(at.x < -0.005 && at.z == 0.0, || format!("the point went to {at}"))?;
    // At the wall x stays, and y goes on, up to its own wall.
    let is_at_wall = at.x <= -0.1;
    let along_m = -slope * at.x;
    let is_that_way =
        if is_at_wall { (along_m - 1e-9..=0.1).contains(&at.y) } else { (at.y - along_m).abs() < 1e-9 };
    ensure(is_that_way, || format!("it went to {at}, not that way"))?;
    ensure(touch.force_n() == DVec3::ZERO, || "a device without motors was sent a force".into())?;
    ensure(counters.malformed() == 0, || format!("{} reports were not understood", counters.malformed()))?;
    ensure(of(&cap, |cap| cap.is_lit()), || "its light went out too early".into())?;
    touch.end()?;
    wait_until("its light goes out", || of(&cap, |cap| !cap.is_lit()))?;
    let lit = of(&cap, |cap| cap.times_lit());
    ensure(lit == 1, || format!("its light went on {lit} times"))?;
    plugged.unplug();
    Ok(format!(
        "{} reports moved the point by {:.1} mm, light on and off",
        counters.read(),
        at.length() * 1e3
    ))
}
