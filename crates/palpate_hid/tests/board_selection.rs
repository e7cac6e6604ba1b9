//! Which devices are taken for a 3-DOF board, and which are refused.

#[path = "shared/bytes.rs"]
mod bytes;

use bytes::bytes;
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::Arc;

const SEREMU: &str = include_str!("data/board_teensy_seremu_descriptor.txt");

/// A Teensy as it shows itself: raw HID, and beside it a serial port made of HID.
fn teensy() -> Arc<SimulatedBus> {
    let bus = SimulatedBus::default();
    let firmware = || BoardFirmware::at_home(BoardForm::Bytes64, &BoardKinematics::default());
    let board = firmware();
    bus.plug(board.info("b"), board.descriptor(), firmware());
    let serial =
        HidInfo { interface: Some(1), applications: vec![Usage::new(0xFFC9, 0x0004)], ..board.info("a") };
    bus.plug(serial, bytes(SEREMU), firmware());
    Arc::new(bus)
}

fn open(
    bus: Arc<SimulatedBus>,
    treat_teensy_as_board: bool,
    board: BoardOptions,
) -> Result<HidDevice, HidError> {
    let selector =
        HidSelector { kind: Some(HidKind::Board), treat_teensy_as_board, ..HidSelector::default() };
    HidDevice::find(bus, &selector, &HidOptions { board, ..HidOptions::default() })
}

#[test]
fn a_teensy_is_a_board_only_for_somebody_who_says_so() {
    let error = open(teensy(), false, BoardOptions::default()).unwrap_err();
    assert!(matches!(error, HidError::NotFound { .. }), "{error}");
    assert!(error.to_string().contains("may be a 3-DOF board"), "{error}");
    assert!(error.to_string().contains("--teensy-is-board"), "{error}");
    // Not where something else was asked for, or there is no Teensy but its serial port.
    let cap = HidSelector::first(HidKind::SpaceMouse).find(&*teensy()).unwrap_err().to_string();
    assert!(!cap.contains("may be"), "{cap}");
    let other = HidSelector { serial: Some("another".into()), ..HidSelector::default() };
    let other = other.find(&*teensy()).unwrap_err().to_string();
    assert!(!other.contains("may be"), "{other}");
    let alone = teensy();
    alone.unplug("b");
    let alone = open(alone, false, BoardOptions::default()).unwrap_err().to_string();
    assert!(!alone.contains("may be"), "{alone}");
    // And its serial port never is: one device is found, not two.
    let device = open(teensy(), true, BoardOptions::default()).unwrap();
    assert_eq!(device.found().info.path, "b");
}

#[test]
fn an_mbed_is_a_board_without_being_asked() {
    for form in [BoardForm::Bytes8, BoardForm::Bytes14] {
        let bus = SimulatedBus::default();
        let firmware = BoardFirmware::at_home(form, &BoardKinematics::default());
        bus.plug(firmware.info("a"), firmware.descriptor(), firmware);
        let device = open(Arc::new(bus), false, BoardOptions::default()).unwrap();
        assert_eq!(device.found().kind, HidKind::Board);
    }
}

#[test]
fn what_no_driver_can_do_is_refused_before_it_is_opened() {
    let plug = |form, change: fn(&mut Vec<u8>)| {
        let bus = SimulatedBus::default();
        let firmware = BoardFirmware::at_home(form, &BoardKinematics::default());
        let mut descriptor = firmware.descriptor();
        change(&mut descriptor);
        bus.plug(firmware.info("a"), descriptor, firmware);
        Arc::new(bus)
    };
    // 16 bytes from it.
    let longer = plug(BoardForm::Bytes14, |descriptor| descriptor[16] = 16);
    let error = open(longer, false, BoardOptions::default()).unwrap_err();
    assert!(
        matches!(&error, HidError::Unsupported { lacks, .. } if lacks.contains("8, 14 or 64")),
        "{error}"
    );
    let kept = BoardOptions { homing: BoardHoming::Kept, ..BoardOptions::default() };
    let error = open(plug(BoardForm::Bytes8, |_| ()), false, kept).unwrap_err();
    assert!(matches!(&error, HidError::Option { found, .. } if found == "Kept"), "{error}");
    let strong = BoardOptions { max_current_a: 5.0, ..BoardOptions::default() };
    let error = open(plug(BoardForm::Bytes14, |_| ()), false, strong).unwrap_err();
    assert!(error.to_string().contains("0 to 3"), "{error}");
}
