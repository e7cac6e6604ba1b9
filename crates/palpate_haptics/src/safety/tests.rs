use super::*;

/// A device without an effective growth limit.
const LIMITS: DeviceLimits = DeviceLimits { force_n: 10.0, slew_n_per_s: 1e12 };

/// A chain after its start-up ramp, without fades in progress.
fn warm(settings: &SafetySettings) -> SafetyChain {
    let mut chain = SafetyChain::new(1e-3, LIMITS).unwrap();
    for _ in 0..1000 {
        chain.apply(settings, &still(DVec3::ZERO));
    }
    chain
}

fn still(force_n: DVec3) -> SafetyInput {
    SafetyInput { force_n, elapsed: 1, sampled: true, has_model: true, ..SafetyInput::default() }
}

#[test]
fn force_within_limits_is_unchanged() {
    let settings = SafetySettings::default();
    let mut chain = warm(&settings);
    let force = DVec3::new(0.1, 0.2, -0.3);
    let (out, report) = chain.apply(&settings, &still(force));
    assert_eq!(out, force);
    assert!(!report.acted());
}

#[test]
fn non_finite_force_becomes_zero_and_growth_restarts() {
    let settings = SafetySettings::default();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut chain = warm(&settings);
        let (out, report) = chain.apply(&settings, &still(DVec3::new(0.0, bad, 0.0)));
        assert_eq!(out, DVec3::ZERO);
        assert!(report.not_finite);
        let (out, report) = chain.apply(&settings, &still(DVec3::X * 3.0));
        assert!((out.x - 0.5).abs() < 1e-12 && report.slew_limited);
    }
}

#[test]
fn overflowing_length_is_limited() {
    let settings = SafetySettings::default();
    let (out, _) = warm(&settings).apply(&settings, &still(DVec3::splat(1e308)));
    assert!(out.is_finite() && out.length() <= 10.0, "{out}");
}

#[test]
fn ramp_scales_force_over_its_duration() {
    let settings =
        SafetySettings { arm_below_n: f64::MAX, max_slew_n_per_s: 1e9, ..SafetySettings::default() };
    let mut chain = SafetyChain::new(1e-3, LIMITS).unwrap();
    for tick in 1..=600 {
        let (out, report) = chain.apply(&settings, &still(DVec3::X * 2.0));
        let expected = 2.0 * (f64::from(tick) / 500.0).min(1.0);
        assert!((out.x - expected).abs() < 1e-9, "tick {tick}: {out}");
        // The sum of 500 parts may miss 1 by a rounding error; tick 501 is checked instead.
        assert_eq!(report.acted(), tick < 501 && report.gain < 1.0, "tick {tick}");
    }
}

#[test]
fn stale_model_fades_out_and_fresh_one_fades_in() {
    let settings = SafetySettings { max_slew_n_per_s: 1e9, ..SafetySettings::default() };
    let mut chain = warm(&settings);
    let aged = |model_age_periods| SafetyInput { model_age_periods, ..still(DVec3::X) };
    assert_eq!(chain.apply(&settings, &aged(3.0)).0, DVec3::X);
    for tick in 1..=120 {
        let (out, report) = chain.apply(&settings, &aged(3.02));
        assert!(report.stale);
        assert!((out.x - (1.0 - f64::from(tick) / 100.0).max(0.0)).abs() < 1e-9);
    }
    for tick in 1..=120 {
        let (out, _) = chain.apply(&settings, &aged(0.1));
        assert!((out.x - (f64::from(tick) / 100.0).min(1.0)).abs() < 1e-9);
    }
}

#[test]
fn silent_device_and_pause_fade_out() {
    let settings = SafetySettings::default();
    for input in [
        SafetyInput { silent_ticks: 21, ..still(DVec3::X * 0.4) },
        SafetyInput { paused: true, ..still(DVec3::X * 0.4) },
    ] {
        let mut chain = warm(&settings);
        let forces: Vec<f64> = (0..110).map(|_| chain.apply(&settings, &input).0.x).collect();
        assert!((forces[49] - 0.2).abs() < 1e-9 && forces[109] == 0.0);
    }
}

#[test]
fn smaller_magnitude_limit_applies() {
    let strong = SafetySettings { max_slew_n_per_s: 1e9, ..SafetySettings::default() };
    let weak = SafetySettings { max_force_n: 2.0, ..strong };
    for (settings, limit) in [(strong, 10.0), (weak, 2.0)] {
        let (out, report) = warm(&settings).apply(&settings, &still(DVec3::new(30.0, 40.0, 0.0)));
        assert!((out - DVec3::new(0.6, 0.8, 0.0) * limit).length() < 1e-12);
        assert!(report.magnitude_limited);
    }
}

#[test]
fn limits_growth_and_reversal_but_not_decrease() {
    let settings = SafetySettings::default();
    let mut chain = warm(&settings);
    let mut next = |x: f64| chain.apply(&settings, &still(DVec3::X * x)).0.x;
    assert!((next(3.0) - 0.5).abs() < 1e-12);
    assert!((next(3.0) - 1.0).abs() < 1e-12);
    assert_eq!(next(0.25), 0.25);
    assert!((next(-3.0) + 0.5).abs() < 1e-12);
    assert_eq!(next(0.0), 0.0);
}

#[test]
fn missed_deadlines_allow_growth_of_four_ticks_at_most() {
    let settings = SafetySettings { arm_below_n: f64::MAX, ..SafetySettings::default() };
    for (elapsed, grown) in [(1, 0.5), (3, 1.5), (4, 2.0), (200, 2.0), (u64::MAX, 2.0)] {
        let input = SafetyInput { elapsed, ..still(DVec3::X * 9.0) };
        assert!((warm(&settings).apply(&settings, &input).0.x - grown).abs() < 1e-12);
        // Start-up ramp and fade-in follow the same rule; a fade-out counts all elapsed time.
        let mut fresh = SafetyChain::new(1e-3, LIMITS).unwrap();
        let (_, report) = fresh.apply(&settings, &input);
        assert!((report.gain - grown / 0.5 * 1e-3 / 0.5).abs() < 1e-12);
        let (out, _) = warm(&settings).apply(&settings, &SafetyInput { paused: true, ..input });
        assert_eq!(out == DVec3::ZERO, elapsed >= 200);
    }
}

#[test]
fn ramp_waits_for_first_sample() {
    let settings = SafetySettings { arm_below_n: f64::MAX, ..SafetySettings::default() };
    let mut chain = SafetyChain::new(1e-3, LIMITS).unwrap();
    for _ in 0..600 {
        let (_, report) = chain.apply(&settings, &SafetyInput { sampled: false, ..still(DVec3::ZERO) });
        assert_eq!(report.gain, 0.0);
    }
    assert!((chain.apply(&settings, &still(DVec3::X)).1.gain - 0.002).abs() < 1e-12);
}

#[test]
fn negative_limit_gives_zero_force() {
    let settings = SafetySettings { max_force_n: -5.0, ..SafetySettings::default() };
    assert_eq!(warm(&settings).apply(&settings, &still(DVec3::X * 9.0)).0, DVec3::ZERO);
}

#[test]
fn rejects_settings_out_of_range() {
    let good = SafetySettings::default();
    good.validate().unwrap();
    for bad in [
        SafetySettings { ramp_s: -1.0, ..good },
        SafetySettings { ramp_s: f64::NAN, ..good },
        SafetySettings { fade_s: f64::INFINITY, ..good },
        SafetySettings { stale_after_periods: 0.5, ..good },
        SafetySettings { max_force_n: f64::NAN, ..good },
        SafetySettings { max_force_n: -1.0, ..good },
        SafetySettings { arm_below_n: -1.0, ..good },
        SafetySettings { max_speed_m_per_s: 0.0, ..good },
        SafetySettings { passivity_damping_ns_per_m: f64::NAN, ..good },
        SafetySettings { passivity_tolerance_j: -1e-3, ..good },
        SafetySettings { max_slew_n_per_s: 0.0, ..good },
        SafetySettings { max_slew_n_per_s: f64::INFINITY, ..good },
    ] {
        assert!(matches!(bad.validate(), Err(HapticsError::Setting { .. })), "{bad:?}");
    }
    assert!(SafetyChain::new(0.0, LIMITS).is_err());
    assert!(SafetyChain::new(1e-3, DeviceLimits::of_force(f64::NAN)).is_err());
    assert!(SafetyChain::new(1e-3, DeviceLimits::of_force(-1.0)).is_err());
}

#[test]
fn start_waits_for_small_force_of_model() {
    let settings = SafetySettings::default();
    let mut chain = SafetyChain::new(1e-3, LIMITS).unwrap();
    // No model yet, then one of 3 N: the hand starts inside a body.
    for _ in 0..300 {
        let silent = SafetyInput { has_model: false, ..still(DVec3::ZERO) };
        assert!(chain.apply(&settings, &silent).1.waiting);
    }
    for _ in 0..300 {
        let (out, report) = chain.apply(&settings, &still(DVec3::X * 3.0));
        assert!(out == DVec3::ZERO && report.waiting && report.gain == 0.0);
    }
    // The ramp begins once the force is small, and continues at any force.
    assert!(!chain.apply(&settings, &still(DVec3::X * 0.5)).1.waiting);
    for tick in 2..=500 {
        let (out, _) = chain.apply(&settings, &still(DVec3::X * 3.0));
        assert!(out.x <= 3.0 * f64::from(tick) / 500.0 + 1e-9);
    }
    let (out, report) = chain.apply(&settings, &still(DVec3::X * 3.0));
    assert!((out.x - 3.0).abs() < 1e-9 && !report.waiting);
}

#[test]
fn long_silence_and_jump_rearm_start_but_short_silence_does_not() {
    let settings = SafetySettings::default();
    let pressed = still(DVec3::X * 3.0);
    let settle = |chain: &mut SafetyChain| {
        (0..20).for_each(|_| {
            chain.apply(&settings, &pressed);
        });
    };
    let silence = |chain: &mut SafetyChain, ticks: u64| {
        for silent_ticks in 1..=ticks {
            chain.apply(&settings, &SafetyInput { silent_ticks, ..pressed });
        }
    };
    let mut chain = warm(&settings);
    settle(&mut chain);
    silence(&mut chain, 20);
    assert_eq!(chain.apply(&settings, &pressed).0, DVec3::X * 3.0);
    // The timeout of 20 ticks and the fade of 100.
    silence(&mut chain, 121);
    assert!(chain.apply(&settings, &pressed).1.waiting);
    settle(&mut chain);
    assert_eq!(chain.apply(&settings, &pressed).0, DVec3::ZERO);
    assert!(!chain.apply(&settings, &still(DVec3::ZERO)).1.waiting);
    let mut chain = warm(&settings);
    settle(&mut chain);
    assert!(chain.apply(&settings, &SafetyInput { has_jumped: true, ..pressed }).1.waiting);
}

#[test]
fn velocity_guard_keeps_braking_and_fades_accelerating_force() {
    let settings = SafetySettings { passivity_damping_ns_per_m: 0.0, ..SafetySettings::default() };
    let at = |speed: f64, force: DVec3| {
        let input = SafetyInput { velocity_m_per_s: DVec3::X * speed, ..still(force) };
        let mut chain = warm(&SafetySettings { max_slew_n_per_s: 1e9, ..settings });
        chain.apply(&SafetySettings { max_slew_n_per_s: 1e9, ..settings }, &input)
    };
    let push = DVec3::new(2.0, 1.0, 0.0);
    assert_eq!(at(2.0, push).0, push);
    let (out, report) = at(3.0, push);
    assert!((out - DVec3::new(1.0, 1.0, 0.0)).length() < 1e-12 && report.speed_guarded && report.acted());
    assert!((at(4.0, push).0 - DVec3::Y).length() < 1e-12 && (at(400.0, push).0 - DVec3::Y).length() < 1e-12);
    // A braking force is unchanged.
    assert_eq!(at(400.0, -push).0, -push);
    assert!(!at(400.0, -push).1.speed_guarded);
}

/// A hand of 75 g with little damping presses onto a surface whose force is delayed by 50 ms: without passivity damping the
/// oscillation grows.
#[test]
fn passivity_stage_reduces_oscillation_of_delayed_surface() {
    let oscillate = |damping: f64| -> (f64, bool) {
        let settings = SafetySettings {
            passivity_damping_ns_per_m: damping,
            passivity_tolerance_j: 1e-4,
            max_slew_n_per_s: 1e9,
            ..SafetySettings::default()
        };
        let mut chain = warm(&settings);
        let (mut x, mut v, mut held) = (2e-3, 0.0, DVec3::ZERO);
        let (mut late, mut widest, mut acted) = (std::collections::VecDeque::from([0.0; 50]), 0.0_f64, false);
        for tick in 0..4000 {
            let before = x;
            // Load of 1 N, damping of the finger 0.3 N s/m.
            v += 1e-3 / 0.075 * (held.x - 0.3 * v - 1.0 - 60.0 * x);
            x += 1e-3 * v;
            late.push_back(-150.0 * x);
            let force_n = DVec3::X * late.pop_front().unwrap();
            let moved_m = DVec3::X * (x - before);
            let input = SafetyInput { moved_m, velocity_m_per_s: DVec3::X * v, ..still(force_n) };
            let (out, report) = chain.apply(&settings, &input);
            (held, acted) = (out, acted || report.damping_ns_per_m > 0.0);
            if tick > 3000 {
                widest = widest.max((x + 1.0 / 210.0).abs());
            }
        }
        (widest, acted)
    };
    let ((undamped, none), (damped, acted)) = (oscillate(0.0), oscillate(5.0));
    assert!(!none && acted);
    assert!(damped < 0.5 * undamped, "{damped} m of {undamped} m");
}

#[test]
fn growth_limit_of_device_applies() {
    let settings = SafetySettings::default();
    let limits = DeviceLimits::of_force(3.0);
    assert_eq!(limits.slew_n_per_s, 150.0);
    let mut chain = SafetyChain::new(1e-3, limits).unwrap();
    for _ in 0..1000 {
        chain.apply(&settings, &still(DVec3::ZERO));
    }
    assert!((chain.apply(&settings, &still(DVec3::X * 3.0)).0.x - 0.15).abs() < 1e-12);
}

#[test]
fn reports_force_after_each_stage() {
    let settings = SafetySettings { max_force_n: 2.0, ..SafetySettings::default() };
    let mut chain = warm(&settings);
    let input = SafetyInput { velocity_m_per_s: DVec3::X * 3.0, ..still(DVec3::new(4.0, 3.0, 0.0)) };
    let (out, SafetyReport { after, .. }) = chain.apply(&settings, &input);
    assert_eq!(after.gains_n, DVec3::new(4.0, 3.0, 0.0));
    assert!((after.velocity_guard_n - DVec3::new(2.0, 3.0, 0.0)).length() < 1e-12);
    assert_eq!(after.passivity_n, after.velocity_guard_n);
    assert!((after.magnitude_n.length() - 2.0).abs() < 1e-12);
    assert!((after.slew_n.length() - 0.5).abs() < 1e-12 && after.slew_n == out);
}

#[test]
fn growth_counts_from_force_at_device() {
    let settings = SafetySettings::default();
    let mut chain = warm(&settings);
    let pressed = still(DVec3::X * 9.0);
    // The first three writes fail.
    for _ in 0..3 {
        assert!((chain.apply(&settings, &pressed).0.x - 0.5).abs() < 1e-12);
        chain.write_failed();
    }
    for tick in 1..=4 {
        assert!((chain.apply(&settings, &pressed).0.x - 0.5 * f64::from(tick)).abs() < 1e-12);
    }
    chain.rotate_frame(DQuat::from_rotation_z(std::f64::consts::PI));
    assert!((chain.apply(&settings, &pressed).0.x - 0.5).abs() < 1e-12, "a reversed force is growth");
    assert!((chain.apply(&settings, &pressed).0.x - 1.0).abs() < 1e-12);
    chain.reset_output();
    assert!((chain.apply(&settings, &pressed).0.x - 0.5).abs() < 1e-12);
}

#[test]
fn output_is_limited_for_extreme_inputs() {
    let values = [0.0, 1.0, -1.0, 1e-320, 1e150, -1e200, f64::MAX, f64::MIN, f64::INFINITY, f64::NAN];
    let vectors: Vec<DVec3> = (0..values.len().pow(2))
        .map(|i| DVec3::new(values[i % 10], values[i / 10], values[(i + i / 10) % 10]))
        .chain(values.map(DVec3::splat))
        .collect();
    let huge = SafetySettings {
        passivity_damping_ns_per_m: f64::MAX,
        passivity_tolerance_j: 0.0,
        max_slew_n_per_s: f64::MAX,
        max_speed_m_per_s: f64::MIN_POSITIVE,
        ..SafetySettings::default()
    };
    for settings in [SafetySettings::default(), huge] {
        for (i, &force_n) in vectors.iter().enumerate() {
            let mut chain = warm(&settings);
            for j in 0..vectors.len() {
                let (moved_m, velocity_m_per_s) = (vectors[j], vectors[(i + 7 * j) % vectors.len()]);
                let input = SafetyInput { moved_m, velocity_m_per_s, ..still(force_n) };
                let (out, _) = chain.apply(&settings, &input);
                assert!(out.is_finite() && out.length() <= 10.0 + 1e-9, "{out} of {input:?}");
            }
        }
    }
}
