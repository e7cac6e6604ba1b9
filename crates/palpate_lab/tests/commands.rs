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

fn reference(name: &str) -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/");
    serde_json::from_str(&std::fs::read_to_string(format!("{path}{name}")).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

#[track_caller]
fn close(here: f64, expected: f64, tolerance: f64) {
    assert!((here / expected - 1.0).abs() < tolerance, "{here}, expected {expected}");
}

#[test]
fn schemes_have_the_reference_s_lags_and_ratios() {
    let reference = reference("spring_1d_schemes.json");
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
        // Overdamped: real poles, a little apart and very far.
        &["chain", "--damping", "10000"],
        &["chain", "--stiffness", "1e-6"],
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
fn the_lattice_s_defaults_are_the_reference_s_system() {
    let (reference, here) = (reference("lattice_2d_12.json"), json(&["lattice"]));
    assert_eq!((&here["order"], &here["reduced_order"]), (&Value::from(524), &Value::from(10)));
    let hankel = numbers(&here["hankel_singular_values"]);
    for (here, expected) in hankel.iter().zip(numbers(&reference["hankel_singular_values"])).take(20) {
        close(*here, expected, 1e-6);
    }
    let axes = numbers(&here["static_stiffness_n_per_m"]);
    for (here, expected) in axes.iter().zip(numbers(&reference["static_stiffness_n_per_m"])) {
        close(*here, expected, 1e-9);
    }
    assert!(number(&here["relative_to_proper_peak"]) < 0.01);
    assert!(number(&here["off_diagonal_db"]) < -200.0);
    let hz = numbers(&here["response"]["frequency_hz"]);
    for (i, expected) in numbers(&reference["frequency_hz"]).iter().enumerate() {
        let at = hz.iter().position(|hz| hz == expected).unwrap();
        for what in ["normal", "tangential"] {
            for (key, of) in [("abs_n_per_m", "response_abs_n_per_m"), ("phase_rad", "response_phase_rad")] {
                let here = number(&here["response"][format!("{what}_{key}")][at]);
                close(here, number(&reference[format!("{what}_{of}")][i]), 1e-9);
            }
        }
    }
}

#[test]
fn balanced_truncations_have_the_reference_s_errors() {
    for (order, expected) in reference("lattice_2d_12.json")["balanced"].as_object().unwrap() {
        let here = json(&["lattice", "--order", order]);
        assert_eq!(here["reduced_order"].to_string(), *order);
        for key in ["hinf_error_n_per_m", "relative_to_proper_peak"] {
            close(number(&here[key]), number(&expected[key]), 0.01);
        }
        close(number(&here["error_bound_n_per_m"]), number(&expected["twice_hankel_tail"]), 1e-6);
        assert!(number(&here["hinf_error_n_per_m"]) <= number(&here["error_bound_n_per_m"]));
    }
}

#[test]
fn every_method_reduces_in_every_dimension() {
    for (dimension, cells) in [("1", "8"), ("2", "6"), ("3", "4")] {
        for (method, states) in [
            ("full", None),
            ("balanced", Some(6)),
            ("neighbourhood", None),
            ("scaled", None),
            ("krylov", None),
            ("modal", Some(6)),
        ] {
            let size = ["--dimension", dimension, "--cells", cells, "--order", "6", "--method", method];
            let here = json(&[&["lattice"], &size[..]].concat());
            let (order, reduced) = (number(&here["order"]), number(&here["reduced_order"]));
            assert!(
                states.map_or(reduced <= order, |states| reduced == f64::from(states)),
                "{method}: {reduced}"
            );
            let hz = numbers(&here["response"]["frequency_hz"]).len();
            for which in ["response", "reduced_response"] {
                assert_eq!(numbers(&here[which]["normal_abs_n_per_m"]).len(), hz);
                let tangential = &here[which]["tangential_phase_rad"];
                assert!(if dimension == "1" {
                    tangential.is_null()
                } else {
                    numbers(tangential).len() == hz
                });
            }
            let dc = number(&here["dc_relative_error"]);
            match method {
                "full" => assert!(dc < 1e-9 && number(&here["hinf_error_n_per_m"]) == 0.0),
                "krylov" => assert!(dc < 1e-9),
                "scaled" if dimension == "1" => assert!(dc < 1e-9),
                _ => assert!(dc.is_finite() && number(&here["band_relative_error"]) > 0.0),
            }
            assert!(number(&here["build_ms"]) > 0.0);
        }
    }
}

/// What the report says of errors against what its own responses say, where those are numbers and not matrices.
#[test]
fn errors_of_a_chain_are_those_of_its_responses() {
    for method in ["neighbourhood", "scaled", "krylov", "modal", "balanced"] {
        let size = ["--dimension", "1", "--cells", "7", "--order", "4", "--shifts-hz", "9"];
        let here = json(&[&["lattice", "--band-hz", "5,300", "--method", method], &size[..]].concat());
        let complex = |which: &str| -> Vec<(f64, f64)> {
            let (abs, phase) = (&here[which]["normal_abs_n_per_m"], &here[which]["normal_phase_rad"]);
            numbers(abs).into_iter().zip(numbers(phase)).map(|(r, a)| (r * a.cos(), r * a.sin())).collect()
        };
        let hz = numbers(&here["response"]["frequency_hz"]);
        let (mut band, mut all) = (0.0_f64, 0.0_f64);
        for ((f, r), hz) in complex("response").into_iter().zip(complex("reduced_response")).zip(hz) {
            let error = (f.0 - r.0).hypot(f.1 - r.1);
            all = all.max(error);
            if hz >= 5.0 {
                band = band.max(error / f.0.hypot(f.1));
            }
        }
        // The report looks at more frequencies.
        let (reported, worst) = (number(&here["band_relative_error"]), number(&here["hinf_error_n_per_m"]));
        assert!(reported > 0.9 * band && reported < 1.3 * band + 1e-9, "{method}: {reported}, {band}");
        assert!(worst >= all * (1.0 - 1e-6), "{method}: {worst}, {all}");
        let dc = |key: &str| number(&here[key][0]);
        let (full, reduced) = (dc("static_stiffness_n_per_m"), dc("reduced_static_stiffness_n_per_m"));
        let off = number(&here["dc_relative_error"]) - (1.0 - reduced / full).abs();
        assert!(off.abs() < 1e-12, "{method}: {off}");
    }
}

/// Poles come in equal pairs in a symmetric mesh of three dimensions.
#[test]
fn errors_of_symmetric_meshes_keep_their_bounds() {
    for damping in ["0.7", "1", "1.4"] {
        let size = ["--dimension", "3", "--cells", "4", "--order", "16", "--damping", damping];
        let here = json(&[&["lattice"], &size[..]].concat());
        let (error, bound) = (number(&here["hinf_error_n_per_m"]), number(&here["error_bound_n_per_m"]));
        assert!(error <= bound && error > 0.01 * bound, "damping {damping}: {error}, bound {bound}");
        // The norm of a matrix is at least its largest entry, and with little off the diagonal not much more.
        let list = |key: &str| numbers(&here[key]);
        let pairs =
            list("static_stiffness_n_per_m").into_iter().zip(list("reduced_static_stiffness_n_per_m"));
        let worst = pairs.map(|(f, r)| (f - r).abs()).fold(0.0, f64::max);
        let expected = worst / list("static_stiffness_n_per_m")[0];
        let dc = number(&here["dc_relative_error"]);
        assert!(dc >= expected * (1.0 - 1e-6) && dc < 2.0 * expected, "{dc}, {expected}");
    }
}

#[test]
fn a_mesh_too_large_for_the_hamiltonian_is_looked_at_where_it_resonates() {
    // Beside the response's own grid, which misses the sharp peaks of light damping.
    let here = json(&["lattice", "--cells", "19", "--method", "neighbourhood", "--damping", "0.05"]);
    assert_eq!(here["hinf_method"], "grid");
    let seen = numbers(&here["response"]["normal_abs_n_per_m"]).into_iter().fold(0.0, f64::max);
    assert!(number(&here["proper_peak_n_per_m"]) > 1000.0 && seen > 0.0);
}

#[test]
fn methods_that_need_no_gramians_do_without() {
    let here = json(&["lattice", "--cells", "6", "--method", "krylov", "--damping", "1e-7"]);
    assert!(number(&here["dc_relative_error"]) < 1e-9);
    // Nor do they look at flags that are others'.
    let chain = ["lattice", "--dimension", "1", "--cells", "4", "--method"];
    for method in ["full", "neighbourhood", "scaled", "krylov"] {
        assert_eq!(json(&[&chain[..], &[method]].concat())["order"], 6);
    }
}

#[test]
fn densities_are_listed_by_dimension() {
    let here = json(&["density", "--dimension", "1,2,3", "--from", "2", "--to", "4"]);
    assert_eq!(here.as_object().unwrap().len(), 3);
    for dimension in ["1", "2", "3"] {
        assert_eq!(numbers(&here[dimension]["density"]), [2.0, 3.0, 4.0]);
        let scaling = numbers(&here[dimension]["scaling"]);
        // Two cells in a row are half as stiff, and so it is in every dimension on the corners.
        close(scaling[0], 0.5, 1e-9);
        assert!(scaling.windows(2).all(|pair| pair[1] < pair[0]));
    }
    close(number(&here["1"]["scaling"][2]), 0.25, 1e-9);
    assert_eq!(json(&["density"]).as_object().unwrap().keys().collect::<Vec<_>>(), ["2", "3"]);
}

#[test]
fn manipulation_has_the_reference_s_errors() {
    let reference = reference("fidelity_6x6x6.json");
    for scheme in ["hold", "low_pass", "tangent", "neighbourhood"] {
        let here = json(&["manipulate", "--scheme", scheme]);
        let expected = number(&reference["relative_rms_error"]["delay_0_ms"][scheme]);
        close(number(&here["relative_rms_error"]), expected, 0.005);
        // At no tick but a model step's does a held force jump, and not when the first model comes either.
        let (jump, held) = (number(&here["largest_jump_n"]), number(&here["low_rate"]["largest_jump_n"]));
        assert!(
            if scheme == "hold" { jump == held } else { jump < held },
            "{scheme}: {jump} N, held {held} N"
        );
    }
    let fast = |scheme| {
        number(&json(&["manipulate", "--model-rate-hz", "100", "--scheme", scheme])["largest_jump_n"])
    };
    assert!(fast("tangent") < 0.7 * fast("hold"));
    let here = json(&["manipulate"]);
    assert_eq!(here["scheme"], "neighbourhood");
    let peak: f64 = numbers(&reference["oracle_peak_abs_n"]).iter().map(|f| f * f).sum();
    let exact = number(&here["exact"]["peak_force_n"]);
    // The peaks along the axes come at different times.
    assert!(exact <= peak.sqrt() + 1e-3 && exact >= number(&reference["oracle_peak_abs_n"][2]) - 1e-3);
}

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
fn the_report_has_a_row_for_every_figure_and_equation() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("paper");
    let here = json(&["paper", "--out", out.to_str().unwrap()]);
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    let rows = here["rows"].as_array().unwrap();
    let place = |row: &Value| row["place"].as_str().unwrap().to_owned();
    for figure in 1..=18 {
        assert!(rows.iter().any(|row| place(row) == format!("Fig. {figure}")), "Fig. {figure}");
    }
    for equations in ["Eqs. 1-4", "Eq. 5", "Eq. 6", "Eqs. 7-9", "Eq. 10", "Eq. 11", "Eq. 12", "Eq. 13"] {
        assert!(rows.iter().any(|row| place(row) == equations), "{equations}");
    }
    let here = |place: &str, what: &str| {
        let row =
            rows.iter().find(|row| row["place"] == place && row["what"].as_str().unwrap().contains(what));
        row.unwrap_or_else(|| panic!("{place}, {what}"))["here"].as_str().unwrap().to_owned()
    };
    assert!(here("Section 4", "order of the linear system").contains("524"));
    assert_eq!(here("Section 3", "cube"), "6000");
    assert!(here("Section 2", "held force").contains(", 49 ms"));
    // It needs nothing but itself, and knows the dark.
    assert!(page.trim_end().ends_with("</html>") && page.contains("prefers-color-scheme: dark"));
    assert_eq!(page.matches("<tr><th class=\"place\"").count(), rows.len());
    let drawn = page.matches("<svg ").count();
    assert!(drawn >= 14 && drawn == page.matches("</svg>").count(), "{drawn} figures");
    for outside in ["src=", "href=", "url(", "@import", "<script"] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert_eq!(page.matches("NaN").count(), 0);
}

#[test]
fn files_are_written_whole() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new").join("results");
    let mut expected = 0;
    for (arguments, names) in [
        (&["schemes"][..], &["schemes"][..]),
        (&["chain"], &["chain"]),
        (
            &["lattice", "--cells", "6"],
            &["lattice_response", "lattice_hankel", "lattice_states", "lattice_mesh"],
        ),
        (&["density", "--to", "3"], &["density"]),
        (&["manipulate", "--nodes", "4"], &["manipulate"]),
        (&["grip", "--duration-s", "1"], &["grip"]),
    ] {
        let output = lab(&[arguments, &["--out", out.to_str().unwrap()]].concat());
        assert!(output.status.success() && !output.stdout.is_empty(), "{arguments:?}");
        assert!(output.stderr.is_empty(), "no bar where there is no terminal");
        for name in names {
            let svg = std::fs::read_to_string(out.join(format!("{name}.svg"))).unwrap();
            assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"));
            expected += 1;
            if *name != "lattice_mesh" {
                let csv = std::fs::read_to_string(out.join(format!("{name}.csv"))).unwrap();
                let columns = csv.lines().next().unwrap().split(',').count();
                assert!(
                    csv.lines().count() > 3 && csv.lines().all(|line| line.split(',').count() == columns)
                );
                assert!(!csv.contains("NaN") && !csv.contains("inf"));
                expected += 1;
            }
        }
    }
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), expected, "nothing else is left");
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let text = refused(&["chain", "--out", file.path().to_str().unwrap()]);
    assert!(text.contains("cannot be written") && text.contains(file.path().to_str().unwrap()), "{text}");
    // What stands in the way of the second file keeps the first from being written.
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("chain.svg")).unwrap();
    assert!(
        refused(&["chain", "--out", folder.path().to_str().unwrap()]).contains("chain.svg cannot be written")
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let inside = file.path().join("deeper");
    assert!(refused(&["chain", "--out", inside.to_str().unwrap()]).contains("cannot be written"));
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
        (&["chain", "--mass", "0"], "error: --mass is 0; it must be 1e-9 to 1e9"),
        (&["chain", "--stiffness", "inf"], "error: --stiffness is inf; it must be 1e-9 to 1e9"),
        (
            &["chain", "--damping", "abc"],
            "error: invalid value 'abc' for '--damping <DAMPING>': it must be a number",
        ),
        (&["nonsense"], "error: unrecognized subcommand 'nonsense'"),
        (
            &["lattice", "--order", "525"],
            "error: --order is 525; it must be 1 to 524, the order of the system",
        ),
        (&["lattice", "--order", "0"], "error: --order is 0; it must be 1 to 524"),
        (
            &["lattice", "--order", "-3"],
            "error: invalid value '-3' for '--order <ORDER>': it must be a whole number",
        ),
        (&["lattice", "--method", "modal", "--order", "5"], "error: --order is 5; it must be even"),
        (
            &["lattice", "--method", "fast"],
            "error: invalid value 'fast' for '--method <METHOD>' [possible values: full, ",
        ),
        (&["lattice", "--dimension", "4"], "error: --dimension is 4; it must be 1, 2 or 3"),
        (&["lattice", "--cells", "1"], "error: --cells is 1; it must be at least 2"),
        (&["lattice", "--cells", "60"], "error: --cells is 60; it must be so few that"),
        (&["lattice", "--damping", "0"], "error: --damping is 0; it must be 1e-9 to 1e9"),
        (
            &["lattice", "--band-hz", "1000,10"],
            "error: high end of --band-hz is 10; it must be above its low end, 1000",
        ),
        (&["lattice", "--band-hz", "NaN,10"], "error: low end of --band-hz is NaN"),
        (&["lattice", "--band-hz", "10"], "error: number of frequencies of --band-hz is 1; it must be 2"),
        (&["lattice", "--shifts-hz", "5,-20"], "error: --shifts-hz is -20; it must be 1e-6 to 1e9"),
        (&["lattice", "--method", "scaled", "--rings", "0"], "error: --rings is 0; it must be 1 to 12"),
        (&["lattice", "--stiffness", "-inf"], "error: --stiffness is -inf; it must be 1e-9 to 1e9"),
        (&["schemes", "--amplitude-mm", "1e3"], "error: --amplitude-mm is 1000; it must be 0.001 to 38.36"),
        (
            &["schemes", "--frequency-hz", "600"],
            "error: --frequency-hz is 600; it must be above 0 and at most half",
        ),
        (&["schemes", "--force-step-n", "1e-310"], "error: --force-step-n is "),
        (&["density", "--dimension", "2,5"], "error: --dimension is 5; it must be 1, 2 or 3"),
        (&["density", "--from", "7", "--to", "6"], "error: --to is 6; it must be at least --from, 7"),
        (&["density", "--to", "1000"], "error: --to is 1000; it must be at most 200 in dimension 2"),
        (&["manipulate", "--nodes", "1"], "error: --nodes is 1; it must be 2 to 24"),
        (&["manipulate", "--model-rate-hz", "2000"], "error: --model-rate-hz is 2000; it must be 1 to 1000"),
        (&["manipulate", "--trajectory", "no/such.csv"], "error: the trajectory cannot be read: no/such.csv"),
        (&["grip", "--device-mass-kg", "0"], "error: --device-mass-kg is 0; it must be 0.001 to 100"),
        (
            &["fidelity", "--nodes", "6,6"],
            "error: invalid value '6,6' for '--nodes <X,Y,Z>': it must be three numbers",
        ),
        (&["fidelity", "--nodes", "1,6,6"], "error: --nodes is 1; it must be 2 to 24 along each axis"),
        (
            &["fidelity", "--scheme", "best"],
            "error: invalid value 'best' for '--scheme <SCHEME>': there is no such scheme",
        ),
        (
            &["fidelity", "--velocity", "two-pole:-1"],
            "error: invalid value 'two-pole:-1' for '--velocity <VELOCITY>': ",
        ),
        (
            &["fidelity", "--integrator", "implicit:0"],
            "error: invalid value 'implicit:0' for '--integrator <INTEGRATOR>': ",
        ),
        (&["fidelity", "--position-step-mm", "-1"], "error: --position-step-mm is -1; it must be 0 to 10"),
        (&["paper", "--nonsense"], "error: unexpected argument '--nonsense' found"),
    ] {
        let text = refused(&[arguments, &["--out", out.to_str().unwrap()]].concat());
        assert!(text.starts_with(said), "{text}");
    }
    assert!(!out.exists());
}

#[test]
fn help_has_examples() {
    for command in
        ["schemes", "chain", "lattice", "density", "manipulate", "grip", "paper", "fidelity", "blackbox"]
    {
        let output = lab(&[command, "--help"]);
        assert!(output.status.success());
        assert!(String::from_utf8(output.stdout).unwrap().contains("Examples:"), "{command}");
    }
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
