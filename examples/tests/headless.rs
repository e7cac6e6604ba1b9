//! Every scene, run as a user runs it without a window: the printed values agree with the physics, and errors are reported.
//!
//! `cargo test` builds the scenes next to this test. If they are not built, because only tests were requested, cargo runs them.

#[path = "../probing/comparable.rs"]
mod comparable;

use palpate_local::Sample;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{PoisonError, RwLock};

/// A scene whose loop is on a thread runs alone, so that the loop does not wait for other scenes. Scenes in lock step run at the same time.
static STAGE: RwLock<()> = RwLock::new(());

/// The scenes whose loop is on a thread.
const THREADED: [&str; 1] = ["probing"];

/// Runs the scene `name` with `args` and `--headless`.
fn run(name: &str, args: &[&str]) -> Output {
    let is_alone = THREADED.contains(&name);
    let _alone = is_alone.then(|| STAGE.write().unwrap_or_else(PoisonError::into_inner));
    let _shared = (!is_alone).then(|| STAGE.read().unwrap_or_else(PoisonError::into_inner));
    let test = std::env::current_exe().unwrap();
    let built = test.parent().unwrap().with_file_name("examples").join(name);
    let mut command = if built.exists() {
        Command::new(built)
    } else {
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
        let mut command = Command::new(cargo);
        command.args(["run", "--quiet", "--locked", "-p", "palpate_examples", "--example", name]);
        // With the features of this test, to build nothing twice.
        if cfg!(feature = "panel") {
            command.args(["--features", "panel,gizmos"]);
        }
        if !cfg!(debug_assertions) {
            command.arg("--release");
        }
        command.arg("--");
        command
    };
    command.args(args).arg("--headless").output().unwrap()
}

/// Standard output of a scene.
fn printed(name: &str, args: &[&str]) -> String {
    let output = run(name, args);
    let (out, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{name} {args:?}: {}\n{out}\n{errors}", output.status);
    out.into_owned()
}

/// The last line of JSON of an output.
fn json(printed: &str) -> Value {
    let line = printed.lines().rev().find(|line| line.starts_with(['{', '['])).expect(printed);
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} of {value}"))
}

#[test]
fn indentation_agrees_with_hertz_and_the_flat_punch() {
    // The formula of the punch is of first order in its radius, a third of the thickness.
    for (tip, half_space, layer) in [("ball", 1.05..1.7, 0.98..1.02), ("punch", 1.15..1.7, 0.93..1.05)] {
        let report = json(&printed("indentation", &["--tip", tip, "--seconds", "3"]));
        let stairs = report.as_array().unwrap();
        assert_eq!(stairs.len(), 4, "{report}");
        for stair in stairs {
            assert!(half_space.contains(&number(stair, "to_half_space")), "{stair}");
            assert!(layer.contains(&number(stair, "to_layer")), "{stair}");
            // At rest the rendered force is that of the full body.
            assert!((number(stair, "rendered_n") / number(stair, "force_n") - 1.0).abs() < 0.05, "{stair}");
        }
        let depths: Vec<f64> = stairs.iter().map(|stair| number(stair, "depth_m")).collect();
        assert!(
            depths.iter().zip([0.002, 0.004, 0.006, 0.008]).all(|(a, b)| (a - b).abs() < 1e-5),
            "{depths:?}"
        );
    }
}

#[test]
fn threads_pull_both_sides_equally_and_tear_at_their_limit() {
    let limit_n = 0.25;
    let report = json(&printed("suture_pull", &["--tear-limit", "0.25"]));
    let threads = report["threads"].as_array().unwrap();
    assert_eq!(threads.len(), 3, "{report}");
    for thread in threads {
        let tension_n = number(thread, "tension_n");
        assert!(tension_n > 0.02 && tension_n < limit_n, "{thread}");
        for side in ["left_n", "right_n"] {
            assert!((number(thread, side) / tension_n - 1.0).abs() < 0.01, "{thread}");
        }
        assert!(number(thread, "sum_n") < 0.01 * tension_n, "equal and opposite: {thread}");
        // 300 N/m.
        assert!((300.0 * number(thread, "extension_m") / tension_n - 1.0).abs() < 0.01, "a spring: {thread}");
    }
    let torn: Vec<f64> = report["torn_at_n"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    assert_eq!(torn.len(), 1, "the middle one: {report}");
    assert!(torn.iter().all(|at_n| (limit_n..1.1 * limit_n).contains(at_n)), "{torn:?}");
    assert!(number(&report, "sewn_m") < 0.7 * number(&report, "apart_m"), "{report}");
}

#[test]
fn threads_of_a_high_limit_do_not_tear() {
    let report = json(&printed("suture_pull", &["--tear-limit", "1000"]));
    assert_eq!(report["torn_at_n"].as_array().unwrap().len(), 0, "{report}");
}

#[test]
fn probing_finds_the_lump_where_it_is() {
    let folder = std::env::temp_dir().join(format!("palpate-probing-{}", std::process::id()));
    let report = json(&printed("probing", &["--seconds", "5", "--out", &folder.display().to_string()]));
    let touches = report["touches"].as_array().unwrap();
    let stiffness = |touch: &Value| number(touch, "force_n") / number(touch, "depth_m");
    let stiffest = touches.iter().max_by(|a, b| stiffness(a).total_cmp(&stiffness(b))).expect("no touch");
    let distance_m = |touch: &Value| (number(touch, "x_m") + 0.010).hypot(number(touch, "z_m") + 0.006);
    assert!(distance_m(stiffest) < 0.004, "{report}");
    for other in touches.iter().filter(|touch| distance_m(touch) > 0.015) {
        assert!(stiffness(stiffest) > 1.3 * stiffness(other), "{report}");
    }
    // The default scheme is close to the full body, holding the force is not.
    let error = |scheme: &str| number(&report["errors"], scheme);
    assert!(error("near_field_exact") < 0.02 && error("hold") > 0.05, "{report}");
    // Independent of the lateness of the thread, its local models were adopted.
    assert!(error("as_rendered") < error("hold"), "{report}");
    for file in ["trace.csv", "force.svg"] {
        assert!(folder.join(file).metadata().unwrap().len() > 1000, "{file}");
    }
    std::fs::remove_dir_all(folder).ok();
}

#[test]
fn one_tool_changes_the_force_on_the_other() {
    let report = json(&printed("two_tools", &["--seconds", "2.5"]));
    let [alone_n, right_n, both_n] = ["alone_n", "right_n", "both_n"].map(|key| number(&report, key));
    assert!(alone_n > 0.2 && right_n > alone_n, "{report}");
    assert!((both_n - alone_n).abs() > 0.05 * alone_n, "{report}");
}

#[test]
fn tracking_error_of_a_spring_driven_device_is_force_over_stiffness() {
    let report = json(&printed("custom_device", &["--seconds", "1.6"]));
    let (force_n, error_m) = (number(&report, "force_n"), number(&report, "error_m"));
    assert!(force_n > 0.5 && number(&report, "contact_ticks") > 200.0, "{report}");
    // Approximately, because damping acts on the moving mass.
    assert!((error_m / (force_n / 300.0) - 1.0).abs() < 0.25, "{report}");
}

#[test]
fn headless_example_passes() {
    let report = printed("headless", &["--seconds", "1.5"]);
    assert!(report.contains("bits of all forces"), "{report}");
    let output = run("headless", &["--seconds", "1"]);
    assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains("1.3 to 3600"));
}

#[test]
fn your_mesh_accepts_the_organ() {
    let organ = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/meshes/organ.glb");
    let report = json(&printed("your_mesh", &[organ, "--seconds", "1.6"]));
    assert!(number(&report, "force_n") > 0.2 && number(&report, "error") < 0.1, "{report}");
    // A third of its bounding box of 126 by 67 by 76 mm, with the density of water.
    assert!((0.15..0.5).contains(&number(&report, "mass_kg")), "{report}");
}

/// Writes a glTF file of tetrahedra with edges of 1, one at each place; without one triangle if `is_open`.
fn tetrahedra(folder: &Path, name: &str, places: &[f32], is_open: bool) -> PathBuf {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0_u16, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    std::fs::write(folder.join("corners.bin"), bytes).unwrap();
    let nodes: Vec<String> =
        places.iter().map(|x| format!(r#"{{"mesh":0,"translation":[{x},0,0]}}"#)).collect();
    let roots: Vec<String> = (0..places.len()).map(|root| root.to_string()).collect();
    let indices = if is_open { 9 } else { 12 };
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[{}]}}],"nodes":[{}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
        {{"bufferView":1,"componentType":5123,"count":{indices},"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":24}}],
        "buffers":[{{"byteLength":72,"uri":"corners.bin"}}]}}"#,
        roots.join(","),
        nodes.join(",")
    );
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn your_mesh_accepts_meshes_far_from_the_origin_and_reports_invalid_ones() {
    let folder = std::env::temp_dir().join(format!("palpate #{} meshes", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).unwrap();
        folder.join(name)
    };
    // 6 cm and 2 m, far from the origin, in a folder with a space and a #.
    let far = tetrahedra(&folder, "far # off.gltf", &[30.0], false);
    for (scale, mass_kg) in [("0.06", 0.036), ("2", 1333.0)] {
        let report = json(&printed(
            "your_mesh",
            &[&far.display().to_string(), "--seconds", "1", "--scale", scale, "--cells", "5"],
        ));
        assert!((number(&report, "mass_kg") / mass_kg - 1.0).abs() < 0.01, "{report}");
        // The force of a sharp corner of soft tissue is a few millinewtons.
        assert!(number(&report, "force_n") > 0.001, "{report}");
    }
    for (file, expected) in [
        (folder.join("none.glb"), "cannot be read"),
        (write("picture.png", b"\x89PNG\r\n\x1a\n"), "picture.png"),
        (write("picture.glb", b"\x89PNG\r\n\x1a\n"), "picture.glb"),
        (write("empty.glb", b""), "empty.glb"),
        (tetrahedra(&folder, "open.gltf", &[0.0], true), "holes"),
        (tetrahedra(&folder, "crossing.gltf", &[0.0, 0.1], false), "through itself"),
    ] {
        let output = run("your_mesh", &[&file.display().to_string(), "--seconds", "1", "--strict"]);
        let text =
            format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(!output.status.success(), "{}: {text}", file.display());
        assert!(text.contains(expected), "{}: {text}", file.display());
    }
    // Without --strict, holes are closed, parts are united, and the largest of several pieces is the body.
    for (file, volume, reported) in [
        (tetrahedra(&folder, "open.gltf", &[0.0], true), 1.0 / 6.0, "1 hole"),
        (tetrahedra(&folder, "pieces.gltf", &[0.0, 5.0], false), 1.0 / 6.0, "2 pieces"),
        // Both tetrahedra contain x > 0.1, y, z > 0, x + y + z < 1.
        (tetrahedra(&folder, "crossing.gltf", &[0.0, 0.1], false), (2.0 - 0.9_f64.powi(3)) / 6.0, "crossing"),
    ] {
        let output = run("your_mesh", &[&file.display().to_string(), "--seconds", "1", "--scale", "0.1"]);
        let (text, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success() && format!("{text}{log}").contains(reported), "{text}{log}");
        assert!((number(&json(&text), "mass_kg") / volume - 1.0).abs() < 0.02, "{text}");
    }
    // Three pieces become three bodies.
    let pieces = tetrahedra(&folder, "three.gltf", &[0.0, 5.0, 10.0], false);
    let text = printed(
        "your_mesh",
        &[&pieces.display().to_string(), "--seconds", "1", "--scale", "0.1", "--each-piece"],
    );
    assert!(text.contains("bodies of other pieces   2"), "{text}");
    // Implausible sizes in both directions, with the flag and the field that change them.
    for size_m in ["6", "0.003"] {
        let output = run(
            "your_mesh",
            &[&far.display().to_string(), "--seconds", "1", "--size-m", size_m, "--cells", "5"],
        );
        let (text, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success() && text.contains("; change --scale or --size-m"), "{text}{log}");
        assert!(format!("{text}{log}").contains("; change MeshShape::metres_per_unit"), "{text}{log}");
    }
    std::fs::remove_dir_all(folder).ok();
}

#[test]
fn your_mesh_names_the_limit_of_the_force() {
    let organ = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/meshes/organ.glb");
    let limit =
        "the force reached        10 N, the limit of the virtual coupling: change HapticTool::coupling";
    let common = printed("your_mesh", &[organ, "--seconds", "1", "--cells", "6"]);
    assert!(!common.contains("the force reached"), "{common}");
    // Forces grow with the area.
    let large = printed("your_mesh", &[organ, "--seconds", "1", "--cells", "6", "--size-m", "6"]);
    assert!(large.contains(limit), "{large}");
}

/// Samples of a loop from `first` on.
fn samples(first: u64, count: u64) -> Vec<Sample> {
    (first..first + count).map(|sequence| Sample { sequence, ..Sample::default() }).collect()
}

#[test]
fn comparison_starts_where_the_body_is_at_rest() {
    // A loop counts from one.
    let whole = samples(1, 5000);
    assert_eq!(comparable::start(&whole, 100..5000), 0, "a whole run from its first sample");
    let with_gap = [samples(0, 1000), samples(3000, 2000)].concat();
    // The time between the two contacts is too short.
    let index = comparable::start(&with_gap, (0..900).chain(2900..3400).chain(3500..3900));
    assert_eq!(with_gap[index].sequence, 3899 + 150);
    let long = samples(0, 30_000);
    assert_eq!(long[comparable::start(&long, 0..20_100)].sequence, 20_099 + 150);
    assert_eq!(comparable::start(&long, 0..30_000), 20_000, "a permanent contact is compared as it is");
    let restarted: Vec<u64> = (0..50).chain(0..20).collect();
    assert_eq!(comparable::of_last_loop(&restarted, |number| *number).len(), 20);
}
