//! Random sequences of faults: no tick panics, and every force at the device is finite and within its magnitude and growth limits.

use glam::{DMat3, DQuat, DVec3};
use palpate_haptics::*;
use palpate_local::{Contact, LocalModel, ModelId, Scheme};
use proptest::prelude::*;

const LIMITS: DeviceLimits = DeviceLimits { force_n: 10.0, slew_n_per_s: 500.0 };
const TICK_S: f64 = 1e-3;

/// A change that lasts for some ticks.
#[derive(Clone, Debug)]
enum Change {
    /// The hand moves with this velocity, m/s.
    Velocity(DVec3),
    /// The hand jumps by this displacement, m.
    Jump(DVec3),
    /// The device returns this result of `read`.
    ReadResult(Result<Reading, DeviceError>),
    /// The device's sequence numbers continue from here.
    SequenceNumber(Option<u64>),
    /// The device returns this result of `write`.
    WriteResult(Result<(), DeviceError>),
    /// This number of periods passes.
    Elapsed(u64),
    /// A local model arrives.
    Model(Model),
    /// Settings arrive.
    Settings(LoopSettings),
}

#[derive(Clone, Debug)]
struct Model {
    id: ModelId,
    scheme: Scheme,
    contact: Contact,
    force_n: DVec3,
    stiffness: f64,
    damping: f64,
    order: usize,
}

impl Model {
    fn write(&self, model: &mut LocalModel, at: DVec3, newest: u64) {
        (model.id, model.scheme, model.contact) = (self.id, self.scheme, self.contact);
        // Mostly for the newest sample.
        model.id.sequence = (newest + 2).saturating_sub(self.id.sequence);
        (model.force_n, model.position_m, model.velocity_m_per_s) = (self.force_n, at, DVec3::ZERO);
        model.stiffness_n_per_m = DMat3::from_diagonal(DVec3::splat(self.stiffness));
        model.damping_ns_per_m = DMat3::from_diagonal(DVec3::splat(self.damping));
        (model.reduced.order, model.reduced.step_s) = (self.order, TICK_S);
        if self.order < 8 {
            let (n, stiff) = (self.order, self.stiffness);
            model.reduced.stiffness.fill(stiff);
            model.reduced.stiffness_rc.fill(stiff);
            let identity: Vec<f64> = (0..n * n).map(|i| f64::from(u8::from(i % (n + 1) == 0))).collect();
            model.reduced.implicit.factorise(n, &identity).unwrap();
        }
    }
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -10.0..10.0,
        1 => prop_oneof![Just(0.0), Just(1e9), Just(-1e160), Just(f64::MAX), Just(f64::MIN)],
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(5e-324)],
    ]
}

fn vector(of: impl Strategy<Value = f64> + Clone) -> impl Strategy<Value = DVec3> {
    (of.clone(), of.clone(), of).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn numbers() -> impl Strategy<Value = DVec3> {
    (number(), number(), number()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn error() -> impl Strategy<Value = DeviceError> {
    prop_oneof![
        Just(DeviceError::TimedOut),
        Just(DeviceError::Disconnected),
        Just(DeviceError::Protocol("a short report")),
        Just(DeviceError::Os(5)),
    ]
}

fn model() -> impl Strategy<Value = Model> {
    let scheme = prop_oneof![
        Just(Scheme::Hold),
        Just(Scheme::LowPass),
        Just(Scheme::Tangent),
        Just(Scheme::Neighbourhood),
        Just(Scheme::NearFieldExact),
    ];
    let contact = prop_oneof![
        Just(Contact::Apart),
        Just(Contact::Held),
        vector(-1.0..1.0).prop_map(|normal| Contact::Touching { normal }),
    ];
    let id =
        (0..3_u64, 0..2_u64, 0..6_u64).prop_map(|(body, epoch, sequence)| ModelId { body, epoch, sequence });
    let order = prop_oneof![8 => 0..8_usize, 1 => Just(97), 1 => Just(usize::MAX)];
    (id, scheme, contact, numbers(), number(), number(), order).prop_map(
        |(id, scheme, contact, force_n, stiffness, damping, order)| Model {
            id,
            scheme,
            contact,
            force_n,
            stiffness: 100.0 * stiffness,
            damping,
            order,
        },
    )
}

fn settings() -> impl Strategy<Value = LoopSettings> {
    let start = prop_oneof![Just(f64::MAX), 0.0..2.0];
    let safety = (start, 0.0..0.1, 0.0..12.0, 1.0..900.0, 0..40_u64, 0.0..0.2, 0.01..5.0, 0.0..50.0)
        .prop_map(
            |(
                arm_below_n,
                ramp_s,
                max_force_n,
                max_slew_n_per_s,
                device_timeout_ticks,
                fade_s,
                speed,
                damping,
            )| {
                SafetySettings {
                    arm_below_n,
                    ramp_s,
                    max_force_n,
                    max_slew_n_per_s,
                    device_timeout_ticks,
                    fade_s,
                    max_speed_m_per_s: speed,
                    passivity_damping_ns_per_m: damping,
                    ..SafetySettings::default()
                }
            },
        );
    let rotation = (vector(-3.0..3.0), -3.0..3.0).prop_map(|(axis, angle): (DVec3, f64)| {
        axis.try_normalize().map_or(DQuat::IDENTITY, |axis| DQuat::from_axis_angle(axis, angle))
    });
    let frame = (rotation, prop_oneof![Just(1.0), 1e-3..1e3, Just(1e-300)], vector(-1.0..1.0));
    let body = prop_oneof![Just(None), (0..3_u64).prop_map(Some)];
    let velocity = prop_oneof![
        Just(VelocityEstimator::BackwardDifference),
        Just(VelocityEstimator::default()),
        Just(VelocityEstimator::Device)
    ];
    (safety, frame, body, velocity, any::<bool>(), any::<bool>()).prop_map(
        |(safety, (rotation, scale, offset_m), body, velocity, paused, record)| LoopSettings {
            frame: DeviceFrame { rotation, scale, offset_m },
            safety,
            velocity,
            body,
            paused: paused && record,
            record,
            ..LoopSettings::default()
        },
    )
}

fn change() -> impl Strategy<Value = Change> {
    let reading = (numbers(), proptest::option::of(numbers()))
        .prop_map(|(at, velocity_m_per_s)| Reading { velocity_m_per_s, ..Reading::at(at) });
    prop_oneof![
        3 => vector(-2.0..2.0).prop_map(Change::Velocity),
        1 => vector(-0.1..0.1).prop_map(Change::Jump),
        2 => prop_oneof![reading.prop_map(Ok), error().prop_map(Err)].prop_map(Change::ReadResult),
        1 => proptest::option::of(0..2000_u64).prop_map(Change::SequenceNumber),
        2 => prop_oneof![Just(Ok(())), error().prop_map(Err)].prop_map(Change::WriteResult),
        1 => prop_oneof![2..10_u64, 190..210_u64, Just(u64::MAX)].prop_map(Change::Elapsed),
        6 => model().prop_map(Change::Model),
        2 => settings().prop_map(Change::Settings),
    ]
}

/// A loop, its hand and the force of its device.
struct Rig {
    handle: HapticHandle,
    haptic_loop: HapticLoop,
    settings: LoopSettings,
    at: DVec3,
    velocity: DVec3,
    count: Option<u64>,
    applied_n: DVec3,
}

impl Rig {
    fn new() -> Self {
        let config = LoopConfig { device: LIMITS, ..LoopConfig::default() };
        let safety = SafetySettings { arm_below_n: f64::MAX, ramp_s: 0.0, ..SafetySettings::default() };
        let settings = LoopSettings { safety, ..LoopSettings::default() };
        let (handle, haptic_loop) = haptic_loop(config, settings).unwrap();
        let (at, velocity, applied_n) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        Self { handle, haptic_loop, settings, at, velocity, count: None, applied_n }
    }

    fn tick(
        &mut self,
        elapsed: u64,
        replaced: Option<Result<Reading, DeviceError>>,
        written: Result<(), DeviceError>,
    ) {
        self.at += self.velocity * TICK_S;
        self.count = self.count.map(|count| count + 1);
        let reading = replaced.unwrap_or(Ok(Reading { sequence: self.count, ..Reading::at(self.at) }));
        let output = self.haptic_loop.tick(elapsed, reading);
        self.haptic_loop.finish_tick(output, None, written);
        if let Some((_, settings)) = output.settings {
            self.settings = settings;
        }
        let force = output.device_force_n;
        assert!(force.is_finite(), "{output:?}");
        let SafetySettings { max_force_n, max_slew_n_per_s, .. } = self.settings.safety;
        assert!(force.length() <= max_force_n.min(LIMITS.force_n) + 1e-9, "{} N: {output:?}", force.length());
        let present = force.try_normalize().map_or(0.0, |along| self.applied_n.dot(along).max(0.0));
        let growth = max_slew_n_per_s.min(LIMITS.slew_n_per_s) * TICK_S * elapsed.clamp(1, 4) as f64;
        assert!(force.length() <= present + growth + 1e-9, "from {} to {force}: {output:?}", self.applied_n);
        if written.is_ok() {
            self.applied_n = force;
        }
        while self.handle.next_event().is_some() || self.handle.next_record().is_some() {}
    }

    fn run(&mut self, all: &[(Change, u64)]) {
        let mut written = Ok(());
        for (change, ticks) in all {
            let (mut replaced, mut elapsed) = (None, 1);
            match change {
                Change::Velocity(velocity) => self.velocity = *velocity,
                Change::Jump(displacement) => self.at += *displacement,
                Change::ReadResult(reading) => replaced = Some(*reading),
                Change::SequenceNumber(from) => self.count = *from,
                Change::WriteResult(result) => written = *result,
                Change::Elapsed(periods) => elapsed = *periods,
                Change::Model(model) => {
                    let newest = self.handle.samples().newest().copied().unwrap_or_default();
                    model.write(self.handle.model_slot(), newest.position_m, newest.sequence);
                    self.handle.publish_model();
                }
                Change::Settings(settings) => {
                    self.handle.set_settings(*settings).unwrap();
                }
            }
            for _ in 0..*ticks {
                self.tick(elapsed, replaced, written);
                elapsed = 1;
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn forces_stay_within_limits_and_fade_without_input(
        all in proptest::collection::vec((change(), prop_oneof![8 => 1..20_u64, 1 => 100..260_u64]), 1..60),
        is_read in any::<bool>(),
    ) {
        let mut rig = Rig::new();
        rig.run(&all);
        // After any sequence, the force ends within the specified time without readings or without a model.
        let SafetySettings { device_timeout_ticks, fade_s, .. } = rig.settings.safety;
        rig.handle.set_settings(LoopSettings { paused: false, ..rig.settings }).unwrap();
        let fade = (fade_s / TICK_S).ceil() as u64 + 2;
        // Three model periods of 50 ticks.
        let within = if is_read { 151 } else { device_timeout_ticks + 1 } + fade;
        let replaced = (!is_read).then_some(Err(DeviceError::TimedOut));
        for _ in 0..within {
            rig.tick(1, replaced, Ok(()));
        }
        for _ in 0..20 {
            rig.tick(1, replaced, Ok(()));
            prop_assert_eq!(rig.applied_n, DVec3::ZERO);
        }
    }
}
