//! Devices that jump, block or disconnect. `palpate-lab faults` injects every fault and measures the resulting forces.

use crate::wait::wait_for;
use glam::DVec3;
use palpate_haptics::*;
use palpate_local::{Contact, Scheme};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

fn settings() -> LoopSettings {
    let safety = SafetySettings { arm_below_n: f64::MAX, ramp_s: 0.0, ..SafetySettings::default() };
    LoopSettings { safety, velocity: VelocityEstimator::BackwardDifference, ..LoopSettings::default() }
}

fn kinds(handle: &mut HapticHandle) -> Vec<LoopEventKind> {
    std::iter::from_fn(|| handle.next_event()).map(|event| event.kind).collect()
}

#[test]
fn accepts_persistent_jump_and_rejects_glitches() {
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), settings()).unwrap();
    let mut tick = |x: f64| {
        let output = haptic_loop.tick(1, Ok(Reading::at(DVec3::X * x)));
        haptic_loop.finish_tick(output, None, Ok(()));
        output.sample.unwrap()
    };
    for i in 0..10 {
        tick(f64::from(i) / 1000.0);
    }
    // Four readings 50 mm away are rejected: the hand stays at its last position.
    for _ in 0..4 {
        let sample = tick(0.059);
        assert_eq!((sample.position_m.x, sample.origin), (0.009, palpate_local::SampleOrigin::Repeated));
    }
    assert_eq!(tick(0.010).position_m.x, 0.010);
    let events = kinds(&mut handle);
    let [LoopEventKind::DeviceFailed(DeviceError::Jumped), LoopEventKind::DeviceRecovered(4)] = events[..]
    else {
        panic!("{events:?}")
    };
    // Alternating glitches are never accepted.
    for i in 0..40 {
        assert_eq!(tick(if i % 2 == 0 { 0.059 } else { -0.059 }).position_m.x, 0.010);
    }
    tick(0.010);
    kinds(&mut handle);
    // A persistent jump is accepted, with zero velocity and a new start.
    let samples: Vec<_> = (0..6).map(|_| tick(0.060)).collect();
    assert_eq!(samples[3].position_m.x, 0.010);
    assert!(samples[4..].iter().all(|s| s.position_m.x == 0.060 && s.velocity_m_per_s == DVec3::ZERO));
    let jumped = kinds(&mut handle).into_iter().find_map(|kind| match kind {
        LoopEventKind::HandJumped(distance_m) => Some(distance_m),
        _ => None,
    });
    assert!((jumped.unwrap() - 0.05).abs() < 1e-12);
}

/// A device whose orientation changes while its position stays the same: reported after half a second, and the loop goes on. A device
/// without motors, such as a SpaceMouse whose cap is only turned, is not reported.
#[test]
fn frozen_position_is_reported_after_half_a_second() {
    for (force_n, is_reported) in [(20.0, true), (0.0, false)] {
        let config = LoopConfig { device: DeviceLimits::of_force(force_n), ..LoopConfig::default() };
        let (mut handle, mut haptic_loop) = haptic_loop(config, settings()).unwrap();
        for tick in 0..2000_u32 {
            let orientation = glam::DQuat::from_rotation_y(1e-3 * f64::from(tick));
            let reading = Reading { orientation, ..Reading::at(DVec3::X) };
            let output = haptic_loop.tick(1, Ok(reading));
            haptic_loop.finish_tick(output, None, Ok(()));
        }
        let events: Vec<LoopEvent> = std::iter::from_fn(|| handle.next_event()).collect();
        if !is_reported {
            assert_eq!(events, []);
            continue;
        }
        let [LoopEvent { sequence, kind: kind @ LoopEventKind::PositionFrozen(frozen_s) }] = events[..]
        else {
            panic!("{events:?}")
        };
        assert!((500..=503).contains(&sequence) && (0.5..0.503).contains(&frozen_s), "{events:?}");
        assert!(kind.is_fault() && kind.to_string().contains("check the encoders"));
    }
}

#[test]
fn fast_hand_is_no_jump_also_after_missed_deadlines() {
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), settings()).unwrap();
    let mut x = 0.0;
    for elapsed in [1, 1, 1, 5, 1, 50, 1] {
        // 15 m/s.
        x += 15e-3 * elapsed as f64;
        let output = haptic_loop.tick(elapsed, Ok(Reading::at(DVec3::X * x)));
        haptic_loop.finish_tick(output, None, Ok(()));
        assert_eq!(output.sample.unwrap().position_m.x, x);
    }
    let faults = kinds(&mut handle).into_iter().filter(|kind| matches!(kind, LoopEventKind::DeviceFailed(_)));
    assert_eq!(faults.count(), 0);
}

/// Calls and simulated faults of a device.
#[derive(Default)]
struct Controls {
    opens: AtomicU64,
    reads: AtomicU64,
    stops: AtomicU64,
    is_disconnected: AtomicBool,
    /// Error of opening while disconnected; `Disconnected` if `None`.
    open_error: Mutex<Option<DeviceError>>,
    blocks: AtomicBool,
    /// Writes fail.
    write_fails: AtomicBool,
    /// The emergency stop panics.
    stop_panics: AtomicBool,
}

struct FaultyDevice(Arc<Controls>);

struct FaultyStop(Arc<Controls>);

impl EmergencyStop for FaultyStop {
    fn stop(&mut self) -> Result<(), DeviceError> {
        assert!(!self.0.stop_panics.load(Ordering::SeqCst), "a simulated panic of the emergency stop");
        // The first attempt fails.
        if self.0.stops.fetch_add(1, Ordering::SeqCst) == 0 { Err(DeviceError::TimedOut) } else { Ok(()) }
    }
}

impl HapticDevice for FaultyDevice {
    fn describe(&self) -> DeviceDescription {
        ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe()
    }
    fn open(&mut self) -> Result<(), DeviceError> {
        self.0.opens.fetch_add(1, Ordering::SeqCst);
        if !self.0.is_disconnected.load(Ordering::SeqCst) {
            return Ok(());
        }
        Err(self.0.open_error.lock().unwrap().unwrap_or(DeviceError::Disconnected))
    }
    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        self.0.reads.fetch_add(1, Ordering::SeqCst);
        wait_for(|| !self.0.blocks.load(Ordering::SeqCst));
        if self.0.is_disconnected.load(Ordering::SeqCst) {
            return Err(DeviceError::Disconnected);
        }
        Ok(Reading::at(DVec3::ZERO))
    }
    fn write(&mut self, _: DVec3) -> Result<(), DeviceError> {
        if self.0.write_fails.load(Ordering::SeqCst) { Err(DeviceError::Disconnected) } else { Ok(()) }
    }
    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        Some(Box::new(FaultyStop(Arc::clone(&self.0))))
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

fn start() -> (HapticHandle, LoopThread, Arc<Controls>) {
    start_with(Arc::new(Controls::default()))
}

fn start_with(controls: Arc<Controls>) -> (HapticHandle, LoopThread, Arc<Controls>) {
    let config = LoopConfig { real_time: RealTimeRequest::NONE, ..LoopConfig::default() };
    let (mut handle, haptic_loop) = haptic_loop(config, settings()).unwrap();
    let thread = haptic_loop.spawn(Box::new(FaultyDevice(Arc::clone(&controls)))).unwrap();
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, DVec3::Y);
    handle.publish_model();
    (handle, thread, controls)
}

#[test]
fn watchdog_stops_blocked_loop_once_and_start_is_rearmed() {
    let (mut handle, mut thread, controls) = start();
    wait_for(|| controls.reads.load(Ordering::SeqCst) > 50);
    assert_eq!(thread.emergency_stops(), 0);
    controls.blocks.store(true, Ordering::SeqCst);
    wait_for(|| thread.emergency_stops() > 0);
    // One failed and one successful stop, then no more.
    let reads = controls.reads.load(Ordering::SeqCst);
    #[expect(clippy::disallowed_methods, reason = "nothing may happen for a while")]
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!((controls.stops.load(Ordering::SeqCst), thread.emergency_stops()), (2, 1));
    controls.blocks.store(false, Ordering::SeqCst);
    wait_for(|| controls.reads.load(Ordering::SeqCst) > reads + 20);
    assert!(kinds(&mut handle).contains(&LoopEventKind::EmergencyStopped));
    assert!(matches!(thread.stop(), StopOutcome::Joined));
}

#[test]
fn disconnected_device_is_reopened() {
    let (mut handle, mut thread, controls) = start();
    wait_for(|| controls.reads.load(Ordering::SeqCst) > 50);
    controls.is_disconnected.store(true, Ordering::SeqCst);
    // Opened once at the start, then one failed attempt.
    wait_for(|| controls.opens.load(Ordering::SeqCst) == 2);
    assert!(!kinds(&mut handle).contains(&LoopEventKind::Reconnected));
    controls.is_disconnected.store(false, Ordering::SeqCst);
    // The device is read again, or reopened within half a second.
    let reads = controls.reads.load(Ordering::SeqCst);
    wait_for(|| controls.reads.load(Ordering::SeqCst) > reads + 20);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    let recovered =
        kinds(&mut handle).into_iter().any(|kind| matches!(kind, LoopEventKind::DeviceRecovered(_)));
    assert!(recovered);
}

/// The first opening is repeated like later ones, and each new reason is reported once.
#[test]
fn device_that_appears_after_the_start_is_opened() {
    let controls = Arc::new(Controls::default());
    controls.is_disconnected.store(true, Ordering::SeqCst);
    let (mut handle, mut thread, controls) = start_with(controls);
    wait_for(|| controls.opens.load(Ordering::SeqCst) >= 2);
    *controls.open_error.lock().unwrap() = Some(DeviceError::Os(13));
    wait_for(|| controls.opens.load(Ordering::SeqCst) >= 4);
    assert_eq!(controls.reads.load(Ordering::SeqCst), 0);
    controls.is_disconnected.store(false, Ordering::SeqCst);
    wait_for(|| controls.reads.load(Ordering::SeqCst) > 50);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    let events = kinds(&mut handle);
    let failed: Vec<LoopEventKind> =
        events.iter().copied().filter(|kind| matches!(kind, LoopEventKind::OpenFailed(_))).collect();
    let expected = [DeviceError::Disconnected, DeviceError::Os(13)];
    assert_eq!(failed, expected.map(LoopEventKind::OpenFailed), "{events:?}");
    assert!(failed.iter().all(LoopEventKind::is_fault));
    assert!(events.contains(&LoopEventKind::Started));
}

/// Each new reason is reported once.
#[test]
fn reports_each_reason_of_failed_reopening_once() {
    let (mut handle, mut thread, controls) = start();
    wait_for(|| controls.reads.load(Ordering::SeqCst) > 50);
    controls.is_disconnected.store(true, Ordering::SeqCst);
    let mut events = Vec::new();
    let mut opens = 1;
    for error in [None, Some(DeviceError::Os(13)), Some(DeviceError::Unavailable("ambiguous"))] {
        *controls.open_error.lock().unwrap() = error;
        // At least two attempts each; the first may still have the previous reason.
        opens += 3;
        wait_for(|| controls.opens.load(Ordering::SeqCst) >= opens);
        events.extend(kinds(&mut handle));
    }
    controls.is_disconnected.store(false, Ordering::SeqCst);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    events.extend(kinds(&mut handle));
    let reasons: Vec<LoopEventKind> =
        events.iter().copied().filter(|kind| matches!(kind, LoopEventKind::ReopenFailed(_))).collect();
    let expected = [DeviceError::Os(13), DeviceError::Unavailable("ambiguous")];
    assert_eq!(reasons, expected.map(LoopEventKind::ReopenFailed), "{events:?}");
    assert!(reasons.iter().all(LoopEventKind::is_fault));
}

/// The device can be read, but every write fails: without a stop the last force would stay.
#[test]
fn device_with_failing_writes_is_stopped_and_reopened() {
    let (mut handle, mut thread, controls) = start();
    wait_for(|| controls.reads.load(Ordering::SeqCst) > 50);
    controls.write_fails.store(true, Ordering::SeqCst);
    wait_for(|| thread.emergency_stops() > 0);
    wait_for(|| controls.opens.load(Ordering::SeqCst) > 1);
    controls.write_fails.store(false, Ordering::SeqCst);
    let mut events = Vec::new();
    wait_for(|| {
        events.extend(kinds(&mut handle));
        events.contains(&LoopEventKind::Reconnected)
    });
    let failed = LoopEventKind::DeviceFailed(DeviceError::Disconnected);
    assert!(events.contains(&failed) && events.contains(&LoopEventKind::EmergencyStopped), "{events:?}");
    assert!(matches!(thread.stop(), StopOutcome::Joined));
}

#[test]
fn panicking_emergency_stop_is_not_repeated_until_loop_resumes() {
    let (_handle, mut thread, controls) = start();
    controls.stop_panics.store(true, Ordering::SeqCst);
    wait_for(|| controls.reads.load(Ordering::SeqCst) > 50);
    controls.blocks.store(true, Ordering::SeqCst);
    #[expect(clippy::disallowed_methods, reason = "the watchdog needs its timeout")]
    std::thread::sleep(Duration::from_millis(150));
    assert_eq!(thread.emergency_stops(), 0);
    controls.blocks.store(false, Ordering::SeqCst);
    // The watchdog still works.
    controls.stop_panics.store(false, Ordering::SeqCst);
    let reads = controls.reads.load(Ordering::SeqCst);
    wait_for(|| controls.reads.load(Ordering::SeqCst) > reads + 20);
    controls.blocks.store(true, Ordering::SeqCst);
    wait_for(|| thread.emergency_stops() == 1);
    controls.blocks.store(false, Ordering::SeqCst);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
}
