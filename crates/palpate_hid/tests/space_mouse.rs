//! Driver of the SpaceMouse: reports byte by byte, motion of the point, selection.

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

/// Lines of the data file: input reports, or output reports of the light.
fn reports(to_light: bool) -> impl Iterator<Item = &'static str> {
    let lines = include_str!("data/space_mouse.txt").lines().filter(|line| !line.starts_with('#'));
    lines.filter(move |line| line.starts_with("light") == to_light)
}

/// Output report that switches the light on or off.
fn light(is_on: bool) -> Vec<u8> {
    let head = if is_on { "light on" } else { "light off" };
    let hex = reports(true).find_map(|line| line.strip_prefix(head)).unwrap();
    hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

#[test]
fn parses_the_reports_of_the_data_file() {
    let mut lines = 0;
    for line in reports(false) {
        let (kind, rest) = line.split_once(' ').unwrap();
        let (values, hex) = rest.trim().split_once("  ").unwrap();
        let values: Vec<i64> = values.split(' ').map(|number| number.parse().unwrap()).collect();
        let bytes: Vec<u8> =
            hex.trim().split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
        let axes = |at: usize| [0, 1, 2].map(|i| i16::try_from(values[at + i]).unwrap());
        let expected = match kind {
            "push" => Ok(SpaceMouseReport::Push(axes(0))),
            "turn" => Ok(SpaceMouseReport::Turn(axes(0))),
            "push+turn" => Ok(SpaceMouseReport::PushAndTurn(axes(0), axes(3))),
            "buttons" => Ok(SpaceMouseReport::Buttons(values[0] as u32)),
            "numbers" => {
                let pressed = [0, 1, 2, 3, 4, 5].map(|i| values[i + 1] as u16);
                Ok(SpaceMouseReport::ButtonNumbers(values[0] as u8, pressed))
            }
            "other" => Ok(SpaceMouseReport::Other(values[0] as u8)),
            _ => Err((values[0] as u8, bytes.len())),
        };
        assert_eq!(
            SpaceMouseReport::parse(&bytes).map_err(|short| (short.id, short.found)),
            expected,
            "{line}"
        );
        lines += 1;
    }
    assert_eq!(lines, 16);
    assert!(SpaceMouseReport::parse(&[]).is_err());
}

proptest::proptest! {
    #[test]
    fn arbitrary_reports_do_not_panic(bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..70)) {
        let _ = SpaceMouseReport::parse(&bytes);
    }
}

/// Firmware with queued input reports that records its output reports.
#[derive(Clone, Default)]
struct Cap {
    input_reports: Arc<Mutex<VecDeque<Vec<u8>>>>,
    output_reports: Arc<Mutex<Vec<Vec<u8>>>>,
}

impl Cap {
    fn queue(&self, report: &[u8]) {
        self.input_reports.lock().unwrap().push_back(report.to_vec());
    }

    fn push(&self, [x, y, z]: [i16; 3]) {
        let [[a, b], [c, d], [e, f]] = [x, y, z].map(i16::to_le_bytes);
        self.queue(&[1, a, b, c, d, e, f]);
    }
}

impl Firmware for Cap {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let Some(next) = self.input_reports.lock().unwrap().pop_front() else { return 0 };
        report[..next.len()].copy_from_slice(&next);
        next.len()
    }

    fn output(&mut self, report: &[u8]) -> bool {
        self.output_reports.lock().unwrap().push(report.to_vec());
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

/// A manual clock.
#[derive(Clone, Default)]
struct ManualClock(Arc<AtomicU64>);

impl ManualClock {
    fn advance(&self, ms: u64) {
        self.0.fetch_add(ms, Ordering::Relaxed);
    }
}

/// An open device, its bus, its firmware and its clock.
fn open(options: SpaceMouseOptions) -> (HidDevice, Arc<SimulatedBus>, Cap, ManualClock) {
    let (bus, cap, time) = (Arc::new(SimulatedBus::default()), Cap::default(), ManualClock::default());
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
fn push_moves_the_point_until_the_cap_is_silent() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions { dead_zone: 0.0, ..Default::default() });
    assert!(device.describe().max_force_n == 0.0 && device.describe().validate().is_ok());
    assert_eq!(device.read(PERIOD).unwrap().position_m, DVec3::ZERO);
    // Half to the right, fully towards the user, a quarter down.
    cap.push([175, 350, 87]);
    let rate = DVec3::new(0.5, -87.0 / 350.0, 1.0) * 0.1;
    for tick in 1..=100_u32 {
        time.advance(1);
        let reading = device.read(PERIOD).unwrap();
        assert!((reading.position_m - rate * f64::from(tick) * 1e-3).length() < 1e-12, "{tick}");
        assert!((reading.velocity_m_per_s.unwrap() - rate).length() < 1e-9);
    }
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
fn point_stays_in_its_box_and_a_stall_moves_it_little() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions::default());
    device.read(PERIOD).unwrap();
    let mut stall = |reports: u32, ms: u64| {
        (0..reports).for_each(|_| cap.push([0, 350, 0]));
        time.advance(ms);
        let before_m = device.read(PERIOD).unwrap().position_m;
        time.advance(ms);
        device.read(PERIOD).unwrap();
        before_m
    };
    // One report and 5 s of silence: the cap was released.
    assert_eq!(stall(1, 5000), DVec3::ZERO);
    // After a stall of 0.4 s with a report every 8 ms at most 20 ms are integrated.
    assert!((stall(50, 400) - DVec3::Z * 0.1 * 0.02).length() < 1e-12);
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
fn turns_are_right_handed() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions { dead_zone: 0.0, ..Default::default() });
    device.read(PERIOD).unwrap();
    // About the cap's z, which points down: -y of the device frame. In the long form of wireless models.
    let full = 350_i16.to_le_bytes();
    for tick in 1..=20_u32 {
        cap.queue(&[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, full[0], full[1]]);
        time.advance(1);
        let reading = device.read(PERIOD).unwrap();
        let expected = DQuat::from_rotation_y(-1.5e-3 * f64::from(tick));
        assert!(reading.orientation.angle_between(expected) < 1e-9 && reading.is_usable());
        assert_eq!(reading.position_m, DVec3::ZERO);
    }
}

#[test]
fn reports_buttons_light_and_skipped_reports() {
    let (mut device, _, cap, time) = open(SpaceMouseOptions::default());
    assert_eq!(*cap.output_reports.lock().unwrap(), [light(true)]);
    let counters = device.counters();
    // 63 unread reports, as many as hidraw keeps: the latest is used, 62 are skipped.
    for count in 1..=63 {
        cap.push([count, 0, 0]);
    }
    cap.queue(&[3, 2]);
    cap.queue(&[1, 0]);
    time.advance(1);
    device.read(PERIOD).unwrap();
    time.advance(10);
    let reading = device.read(PERIOD).unwrap();
    assert_eq!(reading.buttons, 2);
    let speed = 0.1 * (63.0 / 350.0 - 0.02) / 0.98;
    assert!((reading.velocity_m_per_s.unwrap() - DVec3::X * speed).length() < 1e-12);
    assert_eq!((counters.read(), counters.skipped(), counters.malformed()), (64, 62, 1));
    device.close().unwrap();
    assert_eq!(*cap.output_reports.lock().unwrap(), [light(true), light(false)]);
    assert_eq!(device.read(PERIOD), Err(DeviceError::NotOpen));
}

#[test]
fn reopens_at_another_path() {
    let (mut device, bus, cap, time) = open(SpaceMouseOptions::default());
    assert!(bus.unplug("cap 1"));
    assert_eq!(device.read(PERIOD), Err(DeviceError::Disconnected));
    let _ = device.close();
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
    // Another serial number is not accepted.
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
fn selector_finds_one_device_or_fails() {
    let bus = Arc::new(SimulatedBus::default());
    let find = |selector: &HidSelector| {
        HidDevice::find(bus.clone(), selector, &HidOptions::default()).map(|device| device.found().clone())
    };
    let any = HidSelector { kind: Some(HidKind::SpaceMouse), ..HidSelector::default() };
    let Err(HidError::NotFound { requested, present, teensy: None }) = find(&any) else {
        panic!("no device")
    };
    assert_eq!((requested.as_str(), present.len()), ("SpaceMouse", 0));
    // A mouse of the same vendor, as one interface of its receiver.
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
    // Each device is used once: the second tool gets the second device, the third none.
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
    // A selector with a serial number matches only that device.
    let by_serial = HidSelector { serial: Some("a".into()), ..any };
    assert!(matches!(find(&by_serial), Err(HidError::Busy { .. })));
    drop(held);
    assert_eq!(find(&first).unwrap().info.serial, "a");
}

/// All were found before any was opened.
#[test]
fn tools_with_match_first_get_different_devices() {
    let bus = Arc::new(SimulatedBus::default());
    bus.plug(info("a"), Vec::new(), Cap::default());
    bus.plug(info("b"), Vec::new(), Cap::default());
    let find = || HidDevice::find(bus.clone(), &HidSelector::any(), &HidOptions::default()).unwrap();
    let mut tools = [find(), find(), find()];
    let opened = tools.each_mut().map(|tool| tool.open());
    assert!(matches!(opened, [Ok(()), Ok(()), Err(DeviceError::Unavailable(_))]), "{opened:?}");
    let serial = |tool: &HidDevice| tool.found().info.serial.clone();
    assert_eq!((serial(&tools[0]), serial(&tools[1])), ("a".into(), "b".into()));
    // After the first opening the device is fixed.
    tools[0].close().unwrap();
    tools[1].close().unwrap();
    let held = bus.open(&info("a")).unwrap();
    assert!(matches!(tools[0].open(), Err(DeviceError::Unavailable(_))));
    drop(held);
    tools[0].open().unwrap();
}

#[test]
fn rejects_invalid_options() {
    let good = SpaceMouseOptions::default();
    for (bad, start, value) in [
        (SpaceMouseOptions { full_speed_m_per_s: 0.0, ..good }, "full speed", "0"),
        (SpaceMouseOptions { full_turn_rad_per_s: f64::NAN, ..good }, "full turn", "NaN"),
        (SpaceMouseOptions { half_size_m: DVec3::new(0.1, -0.1, 0.1), ..good }, "half a side", "-0.1"),
        (SpaceMouseOptions { dead_zone: 1.0, ..good }, "dead zone", "1"),
        (SpaceMouseOptions { stale_after_s: f64::INFINITY, ..good }, "time after", "inf"),
    ] {
        let error = bad.validate().unwrap_err();
        let HidError::Option { what, found, .. } = &error else { panic!("{error}") };
        assert!(what.starts_with(start) && found == value, "{error}");
    }
    good.validate().unwrap();
}

#[test]
fn read_and_write_do_not_allocate() {
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
