//! After the program was killed, its writes stop and nothing else happens.

use crate::joystick_bench::{Bench, full_force, kinds, openffboard};
use glam::DVec3;
use palpate_haptics::HapticDevice;
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::time::Duration;

/// Advances the bench and the joystick, whose time passes with its input reports, by 1 ms.
fn advance_1_ms(bench: &Bench, device: &mut HidDevice) {
    bench.advance_ms(1);
    device.read(Duration::ZERO).unwrap();
}

fn starts(bench: &Bench, start: &str) -> usize {
    bench.log.take().iter().filter(|line| line.starts_with(start)).count()
}

/// With writes the force stays constant beyond the duration of an effect. Without writes it ends 0.5 s after the last start, which is at
/// most 100 ms ago. Later writes ramp it up from zero.
#[test]
fn firmware_ends_the_force_within_half_a_second() {
    for kind in kinds() {
        let bench = Bench::new(&kind.descriptor, SimulatedStick::default());
        let mut device = bench.device(full_force());
        assert!(device.has_force_timeout());
        device.open().unwrap();
        let (count_n, force_n) = (50.0 / kind.full, DVec3::X * 10.0);
        device.write(force_n).unwrap();
        for ms in 0..1234 {
            advance_1_ms(&bench, &mut device);
            let felt_n = bench.force_n()[0];
            assert!((felt_n - 10.0).abs() <= count_n + 1e-3, "{} at {ms} ms: {felt_n} N", kind.name);
            device.write(force_n).unwrap();
            let felt_n = bench.force_n()[0];
            assert!((felt_n - 10.0).abs() <= count_n + 1e-3, "{}, written: {felt_n} N", kind.name);
        }
        let mut ends_after_ms = 0;
        while bench.force_n() != [0.0, 0.0] {
            advance_1_ms(&bench, &mut device);
            ends_after_ms += 1;
            assert!(ends_after_ms <= 500, "{}: still {:?} N", kind.name, bench.force_n());
        }
        assert!(ends_after_ms >= 400, "{}: {ends_after_ms} ms", kind.name);
        device.write(force_n).unwrap();
        assert_eq!(bench.force_n(), [0.0, 0.0], "{}", kind.name);
        for _ in 0..20 {
            advance_1_ms(&bench, &mut device);
            device.write(force_n).unwrap();
        }
        assert!((bench.force_n()[0] - 10.0).abs() <= count_n + 1e-3, "{}", kind.name);
    }
}

/// Only the effect with a force is started every 100 ms. The first force after a pause finds its effect ended, at zero, and the driver
/// starts it before it sends a magnitude.
#[test]
fn only_effects_with_a_force_are_restarted() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    bench.log.take();
    let mut write_for_a_second = |force_n: DVec3| {
        for _ in 0..1000 {
            advance_1_ms(&bench, &mut device);
            device.write(force_n).unwrap();
        }
    };
    write_for_a_second(DVec3::ZERO);
    assert_eq!(starts(&bench, "write 0a"), 0);
    write_for_a_second(DVec3::X);
    let reports = bench.log.take();
    let magnitudes = ["write 0a 01 01 01", "write 05 01 8f 02"];
    let first: Vec<&str> =
        reports.iter().map(String::as_str).filter(|line| magnitudes.contains(line)).take(2).collect();
    assert_eq!(first, magnitudes, "a start before the magnitude");
    assert_eq!(reports.iter().filter(|line| line.as_str() == magnitudes[0]).count(), 10);
    assert_eq!(reports.iter().filter(|line| line.starts_with("write 0a 02")).count(), 0);
}

/// A duration field with a maximum of 200 ms: the effects are endless, and their force stays.
#[test]
fn effects_are_endless_without_a_suitable_duration() {
    let mut descriptor = openffboard().descriptor;
    let limits =
        |high: [u8; 2]| [0x09, 0xA7, 0x15, 0, 0x26, high[0], high[1], 0x35, 0, 0x46, high[0], high[1]];
    let published = limits([0xFF, 0x7F]);
    let at = descriptor.windows(published.len()).position(|items| items == published).unwrap();
    descriptor[at..at + published.len()].copy_from_slice(&limits([200, 0]));
    let bench = Bench::new(&descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    let reports = bench.log.take();
    assert!(reports.iter().any(|line| line.starts_with("write 01 01 01 ff ff 00")), "{reports:?}");
    assert!(reports.iter().any(|line| line == "write 0a 01 01 ff"), "{reports:?}");
    assert!(!device.has_force_timeout());
    device.write(DVec3::X * 10.0).unwrap();
    (0..2000).for_each(|_| advance_1_ms(&bench, &mut device));
    assert!((bench.force_n()[0] - 10.0).abs() < 0.002);
}
