//! A device that is unplugged while it is used, and plugged in again elsewhere: the loop stays alive without force, and goes on.

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

/// How a kind of device is plugged in and asked, for the scenario that is the same for all of them.
struct Kind<'a, T> {
    serial: &'a str,
    plug: &'a dyn Fn() -> Result<(VirtualDevice, T), Box<dyn Error>>,
    find: &'a dyn Fn() -> Result<HidDevice, Box<dyn Error>>,
    /// What the model presses with, N.
    force_n: DVec3,
    /// Whether the device feels what it should while it is touched.
    is_touched: &'a dyn Fn(&T, &mut Touch) -> bool,
    /// What somebody has to do once the loop has opened it anew.
    put_right: &'a dyn Fn(&T, &mut Touch) -> Result<(), Box<dyn Error>>,
}

/// Unplugs it in mid-touch, plugs another one in so that its place is taken, and then itself.
fn run<T>(kind: &Kind<'_, T>) -> Outcome {
    let Kind { serial, plug, find, force_n, is_touched, put_right } = kind;
    let (plugged, inside) = plug()?;
    let first_node = plugged.node.clone();
    let mut touch = Touch::begin(find()?, *force_n)?;
    touch.until("it is touched", |touch| is_touched(&inside, touch))?;
    touch.told.clear();
    plugged.unplug();
    touch.until("the loop says that it is disconnected", |touch| touch.is_disconnected())?;
    touch.until("the force fades", |touch| touch.force_n() == DVec3::ZERO)?;
    let ticks = touch.ticks();
    // So that the loop has tried to open it in vain.
    touch.until("the loop goes on without it", |touch| touch.ticks() > ticks + 1200)?;
    ensure(!touch.told.contains(&LoopEventKind::Reconnected), || "it opened what is not there".into())?;

    let in_its_place = space_mouse::plug("in-its-place", SpaceMouseLayout::Separate, Pace::WhenTold)?;
    let (again, inside) = plug()?;
    ensure(again.node != first_node, || format!("{serial} is at {first_node} again"))?;
    touch.until("the loop opens it anew", |touch| touch.told.contains(&LoopEventKind::Reconnected))?;
    put_right(&inside, &mut touch)?;
    touch.until("it is touched again", |touch| !touch.is_disconnected() && is_touched(&inside, touch))?;
    let recovered = touch.told.iter().find_map(|kind| match kind {
        LoopEventKind::DeviceRecovered(ticks) => Some(*ticks),
        _ => None,
    });
    let recovered = recovered.ok_or("the loop did not say that it answers again")?;
    let faults = touch.told.iter().filter_map(|kind| match kind {
        LoopEventKind::DeviceFailed(error) => Some(format!("{error:?}")),
        _ => None,
    });
    let faults = faults.collect::<Vec<_>>().join(", ");
    let nodes = format!("{first_node}, then {}", again.node);
    touch.end()?;
    again.unplug();
    in_its_place.0.unplug();
    Ok(format!("{nodes}; {recovered} ticks without it, no force; told: {faults}"))
}

pub fn cap() -> Outcome {
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
        is_touched: &|cap, touch| {
            space_mouse::of(cap, |cap| cap.is_lit()) && touch.position_m().is_some_and(|at| at.x > 0.01)
        },
        put_right: &|_, _| Ok(()),
    })
}

pub fn joystick() -> Outcome {
    let (serial, force_n) = ("loose-joystick", DVec3::new(0.3, 0.0, -0.4));
    run(&Kind {
        serial,
        plug: &|| joystick::plug(serial, &joystick::OPENFFBOARD, Pace::Every(Duration::from_millis(1))),
        find: &|| joystick::find(serial),
        force_n,
        is_touched: &|stick, _| (joystick::felt_n(stick) - force_n).length() < 0.01,
        put_right: &|_, _| Ok(()),
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
        is_touched: &|board, _| board::of(board, |board| (board.applied_force_n() - force_n).length() < 0.01),
        // What was kept is believed no longer, until somebody says that its arm is at home, as it is.
        put_right: &|board, touch| {
            let ticks = touch.ticks();
            touch.until("the loop goes on", |touch| touch.ticks() > ticks + 200)?;
            let currents_ma = board::of(board, |board| board.currents_ma());
            ensure(currents_ma == [0; 3], || format!("{currents_ma:?} mA before it is calibrated"))?;
            let calibration = calibration.borrow().clone().ok_or("a board without calibration")?;
            calibration.request();
            touch.until("it is calibrated", |_| calibration.is_done())
        },
    })
}
