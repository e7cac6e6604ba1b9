//! The status of a new effect (Block Load), which a device may report late.

use crate::hex;
use crate::joystick_bench::{Bench, PATH, full_force, info};
use glam::DVec3;
use palpate_haptics::{DeviceError, HapticDevice};
use palpate_hid::simulated::*;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// What the device reports until the status is ready.
#[derive(Clone, Copy, Debug)]
enum Reply {
    /// The report `06` with this index and status.
    Status(u8, u8),
    /// The request stalls.
    Stall,
    /// Only the first bytes of the report, this many.
    Short(usize),
    /// Zeros, with the report ID 0.
    Zeros,
    /// The status of the effect before.
    Previous,
}

/// When the status is ready.
#[derive(Clone, Copy, Debug)]
enum Ready {
    AfterReads(u32),
    After(Duration),
    Never,
}

/// Firmware whose status report is late.
struct Late {
    firmware: Arc<Mutex<JoystickFirmware>>,
    reply: Reply,
    ready: Ready,
    reads: u32,
    created_at: Instant,
    /// Status before the last creation.
    previous: Vec<u8>,
}

const STATUS: u8 = 6;

impl Firmware for Late {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.firmware.input(report)
    }
    fn output(&mut self, report: &[u8]) -> bool {
        self.firmware.output(report)
    }
    fn feature(&mut self, report: &mut [u8]) -> usize {
        if report[0] != STATUS {
            return self.firmware.feature(report);
        }
        self.reads += 1;
        let is_ready = match self.ready {
            Ready::AfterReads(reads) => self.reads > reads,
            Ready::After(time) => self.created_at.elapsed() >= time,
            Ready::Never => false,
        };
        if is_ready {
            return self.firmware.feature(report);
        }
        report.fill(0);
        match self.reply {
            Reply::Status(index, status) => report[..3].copy_from_slice(&[STATUS, index, status]),
            Reply::Stall => return 0,
            Reply::Short(bytes) => {
                report[0] = STATUS;
                return bytes;
            }
            Reply::Zeros => {}
            Reply::Previous => report.copy_from_slice(&self.previous),
        }
        report.len()
    }
    #[expect(clippy::disallowed_methods, reason = "the device becomes ready in real time")]
    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.previous = vec![STATUS, 0, 0, 0, 0];
        self.firmware.feature(&mut self.previous);
        (self.reads, self.created_at) = (0, Instant::now());
        self.firmware.set_feature(report)
    }
}

/// A bench with late firmware of the published Arduino layout: `06`, index, status (1 success, 2 full, 3 error), two bytes.
#[expect(clippy::disallowed_methods, reason = "the device becomes ready in real time")]
fn bench(reply: Reply, ready: Ready) -> Bench {
    let descriptor = hex::bytes(include_str!("data/arduino_ffb.txt"));
    let bench = Bench::new(&descriptor, SimulatedStick::default());
    let firmware = Arc::clone(&bench.firmware);
    let (created_at, previous) = (Instant::now(), Vec::new());
    bench.bus.plug(info(), descriptor, Late { firmware, reply, ready, reads: 0, created_at, previous });
    bench
}

fn assert_opens(reply: Reply, ready: Ready) {
    let bench = bench(reply, ready);
    let mut device = bench.try_find(full_force()).unwrap();
    device.open().unwrap_or_else(|error| panic!("{reply:?}, {ready:?}: {error}"));
    device.write(DVec3::new(0.4, 0.0, -0.2)).unwrap();
    let [x, y] = bench.force_n();
    assert!((x - 0.4).abs() <= 0.0025 && (y + 0.2).abs() <= 0.0025, "{reply:?}, {ready:?}: {x} {y}");
    assert_eq!(bench.firmware.lock().unwrap().effects(), 2);
    device.close().unwrap();
    assert!(!bench.firmware.lock().unwrap().is_on());
}

#[test]
fn status_may_come_after_any_number_of_reads() {
    for reads in (0..=20).chain([60]) {
        for reply in [Reply::Status(0, 0), Reply::Status(1, 0), Reply::Status(0, 9)] {
            assert_opens(reply, Ready::AfterReads(reads));
        }
    }
}

#[test]
fn status_may_come_after_some_milliseconds() {
    for ms in [1, 2, 5, 20, 50, 120] {
        assert_opens(Reply::Status(0, 0), Ready::After(Duration::from_millis(ms)));
    }
}

/// A stalled request, a short report, zeros instead of the report ID, or the status of the effect before.
#[test]
fn single_bad_reply_is_not_final() {
    for reply in [Reply::Stall, Reply::Short(1), Reply::Short(3), Reply::Zeros, Reply::Previous] {
        for reads in [1, 3, 20] {
            assert_opens(reply, Ready::AfterReads(reads));
        }
    }
}

/// The wait is bounded. The error states the last reply, and the effects and actuators are off.
#[test]
#[expect(clippy::disallowed_methods, reason = "the bound is in real time")]
fn missing_status_is_an_error_after_200_ms() {
    let no_status = "the device reports no status for a new effect within 200 ms";
    let mismatch = "the status report of a new effect does not match the report descriptor";
    for (reply, expected) in [
        (Reply::Status(0, 0), no_status),
        (Reply::Status(1, 0), no_status),
        (Reply::Status(1, 9), no_status),
        (Reply::Status(0, 1), "the index of a new effect is outside the range in the report descriptor"),
        (Reply::Stall, "the device rejected a feature report"),
        (Reply::Short(3), mismatch),
        (Reply::Zeros, mismatch),
    ] {
        let bench = bench(reply, Ready::Never);
        let mut device = bench.try_find(full_force()).unwrap();
        let start = Instant::now();
        assert_eq!(device.open(), Err(DeviceError::Protocol(expected)), "{reply:?}");
        let took_ms = start.elapsed().as_millis();
        assert!((200..2000).contains(&took_ms), "{reply:?}: {took_ms} ms");
        let firmware = bench.firmware.lock().unwrap();
        assert_eq!((firmware.effects(), firmware.is_on()), (0, false), "{reply:?}");
    }
    // Full and error are statuses, and final at once.
    for (status, expected) in [
        (2, "the device has no memory for another effect"),
        (3, "the device failed to create a constant-force effect"),
    ] {
        let start = Instant::now();
        let mut device = bench(Reply::Status(0, status), Ready::Never).try_find(full_force()).unwrap();
        assert_eq!(device.open(), Err(DeviceError::Protocol(expected)));
        assert!(start.elapsed() < Duration::from_millis(150));
    }
}

/// A clock that stands still does not make the wait endless.
#[test]
fn wait_ends_with_a_clock_that_stands_still() {
    let bench = bench(Reply::Status(0, 0), Ready::Never);
    let mut device = bench.device(full_force());
    assert!(matches!(device.open(), Err(DeviceError::Protocol(_))));
}

#[test]
fn unplugging_ends_the_wait_at_once() {
    /// Unplugs itself at the first status request.
    struct Unplugging(Arc<Mutex<JoystickFirmware>>, Arc<SimulatedBus>, u32);
    impl Firmware for Unplugging {
        fn input(&mut self, report: &mut [u8]) -> usize {
            self.0.input(report)
        }
        fn output(&mut self, report: &[u8]) -> bool {
            self.0.output(report)
        }
        fn feature(&mut self, report: &mut [u8]) -> usize {
            if report[0] != STATUS {
                return self.0.feature(report);
            }
            self.2 += 1;
            assert_eq!(self.2, 1, "no further request");
            self.1.unplug(PATH);
            0
        }
        fn set_feature(&mut self, report: &[u8]) -> bool {
            self.0.set_feature(report)
        }
    }
    let descriptor = hex::bytes(include_str!("data/arduino_ffb.txt"));
    let bench = Bench::new(&descriptor, SimulatedStick::default());
    let firmware = Unplugging(Arc::clone(&bench.firmware), Arc::clone(&bench.bus), 0);
    bench.bus.plug(info(), descriptor, firmware);
    let mut device = bench.try_find(full_force()).unwrap();
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
}
