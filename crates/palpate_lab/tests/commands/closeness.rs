//! `palpate-lab fidelity` and `palpate-lab faults`.

use super::*;
use palpate_haptics::{DeviceError, LoopEventKind};

#[test]
fn fidelity_reports_the_error_of_every_scheme() {
    let reference = reference("fidelity_6x6x6.json");
    let here = json(&["fidelity"]);
    for scheme in ["hold", "low_pass", "tangent", "neighbourhood", "krylov_linear"] {
        let expected = number(&reference["relative_rms_error"]["delay_0_ms"][scheme]);
        close(number(&here["schemes"][scheme]["relative_rms_error"]), expected, 0.005);
    }
    let near = &here["schemes"]["near_field_exact"];
    assert!(number(&near["relative_rms_error"]) < 0.003 && number(&near["max_error_n"]) < 0.03);
    assert!(number(&near["states"]) > 0.0 && number(&near["tick_us_p50"]) > 0.0);
    assert!(number(&near["build_ms_p50"]) > 0.0 && number(&near["largest_jump_n"]) > 0.0);
    for (here, expected) in
        numbers(&here["oracle"]["peak_abs_n"]).iter().zip(numbers(&reference["oracle_peak_abs_n"]))
    {
        close(*here, expected, 0.003);
    }
    // A block of another size, a late model, implicit ticks, rounded positions.
    let error = |arguments: &[&str]| {
        let all = [&["fidelity", "--scheme", "near_field_exact"][..], arguments].concat();
        let here = json(&all);
        assert_eq!(here["schemes"].as_object().unwrap().len(), 1);
        number(&here["schemes"]["near_field_exact"]["relative_rms_error"])
    };
    assert!(error(&["--nodes", "7,6,5", "--delay-ms", "40"]) < 0.006);
    assert!((0.001..0.004).contains(&error(&["--integrator", "implicit:2"])));
    assert!(error(&["--position-step-mm", "0.03", "--velocity", "two-pole:80"]) < 0.03);
}

#[test]
fn every_fault_is_survived() {
    let _timed = timed();
    let report = json(&["faults"]);
    let faults = report["faults"].as_array().unwrap();
    assert!(faults.len() >= 20, "{}", faults.len());
    for fault in faults {
        let name = fault["name"].as_str().unwrap();
        assert_eq!(fault["survived"], true, "{fault:#}");
        // Ten newtons, and half a newton per tick; on a thread the growth of four ticks after missed deadlines.
        assert!(number(&fault["max_force_n"]) <= 10.0 + 1e-9, "{name}");
        assert!(number(&fault["max_slew_n_per_ms"]) <= 2.0 + 1e-9, "{name}");
        assert!(number(&fault["max_force_n"]) > 1.5, "{name}: there was no contact");
        assert!(fault["ticks_to_safe"].as_u64().unwrap() < 600, "{name}");
    }
    let report_of = |name: &str| {
        let fault = faults.iter().find(|fault| fault["name"] == name).unwrap();
        fault["told"].as_str().unwrap().to_owned()
    };
    assert!(report_of("unplug_and_replug").contains(&DeviceError::Disconnected.to_string()));
    let stale = LoopEventKind::ModelStale(3.0).to_string();
    assert!(report_of("model_stalled_10_s").starts_with(stale.split("3.0").next().unwrap()));
    let text = rejected(&["faults", "--only", "earthquake"]);
    assert!(text.contains("no fault has \"earthquake\" in its name"), "{text}");
}
