//! The command with devices that are only there in memory.

use super::trial::Trial;
use super::*;
use palpate_haptics::HapticDevice;
use palpate_hid::simulated::{Firmware, SimulatedBus};
use palpate_hid::{HidDevice, HidKind, HidOptions, Usage};

/// A cap that is pushed down all the time.
struct Pushed(bool);

impl Firmware for Pushed {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.0 = !self.0;
        if !self.0 {
            return 0;
        }
        report[..7].copy_from_slice(&[1, 0, 0, 0, 0, 100, 0]);
        7
    }

    fn output(&mut self, _: &[u8]) -> bool {
        true
    }
}

fn info(path: &str, product: u16) -> HidInfo {
    HidInfo {
        path: path.into(),
        vendor: 0x256F,
        product,
        serial: "7".into(),
        name: "SpaceMouse Compact".into(),
        interface: None,
        applications: vec![Usage::new(1, 8)],
    }
}

fn bus() -> Arc<SimulatedBus> {
    let bus = Arc::new(SimulatedBus::default());
    bus.plug(info("/dev/cap", 0xC635), Vec::new(), Pushed(false));
    bus.plug(info("/dev/mouse", 0xC650), Vec::new(), Pushed(false));
    bus
}

#[test]
fn what_is_plugged_in_is_listed_with_what_keeps_it_from_being_opened() {
    let bus = bus();
    let of = |path: &str| {
        let infos = bus.list().unwrap();
        line(&*bus, infos.iter().find(|info| info.path == path).unwrap(), false)
    };
    let cap = of("/dev/cap");
    assert_eq!(
        (cap.kind.as_deref(), cap.vendor.as_str(), cap.refused.as_str()),
        (Some("SpaceMouse"), "256f", "")
    );
    assert_eq!(of("/dev/mouse").kind, None);
    let held = bus.open(&info("/dev/cap", 0xC635)).unwrap();
    assert!(of("/dev/cap").refused.contains("already in use by another program or HapticTool"));
    drop(held);
    let mut text = Vec::new();
    let mut listed = Listed { devices: vec![cap], others: 1, may_be_boards: Vec::new() };
    print(&listed, false, &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert!(
        lines.len() == 3 && lines[1].starts_with("SpaceMouse  ") && lines[2].starts_with("1 other"),
        "{text}"
    );
    listed.may_be_boards.push("/dev/hidraw3".into());
    let mut hinted = Vec::new();
    print(&listed, false, &mut hinted).unwrap();
    let hinted = String::from_utf8(hinted).unwrap();
    assert!(hinted.contains("\n/dev/hidraw3 is a Teensy that may be a 3-DOF board"), "{hinted}");
    // Columns begin where their heads do.
    for head in ["numbers", "path", "name"] {
        let at = lines[0].find(head).unwrap();
        assert!(lines[1].as_bytes()[at - 1] == b' ' && lines[1].as_bytes()[at] != b' ', "{text}");
    }
}

#[test]
fn a_device_is_named_by_path_serial_or_numbers() {
    let bus = bus();
    for id in ["/dev/cap", "7", "256f:c635", "256F:C635"] {
        let found = selector(id, false, &*bus).unwrap().find(&*bus).unwrap();
        assert_eq!((found.kind, found.info.path.as_str()), (HidKind::SpaceMouse, "/dev/cap"), "{id}");
    }
    for id in ["/dev/mouse", "8", "256f:c636", "/dev/nothing", "x:y", ""] {
        let error = selector(id, false, &*bus).unwrap().find(&*bus).unwrap_err();
        let HidError::NotFound { present, .. } = &error else { panic!("{id}: {error}") };
        assert!(present.iter().all(|label| label.contains("serial 7")), "{id}: {error}");
    }
}

fn trial(bus: &SimulatedBus, seconds: f64) -> Trial {
    Trial {
        selector: selector("7", false, bus).unwrap(),
        force_n: 0.3,
        full_scale_n: JoystickOptions::CAREFUL_FULL_SCALE_N,
        arm: Some(Arm::WoodenHaptics),
        seconds,
        asks: false,
    }
}

#[test]
fn a_test_reads_the_device_and_says_what_it_saw() {
    let bus = bus();
    let trial = trial(&bus, 0.4);
    let device = HidDevice::find(bus, &trial.selector, &HidOptions::default()).unwrap();
    let tested = trial.test(device).unwrap();
    assert!(tested.ticks > 50 && tested.reports > 20, "{tested:?}");
    assert_eq!((tested.max_force_n, tested.force_rate_hz, tested.device_errors), (0.0, None, 0));
    // Pushed along its own z, which is down.
    assert!(tested.lowest_m[1] < -1e-3 && tested.highest_m[1] <= 0.0, "{tested:?}");
    assert_eq!([tested.lowest_m[0], tested.highest_m[0], tested.lowest_m[2], tested.highest_m[2]], [0.0; 4]);
    assert!(tested.faults.is_empty(), "{tested:?}");
}

#[test]
fn a_board_is_pushed_gently_and_feels_what_is_told() {
    use palpate_hid::simulated::BoardFirmware;
    use palpate_hid::{BoardForm, BoardHoming, BoardKinematics, BoardOptions};
    use std::sync::Mutex;

    let bus = Arc::new(SimulatedBus::default());
    let board = BoardFirmware::at_home(BoardForm::Bytes64, &BoardKinematics::default());
    let (info, descriptor) = (board.info("/dev/board"), board.descriptor());
    let board = Arc::new(Mutex::new(board));
    bus.plug(info, descriptor, Arc::clone(&board));
    let selector = selector("/dev/board", true, &*bus).unwrap();
    let trial = Trial {
        selector,
        force_n: 0.3,
        full_scale_n: JoystickOptions::CAREFUL_FULL_SCALE_N,
        arm: Some(Arm::WoodenHaptics),
        seconds: 1.2,
        asks: false,
    };
    let options = BoardOptions { homing: BoardHoming::AtOpen, ..BoardOptions::default() };
    let device =
        HidDevice::find(bus, &trial.selector, &HidOptions { board: options, ..HidOptions::default() });
    let tested = trial.test(device.unwrap()).unwrap();
    assert!(tested.max_force_n > 0.1 && tested.max_force_n < 0.3 + 1e-9, "{tested:?}");
    assert!(tested.forces > 100 && tested.force_rate_hz.is_some_and(|hz| hz > 50.0), "{tested:?}");
    assert_eq!(board.lock().unwrap().currents_ma(), [0; 3]);
}

#[test]
fn it_asks_first_and_takes_only_a_yes() {
    let bus = bus();
    let trial = trial(&bus, 1.0);
    let device = HidDevice::find(bus, &trial.selector, &HidOptions::default()).unwrap();
    let mut asked = Vec::new();
    let mut ask = |answer: &str| {
        let of_device = (&device.describe(), HidKind::SpaceMouse, device.ends_by_itself());
        trial.ask(of_device, &mut asked, &mut answer.as_bytes(), true)
    };
    assert!(ask("y\n").is_ok() && ask("yes\n").is_ok());
    for no in ["", "\n", "n\n", "yellow\n"] {
        assert!(matches!(ask(no), Err(LabError::NotAgreed)), "{no:?}");
    }
    assert!(
        String::from_utf8(asked)
            .unwrap()
            .ends_with("has no motors; it will be read for 1 s. Move it.\nBegin? [y/N] ")
    );
    let of_device = (&device.describe(), HidKind::SpaceMouse, true);
    let nobody = trial.ask(of_device, &mut Vec::new(), &mut "y\n".as_bytes(), false);
    assert!(matches!(nobody, Err(LabError::NobodyToAsk)));
}

#[test]
fn a_board_is_taken_for_the_arm_that_is_named() {
    use palpate_hid::BoardForm;
    use palpate_hid::simulated::BoardFirmware;

    let bus = SimulatedBus::default();
    let arms = [(Arm::WoodenHaptics, "link B up"), (Arm::PolhemV2, "Polhem 2"), (Arm::PolhemV3, "Polhem 3")];
    for (arm, word) in arms {
        let board = BoardFirmware::at_home(BoardForm::Bytes14, &arm.kinematics());
        bus.plug(board.info("/dev/board"), board.descriptor(), board);
        let selector = selector("/dev/board", false, &bus).unwrap();
        let trial =
            Trial { selector, force_n: 0.3, full_scale_n: 500.0, arm: Some(arm), seconds: 1.0, asks: true };
        let description = palpate_haptics::DeviceDescription {
            name: "a board".into(),
            workspace_m: [glam::DVec3::NEG_ONE, glam::DVec3::ONE],
            max_force_n: 5.0,
            rate_hz: 1000.0,
        };
        let mut asked = Vec::new();
        trial.ask((&description, HidKind::Board, true), &mut asked, &mut "y\n".as_bytes(), true).unwrap();
        let asked = String::from_utf8(asked).unwrap();
        assert!(asked.contains(word), "{asked}");
    }
}

/// Only where nothing is known to end the force of a program that is killed.
#[test]
fn who_is_asked_is_told_that_a_force_may_stay() {
    use palpate_hid::simulated::BoardFirmware;
    use palpate_hid::{BoardForm, BoardKinematics};

    for (form, may_stay) in
        [(BoardForm::Bytes8, false), (BoardForm::Bytes14, false), (BoardForm::Bytes64, true)]
    {
        let bus = Arc::new(SimulatedBus::default());
        let board = BoardFirmware::at_home(form, &BoardKinematics::default());
        bus.plug(board.info("/dev/board"), board.descriptor(), board);
        let selector = selector("/dev/board", true, &*bus).unwrap();
        let device = HidDevice::find(bus.clone(), &selector, &HidOptions::default()).unwrap();
        let trial = Trial { selector, ..trial(&bus, 1.0) };
        let mut asked = Vec::new();
        let of_device = (&device.describe(), HidKind::Board, device.ends_by_itself());
        trial.ask(of_device, &mut asked, &mut "y\n".as_bytes(), true).unwrap();
        let asked = String::from_utf8(asked).unwrap();
        assert_eq!(asked.contains("if this program is killed its last force may stay"), may_stay, "{asked}");
    }
}

/// With the sizes of another arm a force may be several times as large.
#[test]
fn a_board_whose_arm_is_not_named_is_only_read() {
    use palpate_hid::simulated::BoardFirmware;
    use palpate_hid::{BoardForm, BoardHoming, BoardKinematics, BoardOptions};

    let bus = Arc::new(SimulatedBus::default());
    let board = BoardFirmware::at_home(BoardForm::Bytes14, &BoardKinematics::default());
    bus.plug(board.info("/dev/board"), board.descriptor(), board);
    let selector = selector("/dev/board", true, &*bus).unwrap();
    let trial = Trial { selector, arm: None, ..trial(&bus, 1.2) };
    let options = BoardOptions { homing: BoardHoming::AtOpen, ..BoardOptions::default() };
    let options = HidOptions { board: options, ..HidOptions::default() };
    let device = HidDevice::find(bus, &trial.selector, &options).unwrap();
    let mut asked = Vec::new();
    let of_device = (&device.describe(), HidKind::Board, device.ends_by_itself());
    trial.ask(of_device, &mut asked, &mut "y\n".as_bytes(), true).unwrap();
    let asked = String::from_utf8(asked).unwrap();
    assert!(asked.contains("name its arm (--board)") && !asked.contains("push and pull"), "{asked}");
    let tested = trial.test(device).unwrap();
    assert!(tested.ticks > 500 && tested.max_force_n == 0.0, "{tested:?}");
}
