//! The loop on its own thread: properties that hold at any load of the machine. No test depends on measured times.

#[path = "shared/wait.rs"]
mod wait;

use glam::DVec3;
use palpate_haptics::*;
use palpate_laws::{Spring, ToolShape};
use palpate_local::{
    Capacity, Contact, HandOverSettings, NearEnd, NearField, NearPoint, NearSpring, NearTriangle, Scheme,
    Support, TickIntegrator,
};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use wait::wait_for;

/// Calls of a device.
#[derive(Default)]
struct Log {
    last_force: Mutex<Option<DVec3>>,
    closed: AtomicU64,
    reads: AtomicU64,
}

struct LoggedDevice {
    log: Arc<Log>,
    read: Box<dyn FnMut(u64) -> Result<Reading, DeviceError> + Send>,
}

impl HapticDevice for LoggedDevice {
    fn describe(&self) -> DeviceDescription {
        ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe()
    }
    fn open(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        (self.read)(self.log.reads.fetch_add(1, Ordering::SeqCst))
    }
    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        *self.log.last_force.lock().unwrap() = Some(force_n);
        Ok(())
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        self.log.closed.fetch_add(1, Ordering::SeqCst);
        Ok(())
    }
}

fn start(
    read: impl FnMut(u64) -> Result<Reading, DeviceError> + Send + 'static,
) -> (HapticHandle, LoopThread, Arc<Log>) {
    let log = Arc::new(Log::default());
    let device = LoggedDevice { log: log.clone(), read: Box::new(read) };
    let safety = SafetySettings { arm_below_n: f64::MAX, ramp_s: 0.0, ..SafetySettings::default() };
    let settings = LoopSettings { safety, record: true, ..LoopSettings::default() };
    let (mut handle, haptic_loop) = haptic_loop(LoopConfig::default(), settings).unwrap();
    let thread = haptic_loop.spawn(Box::new(device)).unwrap();
    publish(&mut handle, 0);
    (handle, thread, log)
}

fn publish(handle: &mut HapticHandle, sequence: u64) {
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, DVec3::Y);
    model.id.sequence = sequence;
    handle.publish_model();
}

#[test]
fn every_period_is_a_tick_or_a_counted_missed_deadline() {
    let (mut handle, mut thread, log) = start(|_| Ok(Reading::at(DVec3::ZERO)));
    wait_for(|| log.reads.load(Ordering::SeqCst) > 400);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    let report = handle.report();
    assert!(report.ended);
    let (ticks, missed) = (report.ticks, report.missed_deadlines);
    assert_eq!(ticks, log.reads.load(Ordering::SeqCst));
    assert_eq!(report.lateness.count(), ticks);
    assert_eq!(report.cost.count(), ticks);
    assert_eq!(handle.samples().newest().unwrap().sequence, ticks + missed);
    let mut counted = 0;
    let records: Vec<TickRecord> = std::iter::from_fn(|| handle.next_record()).collect();
    assert_eq!(records.len() as u64, ticks);
    assert_eq!(records.iter().map(|r| r.elapsed).sum::<u64>(), ticks + missed);
    while let Some(event) = handle.next_event() {
        if let LoopEventKind::DeadlinesMissed(n) | LoopEventKind::Gap(n) = event.kind {
            counted += n;
        }
    }
    assert_eq!(counted, missed);
}

#[test]
fn slow_read_misses_deadlines_without_later_burst() {
    #[expect(clippy::disallowed_methods, reason = "the device is slow")]
    let slow = |n| {
        if n == 50 {
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(Reading::at(DVec3::ZERO))
    };
    let (mut handle, mut thread, log) = start(slow);
    wait_for(|| log.reads.load(Ordering::SeqCst) > 100);
    thread.stop();
    let records: Vec<TickRecord> = std::iter::from_fn(|| handle.next_record()).collect();
    assert!(records[51].elapsed >= 5, "{}", records[51].elapsed);
    assert!(handle.report().missed_deadlines >= 4);
}

#[test]
fn stop_and_drop_set_zero_force_and_close_device() {
    for drop_it in [false, true] {
        let (_handle, mut thread, log) = start(|_| Ok(Reading::at(DVec3::ZERO)));
        wait_for(|| {
            *log.last_force.lock().unwrap() != Some(DVec3::ZERO) && log.reads.load(Ordering::SeqCst) > 5
        });
        if drop_it {
            drop(thread);
        } else {
            assert!(matches!(thread.stop(), StopOutcome::Joined));
            assert!(!thread.is_running());
            assert!(matches!(thread.stop(), StopOutcome::AlreadyStopped));
        }
        assert_eq!(*log.last_force.lock().unwrap(), Some(DVec3::ZERO));
        assert_eq!(log.closed.load(Ordering::SeqCst), 1);
    }
}

#[test]
fn panic_of_device_sets_zero_force_and_is_reported() {
    let (mut handle, mut thread, log) = start(|n| {
        assert!(n < 30, "a simulated panic of the device");
        Ok(Reading::at(DVec3::ZERO))
    });
    wait_for(|| !thread.is_running());
    assert!(matches!(thread.stop(), StopOutcome::Panicked));
    assert_eq!(*log.last_force.lock().unwrap(), Some(DVec3::ZERO));
    assert_eq!(log.closed.load(Ordering::SeqCst), 1);
    let events = std::iter::from_fn(|| handle.next_event()).map(|event| event.kind);
    assert_eq!(events.last(), Some(LoopEventKind::Panicked));
    assert!(handle.report().ended && handle.report().ticks == 30);
}

/// Also the write of zero force panics.
#[test]
fn device_that_panics_in_every_write_is_closed() {
    struct PanickingDevice(Arc<AtomicU64>);
    impl HapticDevice for PanickingDevice {
        fn describe(&self) -> DeviceDescription {
            ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe()
        }
        fn open(&mut self) -> Result<(), DeviceError> {
            Ok(())
        }
        fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
            Err(DeviceError::TimedOut)
        }
        fn write(&mut self, _: DVec3) -> Result<(), DeviceError> {
            panic!("a simulated panic of the device")
        }
        fn close(&mut self) -> Result<(), DeviceError> {
            self.0.fetch_add(1, Ordering::SeqCst);
            Ok(())
        }
    }
    let closed = Arc::new(AtomicU64::new(0));
    let (_handle, haptic_loop) = haptic_loop(LoopConfig::default(), LoopSettings::default()).unwrap();
    let mut thread = haptic_loop.spawn(Box::new(PanickingDevice(closed.clone()))).unwrap();
    wait_for(|| !thread.is_running());
    assert!(matches!(thread.stop(), StopOutcome::Panicked));
    assert_eq!(closed.load(Ordering::SeqCst), 1);
}

#[test]
fn blocking_device_is_detached() {
    let release = Arc::new(AtomicBool::new(false));
    let gate = release.clone();
    #[expect(clippy::disallowed_methods, reason = "the device blocks")]
    let (_handle, mut thread, log) = start(move |n| {
        while n == 20 && !gate.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(Reading::at(DVec3::ZERO))
    });
    wait_for(|| log.reads.load(Ordering::SeqCst) > 20);
    assert!(matches!(thread.stop(), StopOutcome::Detached));
    *log.last_force.lock().unwrap() = None;
    release.store(true, Ordering::SeqCst);
    wait_for(|| log.closed.load(Ordering::SeqCst) == 1);
    assert_eq!(*log.last_force.lock().unwrap(), Some(DVec3::ZERO), "only zero force after the stop");
}

#[test]
fn device_that_cannot_be_opened_is_reported_and_gets_no_force() {
    let (mut handle, haptic_loop) = haptic_loop(LoopConfig::default(), LoopSettings::default()).unwrap();
    let mut device = ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::ZERO)));
    device.open().unwrap();
    let mut thread = haptic_loop.spawn(Box::new(device)).unwrap();
    wait_for(|| handle.report().device_errors > 0);
    assert!(thread.is_running() && !handle.report().ended);
    // The stop does not wait for the next attempt.
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    let kinds: Vec<LoopEventKind> = std::iter::from_fn(|| handle.next_event()).map(|e| e.kind).collect();
    let [LoopEventKind::RealTime(_), failed, stopped] = kinds[..] else { panic!("{kinds:?}") };
    assert_eq!(failed, LoopEventKind::OpenFailed(DeviceError::AlreadyOpen));
    assert_eq!(stopped, LoopEventKind::Stopped);
    assert!(handle.report().ended && handle.report().ticks == 0);
}

/// A triangle on springs that the tool touches, and a far field of order two.
fn touched_triangle(field: &mut NearField, is_implicit: bool) {
    field.clear();
    (field.nodes, field.order, field.ring) = (3, 2, 1);
    (field.springs, field.points, field.triangles) = (4, 3, 1);
    field.support = Support::Touched { shape: ToolShape::Sphere { radius_m: 0.005 }, friction: 0.3 };
    let places = [DVec3::ZERO, DVec3::X * 0.02, DVec3::Y * 0.02].map(|x| x - DVec3::new(0.005, 0.005, 0.004));
    let spring = Spring::linear(100.0, 0.02, 0.1).unwrap();
    for (i, x) in places.into_iter().enumerate() {
        (field.node_m[i], field.node_per_kg[i]) = (x, 200.0);
        let b = if i == 0 { NearEnd::Ring(0) } else { NearEnd::Fixed(x - DVec3::Z * 0.02) };
        field.near[i] = NearSpring { a: i, b, spring };
    }
    field.near[3] = NearSpring { a: 1, b: NearEnd::Support(2), spring };
    field.ring_m[0] = places[0] - DVec3::Z * 0.02;
    field.basis[..6].copy_from_slice(&[1.0, 0.0, 1.0, 0.0, 1.0, 1.0]);
    field.stiffness[..4].copy_from_slice(&[1e4, 0.0, 0.0, 1e4]);
    field.damping[..4].copy_from_slice(&[10.0, 0.0, 0.0, 10.0]);
    field.force[..11].fill(0.0);
    field.velocity[..11].fill(0.0);
    field.point[..3].copy_from_slice(&[0, 1, 2].map(NearPoint::node));
    field.triangle[0] = NearTriangle {
        points: [0, 1, 2],
        rest_normal: DVec3::Z,
        is_reachable: true,
        ..NearTriangle::default()
    };
    (field.tick_s, field.start_m) = (1e-3, DVec3::ZERO);
    field.integrator = TickIntegrator::Explicit { substeps: 4 };
    if is_implicit {
        field.integrator = TickIntegrator::Implicit { substeps: 2 };
        let diagonal: Vec<f64> = (0..121).map(|i| if i % 12 == 0 { 100.0 } else { 0.0 }).collect();
        field.factor.factorise(11, &diagonal).unwrap();
        field.tangent[..121].fill(0.0);
        field.impulse_response[..99].fill(0.0);
        (0..9).for_each(|i| field.impulse_response[11 * i + i] = 200.0);
    }
}

/// Covers the runner, the tick, reports and records, with models that have a state and change all the time.
#[test]
fn loop_thread_neither_allocates_nor_frees() {
    let near = Capacity::default().near;
    let capacity = Capacity { order: 12, near, second: near };
    let hand_over = HandOverSettings { capacity, ..Default::default() };
    let config = LoopConfig { hand_over, event_capacity: 16, record_capacity: 32, ..LoopConfig::default() };
    let settings = LoopSettings { record: true, ..LoopSettings::default() };
    let (handle, haptic_loop) = haptic_loop(config, settings).unwrap();
    let handle = Arc::new(Mutex::new(handle));
    let (other, stop) = (handle.clone(), Arc::new(AtomicBool::new(false)));
    let (flag, last) = (stop.clone(), Arc::new(AtomicU64::new(0)));
    let newest = last.clone();
    // The model side on another thread publishes dynamic models and new settings all the time.
    let model_side = std::thread::spawn(move || {
        while !flag.load(Ordering::SeqCst) {
            let mut handle = other.lock().unwrap();
            let sequence = handle.samples().newest().map_or(0, |s| s.sequence);
            let (body, second_body) = (Some(1), (sequence % 5 != 0).then_some(2));
            let settings =
                LoopSettings { paused: sequence % 7 == 0, body, second_body, ..*handle.settings() };
            handle.set_settings(settings).unwrap();
            let model = handle.model_slot();
            let near = sequence % 3;
            let scheme = if near > 0 { Scheme::NearFieldExact } else { Scheme::Neighbourhood };
            (model.scheme, model.contact, model.id.sequence) = (scheme, Contact::Held, sequence);
            touched_triangle(&mut model.near, near == 2);
            model.id.body = 1;
            model.second.clear();
            if sequence % 2 == 0 {
                touched_triangle(&mut model.second.near, near == 2);
                model.second.body = 2;
            }
            model.reduced.order = 12;
            model.reduced.step_s = 1e-3;
            let identity: Vec<f64> = (0..144).map(|i| f64::from(u8::from(i % 13 == 0))).collect();
            model.reduced.implicit.factorise(12, &identity).unwrap();
            handle.publish_model();
            drop(handle);
            std::thread::yield_now();
        }
    });
    let counter = stop.clone();
    let was_touched = Arc::new(AtomicBool::new(false));
    let touched = was_touched.clone();
    let mut device = ScriptedDevice::new(move |n, force_n: DVec3| {
        touched.fetch_or(force_n != DVec3::ZERO, Ordering::SeqCst);
        newest.store(n, Ordering::SeqCst);
        if n == 400 {
            counter.store(true, Ordering::SeqCst);
        }
        match n % 50 {
            10 => Err(DeviceError::TimedOut),
            20 => Ok(Reading::at(DVec3::NAN)),
            _ => Ok(Reading::at(DVec3::X * 0.01 * (n as f64 * 0.01).sin())),
        }
    });
    let mut ended = None;
    let allocations = allocation_counter::measure(|| ended = Some(run(haptic_loop, &mut device, &stop)));
    model_side.join().unwrap();
    assert!(last.load(Ordering::SeqCst) >= 400);
    let mut handle = handle.lock().unwrap();
    assert!(handle.report().models_adopted > 5 && handle.report().dropped_records > 0);
    assert!(was_touched.load(Ordering::SeqCst), "the triangle was touched");
    assert!(handle.black_box().ticks().count() >= 400, "the black box has all ticks");
    assert_eq!(allocations.count_total, 0, "{allocations:?}");
    assert_eq!(allocations.count_current, 0, "and nothing freed");
}

/// All numbers of a published model are equal, which reveals tearing.
#[test]
fn local_models_are_not_torn() {
    let (mut handle, mut thread, log) = start(|_| Ok(Reading::at(DVec3::ZERO)));
    let mut sequence = 1;
    while log.reads.load(Ordering::SeqCst) < 300 {
        let model = handle.model_slot();
        let value = (sequence % 1000) as f64 * 1e-3;
        (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, DVec3::splat(value));
        model.id.sequence = 0;
        (model.id.body, model.id.epoch) = (sequence, sequence);
        handle.publish_model();
        sequence += 1;
    }
    thread.stop();
    let mut checked = 0;
    while let Some(record) = handle.next_record() {
        let (rendered, force) = (record.rendered, record.rendered.force_n);
        let Some(model) = rendered.model.filter(|m| m.body > 0) else {
            continue;
        };
        assert_eq!(model.body, model.epoch);
        assert_eq!(force, DVec3::splat((model.body % 1000) as f64 * 1e-3));
        checked += 1;
    }
    assert!(checked > 100, "{checked}");
}

/// During a model step of 150 ms the local model ages, and the loop keeps ticking.
#[test]
fn slow_model_step_ages_model_without_delaying_loop() {
    let (mut handle, mut thread, log) = start(|_| Ok(Reading::at(DVec3::ZERO)));
    wait_for(|| log.reads.load(Ordering::SeqCst) > 20);
    let built_at = handle.samples().newest().unwrap().sequence;
    let before = log.reads.load(Ordering::SeqCst);
    // The model step lasts until the loop has made 150 more samples.
    wait_for(|| handle.samples().newest().unwrap().sequence >= built_at + 150);
    publish(&mut handle, built_at);
    assert!(log.reads.load(Ordering::SeqCst) > before, "the loop ticked during the model step");
    let adopted = |handle: &mut HapticHandle| {
        handle.latest_tick().unwrap().rendered.model.unwrap().sequence == built_at
    };
    wait_for(|| adopted(&mut handle));
    let tick = handle.latest_tick().unwrap();
    assert!(tick.sample.unwrap().sequence - built_at >= 150, "and the model is that old");
    assert_eq!(tick.rendered.force_n, DVec3::Y);
    thread.stop();
}
