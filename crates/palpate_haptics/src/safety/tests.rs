use super::*;

/// A chain past its start-up ramp, without fades in progress.
fn warm(settings: &SafetySettings) -> SafetyChain {
    let mut chain = SafetyChain::new(1e-3, 10.0).unwrap();
    for _ in 0..1000 {
        chain.apply(settings, &still(DVec3::ZERO));
    }
    chain
}

fn still(force_n: DVec3) -> SafetyInput {
    SafetyInput { force_n, elapsed: 1, sampled: true, ..SafetyInput::default() }
}

#[test]
fn a_force_within_all_limits_is_left_alone() {
    let settings = SafetySettings::default();
    let mut chain = warm(&settings);
    let force = DVec3::new(0.1, 0.2, -0.3);
    let (out, report) = chain.apply(&settings, &still(force));
    assert_eq!(out, force);
    assert!(!report.acted());
}

#[test]
fn what_is_not_finite_becomes_zero_and_the_next_force_grows_from_there() {
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
fn a_length_that_overflows_is_not_let_through() {
    let settings = SafetySettings::default();
    let (out, _) = warm(&settings).apply(&settings, &still(DVec3::splat(1e308)));
    assert!(out.is_finite() && out.length() <= 10.0, "{out}");
}

#[test]
fn the_ramp_lets_force_in_over_its_time() {
    let settings = SafetySettings { max_slew_n_per_s: 1e9, ..SafetySettings::default() };
    let mut chain = SafetyChain::new(1e-3, 10.0).unwrap();
    for tick in 1..=600 {
        let (out, report) = chain.apply(&settings, &still(DVec3::X * 2.0));
        let expected = 2.0 * (f64::from(tick) / 500.0).min(1.0);
        assert!((out.x - expected).abs() < 1e-9, "tick {tick}: {out}");
        // The sum of 500 parts may miss 1 by a rounding, so the tick after is asked.
        assert_eq!(report.acted(), tick < 501 && report.gain < 1.0, "tick {tick}");
    }
}

#[test]
fn a_stale_model_fades_in_a_tenth_of_a_second_and_a_fresh_one_comes_back() {
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
fn a_silent_device_and_a_pause_fade_too() {
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
fn the_smaller_limit_of_magnitude_counts() {
    let strong = SafetySettings { max_slew_n_per_s: 1e9, ..SafetySettings::default() };
    let weak = SafetySettings { max_force_n: 2.0, ..strong };
    for (settings, limit) in [(strong, 10.0), (weak, 2.0)] {
        let (out, report) = warm(&settings).apply(&settings, &still(DVec3::new(30.0, 40.0, 0.0)));
        assert!((out - DVec3::new(0.6, 0.8, 0.0) * limit).length() < 1e-12);
        assert!(report.magnitude_limited);
    }
}

#[test]
fn growth_is_bounded_falling_is_free_and_turning_round_is_growth() {
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
fn after_missed_deadlines_force_grows_for_four_ticks_at_most() {
    let settings = SafetySettings::default();
    for (elapsed, grown) in [(1, 0.5), (3, 1.5), (4, 2.0), (200, 2.0), (u64::MAX, 2.0)] {
        let input = SafetyInput { elapsed, ..still(DVec3::X * 9.0) };
        assert!((warm(&settings).apply(&settings, &input).0.x - grown).abs() < 1e-12);
        // The start-up ramp and a fade in follow the same rule; a fade out counts all the time there was.
        let mut fresh = SafetyChain::new(1e-3, 10.0).unwrap();
        let (_, report) = fresh.apply(&settings, &input);
        assert!((report.gain - grown / 0.5 * 1e-3 / 0.5).abs() < 1e-12);
        let (out, _) = warm(&settings).apply(&settings, &SafetyInput { paused: true, ..input });
        assert_eq!(out == DVec3::ZERO, elapsed >= 200);
    }
}

#[test]
fn the_ramp_waits_for_the_first_sample() {
    let settings = SafetySettings::default();
    let mut chain = SafetyChain::new(1e-3, 10.0).unwrap();
    for _ in 0..600 {
        let (_, report) = chain.apply(&settings, &SafetyInput { sampled: false, ..still(DVec3::ZERO) });
        assert_eq!(report.gain, 0.0);
    }
    assert!((chain.apply(&settings, &still(DVec3::X)).1.gain - 0.002).abs() < 1e-12);
}

#[test]
fn a_limit_below_zero_does_not_turn_the_force_round() {
    let settings = SafetySettings { max_force_n: -5.0, ..SafetySettings::default() };
    assert_eq!(warm(&settings).apply(&settings, &still(DVec3::X * 9.0)).0, DVec3::ZERO);
}

#[test]
fn limits_that_make_no_sense_are_refused() {
    let good = SafetySettings::default();
    good.validate().unwrap();
    for bad in [
        SafetySettings { ramp_s: -1.0, ..good },
        SafetySettings { ramp_s: f64::NAN, ..good },
        SafetySettings { fade_s: f64::INFINITY, ..good },
        SafetySettings { stale_after_periods: 0.5, ..good },
        SafetySettings { max_force_n: f64::NAN, ..good },
        SafetySettings { max_force_n: -1.0, ..good },
        SafetySettings { max_slew_n_per_s: 0.0, ..good },
        SafetySettings { max_slew_n_per_s: f64::INFINITY, ..good },
    ] {
        assert!(matches!(bad.validate(), Err(HapticsError::Setting { .. })), "{bad:?}");
    }
    assert!(SafetyChain::new(0.0, 1.0).is_err());
    assert!(SafetyChain::new(1e-3, f64::NAN).is_err());
    assert!(SafetyChain::new(1e-3, -1.0).is_err());
}
