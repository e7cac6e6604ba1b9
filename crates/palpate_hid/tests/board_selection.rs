//! Identification of 3-DOF boards, and rejected devices and options.

use crate::bytes::bytes;
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::Arc;

const SEREMU: &str = include_str!("data/board_teensy_seremu_descriptor.txt");

/// A Teensy with its two interfaces: raw HID, and a serial port emulated over HID.
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
fn teensy_is_a_board_only_if_selected_as_one() {
    let error = open(teensy(), false, BoardOptions::default()).unwrap_err();
    assert!(matches!(&error, HidError::NotFound { teensy: Some(_), .. }), "{error}");
    assert!(error.to_string().contains("--teensy-is-board"), "{error}");
    // No hint for another selection, or without a Teensy except its serial port.
    let has_hint = |error: &HidError| matches!(error, HidError::NotFound { teensy: Some(_), .. });
    let cap = HidSelector::first(HidKind::SpaceMouse).find(&*teensy()).unwrap_err();
    assert!(!has_hint(&cap), "{cap}");
    let other = HidSelector { serial: Some("another".into()), ..HidSelector::default() };
    let other = other.find(&*teensy()).unwrap_err();
    assert!(!has_hint(&other), "{other}");
    let alone = teensy();
    alone.unplug("b");
    let alone = open(alone, false, BoardOptions::default()).unwrap_err();
    assert!(!has_hint(&alone), "{alone}");
    // The serial port is never a board: one device is found, not two.
    let device = open(teensy(), true, BoardOptions::default()).unwrap();
    assert_eq!(device.found().info.path, "b");
}

#[test]
fn mbed_is_a_board_without_further_options() {
    for form in [BoardForm::Bytes8, BoardForm::Bytes14] {
        let bus = SimulatedBus::default();
        let firmware = BoardFirmware::at_home(form, &BoardKinematics::default());
        bus.plug(firmware.info("a"), firmware.descriptor(), firmware);
        let device = open(Arc::new(bus), false, BoardOptions::default()).unwrap();
        assert_eq!(device.found().kind, HidKind::Board);
    }
}

#[test]
fn rejects_unsupported_descriptors_and_options_when_finding() {
    let plug = |form, change: fn(&mut Vec<u8>)| {
        let bus = SimulatedBus::default();
        let firmware = BoardFirmware::at_home(form, &BoardKinematics::default());
        let mut descriptor = firmware.descriptor();
        change(&mut descriptor);
        bus.plug(firmware.info("a"), descriptor, firmware);
        Arc::new(bus)
    };
    // Input reports of 16 bytes.
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
    assert!(matches!(&error, HidError::Option { found, allowed: "0 to 3", .. } if found == "5"), "{error}");
}
