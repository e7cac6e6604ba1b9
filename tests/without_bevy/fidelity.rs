//! Every scheme against the oracle, and the errors of the baseline schemes against an independent implementation.
//!
//! `data/fidelity_6x6x6.json` is the output of a numpy prototype of the full body and of each scheme. It states body, trajectory, equations
//! and the definition of the error.

use palpate_body::ToolContact;
use palpate_local::Scheme;
use palpate_reduce::{Comparison, ComparisonOptions};
use palpate_tests_without_bevy::{DRIVEN_NODE, reference_body, reference_samples};
use serde_json::Value;

/// First sample of the error, at 0.2 s.
const FROM: usize = 200;

fn reference() -> Value {
    serde_json::from_str(include_str!("../data/fidelity_6x6x6.json")).unwrap()
}

fn compare(delay_ticks: usize, replay_per_tick: usize) -> Comparison {
    let body = reference_body().unwrap();
    let start = body.positions_m()[DRIVEN_NODE];
    let contact = ToolContact::hold(&body, DRIVEN_NODE, start).unwrap();
    let options = ComparisonOptions { delay_ticks, replay_per_tick, ..ComparisonOptions::default() };
    Comparison::run(&body, &contact, &reference_samples(start), &Scheme::ALL, &options).unwrap()
}

/// The errors agree to the four digits of the file. The prototype replays all missed samples within one tick, and so does the comparison.
#[test]
#[expect(clippy::print_stdout, reason = "the table of errors is the result of the test")]
fn baseline_errors_match_the_reference() {
    let expected = reference();
    println!("{:16}{:>10}{:>12}{:>12}", "scheme", "delay ms", "reference", "here");
    for (delay, key) in [(0, "delay_0_ms"), (40, "delay_40_ms")] {
        let comparison = compare(delay, 64);
        for scheme in Scheme::ALL.into_iter().filter(|scheme| *scheme != Scheme::NearFieldExact) {
            let reference = expected["relative_rms_error"][key][scheme.name()].as_f64().unwrap();
            let here = comparison.relative_rms_error(scheme, FROM).unwrap();
            println!("{:16}{delay:>10}{reference:>12.4}{here:>12.4}", scheme.name());
            let difference = (here / reference - 1.0).abs();
            assert!(difference < 0.005, "{} at {delay} ms: {here}, reference {reference}", scheme.name());
        }
        assert!(comparison.clamped.iter().all(|(_, models)| *models == 0));
    }
}

#[test]
fn oracle_peaks_match_the_reference() {
    let expected = reference();
    let peak = compare(0, 8).oracle_peak_n;
    for axis in 0..3 {
        let reference = expected["oracle_peak_abs_n"][axis].as_f64().unwrap();
        assert!(
            (peak[axis] - reference).abs() < 6e-4,
            "axis {axis}: {} N, reference {reference} N",
            peak[axis]
        );
    }
}

/// With 8 samples replayed a tick, as in the loop, a model 40 ms late is swapped 4 ticks later. A scheme without a state has nothing to
/// replay.
#[test]
#[expect(clippy::print_stdout, reason = "the table of errors is the result of the test")]
fn replay_in_slices_raises_the_error_of_dynamic_schemes_slightly() {
    let (whole, slices) = (compare(40, 64), compare(40, 8));
    for scheme in Scheme::ALL {
        let [whole, slices] = [&whole, &slices].map(|c| c.relative_rms_error(scheme, FROM).unwrap());
        println!("{:16} replayed at once {whole:.4}, in slices of 8 {slices:.4}", scheme.name());
        if scheme.has_state() {
            assert!((1.0..1.08).contains(&(slices / whole)), "{}", slices / whole);
        } else {
            assert_eq!(whole, slices);
        }
    }
}
