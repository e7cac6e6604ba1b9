//! What joysticks say, and what they might: positions and buttons to the byte, reports that are none, silence, noise.

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

/// A joystick whose input reports are said to it, and that may answer anything when it is asked.
#[derive(Clone)]
struct Prompted {
    firmware: Arc<Mutex<JoystickFirmware>>,
    says: Arc<Mutex<VecDeque<Vec<u8>>>>,
    answers: Option<Vec<u8>>,
}

impl Firmware for Prompted {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let Some(says) = self.says.lock().unwrap().pop_front() else { return 0 };
        report[..says.len()].copy_from_slice(&says);
        says.len()
    }
    fn output(&mut self, report: &[u8]) -> bool {
        self.firmware.output(report) || self.answers.is_some()
    }
    fn feature(&mut self, report: &mut [u8]) -> usize {
        let Some(answers) = &self.answers else { return self.firmware.feature(report) };
        let length = answers.len().min(report.len());
        report[..length].copy_from_slice(&answers[..length]);
        length
    }
    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.firmware.set_feature(report)
    }
}

/// A device that says what it is told to, and where to tell it.
fn prompted(
    descriptor: &[u8],
    options: JoystickOptions,
    answers: Option<Vec<u8>>,
) -> (HidDevice, Arc<Mutex<VecDeque<Vec<u8>>>>, Bench) {
    let bench = Bench::new(descriptor, SimulatedStick::default());
    let (firmware, says) = (Arc::clone(&bench.firmware), Arc::default());
    let prompted = Prompted { firmware, says: Arc::clone(&says), answers };
    bench.bus.plug(info(), descriptor.to_vec(), prompted);
    (bench.device(options), says, bench)
}

fn read(device: &mut HidDevice, says: &Mutex<VecDeque<Vec<u8>>>, text: &str) -> Result<Reading, DeviceError> {
    says.lock().unwrap().push_back(hex::bytes(text));
    device.read(NOW)
}

/// Least and greatest, low byte first, on all three layouts. z is joystick y.
#[test]
fn positions_and_buttons_are_where_the_descriptor_says() {
    let rest =
        [" 00 00".repeat(6), String::new(), format!("{}{}", " 00".repeat(2 + 4 + 8 + 2), " 00".repeat(13))];
    // x at the right end, y a 256th of the way: bytes in the wrong order would say something else.
    let said = ["01 05 00 00 80 00 00 00 80 ff 7f 80 00", "01 85 ff 7f 80 00", "01 00 10 10 00"];
    let expected = [(0x8000_0005_u32, 128.0 / 32767.0), (0x85, 128.0 / 32767.0), (0, 16.0 / 4096.0)];
    for (index, kind) in kinds().into_iter().enumerate() {
        let (mut device, says, _) = prompted(&kind.descriptor, full_force(), None);
        device.open().unwrap();
        let text = format!("{}{}", said[index], rest[index]);
        let reading = read(&mut device, &says, &text).unwrap();
        let (buttons, part) = expected[index];
        assert_eq!(reading.buttons, buttons, "{}", kind.name);
        let expected_m = DVec3::new(0.06, 0.0, 0.06 * part);
        assert!((reading.position_m - expected_m).length() < 1e-15, "{}: {}", kind.name, reading.position_m);
        assert!(reading.velocity_m_per_s.is_none() && reading.sequence.is_none());
    }
}

/// Buttons of the Rhino come after its axes and sliders.
#[test]
fn buttons_after_the_axes_are_found() {
    let [.., rhino] = kinds();
    let (mut device, says, _) = prompted(&rhino.descriptor, full_force(), None);
    device.open().unwrap();
    let text = format!("01 00 f0 00 00 00 00 ff ff ff ff 02 00 00 80 ff ff ff ff ff ff{}", " ff".repeat(13));
    let reading = read(&mut device, &says, &text).unwrap();
    assert_eq!(reading.buttons, 0x8000_0002, "only the first 32");
    assert_eq!(reading.position_m, DVec3::X * -0.06);
}

#[test]
fn reports_that_are_none_are_counted_and_passed_over() {
    let (mut device, says, _) = prompted(&openffboard().descriptor, full_force(), None);
    device.open().unwrap();
    let counters = device.counters();
    assert_eq!(device.read(NOW), Err(DeviceError::TimedOut), "nothing is known of where it is");
    let good = format!("01{} ff 7f 00 00{}", " 00".repeat(8), " 00 00".repeat(6));
    let place_m = DVec3::X * 0.06;
    assert_eq!(read(&mut device, &says, &good).unwrap().position_m, place_m);
    assert_eq!((counters.read(), counters.malformed()), (1, 0));
    let short = good[..good.len() - 3].to_owned();
    let long = format!("{good} 00");
    for (malformed, text) in [(1, short.as_str()), (2, &long), (3, "01"), (4, "7e 00 00"), (5, "02 00 00 00")]
    {
        assert_eq!(read(&mut device, &says, text).unwrap().position_m, place_m, "{text}");
        assert_eq!((counters.read(), counters.malformed()), (1, malformed), "{text}");
    }
    // Its report on its state is one of its own.
    assert_eq!(read(&mut device, &says, "02 08").unwrap().position_m, place_m);
    assert_eq!((counters.read(), counters.malformed()), (2, 5));
    // Of several the newest counts, and those before it were skipped.
    let left = good.replace("ff 7f", "01 80");
    says.lock().unwrap().extend([&good, &good, &left].map(|text| hex::bytes(text)));
    assert_eq!(device.read(NOW).unwrap().position_m, -place_m);
    assert_eq!((counters.read(), counters.skipped()), (5, 2));
    // Beyond its range it is at its end.
    assert_eq!(read(&mut device, &says, &good.replace("ff 7f", "00 80")).unwrap().position_m, -place_m);
}

#[test]
fn what_was_said_before_it_was_opened_is_old() {
    let (mut device, says, _) = prompted(&openffboard().descriptor, full_force(), None);
    says.lock().unwrap().push_back(hex::bytes(&format!("01{}", " 00".repeat(24))));
    device.open().unwrap();
    assert_eq!(device.read(NOW), Err(DeviceError::TimedOut));
}

#[test]
fn silence_times_out_unless_it_means_nothing() {
    for (silent_after_s, times_out) in [(Some(0.25), true), (None, false)] {
        let options = JoystickOptions { silent_after_s, ..full_force() };
        let (mut device, says, bench) = prompted(&openffboard().descriptor, options, None);
        device.open().unwrap();
        bench.advance_ms(10_000);
        assert_eq!(device.read(NOW), Err(DeviceError::TimedOut));
        let middle = format!("01{}", " 00".repeat(24));
        assert_eq!(read(&mut device, &says, &middle).unwrap().position_m, DVec3::ZERO);
        bench.advance_ms(250);
        assert_eq!(device.read(NOW).unwrap().position_m, DVec3::ZERO, "a stick that is held still");
        bench.advance_ms(1);
        assert_eq!(device.read(NOW).is_err(), times_out);
        assert!(read(&mut device, &says, &middle).is_ok());
    }
}

/// 32 bits for x and y, as some builds have them.
#[test]
fn axes_may_have_any_width() {
    let published = openffboard().descriptor;
    let narrow = hex::bytes("16 01 80 26 ff 7f 75 10 95 08 81 02 c0");
    let wide = hex::bytes("17 01 00 00 80 27 ff ff ff 7f 75 20 95 08 81 02 c0");
    let at = published.windows(narrow.len()).position(|items| items == narrow).unwrap();
    let descriptor = [&published[..at], &wide, &published[at + narrow.len()..]].concat();
    let (mut device, says, _) = prompted(&descriptor, full_force(), None);
    device.open().unwrap();
    let text = format!("01{} ff ff ff 7f 00 00 00 c0{}", " 00".repeat(8), " 00 00 00 00".repeat(6));
    let position_m = read(&mut device, &says, &text).unwrap().position_m;
    assert!((position_m - DVec3::new(0.06, 0.0, -0.03)).length() < 1e-10, "{position_m}");
}

/// What a device may say when it is asked for room and for a new effect, in OpenFFBoard's layout: the number, an index, a status (1 made,
/// 2 full, 3 failed), two bytes. The same bytes are a pool's, whose last bit says whether the device manages it.
#[test]
fn answers_that_make_no_sense_are_refused() {
    let not_its = "its word on a new effect is not what its descriptor says";
    let no_index = "it gave an effect an index that its descriptor does not have";
    for (answer, told) in [
        ("12 01 02 00 01", "it has no room for another effect"),
        ("12 01 03 00 01", "it could not make a constant force"),
        ("12 01 00 00 01", "it does not say whether it has made an effect"),
        ("12 01 04 00 01", "it does not say whether it has made an effect"),
        ("12 00 01 00 01", no_index),
        ("12 29 01 00 01", no_index),
        ("12 01 01 00", not_its),
        ("12", not_its),
        ("21 01 01 00 01", not_its),
        ("12 01 01 00 00", "it leaves the room for effects to the driver, which is not supported"),
        ("12 01 01 01 01", "it plays fewer effects at once than it has axes"),
    ] {
        let answers = Some(hex::bytes(answer));
        let (mut device, ..) = prompted(&openffboard().descriptor, full_force(), answers);
        assert_eq!(device.open(), Err(DeviceError::Protocol(told)), "{answer}");
    }
    let answers = Some(hex::bytes("12 28 01 00 01"));
    let (mut device, ..) = prompted(&openffboard().descriptor, full_force(), answers);
    device.open().unwrap();
}

/// A device whose reports do not agree on how many effects there are: none may be taken for another.
#[test]
fn an_index_must_fit_in_every_report() {
    let mut descriptor = openffboard().descriptor;
    // In the report that sets a constant force, 1 to 1.
    let at = descriptor.windows(4).position(|items| items == [0x09, 0x73, 0xA1, 0x02]).unwrap();
    assert_eq!(descriptor[at + 10..at + 12], [0x25, 0x28]);
    descriptor[at + 11] = 1;
    let (mut device, ..) = prompted(&descriptor, full_force(), None);
    let told = Err(DeviceError::Protocol("it gave an effect an index that its descriptor does not have"));
    assert_eq!(device.open(), told);
    // Where they say that 0 is an index it means none all the same.
    let from_zero = |items: &[u8]| [&items[..items.len() - 1], &[0]].concat();
    let mut descriptor = openffboard().descriptor;
    for items in [&[0x09, 0x22, 0x15, 0x01][..], &[0x09, 0x22, 0x25, 0x28, 0x15, 0x01]] {
        for at in 0..descriptor.len() - items.len() {
            if descriptor[at..].starts_with(items) {
                descriptor[at..at + items.len()].copy_from_slice(&from_zero(items));
            }
        }
    }
    let (mut device, ..) = prompted(&descriptor, full_force(), Some(hex::bytes("12 00 01 00 01")));
    assert_eq!(device.open(), told);
}

proptest! {
    #[test]
    fn no_report_makes_it_panic(
        reports in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..80), 0..20),
        kind in 0_usize..3,
    ) {
        let (mut device, says, _) = prompted(&kinds()[kind].descriptor, full_force(), None);
        device.open().unwrap();
        let reports = reports.into_iter().filter(|report| !report.is_empty()).map(|mut report| {
            // Half of them with the right number.
            report[0] %= 4;
            report
        });
        says.lock().unwrap().extend(reports);
        if let Ok(reading) = device.read(NOW) {
            prop_assert!(reading.position_m.abs().max_element() <= 0.06 && reading.is_usable());
        }
    }

    #[test]
    fn no_answer_makes_it_panic(answers in prop::collection::vec(any::<u8>(), 1..8), kind in 0_usize..3) {
        let (mut device, ..) = prompted(&kinds()[kind].descriptor, full_force(), Some(answers));
        if device.open().is_ok() {
            let _ = device.write(DVec3::X);
            let _ = device.close();
        }
    }

    /// Published descriptors with some bytes changed: understood or refused.
    #[test]
    fn no_descriptor_makes_it_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        kind in 0_usize..3,
        says in prop::collection::vec(any::<u8>(), 1..64),
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
                let _ = device.write(DVec3::new(f64::from(says[0]), 0.0, 3.0));
            }
            let _ = device.close();
        }
    }
}
