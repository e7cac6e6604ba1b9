//! `palpate-lab continuum` against converged solutions: quadratic elements on graded meshes, extrapolated.

use super::*;

/// Solves a case with a number of cells along its longest edge.
fn continuum(case: &str, cells: &str, more: &[&str]) -> Value {
    json(&[&["continuum", "--case", case, "--cells", cells], more].concat())
}

fn assert_near(report: &Value, reference: f64, tolerance: f64) {
    let error = number(&report["value"]) / reference - 1.0;
    assert!(error.abs() < tolerance, "{error}: {report}");
}

#[test]
fn cases_are_near_the_converged_solutions() {
    for (poisson, cube_n, end_m) in [
        ("0.25", 2.085_219_4, 1.275_759e-3),
        ("0.45", 2.345_365_2, 1.253_473e-3),
        ("0.49", 2.439_204_0, 1.246_259e-3),
    ] {
        let more = ["--poisson", poisson];
        assert_near(&continuum("bonded-cube", "8", &more), cube_n, 0.016);
        assert_near(&continuum("cantilever", "16", &more), end_m, 0.01);
    }
    assert_near(&continuum("punch", "12", &["--poisson", "0.45"]), 0.577_779, 0.04);
    let report =
        continuum("bonded-cube", "8", &["--law", "neo-hookean", "--poisson", "0.45", "--load", "0.01"]);
    assert_near(&report, 25.805_21, 0.025);
    // The coarser grids are further off.
    let coarser = report["converged_from"].as_array().unwrap();
    assert_eq!(coarser.iter().map(|of| number(&of["cells"])).collect::<Vec<_>>(), [2.0, 4.0]);
    assert!(number(&coarser[0]["value"]) > number(&coarser[1]["value"]));
    assert!(number(&coarser[1]["value"]) > number(&report["value"]));
    assert_eq!((number(&report["elements"]), number(&report["nodes"])), (512.0, 729.0));
    assert_eq!(report["unit"], "N");
}

#[test]
fn modes_are_near_the_converged_frequencies() {
    for (poisson, expected_hz) in [
        ("0.25", [4.764_10, 4.764_10, 6.585_68, 11.300_22]),
        ("0.45", [4.750_18, 4.750_18, 6.129_91, 11.605_24]),
    ] {
        let report = continuum("modes", "8", &["--poisson", poisson]);
        let modes = report["modes_hz"].as_array().unwrap();
        for (mode, expected_hz) in modes.iter().zip(expected_hz) {
            let error = number(&mode[1]) / expected_hz - 1.0;
            assert!(error.abs() < 0.015, "{poisson} {mode}: {error}");
        }
        assert_eq!(report["value"], modes[0][1]);
        assert!(report["load"].is_null());
    }
}

#[test]
fn bar_under_torsion_has_the_torque_of_its_cross_section() {
    // A square bar of side a: 0.1406 μ a⁴ per angle and length (S. Timoshenko and J. N. Goodier, Theory of Elasticity, section 109); the
    // bonded ends add about a tenth.
    let report = continuum("twist", "60", &["--size", "0.02,0.02,0.2", "--load", "2"]);
    let mu = 20e3 / 2.5;
    let free = 0.1406 * mu * 0.02_f64.powi(4) * 2_f64.to_radians() / 0.2;
    let ratio = number(&report["value"]) / free;
    assert!((1.0..1.08).contains(&ratio), "{ratio}");
}

#[test]
fn springs_have_the_stiffness_of_elements_at_their_ratio() {
    let [springs, hexahedra] = ["spring", "hex"]
        .map(|element| number(&continuum("bonded-cube", "8", &["--element", element])["value"]));
    assert!((springs / hexahedra - 1.0).abs() < 0.02, "{springs} N, {hexahedra} N");
}

#[test]
fn invalid_options_name_the_flag() {
    for (arguments, expected) in [
        (&["--case", "punch", "--poisson", "0.5"][..], "--poisson is 0.5; it must be 0 to 0.49"),
        (
            &["--case", "punch", "--element", "spring", "--poisson", "0.3"],
            "--poisson is 0.3; it must be 0.25 with --element spring",
        ),
        (&["--case", "modes", "--load", "1"], "--load is 1; it must be left out for natural frequencies"),
        (&["--case", "twist", "--cells", "1"], "--cells is 1; it must be 2 to 100"),
        (
            &["--case", "twist", "--cells", "60"],
            "--cells is 60; it must be fewer: at most 20000 nodes in all",
        ),
        (&["--case", "twist", "--size", "1,2"], "it must be one number or three"),
    ] {
        let output = run(&[&["continuum"], arguments].concat());
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && text.contains(expected), "{text}");
    }
}
