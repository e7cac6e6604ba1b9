//! `palpate-lab soak`: guarantees that hold on any machine. Times are not checked.

use palpate_haptics::{DenialReason, Outcome};
use serde_json::Value;
use std::process::Output;

fn soak(arguments: &[&str]) -> Output {
    let _timed = super::timed();
    super::run(&[&["soak"], arguments].concat())
}

fn json(arguments: &[&str]) -> Value {
    let output = soak(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn count(value: &Value, key: &str) -> u64 {
    value[key].as_u64().unwrap_or_else(|| panic!("{key}: {} is not a count", value[key]))
}

/// Starts of the texts of a real-time request's outcome: not requested, granted, denied with a reason.
fn outcomes() -> [String; 3] {
    let denied = Outcome::Denied(DenialReason::NotPermitted).to_string();
    let denied = denied.split(':').next().unwrap().to_owned();
    [Outcome::NotRequested.to_string(), Outcome::Granted.to_string(), denied]
}

#[track_caller]
fn assert_guarantees(report: &Value, load: &str, seconds: u64) {
    assert_eq!((report["load"].as_str(), count(report, "seconds")), (Some(load), seconds));
    assert_eq!(report["accounted"], Value::Bool(true), "{report}");
    for key in ["allocations_on_loop", "forces_out_of_limits", "dropped_records", "dropped_events"] {
        assert_eq!(count(report, key), 0, "{key}: {report}");
    }
    assert!(report["models_rejected"].is_u64() && report["samples_lost"].is_u64());
    let (ticks, missed) = (count(report, "ticks"), count(report, "missed"));
    assert!(ticks > 0 && ticks + missed >= 1000 * seconds - 500, "{ticks} ticks, {missed} missed");
    assert!(count(report, "bare_ticks") > 0 && count(report, "model_steps") > 0);
    assert!(report["bare_missed"].is_u64() && report["gaps"].is_u64() && report["overruns"].is_u64());
    for key in ["lateness_us", "bare_lateness_us", "period_us", "cost_us"] {
        let at = |which: &str| report[key][which].as_f64().unwrap();
        assert!(at("p50") > 0.0, "{key}");
        assert!(at("p50") <= at("p99") && at("p99") <= at("p999") && at("p999") <= at("max"), "{key}");
    }
    let ratio = report["lateness_ratio_p99"].as_f64().unwrap();
    let p99 = |key: &str| report[key]["p99"].as_f64().unwrap();
    assert!((ratio - p99("lateness_us") / p99("bare_lateness_us")).abs() < 1e-9);
    assert!(report["oldest_model_ms"].as_f64().unwrap() >= 0.0);
    assert!(report["model_step_ms"]["mean"].as_f64() <= report["model_step_ms"]["max"].as_f64());
    for thread in ["real_time", "bare_real_time"] {
        for setting in ["priority", "memory", "core"] {
            let text = report[thread][setting].as_str().unwrap();
            assert!(outcomes().iter().any(|outcome| text.starts_with(outcome)), "{text}");
        }
    }
    let memory = &report["memory_bytes"];
    if cfg!(target_os = "linux") {
        assert!(memory["start"].as_u64() > Some(0) && memory["end"].as_u64() > Some(0), "{memory}");
    }
    // Only longer runs have these.
    for key in ["after_10_s", "growth", "kept_by_model_side"] {
        assert!(memory[key].is_null(), "{memory}");
    }
}

#[test]
fn soak_without_load_accounts_for_every_deadline_and_allocates_nothing() {
    let report = json(&["--seconds", "2", "--load", "none", "--nodes", "6"]);
    assert_guarantees(&report, "none", 2);
    assert_eq!(count(&report, "load_rounds"), 0);
    assert!(count(&report, "models_adopted") > 0 && count(&report, "ticks_with_force") > 0, "{report}");
}

#[test]
fn soak_under_cpu_load_accounts_for_every_deadline_and_allocates_nothing() {
    let report = json(&["--seconds", "2", "--load", "cpu"]);
    assert_guarantees(&report, "cpu", 2);
    assert!(count(&report, "load_rounds") > 0);
}

/// Without a priority, on core 0, with a busy disk.
#[test]
fn requests_only_the_given_real_time_settings() {
    let arguments = ["--seconds", "1", "--load", "io", "--nodes", "4", "--core", "0", "--priority", "none"];
    let report = json(&arguments);
    assert_guarantees(&report, "io", 1);
    let not_requested = Outcome::NotRequested.to_string();
    assert_eq!(report["real_time"]["priority"], not_requested);
    assert_ne!(report["real_time"]["core"], not_requested);
    assert_eq!(report["real_time"]["core"], report["bare_real_time"]["core"]);
}

#[test]
fn table_has_the_rows_of_the_report() {
    let output = soak(&["--seconds", "1", "--load", "none", "--nodes", "4"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    for row in ["missed deadlines", "lateness, us", "bare thread, us", "ratio at p99", "forces out of limits"]
    {
        assert!(text.lines().any(|line| line.starts_with(row)), "{row} in\n{text}");
    }
}

#[test]
fn rejects_invalid_arguments_in_one_line() {
    for (arguments, expected) in [
        (["--seconds", "0"], "1 to 86400"),
        (["--seconds", "86401"], "1 to 86400"),
        (["--seconds", "1.5"], "whole number"),
        (["--load", "disk"], "possible values: cpu, io, none"),
        (["--priority", "0"], "1 to 99, or none"),
        (["--priority", "100"], "1 to 99, or none"),
        (["--core", "-1"], "whole number"),
        (["--nodes", "1"], "2 to 24"),
        (["--stiffness", "0"], "above 0"),
        (["--damping-ratio", "-1"], "0 to 10"),
    ] {
        let output = soak(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains(expected) && text.lines().count() == 1, "{arguments:?}: {text}");
    }
}
