//! Finding devices by kind and by serial number; two matching devices, and one in use, give separate errors.

use super::check::{Outcome, ensure};
use super::virtual_device::{Pace, VirtualDevice};
use super::{board, joystick, space_mouse};
use palpate_haptics::HapticDevice;
use palpate_hid::simulated::{BoardFirmware, SpaceMouseLayout};
use palpate_hid::{
    BoardForm, BoardKinematics, FoundDevice, HidBus, HidDevice, HidError, HidKind, HidOptions, HidSelector,
    SystemBus,
};
use std::error::Error;
use std::sync::Arc;

/// Plugged-in devices with their serial number and kind.
pub type Plugged = Vec<(VirtualDevice, &'static str, HidKind)>;

/// Plugs in one device of each kind, and a second cap and a second board.
pub fn plug_all() -> Result<Plugged, Box<dyn Error>> {
    let board = |serial, form| {
        board::plug(serial, BoardFirmware::at_home(form, &BoardKinematics::default()))
            .map(|(plugged, _)| plugged)
    };
    let joystick =
        |serial| joystick::plug(serial, &joystick::OPENFFBOARD, Pace::Manual).map(|(plugged, _)| plugged);
    Ok(vec![
        (
            space_mouse::plug("cap-1", SpaceMouseLayout::Separate, Pace::Manual)?.0,
            "cap-1",
            HidKind::SpaceMouse,
        ),
        (
            space_mouse::plug("cap-2", SpaceMouseLayout::Combined, Pace::Manual)?.0,
            "cap-2",
            HidKind::SpaceMouse,
        ),
        (joystick("joystick-1")?, "joystick-1", HidKind::Joystick),
        (board("board-1", BoardForm::Bytes14)?, "board-1", HidKind::Board),
        (board("board-2", BoardForm::Bytes64)?, "board-2", HidKind::Board),
    ])
}

pub fn run() -> Outcome {
    let plugged = plug_all()?;
    let bus: Arc<dyn HidBus> = Arc::new(SystemBus::new()?);
    let present = bus.list()?;
    let options = HidOptions::default();
    for (device, serial, kind) in &plugged {
        let info = present.iter().find(|info| info.serial == *serial);
        let info = info.ok_or_else(|| format!("{serial} is not listed"))?;
        let known = FoundDevice::identify(&*bus, info, true).map(|found| found.kind);
        ensure(known == Some(*kind), || format!("{} is identified as {known:?}", info.label()))?;
        ensure(info.path == device.node, || format!("{serial} is at {}, not {}", info.path, device.node))?;
        let selector = HidSelector {
            serial: Some((*serial).into()),
            treat_teensy_as_board: true,
            ..HidSelector::default()
        };
        HidDevice::find(Arc::clone(&bus), &selector, &options)?;
    }

    // Every Teensy sketch has these USB IDs.
    let teensy = HidSelector { serial: Some("board-2".into()), ..HidSelector::default() };
    match HidDevice::find(Arc::clone(&bus), &teensy, &options) {
        Err(HidError::NotFound { .. }) => {}
        other => return Err(format!("a Teensy not treated as a board gave {other:?}").into()),
    }
    let vendor = Some(space_mouse::identity("").vendor);
    let caps = HidSelector { kind: Some(HidKind::SpaceMouse), vendor, ..HidSelector::default() };
    match HidDevice::find(Arc::clone(&bus), &caps, &options) {
        Err(HidError::Several { found, .. }) if found.len() == 2 => {}
        other => return Err(format!("two matching devices gave {other:?}").into()),
    }
    let first = HidSelector { match_first: true, ..caps };
    let mut used = HidDevice::find(Arc::clone(&bus), &first, &options)?;
    used.open()?;
    let mut second = HidDevice::find(Arc::clone(&bus), &first, &options)?;
    ensure(second.found().info.path != used.found().info.path, || "a device in use was found again".into())?;
    second.open()?;
    match HidDevice::find(Arc::clone(&bus), &first, &options) {
        Err(HidError::Busy { .. }) => {}
        other => return Err(format!("two devices in use gave {other:?}").into()),
    }
    second.close()?;
    used.close()?;
    HidDevice::find(Arc::clone(&bus), &first, &options)?;

    let nodes: Vec<String> = plugged.iter().map(|(device, ..)| device.node.clone()).collect();
    drop(plugged);
    let info = used.found().info.clone();
    match HidDevice::find(bus, &HidSelector { path: Some(info.path), ..HidSelector::default() }, &options) {
        Err(HidError::NotFound { .. }) => {}
        other => return Err(format!("an unplugged device gave {other:?}").into()),
    }
    Ok(format!("{} devices found; matching, used and unplugged devices are distinguished", nodes.len()))
}
