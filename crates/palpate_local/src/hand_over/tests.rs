//! Tests of submit, replay, swap and render.

use super::*;
use glam::DMat3;

fn sample(sequence: u64) -> Sample {
    let t = sequence as f64 * 1e-3;
    Sample {
        sequence,
        time_s: t,
        position_m: DVec3::new(0.0, 0.0, -0.01 * (12.0 * t).sin()),
        velocity_m_per_s: DVec3::new(0.0, 0.0, -0.12 * (12.0 * t).cos()),
        ..Sample::default()
    }
}

/// A mass on a spring and a damper, driven by the tool through another spring and damper.
fn model(sequence: u64) -> LocalModel {
    let at = sample(sequence);
    let mut m = LocalModel::empty(Capacity::of_order(3));
    m.id = ModelId { body: 1, epoch: 0, sequence };
    m.scheme = Scheme::Neighbourhood;
    m.contact = Contact::Held;
    (m.position_m, m.velocity_m_per_s) = (at.position_m, at.velocity_m_per_s);
    m.force_n = DVec3::Z * 0.5;
    m.stiffness_n_per_m = DMat3::from_diagonal(DVec3::splat(100.0));
    m.damping_ns_per_m = DMat3::from_diagonal(DVec3::splat(0.3));
    m.reduced.order = 3;
    m.reduced.step_s = 1e-3;
    let (mass, k, b, h) = (0.01, 200.0, 0.6, 1e-3);
    let mut implicit = [0.0; 9];
    for i in 0..3 {
        m.reduced.stiffness[4 * i] = k;
        m.reduced.damping[4 * i] = b;
        m.reduced.stiffness_rc[4 * i] = -100.0;
        m.reduced.damping_rc[4 * i] = -0.3;
        implicit[4 * i] = mass / h + b + h * k;
    }
    m.reduced.implicit.factorise(3, &implicit).unwrap();
    m
}

fn hand_over(replay_per_tick: usize) -> HandOver {
    HandOver::new(HandOverSettings {
        capacity: Capacity::of_order(3),
        history: 64,
        replay_per_tick,
        ..Default::default()
    })
    .unwrap()
}

/// Renders at the samples of `range`, and submits `model(built)` when sample `at` has been pushed.
fn run(hand_over: &mut HandOver, range: std::ops::Range<u64>, built: u64, at: u64) -> Vec<RenderedForce> {
    range
        .map(|s| {
            hand_over.push(sample(s));
            if s == at {
                assert_eq!(hand_over.submit(&model(built)), SubmitResult::Accepted);
            }
            hand_over.render()
        })
        .collect()
}

#[test]
fn hand_over_is_send_and_sync() {
    fn is_shared<T: Send + Sync>() {}
    is_shared::<HandOver>();
}

#[test]
fn late_model_renders_the_force_of_a_punctual_one_after_replay() {
    let in_time = run(&mut hand_over(8), 0..60, 10, 10);
    let late = run(&mut hand_over(8), 0..60, 10, 30);
    let swap = late.iter().position(|s| s.swap.is_some()).unwrap();
    // It lacks 20 samples at tick 30, including that of the tick. Replay adds 8 a tick and the tick's own: 9 (k + 1) >= 20 + k at k = 2.
    assert_eq!(swap, 32);
    assert_eq!(late[swap].swap.unwrap().replayed_samples, 22);
    for tick in swap..60 {
        assert_eq!(in_time[tick].force_n, late[tick].force_n, "tick {tick}");
    }
    assert_eq!(late[29].force_n, DVec3::ZERO);
    assert_eq!(late[29].model, None);
}

#[test]
fn punctual_model_renders_the_force_of_the_model_step() {
    let forces = run(&mut hand_over(8), 0..20, 10, 10);
    assert_eq!(forces[10].force_n, DVec3::Z * 0.5);
    assert_eq!(forces[10].swap.unwrap().replayed_samples, 0);
}

#[test]
fn active_model_renders_until_the_candidate_has_caught_up() {
    let alone = run(&mut hand_over(8), 0..40, 5, 5);
    let mut both = hand_over(2);
    run(&mut both, 0..30, 5, 5);
    let forces = run(&mut both, 30..60, 20, 30);
    let swap = forces.iter().position(|s| s.swap.is_some()).unwrap();
    // It lacks 10 samples. Replay adds two a tick and the tick's own: 3 (k + 1) >= 10 + k at k = 4.
    assert_eq!(swap, 4);
    for (k, rendered) in forces.iter().take(swap).enumerate() {
        assert_eq!(rendered.force_n, alone[30 + k].force_n);
    }
    let at_swap = forces[swap].swap.unwrap();
    assert_eq!(forces[swap].force_n, alone[34].force_n + at_swap.force_jump_n);
}

#[test]
fn submit_during_replay_returns_busy() {
    let mut h = hand_over(1);
    run(&mut h, 0..30, 5, 20);
    assert!(h.is_catching_up());
    assert_eq!(h.submit(&model(25)), SubmitResult::Busy);
}

#[test]
fn model_without_state_becomes_active_at_once() {
    let mut h = hand_over(8);
    (0..60).for_each(|s| h.push(sample(s)));
    let mut tangent = model(0);
    tangent.scheme = Scheme::Tangent;
    assert_eq!(h.submit(&tangent), SubmitResult::Accepted);
    let rendered = h.render();
    let dx = sample(59).position_m - sample(0).position_m;
    assert_eq!(rendered.force_n, DVec3::Z * 0.5 - 100.0 * dx);
    assert_eq!(rendered.swap.unwrap().replayed_samples, 0);
}

#[test]
fn model_without_contact_renders_zero_force_in_every_scheme() {
    for scheme in Scheme::ALL {
        let mut h = hand_over(8);
        h.push(sample(0));
        let mut apart = model(0);
        (apart.scheme, apart.contact) = (scheme, Contact::Apart);
        h.submit(&apart);
        assert_eq!(h.render().force_n, DVec3::ZERO);
    }
}

#[test]
fn touched_surface_never_pulls() {
    let mut h = hand_over(8);
    h.push(sample(0));
    let mut touching = model(0);
    touching.contact = Contact::Touching { normal: DVec3::Z };
    touching.scheme = Scheme::Tangent;
    h.submit(&touching);
    let up = Sample { sequence: 1, position_m: DVec3::Z * 0.02, ..Sample::default() };
    h.push(up);
    assert_eq!(h.render().force_n, DVec3::ZERO);
    h.push(Sample { sequence: 2, position_m: DVec3::Z * -0.02, ..up });
    assert_eq!(h.render().force_n, DVec3::Z * 2.5);
}

#[test]
fn rejected_models_leave_the_active_one_in_place() {
    let mut h = hand_over(8);
    run(&mut h, 0..10, 5, 5);
    let before = h.clone().render().force_n;
    let mut nan = model(9);
    nan.force_n.x = f64::NAN;
    assert_eq!(h.submit(&nan), SubmitResult::Rejected(LocalModelError::NotFinite { what: "force" }));
    let future = LocalModelError::FromTheFuture { model: 12, newest: 9 };
    assert_eq!(h.submit(&model(12)), SubmitResult::Rejected(future));
    assert_eq!(
        h.submit(&model(5)),
        SubmitResult::Rejected(LocalModelError::NotNewer { model: 5, active: 5 })
    );
    let mut large = LocalModel::empty(Capacity::of_order(4));
    large.id = ModelId { sequence: 9, ..model(9).id };
    large.reduced.order = 4;
    large.reduced.step_s = 1e-3;
    let identity: Vec<f64> = (0..16).map(|i| f64::from(u8::from(i % 5 == 0))).collect();
    large.reduced.implicit.factorise(4, &identity).unwrap();
    assert_eq!(h.submit(&large), SubmitResult::Rejected(LocalModelError::Order { order: 4, capacity: 3 }));
    assert_eq!(h.render().force_n, before);
}

#[test]
fn model_older_than_the_history_is_rejected_or_abandoned() {
    let mut h = hand_over(8);
    (0..100).for_each(|s| h.push(sample(s)));
    assert_eq!(
        h.submit(&model(20)),
        SubmitResult::Rejected(LocalModelError::TooOld { model: 20, oldest: 36 })
    );
    assert_eq!(h.submit(&model(40)), SubmitResult::Accepted);
    // A jump of the sequence number clears the history that replay requires.
    h.push(sample(500));
    let rendered = h.render();
    assert_eq!(rendered.abandoned, Some(LocalModelError::TooOld { model: 40, oldest: 500 }));
    assert!(!h.is_catching_up());
}

#[test]
fn low_pass_starts_from_the_previous_force() {
    let mut h = hand_over(8);
    h.push(sample(0));
    let mut held = model(0);
    (held.scheme, held.force_n) = (Scheme::Hold, DVec3::X * 3.0);
    h.submit(&held);
    assert_eq!(h.render().force_n, DVec3::X * 3.0);
    h.push(sample(1));
    let mut low = model(1);
    low.scheme = Scheme::LowPass;
    h.submit(&low);
    let a = 1.0 - (-std::f64::consts::TAU * 10.0 * 1e-3).exp();
    let expected = DVec3::X * 3.0 * (1.0 - a) + DVec3::Z * 0.5 * a;
    assert!((h.render().force_n - expected).length() < 1e-14);
    // Missed ticks count as filter steps.
    (2..12).for_each(|s| h.push(sample(s)));
    let expected = DVec3::X * 3.0 * (1.0 - a).powi(11) + DVec3::Z * 0.5 * (1.0 - (1.0 - a).powi(11));
    assert!((h.render().force_n - expected).length() < 1e-14);
}

#[test]
fn low_pass_is_zero_without_contact_and_never_pulls() {
    let mut h = hand_over(8);
    let mut low = model(0);
    (low.scheme, low.force_n) = (Scheme::LowPass, DVec3::Z * 5.0);
    let mut render = |sequence, contact, force_n| {
        h.push(sample(sequence));
        (low.id.sequence, low.contact, low.force_n) = (sequence, contact, force_n);
        assert_eq!(h.submit(&low), SubmitResult::Accepted);
        h.render().force_n
    };
    assert!(render(1, Contact::Held, DVec3::Z * 5.0).z > 0.0);
    assert_eq!(render(2, Contact::Touching { normal: -DVec3::Z }, DVec3::Z * -0.001), DVec3::ZERO);
    assert_eq!(render(3, Contact::Apart, DVec3::ZERO), DVec3::ZERO);
    assert!(render(4, Contact::Held, DVec3::Z).z < 0.1, "the filter was reset while there was no contact");
}

#[test]
fn candidate_catches_up_although_ticks_are_missed() {
    for (replay_per_tick, missed) in [(1, 1), (8, 8), (8, 9), (1, 20)] {
        let mut h = HandOver::new(HandOverSettings {
            capacity: Capacity::of_order(3),
            replay_per_tick,
            ..Default::default()
        })
        .unwrap();
        (0..40).for_each(|s| h.push(sample(s)));
        assert_eq!(h.submit(&model(5)), SubmitResult::Accepted);
        let ticks = (0..100).position(|tick| {
            (0..missed).for_each(|i| h.push(sample(40 + tick * missed + i)));
            h.render().swap.is_some()
        });
        assert!(ticks.unwrap() <= 35, "{ticks:?} with {replay_per_tick} a tick, {missed} samples each");
    }
}

#[test]
fn model_without_state_becomes_active_after_a_jump_of_samples() {
    let mut h = hand_over(8);
    assert_eq!(h.submit(&model(0)), SubmitResult::Busy, "there is no sample yet");
    h.push(sample(4));
    let mut hold = model(0);
    hold.scheme = Scheme::Hold;
    assert_eq!(h.submit(&hold), SubmitResult::Accepted);
    h.push(sample(900));
    assert_eq!(h.render().force_n, DVec3::Z * 0.5);
}

#[test]
fn retain_bodies_drops_models_of_other_bodies() {
    let mut h = hand_over(1);
    run(&mut h, 0..20, 5, 5);
    h.submit(&model(6));
    h.retain_bodies(&[1]);
    assert!(h.is_catching_up() && h.active().is_some());
    h.retain_bodies(&[2]);
    assert!(!h.is_catching_up() && h.active().is_none());
    assert_eq!(h.render().force_n, DVec3::ZERO);
}

#[test]
fn model_without_body_may_be_repeated_for_the_same_sample() {
    let mut h = hand_over(8);
    h.push(sample(7));
    let mut empty = LocalModel::empty(Capacity::of_order(3));
    for sequence in [7, 7] {
        empty.clear(sequence);
        assert_eq!(h.submit(&empty), SubmitResult::Accepted);
        assert_eq!(h.render().force_n, DVec3::ZERO);
    }
    empty.clear(6);
    assert!(matches!(h.submit(&empty), SubmitResult::Rejected(LocalModelError::NotNewer { .. })));
}

#[test]
fn rejects_older_epoch_and_other_tick() {
    let mut h = hand_over(8);
    run(&mut h, 0..10, 5, 5);
    let mut newer = model(9);
    newer.id.epoch = 1;
    assert_eq!(h.submit(&newer), SubmitResult::Accepted);
    h.render();
    h.push(sample(10));
    assert_eq!(
        h.submit(&model(10)),
        SubmitResult::Rejected(LocalModelError::OldEpoch { model: 0, active: 1 })
    );
    let mut slow = model(10);
    (slow.id.epoch, slow.reduced.step_s) = (1, 1e-2);
    assert_eq!(h.submit(&slow), SubmitResult::Rejected(LocalModelError::Step { found: 1e-2, needed: 1e-3 }));
}

#[test]
fn rejects_settings_out_of_range() {
    let good = HandOverSettings::default();
    for bad in [
        HandOverSettings { replay_per_tick: 0, ..good },
        HandOverSettings { history: 0, ..good },
        HandOverSettings { tick_s: 0.0, ..good },
        HandOverSettings { tick_s: 1e300, ..good },
        HandOverSettings { tick_s: 1e-10, ..good },
        HandOverSettings { capacity: Capacity::of_order(usize::MAX), ..good },
        HandOverSettings { history: usize::MAX, ..good },
        HandOverSettings { replay_per_tick: usize::MAX, ..good },
        HandOverSettings { cutoff_hz: f64::NAN, ..good },
    ] {
        assert!(matches!(HandOver::new(bad), Err(LocalModelError::Setting { .. })));
    }
}
