//! The loop with a bridged device: the forces applied by the peer are those written by the loop. No test depends on measured times.

#[path = "shared/bridge.rs"]
mod ends;
#[path = "shared/wait.rs"]
mod wait;

use ends::*;
use glam::{DMat3, DVec3};
use palpate_haptics::bridge::packet::*;
use palpate_haptics::bridge::*;
use palpate_haptics::*;
use palpate_local::{Contact, ModelId, Scheme};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use wait::wait_for;

const TICK: Duration = Duration::from_millis(1);
/// Stiffness of the rendered body, N/m.
const STIFFNESS: f64 = 100.0;

/// A hand of 0.1 kg on a spring of 200 N/m that pulls it to 20 mm from the body's rest.
#[derive(Clone, Debug, Default)]
struct SpringHand {
    x: f64,
    v: f64,
    force_n: DVec3,
}

impl HapticDevice for SpringHand {
    fn describe(&self) -> DeviceDescription {
        ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe()
    }
    fn open(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        self.v += 1e-3 * (200.0 * (0.02 - self.x) - 5.0 * self.v + self.force_n.x) / 0.1;
        self.x += 1e-3 * self.v;
        Ok(Reading::at(DVec3::new(self.x, 0.01 * self.x, 0.0)))
    }
    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        self.force_n = force_n;
        Ok(())
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// A loop that renders a spring without ramp or fade, and records every tick.
fn spring_loop() -> (HapticHandle, HapticLoop) {
    let safety = SafetySettings { arm_below_n: f64::MAX, ramp_s: 0.0, ..SafetySettings::default() };
    let settings = LoopSettings { safety, record: true, model_period_s: 1e3, ..LoopSettings::default() };
    let config =
        LoopConfig { real_time: RealTimeRequest::NONE, record_capacity: 100_000, ..LoopConfig::default() };
    let (mut handle, haptic_loop) = haptic_loop(config, settings).unwrap();
    let model = handle.model_slot();
    model.id = ModelId { body: 1, epoch: 0, sequence: 0 };
    (model.scheme, model.contact, model.force_n) = (Scheme::Tangent, Contact::Held, DVec3::ZERO);
    (model.position_m, model.velocity_m_per_s) = (DVec3::ZERO, DVec3::ZERO);
    model.stiffness_n_per_m = DMat3::from_diagonal(DVec3::splat(STIFFNESS));
    handle.publish_model();
    (handle, haptic_loop)
}

fn bind(device: impl HapticDevice + 'static, watchdog: Duration) -> BridgePeer {
    let settings = PeerSettings { address: any_port(), watchdog, ..PeerSettings::default() };
    BridgePeer::bind(settings, Box::new(device)).unwrap()
}

/// Forces written successfully, in order.
fn written(handle: &mut HapticHandle) -> Vec<DVec3> {
    let records = std::iter::from_fn(|| handle.next_record());
    records.filter(|record| record.written.is_ok()).map(|record| record.force_n).collect()
}

/// A bridge between loop and hand changes no bit of forces or motion.
#[test]
fn lockstep_over_bridge_is_bit_identical() {
    let (mut direct, haptic_loop) = spring_loop();
    let mut lockstep = Lockstep::new(haptic_loop, Box::new(SpringHand::default())).unwrap();
    lockstep.run(2000);
    let expected = written(&mut direct);

    let mut peer = bind(SpringHand::default(), TICK);
    let settings = patient(peer.address());
    let device = while_serving(&mut peer, || BridgeDevice::find(settings)).unwrap();
    let (mut bridged, haptic_loop) = spring_loop();
    let mut lockstep = while_serving(&mut peer, || Lockstep::new(haptic_loop, Box::new(device))).unwrap();
    let mut applied = Vec::new();
    for tick in 0..2000 {
        // The peer's clock stands still; nothing depends on real time.
        wait_for(|| tick == 0 || peer.receive(Duration::ZERO));
        peer.reply();
        applied.push(peer.force_n());
        lockstep.run(1);
    }
    assert_eq!(written(&mut bridged), expected);
    assert_eq!(applied[1..], expected[..1999]);
    let counts = lockstep.device().monitor().counts();
    assert_eq!((counts.accepted, counts.lost, counts.skipped), (2000, 0, 0));
    // The hand rests between both springs.
    let rest = 0.02 * 200.0 / (200.0 + STIFFNESS);
    assert!((applied[1999].x + STIFFNESS * rest).abs() < 1e-3, "{}", applied[1999]);
}

/// The loop on its own thread, the peer on another, each at its own pace: force number n at the peer is the nth that was written.
#[test]
fn threaded_peer_applies_the_written_forces() {
    let mut peer = bind(SpringHand::default(), TICK);
    let settings = patient(peer.address());
    let mut device = while_serving(&mut peer, || BridgeDevice::find(settings)).unwrap();
    let monitor = device.monitor();
    let (mut handle, haptic_loop) = spring_loop();
    let (stop, is_over) = (AtomicBool::new(false), AtomicBool::new(false));
    let mut applied = Vec::new();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            run(haptic_loop, &mut device, &stop);
            is_over.store(true, Ordering::SeqCst);
        });
        // About a thousand times a second, with a clock that never lets the watchdog expire.
        #[expect(clippy::disallowed_methods, reason = "the peer runs at its own rate")]
        while !is_over.load(Ordering::SeqCst) {
            std::thread::sleep(TICK);
            peer.receive(Duration::ZERO);
            peer.reply();
            if peer.forces_written() > 0 {
                applied.push((peer.forces_written(), peer.force_n()));
            }
            if applied.len() == 1500 {
                stop.store(true, Ordering::SeqCst);
            }
        }
    });
    assert_eq!((peer.session(), peer.force_n()), (None, DVec3::ZERO), "the loop has closed its device");
    let written = written(&mut handle);
    for (number, force_n) in &applied {
        assert_eq!(*force_n, written[*number as usize - 1], "{number}");
    }
    assert!(applied.is_sorted_by_key(|(number, _)| *number));
    let last = applied[1499].1;
    assert!((last.x + STIFFNESS * 0.02 * 2.0 / 3.0).abs() < 0.01, "{last}");
    let counts = monitor.counts();
    assert!(counts.accepted > 100 && counts.corrupt + counts.foreign + counts.late == 0, "{counts:?}");
}

fn kinds(handle: &mut HapticHandle) -> Vec<LoopEventKind> {
    std::iter::from_fn(|| handle.next_event()).map(|event| event.kind).collect()
}

#[test]
fn restarted_peer_is_reconnected_with_ramp() {
    let watchdog = Duration::from_secs(1);
    let hand = TestDevice::new();
    let peer = hand.peer(watchdog);
    let address = peer.address();
    let stop = Arc::new(AtomicBool::new(false));
    let runs = |mut peer: BridgePeer, stop: &Arc<AtomicBool>| {
        let stop = Arc::clone(stop);
        std::thread::spawn(move || peer.run(&stop))
    };
    let first = runs(peer, &stop);
    let device = BridgeDevice::find(patient(address)).unwrap();
    let monitor = device.monitor();
    let config = LoopConfig { real_time: RealTimeRequest::NONE, ..LoopConfig::default() };
    let settings = LoopSettings { model_period_s: 1e3, ..LoopSettings::default() };
    let (mut handle, haptic_loop) = haptic_loop(config, settings).unwrap();
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, 0.4 * DVec3::Y);
    handle.publish_model();
    let mut thread = haptic_loop.spawn(Box::new(device)).unwrap();
    wait_for(|| hand.force_n() == 0.4 * DVec3::Y);
    // The peer ends during a touch, and a new one starts on the same port without its state.
    stop.store(true, Ordering::SeqCst);
    first.join().unwrap();
    assert_eq!(hand.force_n(), DVec3::ZERO);
    let again = TestDevice::new();
    let stop = Arc::new(AtomicBool::new(false));
    let settings = PeerSettings { address, watchdog, ..PeerSettings::default() };
    let second = runs(BridgePeer::bind(settings, Box::new(again.clone())).unwrap(), &stop);
    wait_for(|| again.force_n() == 0.4 * DVec3::Y);
    // The force starts again with the ramp.
    let forces = again.hand.lock().unwrap().forces.clone();
    let first_n = forces.iter().find(|force_n| **force_n != DVec3::ZERO).unwrap();
    assert!(first_n.y < 0.2, "{first_n}");
    let events = kinds(&mut handle);
    let position = |kind| events.iter().position(|event| *event == kind);
    let failed = position(LoopEventKind::DeviceFailed(DeviceError::Disconnected));
    assert!(failed.is_some() && failed < position(LoopEventKind::Reconnected), "{events:?}");
    assert!(monitor.counts().sessions >= 2);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    wait_for(|| again.force_n() == DVec3::ZERO);
    stop.store(true, Ordering::SeqCst);
    second.join().unwrap();
}

/// The loop's watchdog sends zero force over the bridge, independently of the peer's watchdog.
#[test]
fn watchdog_of_blocked_loop_sets_zero_force_at_peer() {
    /// A device that blocks in `read` while the flag is set.
    struct Hanging(BridgeDevice, Arc<AtomicBool>);
    impl HapticDevice for Hanging {
        fn describe(&self) -> DeviceDescription {
            self.0.describe()
        }
        fn open(&mut self) -> Result<(), DeviceError> {
            self.0.open()
        }
        fn read(&mut self, within: Duration) -> Result<Reading, DeviceError> {
            wait_for(|| !self.1.load(Ordering::SeqCst));
            self.0.read(within)
        }
        fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
            self.0.write(force_n)
        }
        fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
            self.0.emergency_stop()
        }
        fn close(&mut self) -> Result<(), DeviceError> {
            self.0.close()
        }
    }
    let hand = TestDevice::new();
    // The peer's clock stands still: only the loop's watchdog can act.
    let mut peer = hand.peer(TICK);
    let settings = patient(peer.address());
    let device = while_serving(&mut peer, || BridgeDevice::find(settings)).unwrap();
    let hangs = Arc::new(AtomicBool::new(false));
    let (mut handle, haptic_loop) = spring_loop();
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, DVec3::Y);
    handle.publish_model();
    let mut thread = haptic_loop.spawn(Box::new(Hanging(device, Arc::clone(&hangs)))).unwrap();
    let mut advance_until = |done: &dyn Fn() -> bool| {
        wait_for(|| {
            peer.advance(Duration::ZERO);
            done()
        });
    };
    advance_until(&|| hand.force_n() == DVec3::Y);
    hangs.store(true, Ordering::SeqCst);
    advance_until(&|| hand.force_n() == DVec3::ZERO && thread.emergency_stops() > 0);
    // The session continues.
    hangs.store(false, Ordering::SeqCst);
    advance_until(&|| hand.force_n() == DVec3::Y);
    assert_eq!(peer.monitor().counts().sessions, 1);
    assert!(matches!(thread.stop(), StopOutcome::Joined));
}

/// Covers read and write, packets of strangers, and the peer's cycle.
#[test]
fn neither_end_allocates() {
    let mut peer = bind(SpringHand::default(), Duration::from_secs(1));
    let settings = BridgeSettings { silent_after: TICK, ..patient(peer.address()) };
    let mut device = while_serving(&mut peer, || BridgeDevice::find(settings)).unwrap();
    while_serving(&mut peer, || device.open()).unwrap();
    let mut at_peer = None;
    let readings = AtomicU64::new(0);
    let of_device = |within: Duration, device: &mut BridgeDevice, ticks: usize| {
        allocation_counter::measure(|| {
            for _ in 0..ticks {
                readings.fetch_add(u64::from(device.read(within).is_ok()), Ordering::SeqCst);
                let _ = device.write(DVec3::X);
                let _ = device.write(DVec3::NAN);
            }
        })
    };
    let stranger = ManualEnd::new(peer.address());
    let mut allocations = Vec::new();
    for _ in 0..200 {
        stranger.send(1, Body::Force(DVec3::Z));
        stranger.send_bytes(b"nonsense");
        let cycle = allocation_counter::measure(|| peer.advance(Duration::ZERO));
        at_peer = at_peer.max(Some(cycle.count_total));
        allocations.push(of_device(TICK, &mut device, 1).count_total);
    }
    assert!(readings.load(Ordering::SeqCst) > 0);
    // Also after the timeout and the end of the session.
    allocations.push(of_device(TICK, &mut device, 20).count_total);
    assert_eq!(device.read(TICK), Err(DeviceError::Disconnected));
    assert_eq!((allocations.iter().max(), at_peer), (Some(&0), Some(0)));
}

/// Covers the whole loop with reports and records.
#[test]
fn loop_with_bridged_device_neither_allocates_nor_frees() {
    let peer = bind(SpringHand::default(), Duration::from_secs(1));
    let address = peer.address();
    let (serving, stop) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let (of_peer, peer) = (Arc::clone(&serving), Mutex::new(peer));
    let served = std::thread::spawn(move || peer.lock().unwrap().run(&of_peer));
    let mut device = BridgeDevice::find(patient(address)).unwrap();
    let monitor = device.monitor();
    let (_handle, haptic_loop) = spring_loop();
    let flag = Arc::clone(&stop);
    let stopper = std::thread::spawn(move || {
        wait_for(|| monitor.counts().accepted > 300);
        flag.store(true, Ordering::SeqCst);
    });
    let mut ended = None;
    let allocations = allocation_counter::measure(|| ended = Some(run(haptic_loop, &mut device, &stop)));
    stopper.join().unwrap();
    serving.store(true, Ordering::SeqCst);
    served.join().unwrap();
    assert_eq!((allocations.count_total, allocations.count_current), (0, 0), "{allocations:?}");
}
