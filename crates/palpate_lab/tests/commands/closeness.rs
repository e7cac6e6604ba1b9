//! How close the loop is to the body, and what it survives.

use super::*;

#[test]
fn fidelity_says_of_every_scheme_how_close_it_is() {
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
    // A block of other sizes, a late model, implicit ticks, rough positions.
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
fn a_recorded_hand_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.csv");
    let rows = (0..600).map(|i| {
        let t = f64::from(i) * 1e-3;
        format!("{t},0,0,{}\n", -0.004 * (10.0 * t).sin().abs())
    });
    std::fs::write(&path, String::from("t_s,x_m,y_m,z_m\n") + &rows.collect::<String>()).unwrap();
    let path = path.to_str().unwrap();
    let run = |more: &[&str]| json(&[&["manipulate", "--nodes", "4", "--trajectory", path], more].concat());
    let (slow, fast) = (run(&["--model-rate-hz", "20"]), run(&["--model-rate-hz", "200"]));
    assert!(number(&fast["relative_rms_error"]) < 0.5 * number(&slow["relative_rms_error"]));
    // At the haptic rate the full model speaks at every tick.
    let every = run(&["--model-rate-hz", "1000", "--scheme", "hold"]);
    assert!(number(&every["relative_rms_error"]) < 1e-12, "{every}");
    let touch = run(&["--contact", "touch"]);
    assert!(number(&touch["peak_force_n"]) > 0.0);
    for (text, said) in [
        ("t,x\n", "error: the trajectory cannot be read"),
        (
            "t_s,x_m,y_m,z_m\n0,0,0,0\n0.001,0,0,0\n",
            "error: number of rows of the trajectory is 2; it must be at least 202",
        ),
    ] {
        std::fs::write(path, text).unwrap();
        let text = refused(&["manipulate", "--trajectory", path]);
        assert!(text.starts_with(said), "{text}");
    }
}

#[test]
fn a_loosened_grip_needs_the_local_model() {
    let schemes = &json(&["grip"])["schemes"];
    for (scheme, outcome) in
        [("full", "settles"), ("neighbourhood", "settles"), ("hold", "diverges"), ("tangent", "diverges")]
    {
        assert_eq!(schemes[scheme]["outcome"], outcome, "{scheme}");
    }
    // A firm grip holds everything.
    let firm = &json(&["grip", "--damping", "200", "--duration-s", "1"])["schemes"];
    assert!(firm.as_object().unwrap().values().all(|scheme| scheme["outcome"] == "settles"), "{firm}");
    // Once the full model is fast enough, even a held force will do.
    assert_eq!(json(&["grip", "--model-rate-hz", "500"])["schemes"]["hold"]["outcome"], "settles");
}

#[test]
fn every_fault_is_survived() {
    let report = json(&["faults"]);
    let faults = report["faults"].as_array().unwrap();
    assert!(faults.len() >= 20, "{}", faults.len());
    for fault in faults {
        let name = fault["name"].as_str().unwrap();
        assert_eq!(fault["survived"], true, "{fault:#}");
        // Ten newtons and half a newton a tick; on a thread four ticks' worth after missed deadlines.
        assert!(number(&fault["max_force_n"]) <= 10.0 + 1e-9, "{name}");
        assert!(number(&fault["max_slew_n_per_ms"]) <= 2.0 + 1e-9, "{name}");
        assert!(number(&fault["max_force_n"]) > 1.5, "{name}: there was no touch to break");
        assert!(fault["ticks_to_safe"].as_u64().unwrap() < 600, "{name}");
    }
    let told = |name: &str| {
        let fault = faults.iter().find(|fault| fault["name"] == name).unwrap();
        fault["told"].as_str().unwrap().to_owned()
    };
    assert!(told("unplug_and_replug").contains("plug it in again"));
    assert!(told("model_stalled_10_s").contains("the model side stands still or is too slow"));
    let text = refused(&["faults", "--only", "earthquake"]);
    assert!(text.contains("no fault has \"earthquake\" in its name"), "{text}");
}
