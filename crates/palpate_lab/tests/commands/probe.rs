//! `palpate-lab probe`. Places lie off the nodes, edges and diagonals of the grid.

use super::*;
use std::path::Path;

/// A press that is short, on a small block.
const SHORT: [&str; 7] = ["probe", "--nodes", "5,5,5", "--edge-m", "0.04", "--hold-s", "0.3"];

fn probe(more: &[&str]) -> Value {
    json(&[&SHORT[..], more].concat())
}

fn force(report: &Value, press: usize, of: &str) -> Vec<f64> {
    numbers(&report["presses"][press][of])
}

#[test]
fn report_has_every_field() {
    let here = probe(&["--at", "3,2", "--at", "-2.5,1.5", "--depth-mm", "1.5"]);
    let presses = here["presses"].as_array().unwrap();
    assert_eq!(presses.len(), 2);
    for press in presses {
        assert_eq!(number(&press["depth_mm"]), 1.5);
        for of in ["body_force_n", "loop_force_n"] {
            let [x, y, z] = numbers(&press[of])[..] else { panic!("{press}") };
            assert!(y > 0.1 && x.abs() < 0.01 * y && z.abs() < 0.01 * y, "{press}");
        }
        let apart = number(&press["body_force_n"][1]) - number(&press["loop_force_n"][1]);
        assert!(apart.abs() < 1e-5 * number(&press["body_force_n"][1]), "{press}");
        let ticks = ["first_force_tick", "crossing_tick", "unconverged_steps", "unconverged_ticks"];
        for whole in ticks.iter().chain(&["inverted_cells"]) {
            assert!(press[whole].is_u64(), "{whole}: {press}");
        }
        // The approach is slow enough for the local model to contain the surface.
        assert_eq!(press["first_force_tick"], press["crossing_tick"]);
        assert_eq!(number(&press["inverted_cells"]), 0.0);
        assert!(number(&press["step_ms_max"]) >= number(&press["step_ms_p50"]));
        assert!(number(&press["step_ms_p50"]) > 0.0);
    }
    assert!(here["ripple"].is_null() && here["loop_ripple"].is_null());
    // The default place is the centre of the top.
    let center = probe(&["--depth-mm", "0.5"]);
    assert_eq!(number(&center["presses"][0]["x_mm"]), 0.0);
}

#[test]
fn closed_form_is_that_of_the_half_space() {
    let modulus = 20e3 / (1.0 - 1.0 / 16.0);
    let hertz = |more: &[&str]| number(&probe(&[&["--at", "3,2"], more].concat())["hertz_n"]);
    close(hertz(&["--depth-mm", "2"]), 4.0 / 3.0 * modulus * 0.005_f64.sqrt() * 0.002_f64.powf(1.5), 1e-9);
    let beyond = 4.0 / 3.0 * modulus * 0.005_f64.powi(2) + 2.0 * modulus * 0.005 * 0.003;
    close(hertz(&["--depth-mm", "8"]), beyond, 1e-9);
    close(hertz(&["--tool", "punch:0.004", "--depth-mm", "1"]), 2.0 * 0.004 * modulus * 0.001, 1e-9);
    close(hertz(&["--youngs-pa", "5e3"]), hertz(&[]) / 4.0, 1e-9);
}

#[test]
fn opposite_places_have_equal_forces() {
    let here = probe(&["--at", "3,2", "--at", "-3,-2", "--at", "-3,2"]);
    for of in ["body_force_n", "loop_force_n"] {
        let [one, turned, mirrored] = [0, 1, 2].map(|press| force(&here, press, of));
        // A half-turn about y and a mirror map the block onto itself, and its contact surface too.
        for (other, [x, z]) in [(turned, [-1.0, -1.0]), (mirrored, [-1.0, 1.0])] {
            for (here, there) in [x * one[0], one[1], z * one[2]].into_iter().zip(other) {
                assert!((here - there).abs() < 1e-9 * one[1], "{of}: {here} N and {there} N");
            }
        }
    }
}

#[test]
fn turned_body_and_hand_have_equal_forces() {
    let at = ["--at", "3,2", "--friction", "0.3", "--coupling", "virtual"];
    let still = probe(&at);
    let turned = probe(&[&at[..], &["--turn-deg", "35"]].concat());
    for of in ["body_force_n", "loop_force_n"] {
        let (still, turned) = (force(&still, 0, of), force(&turned, 0, of));
        for (a, b) in still.iter().zip(&turned) {
            assert!((a - b).abs() < 1e-9 * still[1], "{of}: {still:?}, turned {turned:?}");
        }
    }
}

#[test]
fn lump_integrator_and_coupling_change_the_force() {
    let normal = |more: &[&str]| force(&probe(&[&["--at", "3,2"], more].concat()), 0, "body_force_n")[1];
    let plain = normal(&[]);
    let lump = normal(&["--lump", "3,-8,2:8:200000"]);
    assert!(lump > 1.1 * plain, "{lump} N, {plain} N");
    close(normal(&["--integrator", "implicit"]), plain, 1e-3);
    // The coupling is in series with the body, and much stiffer.
    let coupled = normal(&["--coupling", "virtual"]);
    assert!(coupled < plain && coupled > 0.99 * plain, "{coupled} N, {plain} N");
    let punch = probe(&["--at", "3,2", "--tool", "punch:0.004", "--depth-mm", "1"]);
    assert!(force(&punch, 0, "loop_force_n")[1] > 0.1);
}

#[test]
fn force_limit_and_implausible_size_are_named() {
    let warnings = |more: &[&str]| probe(&[&["--at", "3,2"], more].concat())["warnings"].clone();
    let stiff = ["--youngs-pa", "2e6"];
    assert_eq!(warnings(&stiff), Value::Array(Vec::new()));
    let coupled = warnings(&[&stiff[..], &["--coupling", "virtual"]].concat());
    assert_eq!(
        coupled,
        serde_json::json!([
            "the force reached 10 N, the limit of the virtual coupling; change --coupling: rigid has no limit"
        ])
    );
    let large = ["probe", "--nodes", "5,5,5", "--edge-m", "6", "--hold-s", "0.1", "--at", "0,0"];
    let text = String::from_utf8(run(&large).stdout).unwrap();
    assert!(
        text.contains("warning: the body is 6.000 m long") && text.contains("; change --edge-m"),
        "{text}"
    );
}

#[test]
fn scan_has_a_ripple_and_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let here = probe(&["--at", "1,2", "--scan", "-3:3:2", "--z-mm", "2", "--out", out]);
    let presses = here["presses"].as_array().unwrap();
    assert_eq!(presses.len(), 5);
    let normal: Vec<f64> = (1..5).map(|press| force(&here, press, "body_force_n")[1]).collect();
    let (low, high) = normal.iter().fold((f64::MAX, f64::MIN), |(l, h), f| (l.min(*f), h.max(*f)));
    close(number(&here["ripple"]), 4.0 * (high - low) / normal.iter().sum::<f64>(), 1e-9);
    for name in ["probe.svg", "probe_scan.svg"] {
        let svg = std::fs::read_to_string(folder.path().join(name)).unwrap();
        assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>") && !svg.contains("NaN"));
    }
    let rows = |name: &str| {
        let csv = std::fs::read_to_string(folder.path().join(name)).unwrap();
        let columns = csv.lines().next().unwrap().split(',').count();
        assert!(csv.lines().all(|line| line.split(',').count() == columns) && !csv.contains("NaN"));
        csv.lines().count() - 1
    };
    assert_eq!(rows("probe_presses.csv"), 5);
    assert!(rows("probe.csv") > 5 * 300);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
}

#[test]
fn table_names_units_and_unsettled_presses() {
    let output = run(&[&SHORT[..], &["--at", "3,2"]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && text.contains("Hertz, elastic half-space: 0.1"), "{text}");
    assert!(text.contains("x, mm") && text.contains("forces at the end, N") && text.contains("not settled"));
}

/// A box of 40 x 20 x 30 mm as a .gltf file in millimetres, its vertices in a separate file, moved up by half a metre by a node.
fn box_file(folder: &Path) -> String {
    let corners = (0..8).map(|i| [1, 2, 4].map(|bit| if i & bit == 0 { -0.5_f32 } else { 0.5 }));
    let sides: [[u16; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = sides.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]);
    let mut binary: Vec<u8> = corners.flatten().flat_map(f32::to_le_bytes).collect();
    binary.extend(triangles.flat_map(u16::to_le_bytes));
    std::fs::write(folder.join("box.bin"), &binary).unwrap();
    let text = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
        "nodes":[{"children":[1],"translation":[0,500,0]},{"mesh":0,"scale":[40,20,30]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
        "accessors":[
            {"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[-0.5,-0.5,-0.5],"max":[0.5,0.5,0.5]},
            {"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":96},{"buffer":0,"byteOffset":96,"byteLength":72}],
        "buffers":[{"uri":"box.bin","byteLength":168}]}"#;
    let path = folder.join("box.gltf");
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn mesh_of_whole_cells_has_about_the_force_of_the_block() {
    let folder = tempfile::tempdir().unwrap();
    let path = box_file(folder.path());
    let press = ["--hold-s", "0.3", "--at", "3,2", "--depth-mm", "1.5"];
    let mesh = ["probe", "--mesh", &path, "--scale", "0.001", "--cells", "4"];
    let here = json(&[&mesh[..], &press].concat());
    let block = json(&[&["probe", "--nodes", "5,3,4", "--edge-m", "0.04"], &press[..]].concat());
    for of in ["body_force_n", "loop_force_n"] {
        close(force(&here, 0, of)[1], force(&block, 0, of)[1], 0.02);
    }
    // A place off the body, and units other than metres.
    let beyond = rejected(&[&mesh[..], &["--at", "21,0"]].concat());
    assert!(beyond.starts_with("error: --at has the place 21,0 mm, where no surface lies below"), "{beyond}");
    assert!(beyond.contains("-20.0 to 20.0 mm along x and -15.0 to 15.0 mm along z"), "{beyond}");
    let units = rejected(&["probe", "--mesh", &path]);
    assert!(
        units.contains("40 m") && units.contains("`metres_per_unit` (--scale), for example by 0.001"),
        "{units}"
    );
    std::fs::remove_file(folder.path().join("box.bin")).unwrap();
    assert!(rejected(&["probe", "--mesh", &path]).contains("box.bin`, which cannot be read"));
    std::fs::write(&path, "{").unwrap();
    assert!(rejected(&["probe", "--mesh", &path]).contains("file is not valid: "));
}

#[test]
fn rejects_invalid_flags_by_name() {
    for (arguments, expected) in [
        (&["--body", "ball"][..], "invalid value 'ball' for '--body <BODY>' [possible values: block]"),
        (&["--nodes", "6,6"], "invalid value '6,6' for '--nodes <X,Y,Z>': it must be three numbers"),
        (&["--nodes", "1,6,6"], "--nodes is 1; it must be 2 to 24 along each axis"),
        (&["--edge-m", "0"], "--edge-m is 0; it must be 0.001 to 10"),
        (&["--cells", "5"], "the following required arguments were not provided: --mesh <FILE>"),
        (&["--mesh", "no/such.glb"], "--mesh no/such.glb: mesh file `no/such.glb` cannot be read"),
        (
            &["--mesh", "a.glb", "--nodes", "6,6,6"],
            "the argument '--mesh <FILE>' cannot be used with '--nodes",
        ),
        (&["--mesh", "a.glb", "--cells", "0"], "--cells is 0; it must be 1 to 127"),
        (&["--youngs-pa", "-5"], "--youngs-pa is -5; it must be 1 to 1e9"),
        (&["--density", "inf"], "--density is inf; it must be 1 to 100000"),
        (&["--damping", "-1"], "--damping is -1; it must be 0 to 100"),
        (
            &["--tool", "cone:0.005"],
            "invalid value 'cone:0.005' for '--tool <sphere:RADIUS_M|punch:RADIUS_M>': it must",
        ),
        (&["--tool", "sphere:0"], "radius of --tool, m is 0; it must be 1e-5 to 1"),
        (&["--friction", "-0.1"], "--friction is -0.1; it must be 0 to 100"),
        (
            &["--coupling", "loose"],
            "invalid value 'loose' for '--coupling <COUPLING>' [possible values: rigid, virtual]",
        ),
        (&["--at", "4.3"], "invalid value '4.3' for '--at <X_MM,Z_MM>': it must be X_MM,Z_MM"),
        (&["--at", "NaN,0"], "--at is NaN; it must be -10000 to 10000 mm"),
        (
            &["--at", "0,51"],
            "--at has the place 0,51 mm, where no surface lies below the tool; it must be over",
        ),
        (&["--scan", "40:60:10"], "--scan has the place 60,0 mm, where no surface lies below the tool"),
        (&["--scan", "0:10"], "invalid value '0:10' for '--scan <FROM:TO:STEP>': it must be FROM:TO:STEP"),
        (&["--scan", "0:10:0"], "step of --scan is 0; it must be finite and above 0 mm"),
        (&["--scan", "10:0:1"], "end of --scan is 0; it must be at least its start, 10"),
        (&["--scan", "0:10:0.001"], "number of presses is 10001; it must be at most 1000"),
        (&["--z-mm", "3"], "the following required arguments were not provided: --scan <FROM:TO:STEP>"),
        (&["--depth-mm", "0"], "--depth-mm is 0; it must be above 0 and at most 1000"),
        (&["--speed-m-per-s", "20"], "--speed-m-per-s is 20; it must be 0.001 to 15"),
        (&["--hold-s", "0"], "--hold-s is 0; it must be 0.1 to 60"),
        (&["--turn-deg", "400"], "--turn-deg is 400; it must be -360 to 360"),
        (&["--integrator", "exact"], "invalid value 'exact' for '--integrator <INTEGRATOR>'"),
        (&["--lump", "0,0:1:1"], "invalid value '0,0:1:1' for '--lump "),
        (&["--lump", "0,-10,0:0:1e5"], "radius of --lump, mm is 0; it must be finite and above 0"),
        (&["--lump", "0,90,0:5:1e5"], "--lump contains no part of the body: its radius is 5 mm and a cell"),
    ] {
        let text = rejected(&[&["probe"], arguments].concat());
        assert!(text.starts_with(&format!("error: {expected}")), "{arguments:?}: {text}");
    }
}
