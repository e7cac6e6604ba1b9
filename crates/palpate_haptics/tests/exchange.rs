//! The exchange at full speed through the public API: no data is torn in either direction. The test of every single field of a
//! local model needs private access and is in `src/exchange/tests.rs`.

use glam::{DQuat, DVec3};
use palpate_haptics::*;
use palpate_laws::{Spring, ToolShape};
use palpate_local::{
    Capacity, Contact, HandOverSettings, LocalModel, ModelId, NearEnd, NearFieldCapacity, NearPoint,
    NearSpring, NearTriangle, Sample, SampleOrigin, Scheme, Support, TickIntegrator,
};
use std::sync::atomic::{AtomicBool, Ordering};

const CAPACITY: Capacity = Capacity {
    order: 6,
    near: NearFieldCapacity {
        nodes: 3,
        order: 6,
        ring: 3,
        springs: 6,
        hexahedra: 8,
        domains: 0,
        domain_nodes: 0,
        points: 3,
        triangles: 1,
    },
    second: NearFieldCapacity::NONE,
};
const TICK_S: f64 = 1e-3;
const TICKS: u64 = if cfg!(miri) { 60 } else { 200_000 };
/// Number of models to be received.
const TAKEN: u64 = if cfg!(miri) { 20 } else { 20_000 };

/// Ends the other thread even if this one unwinds; otherwise the scope would never end.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

fn config() -> LoopConfig {
    let hand_over = HandOverSettings { capacity: CAPACITY, ..HandOverSettings::default() };
    LoopConfig { hand_over, record_capacity: 64, event_capacity: 64, ..LoopConfig::default() }
}

/// Settings that reveal tearing: every number follows from `number`.
fn settings(number: u64) -> LoopSettings {
    let value = 1.0 + (number % 1000) as f64 * 1e-3;
    LoopSettings {
        safety: SafetySettings {
            arm_below_n: f64::MAX,
            ramp_s: 0.0,
            max_speed_m_per_s: 1e3 * value,
            passivity_damping_ns_per_m: value,
            passivity_tolerance_j: value,
            stale_after_periods: 1e6 * value,
            fade_s: value,
            max_force_n: 10.0 * value,
            max_slew_n_per_s: 1e5 * value,
            device_timeout_ticks: number,
        },
        velocity: VelocityEstimator::BackwardDifference,
        model_period_s: value,
        record: true,
        ..LoopSettings::default()
    }
}

/// A value from 1 to 2, different for every model.
fn value(number: u64) -> f64 {
    1.0 + (number.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 / (1_u64 << 24) as f64
}

/// A triangle on springs that the hand touches, and a far field. All sizes and numbers depend on the model's number.
fn write(id: ModelId, model: &mut LocalModel) {
    let (number, v) = (id.body, value(id.body));
    (model.id, model.scheme, model.contact) = (id, Scheme::NearFieldExact, Contact::Held);
    (model.force_n, model.position_m, model.velocity_m_per_s) = (DVec3::splat(v), DVec3::ZERO, DVec3::ZERO);
    let field = &mut model.near;
    field.clear();
    let p = (number % 7) as usize;
    let ring = 1 + (number % 3) as usize;
    (field.nodes, field.order, field.ring) = (3, p, ring);
    (field.springs, field.points, field.triangles) = (3 + ring, 3, 1);
    field.support = Support::Touched { shape: ToolShape::Sphere { radius_m: 0.005 * v }, friction: 0.2 * v };
    let places = [DVec3::ZERO, DVec3::X * 0.02, DVec3::Y * 0.02].map(|x| x * v - DVec3::splat(0.004));
    let spring = Spring::linear(60.0 * v, 0.02, 0.1 * v).unwrap();
    for (i, x) in places.into_iter().enumerate() {
        (field.node_m[i], field.node_per_kg[i]) = (x, 100.0 * v);
        field.near[i] = NearSpring { a: i, b: NearEnd::Fixed(x - DVec3::Z * 0.02), spring };
    }
    for (i, place) in places.into_iter().enumerate().take(ring) {
        field.ring_m[i] = place + DVec3::new(0.0, 0.005, -0.02) * v;
        field.near[3 + i] = NearSpring { a: i, b: NearEnd::Ring(i), spring };
    }
    field.basis[..3 * ring * p].fill(0.3 * v);
    field.stiffness[..p * p].fill(0.0);
    field.damping[..p * p].fill(0.0);
    for i in 0..p {
        (field.stiffness[i * p + i], field.damping[i * p + i]) = (1e3 * v, 5.0 * v);
    }
    field.force[..9 + p].fill(1e-2 * v);
    field.velocity[..9 + p].fill(1e-3 * v);
    field.point.copy_from_slice(&[0, 1, 2].map(NearPoint::node));
    field.triangle[0] = NearTriangle {
        points: [0, 1, 2],
        rest_normal: DVec3::Z * v,
        is_reachable: number % 2 == 0,
        ..NearTriangle::default()
    };
    (field.tick_s, field.start_m, field.proxy_m) = (TICK_S, DVec3::ZERO, DVec3::ZERO);
    field.integrator = TickIntegrator::Explicit { substeps: 1 + (number % 4) as u32 };
}

/// The device's reading at tick `sequence`.
fn reading(sequence: u64) -> Reading {
    let t = sequence as f64 * TICK_S;
    let position_m = DVec3::new((3.0 * t).sin(), (5.0 * t).sin(), (7.0 * t).sin()) * 1e-3;
    let orientation = DQuat::from_rotation_z(t % 1.0);
    Reading { orientation, buttons: sequence as u32, ..Reading::at(position_m) }
}

/// A second loop receives regenerated copies of the models and settings that the first one reports, and gives the same bits at every
/// tick.
#[test]
fn models_and_settings_are_not_torn_at_full_speed() {
    let (mut handle, mut haptic_loop) = haptic_loop(config(), settings(0)).unwrap();
    let (mut twin_handle, mut twin) = palpate_haptics::haptic_loop(config(), settings(0)).unwrap();
    let is_done = AtomicBool::new(false);
    let (mut taken, mut adopted, mut changed, mut nonzero) = (0_u64, 0_u64, 0_u64, 0_u64);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut number = 0;
            while !is_done.load(Ordering::Acquire) {
                number += 1;
                // The newest sample, to keep the catch-up short.
                let sequence = handle.samples().newest().map_or(0, |sample| sample.sequence);
                write(ModelId { body: number, epoch: 3 * number, sequence }, handle.model_slot());
                handle.publish_model();
                assert_eq!(handle.set_settings(settings(number)).unwrap(), number);
            }
        });
        let _stop = SetOnDrop(&is_done);
        // On a busy machine one side may run many more iterations than the other.
        for sequence in 1..=100 * TICKS {
            if taken == TAKEN {
                break;
            }
            let first = haptic_loop.tick(1, Ok(reading(sequence)));
            if let Some(id) = first.new_model {
                assert_eq!(id.epoch, 3 * id.body, "the identity is torn");
                write(id, twin_handle.model_slot());
                twin_handle.publish_model();
                taken += 1;
            }
            if let Some((number, found)) = first.settings {
                assert_eq!(found, settings(number), "settings {number} are torn");
                twin_handle.set_settings(found).unwrap();
                changed += 1;
            }
            let second = twin.tick(1, Ok(reading(sequence)));
            // The twin has its own count of settings.
            let expected = TickOutput { settings: first.settings, ..second };
            assert_eq!(
                first, expected,
                "a model or settings are torn, or the loop is not a function of them"
            );
            adopted += u64::from(first.rendered.swap.is_some());
            nonzero += u64::from(first.device_force_n != DVec3::ZERO);
            haptic_loop.finish_tick(first, None, Ok(()));
            twin.finish_tick(second, None, Ok(()));
        }
    });
    // The report comes every 64 ticks, more than Miri can run.
    let rejected = handle.report().models_rejected;
    // After a long interruption of the writer its model is too old for the kept samples.
    assert!(
        20 * rejected < taken && 2 * adopted > taken,
        "{rejected} rejected, {adopted} adopted of {taken}"
    );
    let is_enough = taken >= TAKEN && changed >= TAKEN / 2 && nonzero >= TAKEN / 100;
    assert!(is_enough, "{taken} taken, {changed} changed, {nonzero} nonzero");
}

#[test]
fn samples_records_and_reports_are_not_torn_at_full_speed() {
    let (mut handle, mut haptic_loop) = haptic_loop(config(), settings(0)).unwrap();
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, DVec3::ONE);
    handle.publish_model();
    let is_done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let _stop = SetOnDrop(&is_done);
            for sequence in 1..=TICKS {
                let output = haptic_loop.tick(1, Ok(reading(sequence)));
                haptic_loop.finish_tick(output, Some(timing(sequence)), Ok(()));
            }
        });
        let (mut last, mut last_recorded) = (0, 0);
        let mut at_the_end = false;
        loop {
            let newest = handle.samples().newest().map_or(0, |sample| sample.sequence);
            assert!(newest >= last, "samples go back");
            last = newest;
            check_samples(&mut handle);
            while let Some(record) = handle.next_record() {
                let sequence = check_record(&record);
                assert!(sequence > last_recorded, "records go back");
                last_recorded = sequence;
            }
            let report = handle.report();
            for times in [&report.lateness, &report.period, &report.cost, &report.read, &report.write] {
                assert_eq!(times.count(), report.ticks, "the report is torn");
            }
            // One more pass after the loop's last tick.
            if at_the_end {
                break;
            }
            at_the_end = is_done.load(Ordering::Acquire);
        }
        assert_eq!(last, TICKS);
    });
    assert!(handle.report().ticks + 64 >= TICKS);
}

/// The expected sample `sequence`.
fn sample(sequence: u64) -> Sample {
    let Reading { position_m, orientation, buttons, .. } = reading(sequence);
    let time_s = sequence as f64 * TICK_S;
    let origin = SampleOrigin::Measured;
    let mut velocity = VelocityState::default();
    let mut velocity_m_per_s = DVec3::ZERO;
    for s in sequence.saturating_sub(1).max(1)..=sequence {
        velocity_m_per_s =
            velocity.step(VelocityEstimator::BackwardDifference, reading(s).position_m, None, TICK_S);
    }
    Sample { sequence, time_s, position_m, velocity_m_per_s, orientation, buttons, origin, other: None }
}

fn timing(sequence: u64) -> TickTiming {
    let ns = 1000 + sequence;
    TickTiming { lateness_ns: ns, period_ns: ns, cost_ns: ns, read_ns: ns, write_ns: ns }
}

fn check_samples(handle: &mut HapticHandle) {
    let Some(tick) = handle.latest_tick() else { return };
    let sequence = check_record(&tick);
    // Samples and displayed forces are of the same tick or a later one.
    let samples = handle.samples();
    let (oldest, newest) = (samples.oldest_sequence().unwrap(), samples.newest().unwrap().sequence);
    assert!(newest >= sequence && newest - oldest < 512 && (newest < 512 || newest - oldest == 511));
    for s in (oldest..=newest).step_by(if cfg!(miri) { 16 } else { 1 }) {
        assert_eq!(*samples.get(s).unwrap(), sample(s), "sample {s} of {oldest} to {newest} is torn");
    }
    let displayed = handle.displayed();
    for s in sequence.saturating_sub(40)..=sequence {
        assert!(
            displayed.get(s).is_none_or(|force_n| force_n == DVec3::ONE),
            "the displayed forces are torn"
        );
    }
}

/// Checks a record and returns its sequence number.
fn check_record(record: &TickRecord) -> u64 {
    let found = record.sample.unwrap();
    let sequence = found.sequence;
    assert_eq!(found, sample(sequence), "the record of {sequence} is torn");
    assert_eq!(record.reading, Ok(reading(sequence)));
    assert_eq!((record.timing, record.elapsed), (timing(sequence), 1));
    assert_eq!(
        record.rendered.force_n,
        if record.rendered.model.is_some() { DVec3::ONE } else { DVec3::ZERO }
    );
    sequence
}
