//! Every scene, run as a user runs it without a window: what it prints is what the physics says, and what goes wrong is said.
//!
//! `cargo test` builds the scenes beside this test. Where they are not, because only tests were asked for, cargo runs them.

#[path = "../probing/comparable.rs"]
mod comparable;

use palpate_local::Sample;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, PoisonError};

/// One scene at a time: what one does on a thread in real time must not wait for the others.
static STAGE: Mutex<()> = Mutex::new(());

/// Runs the scene `name` with `args` and `--headless`.
fn run(name: &str, args: &[&str]) -> Output {
    let _alone = STAGE.lock().unwrap_or_else(PoisonError::into_inner);
    let beside = std::env::current_exe().unwrap();
    let built = beside.parent().unwrap().with_file_name("examples").join(name);
    let mut command = if built.exists() {
        Command::new(built)
    } else {
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
        let mut command = Command::new(cargo);
        command.args(["run", "--quiet", "--locked", "-p", "palpate_examples", "--example", name]);
        // As this test was built, so that nothing is built twice.
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

/// What a scene prints.
fn printed(name: &str, args: &[&str]) -> String {
    let output = run(name, args);
    let (out, said) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{name} {args:?}: {}\n{out}\n{said}", output.status);
    out.into_owned()
}

/// The line of JSON in what was printed.
fn json(printed: &str) -> Value {
    let line = printed.lines().rev().find(|line| line.starts_with(['{', '['])).expect(printed);
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} of {value}"))
}

#[test]
fn indentation_is_hertz_and_the_flat_punch() {
    for (tip, half_space, layer) in [("ball", 1.05..1.7, 0.95..1.05), ("punch", 1.15..1.7, 0.95..1.05)] {
        let told = json(&printed("indentation", &["--tip", tip, "--seconds", "3"]));
        let stairs = told.as_array().unwrap();
        assert_eq!(stairs.len(), 4, "{told}");
        for stair in stairs {
            assert!(half_space.contains(&number(stair, "to_half_space")), "{stair}");
            assert!(layer.contains(&number(stair, "to_layer")), "{stair}");
            // At rest the hand feels what the full body answers.
            assert!((number(stair, "felt_n") / number(stair, "force_n") - 1.0).abs() < 0.05, "{stair}");
        }
        let depths: Vec<f64> = stairs.iter().map(|stair| number(stair, "depth_m")).collect();
        assert!(
            depths.iter().zip([0.002, 0.004, 0.006, 0.008]).all(|(a, b)| (a - b).abs() < 1e-5),
            "{depths:?}"
        );
    }
}

#[test]
fn both_sides_of_a_wound_are_pulled_alike_and_threads_tear_at_their_limit() {
    let limit_n = 0.25;
    let told = json(&printed("suture_pull", &["--tear-limit", "0.25"]));
    let threads = told["threads"].as_array().unwrap();
    assert_eq!(threads.len(), 3, "{told}");
    for thread in threads {
        let tension_n = number(thread, "tension_n");
        assert!(tension_n > 0.02 && tension_n < limit_n, "{thread}");
        for side in ["left_n", "right_n"] {
            assert!((number(thread, side) / tension_n - 1.0).abs() < 0.01, "{thread}");
        }
        assert!(number(thread, "sum_n") < 0.01 * tension_n, "equal and opposite: {thread}");
        // 300 N/m.
        assert!((300.0 * number(thread, "longer_m") / tension_n - 1.0).abs() < 0.01, "a spring: {thread}");
    }
    let torn: Vec<f64> = told["torn_at_n"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    assert_eq!(torn.len(), 3, "{told}");
    assert!(torn.iter().all(|at_n| (limit_n..1.1 * limit_n).contains(at_n)), "{torn:?}");
    assert!(number(&told, "sewn_m") < 0.7 * number(&told, "apart_m"), "{told}");
    // What never tears never does.
    let told = json(&printed("suture_pull", &["--tear-limit", "1000"]));
    assert_eq!(told["torn_at_n"].as_array().unwrap().len(), 0, "{told}");
}

#[test]
fn probing_finds_the_lump_where_it_is() {
    let folder = std::env::temp_dir().join(format!("palpate-probing-{}", std::process::id()));
    let told = json(&printed("probing", &["--seconds", "5", "--out", &folder.display().to_string()]));
    let touches = told["touches"].as_array().unwrap();
    let stiffness = |touch: &Value| number(touch, "force_n") / number(touch, "depth_m");
    let stiffest = touches.iter().max_by(|a, b| stiffness(a).total_cmp(&stiffness(b))).expect("no touch");
    let beside = |touch: &Value| (number(touch, "x_m") + 0.010).hypot(number(touch, "z_m") + 0.006);
    assert!(beside(stiffest) < 0.004, "{told}");
    for other in touches.iter().filter(|touch| beside(touch) > 0.015) {
        assert!(stiffness(stiffest) > 1.3 * stiffness(other), "{told}");
    }
    // What ships is near the full body, and holding the force is not.
    let error = |scheme: &str| number(&told["errors"], scheme);
    assert!(error("near_field_exact") < 0.02 && error("hold") > 0.05, "{told}");
    // How late the thread was is no business of a test; that its models were taken is.
    assert!(error("as_felt") < error("hold"), "{told}");
    for file in ["trace.csv", "force.svg"] {
        assert!(folder.join(file).metadata().unwrap().len() > 1000, "{file}");
    }
    std::fs::remove_dir_all(folder).ok();
}

#[test]
fn one_hand_feels_the_other_through_a_body() {
    let told = json(&printed("two_tools", &["--seconds", "2.5"]));
    let [alone_n, right_n, beside_n] = ["alone_n", "right_n", "beside_n"].map(|key| number(&told, key));
    assert!(alone_n > 0.2 && right_n > alone_n, "{told}");
    assert!((beside_n - alone_n).abs() > 0.05 * alone_n, "{told}");
}

#[test]
fn a_hand_of_springs_stays_behind_its_wish_by_force_over_stiffness() {
    let told = json(&printed("custom_device", &["--seconds", "1.6"]));
    let (force_n, behind_m) = (number(&told, "force_n"), number(&told, "behind_m"));
    assert!(force_n > 0.5 && number(&told, "touch_ticks") > 200.0, "{told}");
    // It moves, so not quite: its damping takes a part.
    assert!((behind_m / (force_n / 300.0) - 1.0).abs() < 0.25, "{told}");
}

#[test]
fn the_test_of_a_scene_passes_itself() {
    let told = printed("headless", &["--seconds", "1.5"]);
    assert!(told.contains("bits of all forces, twice the same"), "{told}");
    let output = run("headless", &["--seconds", "1"]);
    assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains("1.3 to 3600"));
}

#[test]
fn the_organ_is_a_mesh_of_yours() {
    let organ = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/meshes/organ.glb");
    let told = json(&printed("your_mesh", &[organ, "--seconds", "1.6"]));
    assert!(number(&told, "force_n") > 0.2 && number(&told, "error") < 0.1, "{told}");
    // A third of its box of 126 by 67 by 76 mm, of water.
    assert!((0.15..0.5).contains(&number(&told, "mass_kg")), "{told}");
}

/// A glTF file of tetrahedra of side 1, one for each place, or of one triangle of such a tetrahedron.
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
fn a_mesh_of_yours_may_lie_anywhere_and_a_wrong_one_is_told_with_what_to_do() {
    let folder = std::env::temp_dir().join(format!("palpate #{} meshes", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).unwrap();
        folder.join(name)
    };
    // 6 cm and 2 m, far from the origin, in a folder with a space and a #.
    let far = tetrahedra(&folder, "far # off.gltf", &[30.0], false);
    for (scale, mass_kg) in [("0.06", 0.036), ("2", 1333.0)] {
        let told = json(&printed(
            "your_mesh",
            &[&far.display().to_string(), "--seconds", "1", "--scale", scale, "--cells", "5"],
        ));
        assert!((number(&told, "mass_kg") / mass_kg - 1.0).abs() < 0.01, "{told}");
        // A sharp corner of soft tissue bears a few millinewtons.
        assert!(number(&told, "force_n") > 0.001, "{told}");
    }
    for (file, expected) in [
        (folder.join("none.glb"), "it cannot be read"),
        (write("picture.png", b"\x89PNG\r\n\x1a\n"), "a mesh is read from a .glb or .gltf file"),
        (write("picture.glb", b"\x89PNG\r\n\x1a\n"), "it is no glTF that can be read"),
        (write("empty.glb", b""), "it is no glTF that can be read"),
        (tetrahedra(&folder, "open.gltf", &[0.0], true), "the mesh has holes"),
        (tetrahedra(&folder, "pieces.gltf", &[0.0, 5.0], false), "in 2 pieces"),
        (tetrahedra(&folder, "crossing.gltf", &[0.0, 0.1], false), "passes through itself"),
    ] {
        let output = run("your_mesh", &[&file.display().to_string(), "--seconds", "1"]);
        let said =
            format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(!output.status.success(), "{}: {said}", file.display());
        assert!(said.contains(expected), "{}: {said}", file.display());
    }
    std::fs::remove_dir_all(folder).ok();
}

/// Samples of a loop from `first` on.
fn samples(first: u64, count: u64) -> Vec<Sample> {
    (first..first + count).map(|sequence| Sample { sequence, ..Sample::default() }).collect()
}

#[test]
fn a_run_is_compared_from_where_the_body_is_at_rest() {
    let whole = samples(0, 5000);
    assert_eq!(comparable::begin(&whole, 100..5000), 0, "a whole run from its first sample");
    let after_a_hole = [samples(0, 1000), samples(3000, 2000)].concat();
    // Between the two touches there was too little time.
    let index = comparable::begin(&after_a_hole, (0..900).chain(2900..3400).chain(3500..3900));
    assert_eq!(after_a_hole[index].sequence, 3899 + 150);
    let long = samples(0, 30_000);
    assert_eq!(long[comparable::begin(&long, 0..20_100)].sequence, 20_099 + 150);
    assert_eq!(comparable::begin(&long, 0..30_000), 20_000, "a hand that never left is compared as it is");
    let restarted: Vec<u64> = (0..50).chain(0..20).collect();
    assert_eq!(comparable::of_last_loop(&restarted, |number| *number).len(), 20);
}
