//! The scene with rigid bodies of avian, run as a user runs it without a window: the printed values agree with statics.

use serde_json::Value;
use std::process::Command;

/// The last line of JSON that the scene prints.
fn report() -> Value {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let mut run = Command::new(cargo);
    // With the features of this test, to build nothing twice.
    let features = if cfg!(feature = "panel") { "panel,gizmos,avian" } else { "avian" };
    run.args(["run", "--quiet", "--locked", "-p", "palpate_examples", "--features", features]);
    if !cfg!(debug_assertions) {
        run.arg("--release");
    }
    let output = run.args(["--example", "tray", "--", "--headless"]).output().unwrap();
    let (out, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{}\n{out}\n{errors}", output.status);
    let line = out.lines().rev().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("{out}"));
    serde_json::from_str(line).unwrap()
}

#[test]
fn tray_bears_the_organ_and_the_hand_and_the_lump_rolls_off() {
    let report = report();
    let number = |key: &str| report[key].as_f64().unwrap_or_else(|| panic!("{key} of {report}"));
    let (organ_n, rest_n, pressed_n) = (number("organ_n"), number("rest_n"), number("pressed_n"));
    assert!((rest_n / organ_n - 1.0).abs() < 2e-3, "{report}");
    // The loop's force is that of its local model.
    let hand_n = number("hand_n");
    assert!(hand_n > 0.3 && ((pressed_n - rest_n) / hand_n - 1.0).abs() < 0.05, "{report}");
    // The lump, of 18 mm, lies on the tray's bottom, which is 8 mm thick.
    assert!((number("lump_height_m") - 0.026).abs() < 5e-4, "{report}");
    assert!(number("lump_way_m") > 0.06, "{report}");
    assert!(number("tray_way_m") < 1e-3, "{report}");
}
