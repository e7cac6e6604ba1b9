//! Experiments of the seed paper against reference data and closed forms.

use super::*;

#[test]
fn schemes_have_the_lags_and_ratios_of_the_reference() {
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
        // Overdamped: real poles, slightly and far apart.
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
fn default_lattice_is_the_reference_system() {
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
fn balanced_truncations_have_the_errors_of_the_reference() {
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

/// Errors of the report against the responses of the report, which are scalar for a chain.
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
        // The report evaluates more frequencies.
        let (reported, worst) = (number(&here["band_relative_error"]), number(&here["hinf_error_n_per_m"]));
        assert!(reported > 0.9 * band && reported < 1.3 * band + 1e-9, "{method}: {reported}, {band}");
        assert!(worst >= all * (1.0 - 1e-6), "{method}: {worst}, {all}");
        let dc = |key: &str| number(&here[key][0]);
        let (full, reduced) = (dc("static_stiffness_n_per_m"), dc("reduced_static_stiffness_n_per_m"));
        let off = number(&here["dc_relative_error"]) - (1.0 - reduced / full).abs();
        assert!(off.abs() < 1e-12, "{method}: {off}");
    }
}

/// A symmetric mesh of three dimensions has equal pairs of poles.
#[test]
fn errors_of_symmetric_meshes_are_within_their_bounds() {
    for damping in ["0.7", "1", "1.4"] {
        let size = ["--dimension", "3", "--cells", "4", "--order", "16", "--damping", damping];
        let here = json(&[&["lattice"], &size[..]].concat());
        let (error, bound) = (number(&here["hinf_error_n_per_m"]), number(&here["error_bound_n_per_m"]));
        assert!(error <= bound && error > 0.01 * bound, "damping {damping}: {error}, bound {bound}");
        // The norm of a matrix is at least its largest entry, and close to it for a nearly diagonal matrix.
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
fn mesh_too_large_for_the_hamiltonian_uses_a_grid_with_its_resonances() {
    // The grid of the response misses the sharp peaks of light damping.
    let here = json(&["lattice", "--cells", "18", "--method", "neighbourhood", "--damping", "0.05"]);
    // The order is just above the limit of 1200.
    assert_eq!((&here["order"], &here["hinf_method"]), (&Value::from(1220), &Value::from("grid")));
    let response_peak = numbers(&here["response"]["normal_abs_n_per_m"]).into_iter().fold(0.0, f64::max);
    assert!(number(&here["proper_peak_n_per_m"]) > 1000.0 && response_peak > 0.0);
}

#[test]
fn methods_without_gramians_work_where_there_are_none() {
    let here = json(&["lattice", "--cells", "6", "--method", "krylov", "--damping", "1e-7"]);
    assert!(number(&here["dc_relative_error"]) < 1e-9);
    // They ignore the flags of other methods.
    let chain = ["lattice", "--dimension", "1", "--cells", "4", "--method"];
    for method in ["full", "neighbourhood", "scaled", "krylov"] {
        assert_eq!(json(&[&chain[..], &[method]].concat())["order"], 6);
    }
}

#[test]
fn density_lists_scalings_by_dimension() {
    let here = json(&["density", "--dimension", "1,2,3", "--from", "2", "--to", "4"]);
    assert_eq!(here.as_object().unwrap().len(), 3);
    for dimension in ["1", "2", "3"] {
        assert_eq!(numbers(&here[dimension]["density"]), [2.0, 3.0, 4.0]);
        let scaling = numbers(&here[dimension]["scaling"]);
        // Two cells in series are half as stiff, and so is a block on its corners in every dimension.
        close(scaling[0], 0.5, 1e-9);
        assert!(scaling.windows(2).all(|pair| pair[1] < pair[0]));
    }
    close(number(&here["1"]["scaling"][2]), 0.25, 1e-9);
    assert_eq!(json(&["density"]).as_object().unwrap().keys().collect::<Vec<_>>(), ["2", "3"]);
}

#[test]
fn manipulation_has_the_errors_of_the_reference() {
    let reference = reference("fidelity_6x6x6.json");
    for scheme in ["hold", "low_pass", "tangent", "neighbourhood"] {
        let here = json(&["manipulate", "--scheme", scheme]);
        let expected = number(&reference["relative_rms_error"]["delay_0_ms"][scheme]);
        close(number(&here["relative_rms_error"]), expected, 0.005);
        // A held force jumps only at model steps, the first of which does not count.
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
    // The peaks along the axes occur at different times.
    assert!(exact <= peak.sqrt() + 1e-3 && exact >= number(&reference["oracle_peak_abs_n"][2]) - 1e-3);
}

#[test]
fn page_has_a_row_for_every_figure_and_equation() {
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
    // The page is a single file with a dark mode.
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
fn manipulation_follows_a_recorded_trajectory() {
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
    // At the haptic rate every tick has a model step.
    let every = run(&["--model-rate-hz", "1000", "--scheme", "hold"]);
    assert!(number(&every["relative_rms_error"]) < 1e-12, "{every}");
    let touch = run(&["--contact", "touch"]);
    assert!(number(&touch["peak_force_n"]) > 0.0);
    for (text, expected) in [
        ("t,x\n", "error: the trajectory cannot be read"),
        (
            "t_s,x_m,y_m,z_m\n0,0,0,0\n0.001,0,0,0\n",
            "error: number of rows of the trajectory is 2; it must be at least 202",
        ),
    ] {
        std::fs::write(path, text).unwrap();
        let text = rejected(&["manipulate", "--trajectory", path]);
        assert!(text.starts_with(expected), "{text}");
    }
}

#[test]
fn loose_grip_is_stable_only_with_the_local_model() {
    let schemes = &json(&["grip"])["schemes"];
    for (scheme, outcome) in
        [("full", "settles"), ("neighbourhood", "settles"), ("hold", "diverges"), ("tangent", "diverges")]
    {
        assert_eq!(schemes[scheme]["outcome"], outcome, "{scheme}");
    }
    // A firm grip stabilises every scheme.
    let firm = &json(&["grip", "--damping", "200", "--duration-s", "1"])["schemes"];
    assert!(firm.as_object().unwrap().values().all(|scheme| scheme["outcome"] == "settles"), "{firm}");
    // With a fast full model even a held force is stable.
    let fast = json(&["grip", "--model-rate-hz", "500", "--duration-s", "2"]);
    assert_eq!(fast["schemes"]["hold"]["outcome"], "settles");
}
