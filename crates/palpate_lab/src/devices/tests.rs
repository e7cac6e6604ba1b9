//! The command with simulated devices.

use super::device_test::DeviceTest;
use super::*;
use palpate_haptics::HapticDevice;
use palpate_hid::simulated::{Firmware, SimulatedBus};
use palpate_hid::{HidDevice, HidKind, HidOptions, Usage};

/// SpaceMouse whose cap is always pushed down.
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
fn list_has_kinds_and_open_errors() {
    let bus = bus();
    let of = |path: &str| {
        let infos = bus.list().unwrap();
        line(&*bus, infos.iter().find(|info| info.path == path).unwrap(), false)
    };
    let cap = of("/dev/cap");
    assert_eq!(
        (cap.kind.as_deref(), cap.vendor.as_str(), cap.error.as_str()),
        (Some("SpaceMouse"), "256f", "")
    );
    assert_eq!(of("/dev/mouse").kind, None);
    let held = bus.open(&info("/dev/cap", 0xC635)).unwrap();
    let error = bus.open(&info("/dev/cap", 0xC635)).err().unwrap();
    assert!(matches!(error, HidError::Busy { .. }), "{error}");
    assert_eq!(of("/dev/cap").error, error.to_string());
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
    let mut with_hint = Vec::new();
    print(&listed, false, &mut with_hint).unwrap();
    let with_hint = String::from_utf8(with_hint).unwrap();
    assert!(with_hint.contains("\n/dev/hidraw3 ") && with_hint.contains("--teensy-is-board"), "{with_hint}");
    // Columns start below their headings.
    for head in ["numbers", "path", "name"] {
        let at = lines[0].find(head).unwrap();
        assert!(lines[1].as_bytes()[at - 1] == b' ' && lines[1].as_bytes()[at] != b' ', "{text}");
    }
}

#[test]
fn selects_by_path_serial_number_or_vendor_and_product() {
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

fn test(bus: &SimulatedBus, seconds: f64) -> DeviceTest {
    DeviceTest { selector: selector("7", false, bus).unwrap(), ..test_of(seconds) }
}

fn test_of(seconds: f64) -> DeviceTest {
    DeviceTest {
        selector: HidSelector::default(),
        force_n: 0.3,
        joystick: JoystickOptions::default(),
        arm: Some(Arm::WoodenHaptics),
        seconds,
        needs_confirmation: false,
    }
}

#[test]
fn test_reports_reads_and_positions() {
    let bus = bus();
    let test = test(&bus, 0.4);
    let device = HidDevice::find(bus, &test.selector, &HidOptions::default()).unwrap();
    let report = test.test(device).unwrap();
    assert!(report.ticks > 50 && report.reports > 20, "{report:?}");
    assert_eq!((report.max_force_n, report.force_rate_hz, report.device_errors), (0.0, None, 0));
    // The cap is pushed along its own z, which points down.
    assert!(report.lowest_m[1] < -1e-3 && report.highest_m[1] <= 0.0, "{report:?}");
    assert_eq!([report.lowest_m[0], report.highest_m[0], report.lowest_m[2], report.highest_m[2]], [0.0; 4]);
    assert!(report.faults.is_empty(), "{report:?}");
}

#[test]
fn test_of_a_board_stays_below_its_force_and_ends_at_zero() {
    use palpate_hid::simulated::BoardFirmware;
    use palpate_hid::{BoardForm, BoardHoming, BoardKinematics, BoardOptions};
    use std::sync::Mutex;

    let bus = Arc::new(SimulatedBus::default());
    let board = BoardFirmware::at_home(BoardForm::Bytes64, &BoardKinematics::default());
    let (info, descriptor) = (board.info("/dev/board"), board.descriptor());
    let board = Arc::new(Mutex::new(board));
    bus.plug(info, descriptor, Arc::clone(&board));
    let selector = selector("/dev/board", true, &*bus).unwrap();
    let test = DeviceTest {
        selector,
        force_n: 0.3,
        joystick: JoystickOptions::default(),
        arm: Some(Arm::WoodenHaptics),
        seconds: 1.2,
        needs_confirmation: false,
    };
    let options = BoardOptions { homing: BoardHoming::AtOpen, ..BoardOptions::default() };
    let device =
        HidDevice::find(bus, &test.selector, &HidOptions { board: options, ..HidOptions::default() });
    let report = test.test(device.unwrap()).unwrap();
    assert!(report.max_force_n > 0.1 && report.max_force_n < 0.3 + 1e-9, "{report:?}");
    assert!(report.forces > 100 && report.force_rate_hz.is_some_and(|hz| hz > 50.0), "{report:?}");
    assert_eq!(board.lock().unwrap().currents_ma(), [0; 3]);
}

#[test]
fn only_yes_confirms_a_test() {
    let bus = bus();
    let test = test(&bus, 1.0);
    let device = HidDevice::find(bus, &test.selector, &HidOptions::default()).unwrap();
    let mut question = Vec::new();
    let mut confirm = |reply: &str| {
        let described = (&device.describe(), HidKind::SpaceMouse, device.has_force_timeout());
        test.confirm(described, &mut question, &mut reply.as_bytes(), true)
    };
    assert!(confirm("y\n").is_ok() && confirm("yes\n").is_ok());
    for no in ["", "\n", "n\n", "yellow\n"] {
        assert!(matches!(confirm(no), Err(LabError::Declined)), "{no:?}");
    }
    assert!(
        String::from_utf8(question)
            .unwrap()
            .ends_with("has no motors; it will be read for 1 s. Move it.\nBegin? [y/N] ")
    );
    let of_device = (&device.describe(), HidKind::SpaceMouse, true);
    let unattended = test.confirm(of_device, &mut Vec::new(), &mut "y\n".as_bytes(), false);
    assert!(matches!(unattended, Err(LabError::NoTerminal)));
}

#[test]
fn question_names_the_arm_of_a_board() {
    use palpate_hid::BoardForm;
    use palpate_hid::simulated::BoardFirmware;

    let bus = SimulatedBus::default();
    let arms = [(Arm::WoodenHaptics, "link B up"), (Arm::PolhemV2, "Polhem 2"), (Arm::PolhemV3, "Polhem 3")];
    for (arm, word) in arms {
        let board = BoardFirmware::at_home(BoardForm::Bytes14, &arm.kinematics());
        bus.plug(board.info("/dev/board"), board.descriptor(), board);
        let selector = selector("/dev/board", false, &bus).unwrap();
        let test = DeviceTest {
            selector,
            force_n: 0.3,
            joystick: JoystickOptions::default(),
            arm: Some(arm),
            seconds: 1.0,
            needs_confirmation: true,
        };
        let description = palpate_haptics::DeviceDescription {
            name: "a board".into(),
            workspace_m: [glam::DVec3::NEG_ONE, glam::DVec3::ONE],
            max_force_n: 5.0,
            rate_hz: 1000.0,
        };
        let mut question = Vec::new();
        test.confirm((&description, HidKind::Board, true), &mut question, &mut "y\n".as_bytes(), true)
            .unwrap();
        let question = String::from_utf8(question).unwrap();
        assert!(question.contains(word), "{question}");
    }
}

/// Only where nothing ends the force of a killed program.
#[test]
fn question_warns_of_a_force_that_may_stay() {
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
        let test = DeviceTest { selector, ..test(&bus, 1.0) };
        let mut question = Vec::new();
        let of_device = (&device.describe(), HidKind::Board, device.has_force_timeout());
        test.confirm(of_device, &mut question, &mut "y\n".as_bytes(), true).unwrap();
        let question = String::from_utf8(question).unwrap();
        assert_eq!(
            question.contains("if this program is killed its last force may stay"),
            may_stay,
            "{question}"
        );
    }
}

/// With the dimensions of another arm a force may be several times as large.
#[test]
fn board_without_an_arm_is_only_read() {
    use palpate_hid::simulated::BoardFirmware;
    use palpate_hid::{BoardForm, BoardHoming, BoardKinematics, BoardOptions};

    let bus = Arc::new(SimulatedBus::default());
    let board = BoardFirmware::at_home(BoardForm::Bytes14, &BoardKinematics::default());
    bus.plug(board.info("/dev/board"), board.descriptor(), board);
    let selector = selector("/dev/board", true, &*bus).unwrap();
    let test = DeviceTest { selector, arm: None, ..test(&bus, 1.2) };
    let options = BoardOptions { homing: BoardHoming::AtOpen, ..BoardOptions::default() };
    let options = HidOptions { board: options, ..HidOptions::default() };
    let device = HidDevice::find(bus, &test.selector, &options).unwrap();
    let mut question = Vec::new();
    let of_device = (&device.describe(), HidKind::Board, device.has_force_timeout());
    test.confirm(of_device, &mut question, &mut "y\n".as_bytes(), true).unwrap();
    let question = String::from_utf8(question).unwrap();
    assert!(question.contains("name its arm (--board)") && !question.contains("push and pull"), "{question}");
    let report = test.test(device).unwrap();
    assert!(report.ticks > 500 && report.max_force_n == 0.0, "{report:?}");
}

/// Motors wired in several ways: the test names `reverse` or `use_y`, and nothing for a joystick of the right sign.
#[test]
fn test_of_a_joystick_names_reverse_or_use_y() {
    use palpate_hid::simulated::{JoystickFirmware, SimulatedStick};
    use std::sync::Mutex;

    let text = include_str!("../../../palpate_hid/tests/data/openffboard_2axis.txt");
    let words = text.lines().flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace());
    let descriptor: Vec<u8> = words.map(|word| u8::from_str_radix(word, 16).unwrap()).collect();
    let test_with_wiring = |wiring| {
        let mut firmware = JoystickFirmware::new(&descriptor, SimulatedStick::default()).unwrap();
        firmware.wire_motors(wiring);
        let bus = Arc::new(SimulatedBus::default());
        let info =
            HidInfo { path: "/dev/stick".into(), applications: vec![Usage::new(1, 4)], ..HidInfo::default() };
        let firmware = Arc::new(Mutex::new(firmware));
        bus.plug(info, descriptor.clone(), Arc::clone(&firmware));
        let joystick =
            JoystickOptions { full_scale_n: 50.0, check_direction: false, ..JoystickOptions::default() };
        let selector = selector("/dev/stick", false, &*bus).unwrap();
        let test = DeviceTest { selector, joystick, ..test_of(3.8) };
        let options = HidOptions { joystick, ..HidOptions::default() };
        let device = HidDevice::find(bus, &test.selector, &options).unwrap();
        let report = test.test(device).unwrap();
        assert!(!firmware.lock().unwrap().is_on());
        report
    };
    let cases = [
        ([[1.0, 0.0], [0.0, 1.0]], None),
        ([[-1.0, 0.0], [0.0, 1.0]], Some("set `JoystickOptions::reverse` to [true, false] (--reverse x)")),
        ([[1.0, 1.0], [0.0, 0.0]], Some("set `JoystickOptions::use_y` to false (--no-y)")),
    ];
    // A test lasts as long as its forces, and its loop is idle for most of that time.
    let of_wiring = &test_with_wiring;
    let reports = std::thread::scope(|scope| {
        let running = cases.map(|(wiring, _)| scope.spawn(move || of_wiring(wiring)));
        running.map(|test| test.join().unwrap())
    });
    for ((_, advised), report) in cases.into_iter().zip(reports) {
        assert!(report.notes.len() == 1 && report.notes[0].contains("use_y"), "{report:?}");
        match advised {
            None => assert!(report.advice.is_empty(), "{report:?}"),
            Some(option) => {
                assert!(report.advice.len() == 1 && report.advice[0].contains(option), "{report:?}");
            }
        }
    }
}
