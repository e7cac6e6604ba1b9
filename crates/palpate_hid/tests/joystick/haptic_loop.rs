//! A joystick in the haptic loop: in lock step, on a thread, unplugged and plugged in again.

use crate::hex;
use crate::joystick_bench::{Bench, PATH, info, kinds, openffboard, whole_force};
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use palpate_local::{Contact, Scheme};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A loop whose safety settings are the device's own, and which shows force at once.
fn make_loop(device: &HidDevice) -> (HapticHandle, HapticLoop) {
    let config = LoopConfig {
        device: device.describe().limits(),
        real_time: RealTimeRequest::NONE,
        ..LoopConfig::default()
    };
    let safety = SafetySettings { arm_below_n: f64::MAX, ramp_s: 0.0, ..device.describe().safety(1e-3) };
    let settings = LoopSettings { safety, record: true, ..LoopSettings::default() };
    haptic_loop(config, settings).unwrap()
}

fn publish(handle: &mut HapticHandle, force_n: DVec3, sequence: u64) {
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, force_n);
    model.id.sequence = sequence;
    handle.publish_model();
}

/// What the stick feels is what the loop wrote, at every tick within a count of the device, while the force goes round; and the stick
/// goes where it is pushed.
#[test]
fn force_felt_is_force_written_at_every_tick_of_the_loop() {
    for kind in kinds() {
        let bench = Bench::new(&kind.descriptor, SimulatedStick::default());
        let device = bench.device(whole_force());
        let (mut handle, haptic_loop) = make_loop(&device);
        let counters = device.counters();
        let mut lockstep = Lockstep::new(haptic_loop, Box::new(device)).unwrap();
        let magnitude = &hex::part(kind.reports, "half to the right and a quarter away")[0][..8];
        let (mut largest_n, mut sent_at) = (0.0_f64, Vec::new());
        bench.ear.heard();
        for tick in 0..1000_u64 {
            if tick % 50 == 0 {
                let angle = 0.3 * tick as f64 / 50.0;
                publish(&mut handle, 4.0 * DVec3::new(angle.cos(), 0.0, angle.sin()), tick);
            }
            bench.wait_ms(1);
            lockstep.run(1);
            let written_n = handle.next_record().unwrap().force_n;
            if bench.ear.heard().iter().any(|line| line.starts_with(magnitude)) {
                sent_at.push(tick);
            }
            let [x, y] = bench.force_n();
            let count_n = 50.0 / kind.full;
            assert!((x - written_n.x).abs() <= count_n + 1e-4 * written_n.x.abs(), "{} at {tick}", kind.name);
            let crossed_n = kind.crossed * written_n.x.abs();
            assert!((y - written_n.z).abs() <= count_n + crossed_n, "{} at {tick}", kind.name);
            largest_n = largest_n.max(written_n.length());
        }
        assert!((largest_n - 4.0).abs() < 1e-9, "{largest_n}");
        // Each tick one report: nothing was skipped, nothing malformed. Forces that stay are said again at times.
        assert_eq!((counters.read(), counters.skipped(), counters.malformed()), (1001, 0, 0));
        let sent = sent_at.len() as u64;
        assert_eq!(counters.forces(), sent);
        let rate_hz = 1e3 * (sent - 1) as f64 / (sent_at[sent_at.len() - 1] - sent_at[0]) as f64;
        assert!((counters.force_rate_hz().unwrap() - rate_hz).abs() < 1e-6);
        let [x, y] = bench.firmware.lock().unwrap().position_m();
        let last_n = 4.0 * DVec3::new((0.3 * 19.0_f64).cos(), 0.0, (0.3 * 19.0_f64).sin());
        assert!(x * last_n.x + y * last_n.z > 0.0, "it gives way to the force: {x} {y}");
        drop(lockstep);
        let firmware = bench.firmware.lock().unwrap();
        assert_eq!((firmware.force_n(), firmware.effects(), firmware.is_on()), ([0.0; 2], 0, false));
    }
}

/// In a hand of stiffness k a force F, held, moves the stick by F/k.
#[test]
fn a_held_stick_rests_where_hand_and_motor_agree() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(whole_force());
    device.open().unwrap();
    let force_n = DVec3::new(3.0, 0.0, -1.5);
    let mut position_m = DVec3::ZERO;
    for _ in 0..3000 {
        bench.wait_ms(1);
        position_m = device.read(Duration::ZERO).unwrap().position_m;
        device.write(force_n).unwrap();
    }
    // Half a count of force, half a count of place.
    let tolerance_m = 0.5 * 50.0 / 32767.0 / 150.0 + 0.5 * 0.06 / 32767.0;
    let error_m = (position_m - force_n / 150.0).abs().max_element();
    assert!(error_m <= 1.01 * tolerance_m, "{error_m}");
}

/// Waits until `done`, for ten seconds at most.
#[expect(clippy::disallowed_methods, reason = "a test of a thread has to wait for it")]
fn wait_for(mut done: impl FnMut() -> bool) {
    for _ in 0..10_000 {
        if done() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("it did not happen within ten seconds");
}

#[test]
fn unplugged_in_the_middle_of_a_touch_and_plugged_in_again() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let device = bench.try_find(whole_force()).unwrap();
    let (mut handle, haptic_loop) = make_loop(&device);
    let mut thread = haptic_loop.spawn(Box::new(device)).unwrap();
    let mut told = Vec::new();
    let mut kinds_of = |handle: &mut HapticHandle| {
        told.extend(std::iter::from_fn(|| handle.next_event()).map(|event| event.kind));
        told.clone()
    };
    let touch = |handle: &mut HapticHandle| {
        let sequence = handle.samples().newest().map_or(0, |sample| sample.sequence);
        publish(handle, DVec3::X * 2.0, sequence);
    };
    wait_for(|| {
        touch(&mut handle);
        (bench.force_n()[0] - 2.0).abs() < 0.01
    });
    assert!(bench.bus.unplug(PATH));
    let failed = LoopEventKind::DeviceFailed(DeviceError::Disconnected);
    wait_for(|| kinds_of(&mut handle).contains(&failed));
    // Without its driver its effects last half a second. Plugged in anew it is in reset.
    bench.plug();
    wait_for(|| kinds_of(&mut handle).contains(&LoopEventKind::Reconnected));
    wait_for(|| {
        touch(&mut handle);
        (bench.force_n()[0] - 2.0).abs() < 0.01
    });
    assert_eq!(bench.firmware.lock().unwrap().effects(), 2, "those from before were freed");
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    assert!(!bench.firmware.lock().unwrap().is_on());
}

/// A firmware that takes no output reports while it is deaf.
struct Deaf {
    firmware: Arc<Mutex<JoystickFirmware>>,
    is_deaf: Arc<AtomicBool>,
}

impl Firmware for Deaf {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.firmware.input(report)
    }
    fn output(&mut self, report: &[u8]) -> bool {
        !self.is_deaf.load(Ordering::SeqCst) && self.firmware.output(report)
    }
    fn feature(&mut self, report: &mut [u8]) -> usize {
        self.firmware.feature(report)
    }
    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.firmware.set_feature(report)
    }
}

/// Reading and writing, with forces that change and that stay, with ticks that are refused and ticks that come late.
#[test]
fn nothing_is_allocated_once_it_is_open() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let is_deaf = Arc::new(AtomicBool::new(false));
    let deaf = Deaf { firmware: Arc::clone(&bench.firmware), is_deaf: Arc::clone(&is_deaf) };
    bench.bus.plug(info(), openffboard().descriptor, deaf);
    let mut device = bench.device(whole_force());
    device.open().unwrap();
    let (mut felt_n, mut refused): (f64, u64) = (0.0, 0);
    let allocations = allocation_counter::measure(|| {
        for tick in 0..500_u64 {
            is_deaf.store(tick % 70 > 65, Ordering::SeqCst);
            bench.wait_ms(if tick % 100 == 99 { 60 } else { 1 });
            device.read(Duration::from_millis(1)).unwrap();
            let written = device.write(DVec3::X * (tick / 3) as f64 * 0.02);
            refused += u64::from(written.is_err());
            felt_n = felt_n.max(bench.force_n()[0]);
        }
    });
    assert!(felt_n > 3.0 && refused > 20, "{felt_n} N, {refused} refused");
    assert_eq!((allocations.count_total, allocations.count_current), (0, 0), "{allocations:?}");
}
