//! The black box of a running loop.

use crate::wait::wait_for;
use glam::DVec3;
use palpate_haptics::*;
use palpate_local::{Contact, ModelId, Scheme};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A loop in lock step with a swinging hand, and a local model of 300 N from tick 100 on.
fn run(ticks: usize) -> HapticHandle {
    let swing = |n: u64, _| Ok(Reading::at(DVec3::X * 0.01 * (n as f64 * 0.013).sin()));
    // Without the start condition and passivity damping.
    let safety = SafetySettings {
        arm_below_n: f64::MAX,
        passivity_damping_ns_per_m: 0.0,
        ..SafetySettings::default()
    };
    let settings = LoopSettings { safety, ..LoopSettings::default() };
    let (mut handle, haptic_loop) = haptic_loop(LoopConfig::default(), settings).unwrap();
    let mut lockstep = Lockstep::new(haptic_loop, Box::new(ScriptedDevice::new(swing))).unwrap();
    lockstep.run(100);
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, DVec3::Y * -300.0);
    model.id = ModelId { body: 7, epoch: 2, sequence: 100 };
    handle.publish_model();
    lockstep.run(ticks - 100);
    handle
}

#[test]
fn black_box_contains_newest_ticks() {
    let mut handle = run(5000);
    let newest = handle.latest_tick().unwrap();
    let black_box = handle.black_box();
    let ticks: Vec<&BlackBoxTick> = black_box.ticks().collect();
    assert_eq!(ticks.len(), BlackBox::CAPACITY);
    assert!(ticks.iter().zip(905..).all(|(tick, sequence)| tick.sequence == sequence));
    assert_eq!(*black_box.newest().unwrap(), BlackBoxTick::of(&newest, 1e-3));
    let last = black_box.newest().unwrap();
    assert_eq!((last.sequence, last.time_s, last.elapsed), (5000, 5.0, 1));
    assert_eq!(last.sample, newest.sample);
    assert_eq!(last.model, Some(ModelId { body: 7, epoch: 2, sequence: 100 }));
    assert_eq!((last.before_n, last.written_n), (newest.rendered.force_n, newest.force_n));
    assert!(last.acted.contains(SafetyAction::Stale) && last.gain == 0.0);
}

#[test]
fn forces_between_stages_match_safety_chain() {
    let mut handle = run(400);
    let mut seen = [false; 3];
    for tick in handle.black_box().ticks().filter(|tick| tick.sequence > 100) {
        let StageForces { gains_n, velocity_guard_n, passivity_n, magnitude_n, slew_n } = tick.after;
        assert_eq!((gains_n, slew_n), (tick.before_n * tick.gain, tick.written_n));
        assert_eq!((velocity_guard_n, passivity_n), (gains_n, gains_n));
        let acted = |action| usize::from(tick.acted.contains(action));
        seen[acted(SafetyAction::Magnitude) + acted(SafetyAction::Slew)] = true;
        match (acted(SafetyAction::Magnitude), acted(SafetyAction::Slew)) {
            (0, 0) => assert_eq!((magnitude_n, tick.written_n), (gains_n, gains_n)),
            (0, _) => assert_eq!(magnitude_n, gains_n),
            _ => assert!((magnitude_n.length() - 20.0).abs() < 1e-12),
        }
    }
    assert_eq!(seen, [true; 3]);
}

/// A loop on a thread, and the number of reads of its device.
fn spawn(
    mut read: impl FnMut(u64) -> Result<Reading, DeviceError> + Send + 'static,
) -> (HapticHandle, LoopThread, Arc<AtomicU64>) {
    let reads = Arc::new(AtomicU64::new(0));
    let counter = reads.clone();
    let device = ScriptedDevice::new(move |n, _| {
        counter.store(n + 1, Ordering::SeqCst);
        read(n)
    });
    let (handle, haptic_loop) = haptic_loop(LoopConfig::default(), LoopSettings::default()).unwrap();
    let thread = haptic_loop.spawn(Box::new(device)).unwrap();
    (handle, thread, reads)
}

/// The app reads the black box 20 times a second, as in a scene; the last read follows the end of the loop.
#[test]
fn black_box_contains_all_ticks_around_device_fault() {
    let (mut handle, mut thread, reads) = spawn(|n| match n {
        150..160 => Err(DeviceError::Disconnected),
        _ => Ok(Reading::at(DVec3::X * n as f64 * 1e-6)),
    });
    let mut next = 0;
    wait_for(|| {
        let done = reads.load(Ordering::SeqCst);
        if done >= next {
            next = done + 50;
            handle.black_box();
        }
        done > 300
    });
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    let ticks: Vec<BlackBoxTick> = handle.black_box().ticks().copied().collect();
    assert_eq!(ticks.len() as u64, handle.report().ticks, "no tick is missing");
    for pair in ticks.windows(2) {
        assert_eq!(pair[1].sequence - pair[1].elapsed, pair[0].sequence);
    }
    let failed: Vec<usize> = (0..ticks.len()).filter(|&i| ticks[i].read_failed.is_some()).collect();
    assert_eq!(failed, (150..160).collect::<Vec<_>>());
    assert!(ticks.iter().all(|tick| tick.timing.cost_ns > 0));
    assert_eq!(ticks[155].sample.unwrap().position_m, ticks[149].sample.unwrap().position_m);
}

#[test]
fn black_box_survives_panic_of_thread() {
    let (mut handle, mut thread, _) = spawn(|n| {
        assert!(n < 600, "a simulated panic of the device");
        Ok(Reading::at(DVec3::ZERO))
    });
    wait_for(|| !thread.is_running());
    assert!(matches!(thread.stop(), StopOutcome::Panicked));
    assert_eq!(handle.black_box().ticks().count(), 600);
}

#[test]
fn black_box_records_failed_write() {
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), LoopSettings::default()).unwrap();
    for written in [Ok(()), Err(DeviceError::Disconnected)] {
        let output = haptic_loop.tick(1, Ok(Reading::at(DVec3::ZERO)));
        haptic_loop.finish_tick(output, None, written);
        assert_eq!(handle.latest_tick().unwrap().written, written);
        assert_eq!(
            handle.black_box().newest().unwrap().write_failed,
            written.err().map(RecordedDeviceError::from)
        );
    }
}
