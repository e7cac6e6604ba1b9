//! A device that jumps, hangs or goes away. `palpate-lab faults` has every fault and what the hand feels of it.

#[path = "shared/wait.rs"]
mod wait;

use glam::DVec3;
use palpate_haptics::*;
use palpate_local::{Contact, Scheme};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use wait::wait_for;

fn settings() -> LoopSettings {
    let safety = SafetySettings { arm_below_n: f64::MAX, ramp_s: 0.0, ..SafetySettings::default() };
    LoopSettings { safety, velocity: VelocityEstimator::BackwardDifference, ..LoopSettings::default() }
}

fn kinds(handle: &mut HapticHandle) -> Vec<LoopEventKind> {
    std::iter::from_fn(|| handle.next_event()).map(|event| event.kind).collect()
}

#[test]
fn a_jump_is_believed_when_it_stays_and_a_glitch_never() {
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), settings()).unwrap();
    let mut tick = |x: f64| {
        let ticked = haptic_loop.tick(1, Ok(Reading::at(DVec3::X * x)));
        haptic_loop.finish_tick(ticked, None, Ok(()));
        ticked.sample.unwrap()
    };
    for i in 0..10 {
        tick(f64::from(i) / 1000.0);
    }
    // Four readings elsewhere, 50 mm away, are not believed: the hand stays where it was.
    for _ in 0..4 {
        let sample = tick(0.059);
        assert_eq!((sample.position_m.x, sample.origin), (0.009, palpate_local::SampleOrigin::Repeated));
    }
    assert_eq!(tick(0.010).position_m.x, 0.010);
    let told = kinds(&mut handle);
    let [LoopEventKind::DeviceFailed(DeviceError::Jumped), LoopEventKind::DeviceRecovered(4)] = told[..]
    else {
        panic!("{told:?}")
    };
    // Two glitches at different places are no hand.
    for i in 0..40 {
        assert_eq!(tick(if i % 2 == 0 { 0.059 } else { -0.059 }).position_m.x, 0.010);
    }
    tick(0.010);
    kinds(&mut handle);
    // What stays is the hand: without a velocity, and with a start of its own.
    let samples: Vec<_> = (0..6).map(|_| tick(0.060)).collect();
    assert_eq!(samples[3].position_m.x, 0.010);
    assert!(samples[4..].iter().all(|s| s.position_m.x == 0.060 && s.velocity_m_per_s == DVec3::ZERO));
    let jumped = kinds(&mut handle).into_iter().find_map(|kind| match kind {
        LoopEventKind::HandJumped(distance_m) => Some(distance_m),
        _ => None,
    });
    assert!((jumped.unwrap() - 0.05).abs() < 1e-12);
}

#[test]
fn a_fast_hand_is_no_jump_nor_is_one_after_missed_deadlines() {
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), settings()).unwrap();
    let mut x = 0.0;
    for elapsed in [1, 1, 1, 5, 1, 50, 1] {
        // 15 m/s.
        x += 15e-3 * elapsed as f64;
        let ticked = haptic_loop.tick(elapsed, Ok(Reading::at(DVec3::X * x)));
        haptic_loop.finish_tick(ticked, None, Ok(()));
        assert_eq!(ticked.sample.unwrap().position_m.x, x);
    }
    let faults = kinds(&mut handle).into_iter().filter(|kind| matches!(kind, LoopEventKind::DeviceFailed(_)));
    assert_eq!(faults.count(), 0);
}

/// What happened to a device.
#[derive(Default)]
struct Seen {
    opens: AtomicU64,
    reads: AtomicU64,
    stops: AtomicU64,
    is_gone: AtomicBool,
    /// Why it cannot be opened while it is gone, if not because it is gone.
    refuses: Mutex<Option<DeviceError>>,
    hangs: AtomicBool,
    /// Forces are not taken.
    is_deaf: AtomicBool,
    /// Stopping it panics.
    brake_panics: AtomicBool,
}

struct Stand(Arc<Seen>);

struct Brake(Arc<Seen>);

impl EmergencyStop for Brake {
    fn stop(&mut self) -> Result<(), DeviceError> {
        assert!(!self.0.brake_panics.load(Ordering::SeqCst), "a rehearsed panic of the brake");
        // The first attempt fails; it is tried again.
        if self.0.stops.fetch_add(1, Ordering::SeqCst) == 0 { Err(DeviceError::TimedOut) } else { Ok(()) }
    }
}

impl HapticDevice for Stand {
    fn describe(&self) -> DeviceDescription {
        ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe()
    }
    fn open(&mut self) -> Result<(), DeviceError> {
        self.0.opens.fetch_add(1, Ordering::SeqCst);
        if !self.0.is_gone.load(Ordering::SeqCst) {
            return Ok(());
        }
        Err(self.0.refuses.lock().unwrap().unwrap_or(DeviceError::Disconnected))
    }
    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        self.0.reads.fetch_add(1, Ordering::SeqCst);
        wait_for(|| !self.0.hangs.load(Ordering::SeqCst));
        if self.0.is_gone.load(Ordering::SeqCst) {
            return Err(DeviceError::Disconnected);
        }
        Ok(Reading::at(DVec3::ZERO))
    }
    fn write(&mut self, _: DVec3) -> Result<(), DeviceError> {
        if self.0.is_deaf.load(Ordering::SeqCst) { Err(DeviceError::Disconnected) } else { Ok(()) }
    }
    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        Some(Box::new(Brake(Arc::clone(&self.0))))
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

fn start() -> (HapticHandle, LoopThread, Arc<Seen>) {
    let seen = Arc::new(Seen::default());
    let config = LoopConfig { real_time: RealTimeRequest::NONE, ..LoopConfig::default() };
    let (mut handle, haptic_loop) = haptic_loop(config, settings()).unwrap();
    let thread = haptic_loop.spawn(Box::new(Stand(Arc::clone(&seen)))).unwrap();
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, DVec3::Y);
    handle.publish_model();
    (handle, thread, seen)
}

#[test]
fn a_loop_that_hangs_is_stopped_once_and_starts_anew() {
    let (mut handle, mut thread, seen) = start();
    wait_for(|| seen.reads.load(Ordering::SeqCst) > 50);
    assert_eq!(thread.emergency_stops(), 0);
    seen.hangs.store(true, Ordering::SeqCst);
    wait_for(|| thread.emergency_stops() > 0);
    // It failed once, succeeded, and is left at that.
    let reads = seen.reads.load(Ordering::SeqCst);
    #[expect(clippy::disallowed_methods, reason = "nothing is to happen for a while")]
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!((seen.stops.load(Ordering::SeqCst), thread.emergency_stops()), (2, 1));
    seen.hangs.store(false, Ordering::SeqCst);
    wait_for(|| seen.reads.load(Ordering::SeqCst) > reads + 20);
    assert!(kinds(&mut handle).contains(&LoopEventKind::EmergencyStopped));
    assert!(matches!(thread.stop(), StopOutcome::Joined));
}

#[test]
fn a_device_that_went_away_is_opened_again() {
    let (mut handle, mut thread, seen) = start();
    wait_for(|| seen.reads.load(Ordering::SeqCst) > 50);
    seen.is_gone.store(true, Ordering::SeqCst);
    // Once at the beginning, and tried in vain.
    wait_for(|| seen.opens.load(Ordering::SeqCst) == 2);
    assert!(!kinds(&mut handle).contains(&LoopEventKind::Reconnected));
    seen.is_gone.store(false, Ordering::SeqCst);
    // What can be read again needs no opening; what cannot is opened within half a second.
    let reads = seen.reads.load(Ordering::SeqCst);
    wait_for(|| seen.reads.load(Ordering::SeqCst) > reads + 20);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    let recovered =
        kinds(&mut handle).into_iter().any(|kind| matches!(kind, LoopEventKind::DeviceRecovered(_)));
    assert!(recovered);
}

/// Plugged in again it cannot be opened, for one reason after the other: each is told, and told once.
#[test]
fn why_a_device_that_is_back_cannot_be_opened_is_told() {
    let (mut handle, mut thread, seen) = start();
    wait_for(|| seen.reads.load(Ordering::SeqCst) > 50);
    seen.is_gone.store(true, Ordering::SeqCst);
    let mut told = Vec::new();
    let mut opens = 1;
    for refused in [None, Some(DeviceError::Os(13)), Some(DeviceError::Unavailable("it is two"))] {
        *seen.refuses.lock().unwrap() = refused;
        // Twice each; the first may be that of the reason before.
        opens += 3;
        wait_for(|| seen.opens.load(Ordering::SeqCst) >= opens);
        told.extend(kinds(&mut handle));
    }
    seen.is_gone.store(false, Ordering::SeqCst);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    told.extend(kinds(&mut handle));
    let reasons: Vec<LoopEventKind> =
        told.iter().copied().filter(|kind| matches!(kind, LoopEventKind::ReopenFailed(_))).collect();
    let expected = [DeviceError::Os(13), DeviceError::Unavailable("it is two")];
    assert_eq!(reasons, expected.map(LoopEventKind::ReopenFailed), "{told:?}");
    assert!(reasons.iter().all(LoopEventKind::is_fault));
}

/// It can be read, but it takes no force: the last one would stay for ever.
#[test]
fn a_device_that_takes_no_force_is_stopped_and_opened_again() {
    let (mut handle, mut thread, seen) = start();
    wait_for(|| seen.reads.load(Ordering::SeqCst) > 50);
    seen.is_deaf.store(true, Ordering::SeqCst);
    wait_for(|| thread.emergency_stops() > 0);
    wait_for(|| seen.opens.load(Ordering::SeqCst) > 1);
    seen.is_deaf.store(false, Ordering::SeqCst);
    let mut told = Vec::new();
    wait_for(|| {
        told.extend(kinds(&mut handle));
        told.contains(&LoopEventKind::Reconnected)
    });
    let failed = LoopEventKind::DeviceFailed(DeviceError::Disconnected);
    assert!(told.contains(&failed) && told.contains(&LoopEventKind::EmergencyStopped), "{told:?}");
    assert!(matches!(thread.stop(), StopOutcome::Joined));
}

#[test]
fn a_brake_that_panics_is_not_asked_again_and_the_loop_goes_on() {
    let (_handle, mut thread, seen) = start();
    seen.brake_panics.store(true, Ordering::SeqCst);
    wait_for(|| seen.reads.load(Ordering::SeqCst) > 50);
    seen.hangs.store(true, Ordering::SeqCst);
    #[expect(clippy::disallowed_methods, reason = "the watchdog takes its time")]
    std::thread::sleep(Duration::from_millis(150));
    assert_eq!(thread.emergency_stops(), 0);
    seen.hangs.store(false, Ordering::SeqCst);
    // It watches on.
    seen.brake_panics.store(false, Ordering::SeqCst);
    let reads = seen.reads.load(Ordering::SeqCst);
    wait_for(|| seen.reads.load(Ordering::SeqCst) > reads + 20);
    seen.hangs.store(true, Ordering::SeqCst);
    wait_for(|| thread.emergency_stops() == 1);
    seen.hangs.store(false, Ordering::SeqCst);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
}
