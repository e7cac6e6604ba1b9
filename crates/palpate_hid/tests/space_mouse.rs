//! The SpaceMouse: its reports byte by byte, and what becomes of a push.

use glam::{DQuat, DVec3};
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::simulated::{Firmware, SimulatedBus};
use palpate_hid::{
    HidBus, HidDevice, HidError, HidInfo, HidKind, HidOptions, HidSelector, SpaceMouseOptions,
    SpaceMouseReport, Usage,
};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// The lines of the reports' file: those from the cap, or those to its light.
fn reports(to_light: bool) -> impl Iterator<Item = &'static str> {
    let lines = include_str!("data/space_mouse.txt").lines().filter(|line| !line.starts_with('#'));
    lines.filter(move |line| line.starts_with("light") == to_light)
}

/// The output report that turns the light on or off.
fn light(is_on: bool) -> Vec<u8> {
    let head = if is_on { "light on" } else { "light off" };
    let hex = reports(true).find_map(|line| line.strip_prefix(head)).unwrap();
    hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

#[test]
fn reports_are_read_byte_by_byte() {
    let mut lines = 0;
    for line in reports(false) {
        let (kind, rest) = line.split_once(' ').unwrap();
        let (said, hex) = rest.trim().split_once("  ").unwrap();
        let said: Vec<i64> = said.split(' ').map(|number| number.parse().unwrap()).collect();
        let bytes: Vec<u8> =
            hex.trim().split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
        let axes = |at: usize| [0, 1, 2].map(|i| i16::try_from(said[at + i]).unwrap());
        let expected = match kind {
            "push" => Ok(SpaceMouseReport::Push(axes(0))),
            "turn" => Ok(SpaceMouseReport::Turn(axes(0))),
            "push+turn" => Ok(SpaceMouseReport::PushAndTurn(axes(0), axes(3))),
            "buttons" => Ok(SpaceMouseReport::Buttons(said[0] as u32)),
            "other" => Ok(SpaceMouseReport::Other(said[0] as u8)),
            _ => Err((said[0] as u8, bytes.len())),
        };
        assert_eq!(
            SpaceMouseReport::parse(&bytes).map_err(|short| (short.id, short.found)),
            expected,
            "{line}"
        );
        lines += 1;
    }
    assert_eq!(lines, 12);
    assert!(SpaceMouseReport::parse(&[]).is_err());
}

proptest::proptest! {
    #[test]
    fn no_report_makes_it_panic(bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..70)) {
        let _ = SpaceMouseReport::parse(&bytes);
    }
}

/// A cap that says what it is told to, and what has been written to it.
#[derive(Clone, Default)]
struct Cap {
    says: Arc<Mutex<VecDeque<Vec<u8>>>>,
    heard: Arc<Mutex<Vec<Vec<u8>>>>,
}

impl Cap {
    fn say(&self, report: &[u8]) {
        self.says.lock().unwrap().push_back(report.to_vec());
    }

    fn push(&self, [x, y, z]: [i16; 3]) {
        let [[a, b], [c, d], [e, f]] = [x, y, z].map(i16::to_le_bytes);
        self.say(&[1, a, b, c, d, e, f]);
    }
}

impl Firmware for Cap {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let Some(said) = self.says.lock().unwrap().pop_front() else { return 0 };
        report[..said.len()].copy_from_slice(&said);
        said.len()
    }

    fn output(&mut self, report: &[u8]) -> bool {
        self.heard.lock().unwrap().push(report.to_vec());
        true
    }
}

fn info(serial: &str) -> HidInfo {
    HidInfo {
        path: format!("cap {serial}"),
        vendor: 0x256F,
        product: 0xC635,
        serial: serial.into(),
        name: "SpaceMouse Compact".into(),
        interface: None,
        applications: vec![Usage::new(1, 8)],
    }
}

/// Time that the test makes pass.
#[derive(Clone, Default)]
struct Time(Arc<AtomicU64>);

impl Time {
    fn advance(&self, ms: u64) {
        self.0.fetch_add(ms, Ordering::Relaxed);
    }
}

/// An open cap, its bus, its other end and its clock.
fn open(options: SpaceMouseOptions) -> (HidDevice, Arc<SimulatedBus>, Cap, Time) {
    let (bus, cap, time) = (Arc::new(SimulatedBus::default()), Cap::default(), Time::default());
    bus.plug(info("1"), Vec::new(), cap.clone());
    let now = time.0.clone();
    let options = HidOptions { space_mouse: options, ..HidOptions::default() };
    let selector = HidSelector::first(HidKind::SpaceMouse);
    let mut device = HidDevice::find(bus.clone(), &selector, &options)
        .unwrap()
        .with_clock(move || Duration::from_millis(now.load(Ordering::Relaxed)));
    device.open().unwrap();
    (device, bus, cap, time)
}

const PERIOD: Duration = Duration::from_millis(1);

#[test]
fn a_push_moves_the_point_and_ends_when_the_cap_falls_silent() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions { dead_zone: 0.0, ..Default::default() });
    assert!(device.describe().max_force_n == 0.0 && device.describe().validate().is_ok());
    assert_eq!(device.read(PERIOD).unwrap().position_m, DVec3::ZERO);
    // Half to the right, fully towards the owner, a quarter down.
    cap.push([175, 350, 87]);
    let rate = DVec3::new(0.5, -87.0 / 350.0, 1.0) * 0.1;
    for tick in 1..=100_u32 {
        time.advance(1);
        let reading = device.read(PERIOD).unwrap();
        assert!((reading.position_m - rate * f64::from(tick) * 1e-3).length() < 1e-12, "{tick}");
        assert!((reading.velocity_m_per_s.unwrap() - rate).length() < 1e-9);
    }
    // It was last heard at the first of these ticks, 0.1 s ago at the last one that counts.
    time.advance(1);
    device.read(PERIOD).unwrap();
    let there = device.read(PERIOD).unwrap();
    for _ in 0..50 {
        time.advance(1);
        let reading = device.read(PERIOD).unwrap();
        assert_eq!((reading.position_m, reading.velocity_m_per_s), (there.position_m, Some(DVec3::ZERO)));
    }
}

#[test]
fn the_point_stays_in_its_box_and_a_stall_moves_it_little() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions::default());
    device.read(PERIOD).unwrap();
    cap.push([0, 350, 0]);
    time.advance(5000);
    // 5 s of silence in the loop, but no hand moves on unseen: 20 ms at most.
    assert!((device.read(PERIOD).unwrap().position_m - DVec3::Z * 0.1 * 0.02).length() < 1e-12);
    for _ in 0..2000 {
        cap.push([0, 32767, 0]);
        time.advance(1);
        device.read(PERIOD).unwrap();
    }
    let reading = device.read(PERIOD).unwrap();
    assert_eq!((reading.position_m, reading.velocity_m_per_s), (DVec3::Z * 0.1, Some(DVec3::ZERO)));
    assert_eq!(device.describe().workspace_m, [DVec3::splat(-0.1), DVec3::splat(0.1)]);
}

#[test]
fn turns_go_about_the_axes_by_the_right_hand() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions { dead_zone: 0.0, ..Default::default() });
    device.read(PERIOD).unwrap();
    // About its z, which is down: about -y here. In the long form, as wireless models say it.
    let full = 350_i16.to_le_bytes();
    for tick in 1..=20_u32 {
        cap.say(&[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, full[0], full[1]]);
        time.advance(1);
        let reading = device.read(PERIOD).unwrap();
        let expected = DQuat::from_rotation_y(-1.5e-3 * f64::from(tick));
        assert!(reading.orientation.angle_between(expected) < 1e-9 && reading.is_usable());
        assert_eq!(reading.position_m, DVec3::ZERO);
    }
}

#[test]
fn buttons_light_and_the_count_of_what_was_passed_over() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions::default());
    assert_eq!(*cap.heard.lock().unwrap(), [light(true)]);
    let counters = device.counters();
    // 63 unread reports, as many as hidraw keeps: the newest counts, 62 are passed over.
    for count in 1..=63 {
        cap.push([count, 0, 0]);
    }
    cap.say(&[3, 2]);
    cap.say(&[1, 0]);
    time.advance(1);
    device.read(PERIOD).unwrap();
    time.advance(10);
    let reading = device.read(PERIOD).unwrap();
    assert_eq!(reading.buttons, 2);
    let speed = 0.1 * (63.0 / 350.0 - 0.02) / 0.98;
    assert!((reading.velocity_m_per_s.unwrap() - DVec3::X * speed).length() < 1e-12);
    assert_eq!((counters.read(), counters.skipped(), counters.malformed()), (64, 62, 1));
    device.close().unwrap();
    assert_eq!(*cap.heard.lock().unwrap(), [light(true), light(false)]);
    assert_eq!(device.read(PERIOD), Err(DeviceError::NotOpen));
}

#[test]
fn it_is_found_again_where_it_is_plugged_in_anew() {
    let (mut device, bus, cap, time) = open(SpaceMouseOptions::default());
    assert!(bus.unplug("cap 1"));
    assert_eq!(device.read(PERIOD), Err(DeviceError::Disconnected));
    let _ = device.close();
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    // Another one is not it.
    bus.plug(info("2"), Vec::new(), Cap::default());
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    bus.plug(HidInfo { path: "elsewhere".into(), ..info("1") }, Vec::new(), cap.clone());
    device.open().unwrap();
    assert_eq!(device.found().info.path, "elsewhere");
    cap.push([350, 0, 0]);
    device.read(PERIOD).unwrap();
    time.advance(10);
    assert!(device.read(PERIOD).unwrap().position_m.x > 0.0);
}

#[test]
fn which_one_is_meant_is_said_or_refused() {
    let bus = Arc::new(SimulatedBus::default());
    let find = |selector: &HidSelector| {
        HidDevice::find(bus.clone(), selector, &HidOptions::default()).map(|device| device.found().clone())
    };
    let any = HidSelector { kind: Some(HidKind::SpaceMouse), ..HidSelector::default() };
    let text = find(&any).unwrap_err().to_string();
    assert_eq!(text, "no SpaceMouse is plugged in; there is no HID device at all");
    // A mouse of the same maker, and one of its receivers' other interfaces.
    bus.plug(
        HidInfo { product: 0xC652, path: "m".into(), applications: vec![Usage::new(1, 2)], ..info("") },
        Vec::new(),
        Cap::default(),
    );
    assert!(matches!(find(&any), Err(HidError::NotFound { .. })));
    bus.plug(info("b"), Vec::new(), Cap::default());
    bus.plug(info("a"), Vec::new(), Cap::default());
    let Err(HidError::Several { found, .. }) = find(&any) else { panic!("two alike") };
    assert_eq!(found.len(), 2);
    assert!(found[0].ends_with("serial a) at cap a") && found[1].ends_with(" at cap b"), "{found:?}");
    assert_eq!(find(&HidSelector::any()).unwrap().info.serial, "a");
    let by_serial = HidSelector { serial: Some("b".into()), ..any.clone() };
    assert_eq!(find(&by_serial).unwrap().info.serial, "b");
    let not_there = HidSelector { vendor: Some(0x046D), ..by_serial };
    let text = find(&not_there).unwrap_err().to_string();
    assert!(
        text.starts_with("no SpaceMouse of vendor 046d with serial number b is plugged in; there are"),
        "{text}"
    );
    // One device has one hand: the second tool gets the second device, the third none.
    let first = HidSelector::any();
    let hold = || {
        let mut held = HidDevice::find(bus.clone(), &first, &HidOptions::default()).unwrap();
        held.open().unwrap();
        held
    };
    let held = [hold(), hold()];
    assert_eq!(held.each_ref().map(|held| held.found().info.serial.as_str()), ["a", "b"]);
    let busy = find(&first).unwrap_err();
    assert!(matches!(&busy, HidError::Busy { device } if device.ends_with("serial a)")), "{busy}");
    // Who names one means that one.
    let by_serial = HidSelector { serial: Some("a".into()), ..any };
    assert!(matches!(find(&by_serial), Err(HidError::Busy { .. })));
    drop(held);
    assert_eq!(find(&first).unwrap().info.serial, "a");
}

/// Both were found before either was opened.
#[test]
fn two_tools_that_mean_the_first_get_one_each() {
    let bus = Arc::new(SimulatedBus::default());
    bus.plug(info("a"), Vec::new(), Cap::default());
    bus.plug(info("b"), Vec::new(), Cap::default());
    let find = || HidDevice::find(bus.clone(), &HidSelector::any(), &HidOptions::default()).unwrap();
    let mut tools = [find(), find(), find()];
    let opened = tools.each_mut().map(|tool| tool.open());
    assert!(matches!(opened, [Ok(()), Ok(()), Err(DeviceError::Unavailable(_))]), "{opened:?}");
    let serial = |tool: &HidDevice| tool.found().info.serial.clone();
    assert_eq!((serial(&tools[0]), serial(&tools[1])), ("a".into(), "b".into()));
    // Once it was opened it is that one for good.
    tools[0].close().unwrap();
    tools[1].close().unwrap();
    let held = bus.open(&info("a")).unwrap();
    assert!(matches!(tools[0].open(), Err(DeviceError::Unavailable(_))));
    drop(held);
    tools[0].open().unwrap();
}

#[test]
fn options_that_make_no_sense_are_refused() {
    let good = SpaceMouseOptions::default();
    for (bad, what) in [
        (SpaceMouseOptions { full_speed_m_per_s: 0.0, ..good }, "full speed"),
        (SpaceMouseOptions { full_turn_rad_per_s: f64::NAN, ..good }, "full turn"),
        (SpaceMouseOptions { half_size_m: DVec3::new(0.1, -0.1, 0.1), ..good }, "half a side"),
        (SpaceMouseOptions { dead_zone: 1.0, ..good }, "dead zone"),
        (SpaceMouseOptions { stale_after_s: f64::INFINITY, ..good }, "let go"),
    ] {
        let text = bad.validate().unwrap_err().to_string();
        assert!(text.contains(what) && text.contains("must be"), "{text}");
    }
    good.validate().unwrap();
}

#[test]
fn reading_allocates_nothing() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions::default());
    for count in 0..200 {
        cap.push([count, 0, 0]);
    }
    time.advance(1);
    let counted = allocation_counter::measure(|| {
        for _ in 0..3 {
            time.advance(1);
            device.read(PERIOD).unwrap();
            device.write(DVec3::ZERO).unwrap();
        }
    });
    assert_eq!(counted.count_total, 0, "{counted:?}");
}
