//! Ticks, in lock step or called one by one.

use glam::{DMat3, DQuat, DVec3};
use palpate_haptics::*;
use palpate_local::*;
use proptest::prelude::*;

/// A device without an effective growth limit.
const DEVICE: DeviceLimits = DeviceLimits { force_n: 20.0, slew_n_per_s: 1e12 };

/// Settings without ramp, growth limit and guards, with records and velocities by backward difference.
fn unguarded() -> LoopSettings {
    let safety = SafetySettings {
        arm_below_n: f64::MAX,
        ramp_s: 0.0,
        max_speed_m_per_s: f64::MAX,
        passivity_damping_ns_per_m: 0.0,
        max_slew_n_per_s: 1e9,
        ..SafetySettings::default()
    };
    LoopSettings {
        safety,
        record: true,
        velocity: VelocityEstimator::BackwardDifference,
        ..Default::default()
    }
}

fn new_loop(settings: LoopSettings) -> (HapticHandle, HapticLoop) {
    haptic_loop(LoopConfig { device: DEVICE, ..LoopConfig::default() }, settings).unwrap()
}

fn publish(handle: &mut HapticHandle, sequence: u64, change: impl FnOnce(&mut LocalModel)) {
    let model = handle.model_slot();
    model.id = ModelId { body: 1, epoch: 0, sequence };
    model.scheme = Scheme::Tangent;
    model.contact = Contact::Held;
    model.force_n = DVec3::ZERO;
    model.position_m = DVec3::ZERO;
    model.velocity_m_per_s = DVec3::ZERO;
    model.stiffness_n_per_m = DMat3::from_diagonal(DVec3::splat(100.0));
    model.damping_ns_per_m = DMat3::ZERO;
    model.reduced.order = 0;
    change(model);
    handle.publish_model();
}

fn tick(haptic_loop: &mut HapticLoop, elapsed: u64, reading: Result<Reading, DeviceError>) -> TickOutput {
    let output = haptic_loop.tick(elapsed, reading);
    haptic_loop.finish_tick(output, None, Ok(()));
    output
}

fn at(x: f64) -> Result<Reading, DeviceError> {
    Ok(Reading::at(DVec3::X * x))
}

fn events(handle: &mut HapticHandle) -> Vec<LoopEventKind> {
    std::iter::from_fn(|| handle.next_event()).map(|e| e.kind).collect()
}

#[test]
fn published_model_renders_force_at_next_tick() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    assert_eq!(tick(&mut haptic_loop, 1, at(0.01)).device_force_n, DVec3::ZERO);
    publish(&mut handle, 1, |_| ());
    let output = tick(&mut haptic_loop, 1, at(0.02));
    assert!((output.device_force_n - DVec3::X * -2.0).length() < 1e-15);
    assert_eq!(output.new_model.unwrap().sequence, 1);
    assert!(matches!(events(&mut handle)[..], [LoopEventKind::ModelAdopted(_)]));
}

#[test]
fn missed_deadlines_are_counted_and_bridged() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.0));
    tick(&mut haptic_loop, 4, at(0.004));
    let samples = handle.samples();
    assert_eq!(samples.len(), 5);
    for sequence in 1..=5 {
        let sample = samples.get(sequence).unwrap();
        assert!((sample.position_m.x - 0.001 * (sequence as f64 - 1.0)).abs() < 1e-15);
        assert!((sample.time_s - sequence as f64 * 1e-3).abs() < 1e-15);
        if sequence > 1 {
            assert!((sample.velocity_m_per_s.x - 1.0).abs() < 1e-9, "the hand did not move faster");
        }
        let between = (2..5).contains(&sequence);
        let expected = if between { SampleOrigin::Interpolated } else { SampleOrigin::Measured };
        assert_eq!(sample.origin, expected);
    }
    assert_eq!(events(&mut handle), [LoopEventKind::DeadlinesMissed(3)]);
}

#[test]
fn long_gap_restarts_sample_history() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.0));
    tick(&mut haptic_loop, MAX_BRIDGED_TICKS + 1, at(0.1));
    assert_eq!(handle.samples().len(), MAX_BRIDGED_TICKS as usize + 2);
    tick(&mut haptic_loop, MAX_BRIDGED_TICKS + 2, at(0.5));
    let samples = handle.samples();
    assert_eq!(samples.len(), 1);
    assert_eq!(samples.newest().unwrap().velocity_m_per_s, DVec3::ZERO);
    let expected =
        [LoopEventKind::DeadlinesMissed(MAX_BRIDGED_TICKS), LoopEventKind::Gap(MAX_BRIDGED_TICKS + 1)];
    assert_eq!(events(&mut handle), expected);
}

#[test]
fn nan_reading_reaches_neither_force_nor_samples() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.01));
    publish(&mut handle, 1, |_| ());
    tick(&mut haptic_loop, 1, at(0.01));
    events(&mut handle);
    for bad in [f64::NAN, f64::INFINITY] {
        let output = tick(&mut haptic_loop, 1, at(bad));
        assert_eq!(output.device_force_n, DVec3::X * -1.0, "the last good sample is repeated");
        let sample = *handle.samples().newest().unwrap();
        assert_eq!((sample.position_m, sample.velocity_m_per_s), (DVec3::X * 0.01, DVec3::ZERO));
        assert_eq!(sample.origin, SampleOrigin::Repeated);
    }
    tick(&mut haptic_loop, 1, at(0.02));
    let sample = *handle.samples().newest().unwrap();
    assert_eq!(sample.velocity_m_per_s, DVec3::ZERO, "the motion without readings gives no velocity");
    let expected = [LoopEventKind::DeviceFailed(DeviceError::Unusable), LoopEventKind::DeviceRecovered(2)];
    assert_eq!(events(&mut handle), expected);
}

#[test]
fn rejects_reading_out_of_bounds_without_effect_on_samples() {
    let frame = DeviceFrame { scale: 10.0, ..DeviceFrame::default() };
    let settings = LoopSettings { velocity: VelocityEstimator::default(), frame, ..unguarded() };
    let (mut handle, mut haptic_loop) = new_loop(settings);
    for x in [0.0, 1e306, 101.0, -1e5, 0.0, 0.0] {
        tick(&mut haptic_loop, 1, at(x));
        let sample = handle.samples().newest().unwrap();
        assert_eq!((sample.position_m, sample.velocity_m_per_s), (DVec3::ZERO, DVec3::ZERO), "{x}");
    }
    let expected = [LoopEventKind::DeviceFailed(DeviceError::Unusable), LoopEventKind::DeviceRecovered(3)];
    assert_eq!(events(&mut handle), expected);
}

#[test]
fn jump_of_tool_has_zero_velocity() {
    // A device that recovers together with a missed deadline.
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.0));
    for _ in 0..5 {
        tick(&mut haptic_loop, 1, Err(DeviceError::TimedOut));
    }
    tick(&mut haptic_loop, 3, at(0.05));
    let samples = handle.samples();
    for sequence in 1..=9 {
        assert_eq!(samples.get(sequence).unwrap().velocity_m_per_s, DVec3::ZERO, "{sequence}");
    }
    assert_eq!(samples.get(8).unwrap().position_m, DVec3::ZERO);
    assert_eq!(samples.get(9).unwrap().position_m, DVec3::X * 0.05);
    // Another frame.
    let frame = DeviceFrame { offset_m: DVec3::Y * 0.1, ..DeviceFrame::default() };
    handle.set_settings(LoopSettings { frame, ..unguarded() }).unwrap();
    tick(&mut haptic_loop, 2, at(0.05));
    let sample = *handle.samples().newest().unwrap();
    assert_eq!((sample.position_m.y, sample.velocity_m_per_s), (0.1, DVec3::ZERO));
}

#[test]
fn accepts_any_number_of_elapsed_periods() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    for elapsed in [u64::MAX, u64::MAX / 2, 0, u64::MAX] {
        assert!(tick(&mut haptic_loop, elapsed, at(0.0)).device_force_n.is_finite());
    }
    publish(&mut handle, 1, |m| m.reduced.order = usize::MAX);
    tick(&mut haptic_loop, 1, at(0.0));
    assert!(
        events(&mut handle)
            .iter()
            .any(|e| matches!(e, LoopEventKind::ModelRejected(LocalModelError::Order { .. })))
    );
}

#[test]
fn selecting_another_body_drops_previous_model_at_once() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.01));
    publish(&mut handle, 1, |_| ());
    assert_eq!(tick(&mut haptic_loop, 1, at(0.01)).device_force_n, DVec3::X * -1.0);
    handle.set_settings(LoopSettings { body: Some(2), ..unguarded() }).unwrap();
    assert_eq!(tick(&mut haptic_loop, 1, at(0.01)).device_force_n, DVec3::ZERO);
    handle.set_settings(LoopSettings { body: Some(3), ..unguarded() }).unwrap();
    publish(&mut handle, 3, |m| m.id.body = 3);
    assert_eq!(tick(&mut haptic_loop, 1, at(0.01)).device_force_n, DVec3::X * -1.0);
    assert!(!events(&mut handle).iter().any(LoopEventKind::is_fault));
}

#[test]
fn blocking_read_counts_as_silence_for_its_duration() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.01));
    publish(&mut handle, 1, |_| ());
    tick(&mut haptic_loop, 1, at(0.01));
    let force = tick(&mut haptic_loop, 50, Err(DeviceError::TimedOut)).device_force_n.x;
    assert!((force + 0.5).abs() < 1e-9, "silent for 50 ms: half of the fade has passed, {force} N");
}

#[test]
fn persistent_write_failure_emits_one_event() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    for _ in 0..128 {
        let output = haptic_loop.tick(1, at(0.0));
        haptic_loop.finish_tick(output, None, Err(DeviceError::Disconnected));
    }
    assert_eq!(events(&mut handle), [LoopEventKind::DeviceFailed(DeviceError::Disconnected)]);
    assert_eq!((handle.report().device_errors, handle.report().dropped_events), (128, 0));
}

#[test]
fn failed_writes_do_not_count_for_growth() {
    let safety = SafetySettings { max_slew_n_per_s: 100.0, ..unguarded().safety };
    let (mut handle, mut haptic_loop) = new_loop(LoopSettings { safety, ..unguarded() });
    tick(&mut haptic_loop, 1, at(0.01));
    publish(&mut handle, 1, |_| ());
    for _ in 0..15 {
        let output = haptic_loop.tick(1, at(0.01));
        assert!((output.device_force_n.x + 0.1).abs() < 1e-12);
        haptic_loop.finish_tick(output, None, Err(DeviceError::TimedOut));
    }
    for n in 1..=5 {
        let force = tick(&mut haptic_loop, 1, at(0.01)).device_force_n.x;
        assert!((force + 0.1 * f64::from(n)).abs() < 1e-12, "{force}");
    }
    // After more failed writes the device counts as silent.
    let mut forces = Vec::new();
    for _ in 0..130 {
        let output = haptic_loop.tick(1, at(0.01));
        haptic_loop.finish_tick(output, None, Err(DeviceError::TimedOut));
        forces.push(output.device_force_n.x);
    }
    assert!(forces[20] < -0.5 && forces[121..].iter().all(|force| *force == 0.0), "{forces:?}");
}

#[test]
fn rotated_frame_limits_growth_in_device_direction() {
    let safety = SafetySettings { max_slew_n_per_s: 100.0, ..unguarded().safety };
    let (mut handle, mut haptic_loop) = new_loop(LoopSettings { safety, ..unguarded() });
    tick(&mut haptic_loop, 1, at(0.01));
    publish(&mut handle, 1, |model| (model.scheme, model.force_n) = (Scheme::Hold, DVec3::X));
    for _ in 0..20 {
        tick(&mut haptic_loop, 1, at(0.01));
    }
    let rotation = DQuat::from_rotation_z(std::f64::consts::PI);
    let frame = DeviceFrame { rotation, ..DeviceFrame::default() };
    handle.set_settings(LoopSettings { safety, frame, ..unguarded() }).unwrap();
    for n in 1..=3 {
        let force = tick(&mut haptic_loop, 1, at(0.01)).device_force_n;
        assert!((force + DVec3::X * 0.1 * f64::from(n)).length() < 1e-9, "{force}");
    }
}

#[test]
fn non_finite_force_emits_one_event() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.01));
    // All its numbers are finite, but their product is not.
    publish(&mut handle, 1, |model| model.stiffness_n_per_m = DMat3::from_diagonal(DVec3::splat(f64::MAX)));
    for _ in 0..10 {
        tick(&mut haptic_loop, 1, at(0.9));
        assert_eq!(tick(&mut haptic_loop, 1, at(0.9)).device_force_n, DVec3::ZERO);
    }
    let events = events(&mut handle);
    assert_eq!(events.iter().filter(|kind| **kind == LoopEventKind::ForceNotFinite).count(), 1);
}

#[test]
fn repeated_readings_count_as_silence_after_ten_ticks() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    let numbered = |n: u64| Ok(Reading { sequence: Some(n), ..Reading::at(DVec3::X * 0.01) });
    tick(&mut haptic_loop, 1, numbered(1));
    publish(&mut handle, 1, |_| ());
    let forces: Vec<f64> =
        (0..140).map(|_| tick(&mut haptic_loop, 1, numbered(1)).device_force_n.x).collect();
    assert!(forces[29] == -1.0 && forces[30] > -1.0 && forces[131] == 0.0, "ten ticks, twenty, and the fade");
    tick(&mut haptic_loop, 1, numbered(0));
    tick(&mut haptic_loop, 1, numbered(2));
    let events = events(&mut handle);
    assert!(events.contains(&LoopEventKind::DeviceFailed(DeviceError::Repeated)), "{events:?}");
    assert_eq!(events.last(), Some(&LoopEventKind::DeviceRecovered(131)));
}

#[test]
fn nan_as_first_reading_gives_no_sample() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    assert_eq!(tick(&mut haptic_loop, 1, at(f64::NAN)).device_force_n, DVec3::ZERO);
    assert!(handle.samples().is_empty());
}

#[test]
fn force_fades_to_zero_without_readings() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.01));
    publish(&mut handle, 1, |_| ());
    let forces: Vec<f64> =
        (0..140).map(|_| tick(&mut haptic_loop, 1, Err(DeviceError::TimedOut)).device_force_n.x).collect();
    assert_eq!(forces[19], -1.0);
    assert!(forces[20] > -1.0 && forces[69] > -0.51 && forces[69] < -0.49, "{}", forces[69]);
    assert_eq!(forces[125], 0.0);
}

#[test]
fn rejects_local_model_with_nan_or_of_another_body() {
    let settings = LoopSettings { body: Some(1), ..unguarded() };
    let (mut handle, mut haptic_loop) = new_loop(settings);
    tick(&mut haptic_loop, 1, at(0.01));
    publish(&mut handle, 1, |_| ());
    tick(&mut haptic_loop, 1, at(0.01));
    events(&mut handle);
    publish(&mut handle, 2, |m| m.force_n.y = f64::NAN);
    assert_eq!(tick(&mut haptic_loop, 1, at(0.01)).device_force_n, DVec3::X * -1.0);
    publish(&mut handle, 3, |m| m.id.body = 9);
    assert_eq!(tick(&mut haptic_loop, 1, at(0.01)).device_force_n, DVec3::X * -1.0);
    let expected = [
        LoopEventKind::ModelRejected(LocalModelError::NotFinite { what: "force" }),
        LoopEventKind::WrongBody(ModelId { body: 9, epoch: 0, sequence: 3 }),
    ];
    assert_eq!(events(&mut handle), expected);
}

#[test]
fn force_fades_after_three_model_periods_without_model() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.01));
    publish(&mut handle, 1, |_| ());
    let forces: Vec<f64> = (0..260).map(|_| tick(&mut haptic_loop, 1, at(0.01)).device_force_n.x).collect();
    // forces[i] is of sample i + 2, so the model is 150 ticks old at i = 149.
    assert_eq!(forces[149], -1.0);
    assert!(forces[150] > -1.0);
    assert_eq!(forces[251], 0.0);
}

#[test]
fn settings_apply_at_next_tick_and_are_acknowledged() {
    let (mut handle, mut haptic_loop) = new_loop(unguarded());
    tick(&mut haptic_loop, 1, at(0.01));
    let frame = DeviceFrame {
        rotation: DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
        scale: 2.0,
        offset_m: DVec3::Z,
    };
    assert_eq!(handle.set_settings(LoopSettings { frame, ..unguarded() }).unwrap(), 1);
    publish(&mut handle, 1, |m| m.position_m = DVec3::Z);
    let output = tick(&mut haptic_loop, 1, at(0.01));
    let sample = output.sample.unwrap();
    assert!((sample.position_m - DVec3::new(0.0, 0.02, 1.0)).length() < 1e-15);
    assert!((output.force_n - DVec3::Y * -2.0).length() < 1e-12);
    assert!((output.device_force_n - DVec3::X * -2.0).length() < 1e-12);
    assert_eq!(output.settings.unwrap().0, 1);
    assert!(events(&mut handle).contains(&LoopEventKind::SettingsAdopted(1)));
}

#[test]
fn rejects_invalid_settings_and_keeps_previous() {
    let (mut handle, _haptic_loop) = new_loop(unguarded());
    let mut bad = unguarded();
    bad.model_period_s = 0.0;
    let error = handle.set_settings(bad).unwrap_err();
    assert!(matches!(error, HapticsError::Setting { value: 0.0, .. }), "{error}");
    assert_eq!(
        error.to_string(),
        "time between two model steps (model_period_s), s is 0; it must be finite and above 0"
    );
    bad = unguarded();
    bad.frame.scale = f64::NAN;
    assert!(handle.set_settings(bad).is_err());
    assert_eq!(*handle.settings(), unguarded());
    for config in [
        LoopConfig { device: DeviceLimits::of_force(f64::NAN), ..LoopConfig::default() },
        LoopConfig { event_capacity: 0, ..LoopConfig::default() },
        LoopConfig { event_capacity: usize::MAX, ..LoopConfig::default() },
        LoopConfig { record_capacity: usize::MAX, ..LoopConfig::default() },
        LoopConfig {
            hand_over: HandOverSettings { capacity: Capacity::of_order(usize::MAX), ..Default::default() },
            ..Default::default()
        },
        LoopConfig {
            hand_over: HandOverSettings { tick_s: 1e-10, ..Default::default() },
            ..Default::default()
        },
        LoopConfig {
            hand_over: HandOverSettings { tick_s: 1e300, ..Default::default() },
            ..Default::default()
        },
        LoopConfig { record_capacity: 0, ..LoopConfig::default() },
        LoopConfig {
            hand_over: HandOverSettings { history: 511, ..Default::default() },
            ..Default::default()
        },
        LoopConfig {
            hand_over: HandOverSettings { tick_s: -1.0, ..Default::default() },
            ..Default::default()
        },
    ] {
        assert!(haptic_loop(config, unguarded()).is_err(), "{config:?}");
    }
}

#[test]
fn full_queues_drop_and_count() {
    let config = LoopConfig { event_capacity: 2, record_capacity: 3, ..LoopConfig::default() };
    let (mut handle, mut haptic_loop) = haptic_loop(config, unguarded()).unwrap();
    for _ in 0..64 {
        tick(&mut haptic_loop, 2, at(0.0));
    }
    let report = handle.report();
    assert_eq!((report.ticks, report.missed_deadlines), (64, 64));
    assert_eq!((report.dropped_events, report.dropped_records), (62, 61));
}

#[test]
fn lockstep_leaves_device_at_zero_force() {
    let last = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    struct Witness(std::sync::Arc<std::sync::Mutex<Vec<&'static str>>>);
    impl HapticDevice for Witness {
        fn describe(&self) -> DeviceDescription {
            ScriptedDevice::new(|_, _| Err(DeviceError::TimedOut)).describe()
        }
        fn open(&mut self) -> Result<(), DeviceError> {
            Ok(())
        }
        fn read(&mut self, _: std::time::Duration) -> Result<Reading, DeviceError> {
            Ok(Reading::at(DVec3::X * 0.01))
        }
        fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
            self.0.lock().unwrap().push(if force_n == DVec3::ZERO { "zero" } else { "force" });
            Ok(())
        }
        fn close(&mut self) -> Result<(), DeviceError> {
            self.0.lock().unwrap().push("closed");
            Ok(())
        }
    }
    let (mut handle, haptic_loop) = new_loop(unguarded());
    let mut lockstep = Lockstep::new(haptic_loop, Box::new(Witness(last.clone()))).unwrap();
    lockstep.run(1);
    publish(&mut handle, 1, |_| ());
    lockstep.run(1);
    drop(lockstep);
    assert_eq!(*last.lock().unwrap(), ["zero", "force", "zero", "closed"]);
    assert_eq!(events(&mut handle).last(), Some(&LoopEventKind::Stopped));
    assert!(handle.report().ended);
}

proptest! {
    /// For any input of device and model side, the written force is finite, within its limit, and grows slowly.
    #[test]
    fn force_is_safe_for_any_input(
        inputs in prop::collection::vec((1u64..300, any::<[f64; 3]>(), 0u8..6, any::<[f64; 3]>()), 1..60),
    ) {
        let settings = LoopSettings { velocity: VelocityEstimator::default(), ..LoopSettings::default() };
        let (mut handle, mut haptic_loop) = new_loop(settings);
        let (mut sequence, mut last) = (0, DVec3::ZERO);
        for (elapsed, position, kind, force) in inputs {
            if kind % 2 == 0 {
                let scheme = Scheme::ALL[usize::from(kind / 2)];
                publish(&mut handle, sequence, |m| (m.scheme, m.force_n) = (scheme, DVec3::from_array(force)));
            }
            let reading = if kind == 5 { Err(DeviceError::TimedOut) } else { Ok(Reading::at(DVec3::from_array(position))) };
            let out = tick(&mut haptic_loop, elapsed, reading).force_n;
            sequence += elapsed;
            prop_assert!(out.is_finite() && out.length() <= 20.0 * (1.0 + 1e-12), "{out}");
            if let Some(s) = handle.samples().newest() {
                prop_assert!(s.position_m.is_finite() && s.velocity_m_per_s.is_finite(), "{s:?}");
            }
            let present = if out.length() == 0.0 { 0.0 } else { last.dot(out).max(0.0) / out.length() };
            prop_assert!(out.length() <= present + 0.5 * elapsed.min(4) as f64 + 1e-9, "{last} to {out}");
            last = out;
        }
    }
}
