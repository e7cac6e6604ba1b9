//! A device is unplugged in use and plugged in again at another path: the loop runs without force, and recovers.

use super::check::{Outcome, ensure};
use super::touch::Touch;
use super::virtual_device::{Pace, VirtualDevice};
use super::{board, joystick, space_mouse};
use glam::DVec3;
use palpate_haptics::LoopEventKind;
use palpate_hid::simulated::{BoardFirmware, SpaceMouseLayout};
use palpate_hid::{BoardCalibration, BoardForm, BoardHoming, BoardKinematics, HidDevice};
use std::cell::RefCell;
use std::error::Error;
use std::time::Duration;

/// A kind of device for the common scenario.
struct Kind<'a, T> {
    serial: &'a str,
    plug: &'a dyn Fn() -> Result<(VirtualDevice, T), Box<dyn Error>>,
    find: &'a dyn Fn() -> Result<HidDevice, Box<dyn Error>>,
    /// Force of the model, N.
    force_n: DVec3,
    /// Whether the device displays the expected state while the model is active.
    is_active: &'a dyn Fn(&T, &mut Touch) -> bool,
    /// Action of the user after the loop has opened the device again.
    recover: &'a dyn Fn(&T, &mut Touch) -> Result<(), Box<dyn Error>>,
}

/// Unplugs the device in use, plugs in another one at its path, and then the device itself.
fn run<T>(kind: &Kind<'_, T>) -> Outcome {
    let Kind { serial, plug, find, force_n, is_active, recover } = kind;
    let (plugged, inside) = plug()?;
    let first_node = plugged.node.clone();
    let mut touch = Touch::begin(find()?, *force_n)?;
    touch.until("the device is active", |touch| is_active(&inside, touch))?;
    touch.events.clear();
    plugged.unplug();
    touch.until("the loop reports the disconnection", |touch| touch.is_disconnected())?;
    touch.until("the force fades", |touch| touch.force_n() == DVec3::ZERO)?;
    let ticks = touch.ticks();
    // Long enough for failed attempts to open the device.
    touch.until("the loop runs without the device", |touch| touch.ticks() > ticks + 1200)?;
    ensure(!touch.events.contains(&LoopEventKind::Reconnected), || {
        "the loop opened a missing device".into()
    })?;

    let replacement = space_mouse::plug("replacement", SpaceMouseLayout::Separate, Pace::Manual)?;
    let (again, inside) = plug()?;
    ensure(again.node != first_node, || format!("{serial} is at {first_node} again"))?;
    touch.until("the loop opens the device again", |touch| {
        touch.events.contains(&LoopEventKind::Reconnected)
    })?;
    recover(&inside, &mut touch)?;
    touch
        .until("the device is active again", |touch| !touch.is_disconnected() && is_active(&inside, touch))?;
    let recovered = touch.events.iter().find_map(|kind| match kind {
        LoopEventKind::DeviceRecovered(ticks) => Some(*ticks),
        _ => None,
    });
    let recovered = recovered.ok_or("the loop did not report the recovery")?;
    let faults = touch.events.iter().filter_map(|kind| match kind {
        LoopEventKind::DeviceFailed(error) => Some(format!("{error:?}")),
        _ => None,
    });
    let faults = faults.collect::<Vec<_>>().join(", ");
    let nodes = format!("{first_node}, then {}", again.node);
    touch.end()?;
    again.unplug();
    replacement.0.unplug();
    Ok(format!("{nodes}; {recovered} ticks without it, no force; faults: {faults}"))
}

pub fn space_mouse() -> Outcome {
    let serial = "loose-cap";
    run(&Kind {
        serial,
        plug: &|| {
            let (plugged, cap) =
                space_mouse::plug(serial, SpaceMouseLayout::Separate, Pace::Every(Duration::from_millis(8)))?;
            space_mouse::of(&cap, |cap| (0..10_000).for_each(|_| cap.push([350, 0, 0], [0; 3])));
            Ok((plugged, cap))
        },
        find: &|| space_mouse::find(serial),
        force_n: DVec3::ZERO,
        is_active: &|cap, touch| {
            space_mouse::of(cap, |cap| cap.is_lit()) && touch.position_m().is_some_and(|at| at.x > 0.01)
        },
        recover: &|_, _| Ok(()),
    })
}

pub fn joystick() -> Outcome {
    let (serial, force_n) = ("loose-joystick", DVec3::new(0.3, 0.0, -0.4));
    run(&Kind {
        serial,
        plug: &|| joystick::plug(serial, &joystick::OPENFFBOARD, Pace::Every(Duration::from_millis(1))),
        find: &|| joystick::find(serial),
        force_n,
        is_active: &|stick, _| (joystick::applied_force_n(stick) - force_n).length() < 0.01,
        recover: &|_, _| Ok(()),
    })
}

pub fn board() -> Outcome {
    let (serial, force_n) = ("loose-board", DVec3::new(0.3, 0.4, 0.0));
    let calibration = RefCell::<Option<BoardCalibration>>::default();
    run(&Kind {
        serial,
        plug: &|| {
            let board = BoardFirmware::at_home(BoardForm::Bytes14, &BoardKinematics::default());
            board::plug(serial, board.calibrated())
        },
        find: &|| {
            let device = board::find(serial, BoardHoming::Kept)?;
            *calibration.borrow_mut() = device.board_calibration();
            Ok(device)
        },
        force_n,
        is_active: &|board, _| board::of(board, |board| (board.applied_force_n() - force_n).length() < 0.01),
        // The counters are invalid until calibration is requested; the arm is at home.
        recover: &|board, touch| {
            let ticks = touch.ticks();
            touch.until("the loop runs", |touch| touch.ticks() > ticks + 200)?;
            let currents_ma = board::of(board, |board| board.currents_ma());
            ensure(currents_ma == [0; 3], || format!("{currents_ma:?} mA before it is calibrated"))?;
            let calibration = calibration.borrow().clone().ok_or("a board without calibration")?;
            calibration.request();
            touch.until("it is calibrated", |_| calibration.is_done())
        },
    })
}
