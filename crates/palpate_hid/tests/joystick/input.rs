//! Input reports of joysticks: positions and buttons byte by byte, malformed reports, silence, arbitrary bytes.

use crate::hex;
use crate::joystick_bench::{Bench, PATH, full_force, info, kinds, openffboard};
use glam::DVec3;
use palpate_haptics::{DeviceError, HapticDevice, Reading};
use palpate_hid::simulated::*;
use palpate_hid::*;
use proptest::prelude::*;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

const NOW: Duration = Duration::ZERO;

/// Firmware with queued input reports, and optionally a fixed reply to feature requests.
#[derive(Clone)]
struct QueuedFirmware {
    firmware: Arc<Mutex<JoystickFirmware>>,
    input: Arc<Mutex<VecDeque<Vec<u8>>>>,
    reply: Option<Vec<u8>>,
}

impl Firmware for QueuedFirmware {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let Some(next) = self.input.lock().unwrap().pop_front() else { return 0 };
        report[..next.len()].copy_from_slice(&next);
        next.len()
    }
    fn output(&mut self, report: &[u8]) -> bool {
        self.firmware.output(report) || self.reply.is_some()
    }
    fn feature(&mut self, report: &mut [u8]) -> usize {
        let Some(reply) = &self.reply else { return self.firmware.feature(report) };
        let length = reply.len().min(report.len());
        report[..length].copy_from_slice(&reply[..length]);
        length
    }
    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.firmware.set_feature(report)
    }
}

/// A device with queued input reports, and its queue.
fn with_queue(
    descriptor: &[u8],
    options: JoystickOptions,
    reply: Option<Vec<u8>>,
) -> (HidDevice, Arc<Mutex<VecDeque<Vec<u8>>>>, Bench) {
    let bench = Bench::new(descriptor, SimulatedStick::default());
    let (firmware, queue) = (Arc::clone(&bench.firmware), Arc::default());
    let queued = QueuedFirmware { firmware, input: Arc::clone(&queue), reply };
    bench.bus.plug(info(), descriptor.to_vec(), queued);
    (bench.device(options), queue, bench)
}

fn read(
    device: &mut HidDevice,
    queue: &Mutex<VecDeque<Vec<u8>>>,
    text: &str,
) -> Result<Reading, DeviceError> {
    queue.lock().unwrap().push_back(hex::bytes(text));
    device.read(NOW)
}

/// Minimum and maximum, little-endian, on all three layouts. z is the joystick's y.
#[test]
fn reads_positions_and_buttons_on_all_layouts() {
    let rest =
        [" 00 00".repeat(6), String::new(), format!("{}{}", " 00".repeat(2 + 4 + 8 + 2), " 00".repeat(13))];
    // x at the right end, y at 1/256 of the range, which detects swapped bytes.
    let reports = ["01 05 00 00 80 00 00 00 80 ff 7f 80 00", "01 85 ff 7f 80 00", "01 00 10 10 00"];
    let expected = [(0x8000_0005_u32, 128.0 / 32767.0), (0x85, 128.0 / 32767.0), (0, 16.0 / 4096.0)];
    for (index, kind) in kinds().into_iter().enumerate() {
        let (mut device, queue, _) = with_queue(&kind.descriptor, full_force(), None);
        device.open().unwrap();
        let text = format!("{}{}", reports[index], rest[index]);
        let reading = read(&mut device, &queue, &text).unwrap();
        let (buttons, part) = expected[index];
        assert_eq!(reading.buttons, buttons, "{}", kind.name);
        let expected_m = DVec3::new(0.06, 0.0, 0.06 * part);
        assert!((reading.position_m - expected_m).length() < 1e-15, "{}: {}", kind.name, reading.position_m);
        assert!(reading.velocity_m_per_s.is_none() && reading.sequence.is_none());
    }
}

/// The buttons of the Rhino follow its axes and sliders.
#[test]
fn reads_buttons_after_the_axes() {
    let [.., rhino] = kinds();
    let (mut device, queue, _) = with_queue(&rhino.descriptor, full_force(), None);
    device.open().unwrap();
    let text = format!("01 00 f0 00 00 00 00 ff ff ff ff 02 00 00 80 ff ff ff ff ff ff{}", " ff".repeat(13));
    let reading = read(&mut device, &queue, &text).unwrap();
    assert_eq!(reading.buttons, 0x8000_0002, "only the first 32");
    assert_eq!(reading.position_m, DVec3::X * -0.06);
}

#[test]
fn malformed_reports_are_counted_and_discarded() {
    let (mut device, queue, _) = with_queue(&openffboard().descriptor, full_force(), None);
    device.open().unwrap();
    let counters = device.counters();
    assert_eq!(device.read(NOW), Err(DeviceError::TimedOut), "no position before the first report");
    let good = format!("01{} ff 7f 00 00{}", " 00".repeat(8), " 00 00".repeat(6));
    let position_m = DVec3::X * 0.06;
    assert_eq!(read(&mut device, &queue, &good).unwrap().position_m, position_m);
    assert_eq!((counters.read(), counters.malformed()), (1, 0));
    let short = good[..good.len() - 3].to_owned();
    let long = format!("{good} 00");
    for (malformed, text) in [(1, short.as_str()), (2, &long), (3, "01"), (4, "7e 00 00"), (5, "02 00 00 00")]
    {
        assert_eq!(read(&mut device, &queue, text).unwrap().position_m, position_m, "{text}");
        assert_eq!((counters.read(), counters.malformed()), (1, malformed), "{text}");
    }
    // The status report is a valid report of the device.
    assert_eq!(read(&mut device, &queue, "02 08").unwrap().position_m, position_m);
    assert_eq!((counters.read(), counters.malformed()), (2, 5));
    // Of several reports the latest is used, and the others are skipped.
    let left = good.replace("ff 7f", "01 80");
    queue.lock().unwrap().extend([&good, &good, &left].map(|text| hex::bytes(text)));
    assert_eq!(device.read(NOW).unwrap().position_m, -position_m);
    assert_eq!((counters.read(), counters.skipped()), (5, 2));
    // A value beyond the range is clamped.
    assert_eq!(read(&mut device, &queue, &good.replace("ff 7f", "00 80")).unwrap().position_m, -position_m);
}

#[test]
fn reports_from_before_the_opening_are_discarded() {
    let (mut device, queue, _) = with_queue(&openffboard().descriptor, full_force(), None);
    queue.lock().unwrap().push_back(hex::bytes(&format!("01{}", " 00".repeat(24))));
    device.open().unwrap();
    assert_eq!(device.read(NOW), Err(DeviceError::TimedOut));
}

#[test]
fn silence_times_out_only_with_a_limit() {
    for (silent_after_s, times_out) in [(Some(0.25), true), (None, false)] {
        let options = JoystickOptions { silent_after_s, ..full_force() };
        let (mut device, queue, bench) = with_queue(&openffboard().descriptor, options, None);
        device.open().unwrap();
        bench.advance_ms(10_000);
        assert_eq!(device.read(NOW), Err(DeviceError::TimedOut));
        let middle = format!("01{}", " 00".repeat(24));
        assert_eq!(read(&mut device, &queue, &middle).unwrap().position_m, DVec3::ZERO);
        bench.advance_ms(250);
        assert_eq!(device.read(NOW).unwrap().position_m, DVec3::ZERO, "a stick that is held still");
        bench.advance_ms(1);
        assert_eq!(device.read(NOW).is_err(), times_out);
        assert!(read(&mut device, &queue, &middle).is_ok());
    }
}

/// Axes with 32 bits, as in some builds.
#[test]
fn reads_axes_of_32_bits() {
    let published = openffboard().descriptor;
    let narrow = hex::bytes("16 01 80 26 ff 7f 75 10 95 08 81 02 c0");
    let wide = hex::bytes("17 01 00 00 80 27 ff ff ff 7f 75 20 95 08 81 02 c0");
    let at = published.windows(narrow.len()).position(|items| items == narrow).unwrap();
    let descriptor = [&published[..at], &wide, &published[at + narrow.len()..]].concat();
    let (mut device, queue, _) = with_queue(&descriptor, full_force(), None);
    device.open().unwrap();
    let text = format!("01{} ff ff ff 7f 00 00 00 c0{}", " 00".repeat(8), " 00 00 00 00".repeat(6));
    let position_m = read(&mut device, &queue, &text).unwrap().position_m;
    assert!((position_m - DVec3::new(0.06, 0.0, -0.03)).length() < 1e-10, "{position_m}");
}

/// Replies to the pool and block load requests in the layout of OpenFFBoard: ID, effect index, status (1 success, 2 full, 3 error), two
/// bytes. As a pool report, the last bit of the same bytes is Device Managed Pool.
#[test]
fn rejects_invalid_replies_to_effect_creation() {
    let mismatch = "the status report of a new effect does not match the report descriptor";
    let bad_index = "the index of a new effect is outside the range in the report descriptor";
    for (bytes, expected) in [
        ("12 01 02 00 01", "the device has no memory for another effect"),
        ("12 01 03 00 01", "the device failed to create a constant-force effect"),
        ("12 01 00 00 01", "the device reports no status for a new effect within 200 ms"),
        ("12 01 04 00 01", "the device reports no status for a new effect within 200 ms"),
        ("12 00 01 00 01", bad_index),
        ("12 29 01 00 01", bad_index),
        ("12 01 01 00", mismatch),
        ("12", mismatch),
        ("21 01 01 00 01", mismatch),
        ("12 01 01 00 00", "the device requires driver-managed effect memory, which is not supported"),
        ("12 01 01 01 01", "the device plays fewer simultaneous effects than it has axes"),
    ] {
        let reply = Some(hex::bytes(bytes));
        let (mut device, ..) = with_queue(&openffboard().descriptor, full_force(), reply);
        assert_eq!(device.open(), Err(DeviceError::Protocol(expected)), "{bytes}");
    }
    let reply = Some(hex::bytes("12 28 01 00 01"));
    let one_axis = JoystickOptions { use_y: false, ..full_force() };
    let (mut device, ..) = with_queue(&openffboard().descriptor, one_axis, reply.clone());
    device.open().unwrap();
    // The same index for two effects.
    let (mut device, ..) = with_queue(&openffboard().descriptor, full_force(), reply);
    let repeated = "the device reports the index of an earlier effect for a new one";
    assert_eq!(device.open(), Err(DeviceError::Protocol(repeated)));
}

/// A device whose reports have different ranges of the effect index.
#[test]
fn rejects_an_index_outside_the_range_of_any_report() {
    let mut descriptor = openffboard().descriptor;
    // Range 1 to 1 in the Set Constant Force report.
    let at = descriptor.windows(4).position(|items| items == [0x09, 0x73, 0xA1, 0x02]).unwrap();
    assert_eq!(descriptor[at + 10..at + 12], [0x25, 0x28]);
    descriptor[at + 11] = 1;
    let (mut device, ..) = with_queue(&descriptor, full_force(), None);
    let expected =
        Err(DeviceError::Protocol("the index of a new effect is outside the range in the report descriptor"));
    assert_eq!(device.open(), expected);
    // Index 0 means none, even if the declared range contains it.
    let from_zero = |items: &[u8]| [&items[..items.len() - 1], &[0]].concat();
    let mut descriptor = openffboard().descriptor;
    for items in [&[0x09, 0x22, 0x15, 0x01][..], &[0x09, 0x22, 0x25, 0x28, 0x15, 0x01]] {
        for at in 0..descriptor.len() - items.len() {
            if descriptor[at..].starts_with(items) {
                descriptor[at..at + items.len()].copy_from_slice(&from_zero(items));
            }
        }
    }
    let (mut device, ..) = with_queue(&descriptor, full_force(), Some(hex::bytes("12 00 01 00 01")));
    assert_eq!(device.open(), expected);
}

proptest! {
    // Each rejected reply is read for 200 ms.
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn arbitrary_replies_do_not_panic(reply in prop::collection::vec(any::<u8>(), 1..8), kind in 0_usize..3) {
        let (mut device, ..) = with_queue(&kinds()[kind].descriptor, full_force(), Some(reply));
        if device.open().is_ok() {
            let _ = device.write(DVec3::X);
            let _ = device.close();
        }
    }
}

proptest! {
    #[test]
    fn arbitrary_reports_do_not_panic(
        reports in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..80), 0..20),
        kind in 0_usize..3,
    ) {
        let (mut device, queue, _) = with_queue(&kinds()[kind].descriptor, full_force(), None);
        device.open().unwrap();
        let reports = reports.into_iter().filter(|report| !report.is_empty()).map(|mut report| {
            // A quarter of them with the correct ID.
            report[0] %= 4;
            report
        });
        queue.lock().unwrap().extend(reports);
        if let Ok(reading) = device.read(NOW) {
            prop_assert!(reading.position_m.abs().max_element() <= 0.06 && reading.is_usable());
        }
    }

    /// Published descriptors with some changed bytes: accepted or rejected.
    #[test]
    fn arbitrary_descriptors_do_not_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        kind in 0_usize..3,
        queue in prop::collection::vec(any::<u8>(), 1..64),
    ) {
        let mut descriptor = kinds()[kind].descriptor.clone();
        for (at, byte) in changes {
            let at = at.index(descriptor.len());
            descriptor[at] = byte;
        }
        let Ok(firmware) = JoystickFirmware::new(&descriptor, SimulatedStick::default()) else { return Ok(()) };
        let bus = Arc::new(SimulatedBus::default());
        bus.plug(info(), descriptor, firmware);
        let selector = HidSelector { path: Some(PATH.into()), ..HidSelector::any() };
        let Ok(mut device) = HidDevice::find(bus, &selector, &HidOptions::default()) else { return Ok(()) };
        prop_assert!(device.describe().validate().is_ok());
        if device.open().is_ok() {
            for _ in 0..3 {
                if let Ok(reading) = device.read(NOW) {
                    prop_assert!(reading.is_usable());
                }
                let _ = device.write(DVec3::new(f64::from(queue[0]), 0.0, 3.0));
            }
            let _ = device.close();
        }
    }
}
