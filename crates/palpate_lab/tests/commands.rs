//! The commands as a user runs them.

use serde_json::Value;
use std::process::{Command, Output};

fn lab(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate-lab")).args(arguments).output().unwrap()
}

fn json(arguments: &[&str]) -> Value {
    let output = lab(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refused(arguments: &[&str]) -> String {
    let output = lab(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(output.stdout.is_empty());
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(text.lines().count(), 1, "{text}");
    text
}

#[test]
fn schemes_have_the_reference_s_lags_and_ratios() {
    let reference: Value =
        serde_json::from_str(include_str!("../../../tests/data/spring_1d_schemes.json")).unwrap();
    let here = json(&["schemes"]);
    for scheme in ["full", "hold", "low_pass", "tangent"] {
        let (here, expected) = (&here["schemes"][scheme], &reference["schemes"][scheme]);
        assert_eq!(here["lag_ms"].as_f64(), expected["lag_ms"].as_f64(), "{scheme}");
        for key in ["snr_db", "ten_ln_power_ratio"] {
            let off = here[key].as_f64().unwrap() - expected[key].as_f64().unwrap();
            assert!(off.abs() < 0.01, "{scheme}.{key} is off by {off}");
        }
    }
}

#[test]
fn chains_of_any_parameters_equal_their_closed_form() {
    for arguments in [
        &["chain"][..],
        &["chain", "--stiffness", "3000", "--damping", "0.2", "--mass", "0.5"],
        // Overdamped: real poles.
        &["chain", "--stiffness", "50", "--damping", "9", "--mass", "0.02"],
    ] {
        for (name, model) in json(arguments)["models"].as_object().unwrap() {
            let closed = &model["closed_form"];
            let near = |a: &Value, b: &Value, scale: f64| {
                let off = (a.as_f64().unwrap() - b.as_f64().unwrap()).abs();
                assert!(off < 1e-9 * scale, "{name} of {arguments:?}: {a}, closed form {b}");
            };
            for key in ["dc_gain", "asymptote_stiffness", "asymptote_damping"] {
                near(&model[key], &closed[key], closed[key].as_f64().unwrap());
            }
            let (poles, expected) = (model["poles"].as_array().unwrap(), closed["poles"].as_array().unwrap());
            assert_eq!(poles.len(), expected.len());
            for (pole, expected) in poles.iter().zip(expected) {
                let scale = expected["re"].as_f64().unwrap().hypot(expected["im"].as_f64().unwrap());
                near(&pole["re"], &expected["re"], scale);
                near(&pole["im"], &expected["im"], scale);
            }
        }
    }
}

#[test]
fn files_are_written_whole() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new").join("results");
    for command in ["schemes", "chain"] {
        let output = lab(&[command, "--out", out.to_str().unwrap()]);
        assert!(output.status.success() && !output.stdout.is_empty());
        let csv = std::fs::read_to_string(out.join(format!("{command}.csv"))).unwrap();
        assert!(csv.lines().count() > 300 && !csv.contains("NaN"));
        let svg = std::fs::read_to_string(out.join(format!("{command}.svg"))).unwrap();
        assert!(svg.trim_end().ends_with("</svg>") && svg.contains("polyline"));
    }
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 4, "nothing else is left");
}

#[test]
fn what_makes_no_sense_is_refused_in_one_line_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("results");
    for (arguments, said) in [
        (
            &["schemes", "--model-rate-hz", "0"][..],
            "error: --model-rate-hz is 0; it must be finite and above 0",
        ),
        (&["schemes", "--cutoff-hz", "-1"], "error: --cutoff-hz is -1; it must be finite and above 0"),
        (&["schemes", "--duration-s", "NaN"], "error: --duration-s is NaN; it must be 1 to 600"),
        (
            &["schemes", "--model-rate-hz", "2000"],
            "error: --model-rate-hz is 2000; it must be at most the haptic rate, 1000",
        ),
        (&["schemes", "--offset-mm", "35"], "error: --offset-mm is 35; it must be at least 0 and such that"),
        (&["chain", "--mass", "0"], "error: --mass is 0; it must be finite and above 0"),
        (&["chain", "--stiffness", "inf"], "error: --stiffness is inf; it must be finite and above 0"),
        (
            &["chain", "--damping", "abc"],
            "error: invalid value 'abc' for '--damping <DAMPING>': invalid float literal",
        ),
        (&["nonsense"], "error: unrecognized subcommand 'nonsense'"),
    ] {
        let text = refused(&[arguments, &["--out", out.to_str().unwrap()]].concat());
        assert!(text.starts_with(said), "{text}");
    }
    assert!(!out.exists());
}

#[test]
fn help_has_examples() {
    for arguments in [&["schemes", "--help"][..], &["chain", "--help"]] {
        let output = lab(arguments);
        assert!(output.status.success());
        assert!(String::from_utf8(output.stdout).unwrap().contains("Examples:"));
    }
}
