//! A joystick in the haptic loop: in lockstep, on a thread, unplugged and plugged in again.

use crate::hex;
use crate::joystick_bench::{Bench, PATH, full_force, info, kinds, openffboard};
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use palpate_local::{Contact, Scheme};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A loop with the safety settings of the device, without a ramp.
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

/// The force on the stick is the force of the loop, at every tick within one count, for a rotating force; and the stick moves along it.
#[test]
fn applied_force_is_the_loop_force_at_every_tick() {
    for kind in kinds() {
        let bench = Bench::new(&kind.descriptor, SimulatedStick::default());
        let device = bench.device(full_force());
        let (mut handle, haptic_loop) = make_loop(&device);
        let counters = device.counters();
        let mut lockstep = Lockstep::new(haptic_loop, Box::new(device)).unwrap();
        let magnitude = &hex::part(kind.reports, "half to the right and a quarter away")[0][..8];
        let (mut max_n, mut sent_at) = (0.0_f64, Vec::new());
        bench.log.take();
        for tick in 0..1000_u64 {
            if tick % 50 == 0 {
                let angle = 0.3 * tick as f64 / 50.0;
                publish(&mut handle, 4.0 * DVec3::new(angle.cos(), 0.0, angle.sin()), tick);
            }
            bench.advance_ms(1);
            lockstep.run(1);
            let written_n = handle.next_record().unwrap().force_n;
            if bench.log.take().iter().any(|line| line.starts_with(magnitude)) {
                sent_at.push(tick);
            }
            let [x, y] = bench.force_n();
            let count_n = 50.0 / kind.full;
            assert!((x - written_n.x).abs() <= count_n + 1e-4 * written_n.x.abs(), "{} at {tick}", kind.name);
            let crossed_n = kind.crossed * written_n.x.abs();
            assert!((y - written_n.z).abs() <= count_n + crossed_n, "{} at {tick}", kind.name);
            max_n = max_n.max(written_n.length());
        }
        assert!((max_n - 4.0).abs() < 1e-9, "{max_n}");
        // One report per tick, none skipped or malformed. Constant forces are sent again at times.
        assert_eq!((counters.read(), counters.skipped(), counters.malformed()), (1001, 0, 0));
        let sent = sent_at.len() as u64;
        assert_eq!(counters.forces(), sent);
        let rate_hz = 1e3 * (sent - 1) as f64 / (sent_at[sent_at.len() - 1] - sent_at[0]) as f64;
        assert!((counters.force_rate_hz().unwrap() - rate_hz).abs() < 1e-6);
        let [x, y] = bench.firmware.lock().unwrap().position_m();
        let last_n = 4.0 * DVec3::new((0.3 * 19.0_f64).cos(), 0.0, (0.3 * 19.0_f64).sin());
        assert!(x * last_n.x + y * last_n.z > 0.0, "it moves along the force: {x} {y}");
        drop(lockstep);
        let firmware = bench.firmware.lock().unwrap();
        assert_eq!((firmware.force_n(), firmware.effects(), firmware.is_on()), ([0.0; 2], 0, false));
    }
}

/// A constant force F moves the stick by F/k against a hand of stiffness k.
#[test]
fn constant_force_displaces_the_stick_by_force_over_stiffness() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let mut device = bench.device(full_force());
    device.open().unwrap();
    let force_n = DVec3::new(3.0, 0.0, -1.5);
    let mut position_m = DVec3::ZERO;
    for _ in 0..3000 {
        bench.advance_ms(1);
        position_m = device.read(Duration::ZERO).unwrap().position_m;
        device.write(force_n).unwrap();
    }
    // Half a count of force, half a count of position.
    let tolerance_m = 0.5 * 50.0 / 32767.0 / 150.0 + 0.5 * 0.06 / 32767.0;
    let error_m = (position_m - force_n / 150.0).abs().max_element();
    assert!(error_m <= 1.01 * tolerance_m, "{error_m}");
}

/// Waits until `done`, for at most 10 s.
#[expect(clippy::disallowed_methods, reason = "a test of a thread has to wait for it")]
fn wait_for(mut done: impl FnMut() -> bool) {
    for _ in 0..10_000 {
        if done() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("timeout after 10 s");
}

#[test]
fn reconnected_joystick_displays_the_force_again() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let device = bench.try_find(full_force()).unwrap();
    let (mut handle, haptic_loop) = make_loop(&device);
    let mut thread = haptic_loop.spawn(Box::new(device)).unwrap();
    let mut events = Vec::new();
    let mut kinds_of = |handle: &mut HapticHandle| {
        events.extend(std::iter::from_fn(|| handle.next_event()).map(|event| event.kind));
        events.clone()
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
    // Without the driver the effects last 0.5 s. The device is reset when it is opened again.
    bench.plug();
    wait_for(|| kinds_of(&mut handle).contains(&LoopEventKind::Reconnected));
    wait_for(|| {
        touch(&mut handle);
        (bench.force_n()[0] - 2.0).abs() < 0.01
    });
    assert_eq!(bench.firmware.lock().unwrap().effects(), 2, "the former ones were freed");
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    assert!(!bench.firmware.lock().unwrap().is_on());
}

/// Firmware that rejects output reports while `is_rejecting`.
struct RejectingFirmware {
    firmware: Arc<Mutex<JoystickFirmware>>,
    is_rejecting: Arc<AtomicBool>,
}

impl Firmware for RejectingFirmware {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.firmware.input(report)
    }
    fn output(&mut self, report: &[u8]) -> bool {
        !self.is_rejecting.load(Ordering::SeqCst) && self.firmware.output(report)
    }
    fn feature(&mut self, report: &mut [u8]) -> usize {
        self.firmware.feature(report)
    }
    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.firmware.set_feature(report)
    }
}

/// Reading and writing with changing and constant forces, rejected reports and late ticks.
#[test]
fn read_and_write_do_not_allocate() {
    let bench = Bench::new(&openffboard().descriptor, SimulatedStick::default());
    let is_rejecting = Arc::new(AtomicBool::new(false));
    let rejecting =
        RejectingFirmware { firmware: Arc::clone(&bench.firmware), is_rejecting: Arc::clone(&is_rejecting) };
    bench.bus.plug(info(), openffboard().descriptor, rejecting);
    let mut device = bench.device(full_force());
    device.open().unwrap();
    let (mut felt_n, mut rejected): (f64, u64) = (0.0, 0);
    let allocations = allocation_counter::measure(|| {
        for tick in 0..500_u64 {
            is_rejecting.store(tick % 70 > 65, Ordering::SeqCst);
            bench.advance_ms(if tick % 100 == 99 { 60 } else { 1 });
            device.read(Duration::from_millis(1)).unwrap();
            let written = device.write(DVec3::X * (tick / 3) as f64 * 0.02);
            rejected += u64::from(written.is_err());
            felt_n = felt_n.max(bench.force_n()[0]);
        }
    });
    assert!(felt_n > 3.0 && rejected > 20, "{felt_n} N, {rejected} rejected");
    assert_eq!((allocations.count_total, allocations.count_current), (0, 0), "{allocations:?}");
}
