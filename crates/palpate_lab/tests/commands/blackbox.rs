//! `palpate-lab blackbox`.

use glam::DVec3;
use palpate_haptics::*;
use palpate_local::{Contact, ModelId, Scheme};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn with_file<'a>(file: &'a Path, arguments: &[&'a str]) -> Vec<&'a str> {
    [&["blackbox", file.to_str().unwrap()], arguments].concat()
}

fn printed(file: &Path, arguments: &[&str]) -> String {
    let output = super::run(&with_file(file, arguments));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn rejected(file: &Path, arguments: &[&str]) -> String {
    super::rejected(&with_file(file, arguments))
}

/// Writes the black box of a hand that presses a surface. Its device fails for 100 ticks from tick 1300, and one tick is 5 periods
/// late.
fn write_black_box(folder: &Path) -> PathBuf {
    // The force starts without a ramp, and passivity control does not reduce it.
    let safety = SafetySettings {
        arm_below_n: f64::MAX,
        passivity_damping_ns_per_m: 0.0,
        ..SafetySettings::default()
    };
    let settings = LoopSettings { safety, ..LoopSettings::default() };
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), settings).unwrap();
    let mut noise = 1_u64;
    for n in 1..=3000_u64 {
        let t = n as f64 * 1e-3;
        let depth_m = 0.012 * (2.0 * t).sin() + 0.001 * (9.0 * t).sin();
        let reading = match n {
            1300..1400 => Err(DeviceError::TimedOut),
            _ => Ok(Reading::at(DVec3::new(0.3 + 0.005 * t.sin(), 0.004 * (t * 5.0).cos(), -depth_m))),
        };
        let elapsed = if n == 1200 { 6 } else { 1 };
        if n % 50 == 0 {
            let model = handle.model_slot();
            (model.scheme, model.contact) = (Scheme::Hold, Contact::Held);
            model.force_n = DVec3::Z * (2500.0 * depth_m).max(0.0);
            model.id = ModelId { body: 7, epoch: 1, sequence: n };
            handle.publish_model();
        }
        let output = haptic_loop.tick(elapsed, reading);
        noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let jitter = noise >> 50;
        let late = if n == 1200 { 5_300_000 } else { 40_000 + jitter };
        let timing = TickTiming {
            lateness_ns: late,
            period_ns: 1_000_000,
            read_ns: 5_000,
            write_ns: 3_000,
            cost_ns: 21_000 + jitter / 2 + if n % 50 == 0 { 60_000 } else { 0 },
        };
        haptic_loop.finish_tick(output, Some(timing), Ok(()));
    }
    let path = folder.join("blackbox-1-the-device-failed.csv");
    handle.black_box().write_csv(&path).unwrap();
    path
}

#[test]
fn summary_counts_ticks_samples_models_and_errors() {
    let folder = tempfile::tempdir().unwrap();
    let file = write_black_box(folder.path());
    let here: Value = serde_json::from_str(&printed(&file, &["--json"])).unwrap();
    for (key, expected) in [
        ("ticks", json!(3000)),
        ("first_sequence", json!(1)),
        ("last_sequence", json!(3005)),
        ("missed_deadlines", json!(5)),
        ("periods_not_in_file", json!(0)),
        ("samples", json!({ "measured": 2900, "repeated": 100, "none": 0 })),
        ("models", json!([{ "body": 7, "epoch": 1, "models": 60 }])),
        ("device_errors", json!({ "read: timed_out": 100 })),
    ] {
        assert_eq!(here[key], expected, "{key}");
    }
    let read = Recording::read_csv(&file).unwrap();
    let peak = |force: fn(&BlackBoxTick) -> DVec3| {
        read.ticks().iter().map(|tick| force(tick).length()).fold(0.0, f64::max)
    };
    assert_eq!(here["peak_force_before_n"], peak(|tick| tick.before_n));
    assert_eq!(here["peak_force_written_n"], peak(|tick| tick.written_n));
    assert_eq!(here["lateness_us"]["max"], 5300.0);
    assert!((40.0..57.0).contains(&here["lateness_us"]["p99"].as_f64().unwrap()));
    assert!(here["cost_us"]["p99"].as_f64().unwrap() > 60.0, "one tick in fifty is expensive");
    let acted = here["acted"].as_array().unwrap();
    let ticks = |stage: &str| acted.iter().find(|acted| acted["stage"] == stage).map(|a| a["ticks"].clone());
    assert_eq!(ticks("silent"), Some(json!(80)), "from the 21st tick without a reading");
    assert!(ticks("gains").is_some() && ticks("magnitude").is_some() && ticks("not_finite").is_none());
}

#[test]
fn lists_the_last_ticks() {
    let folder = tempfile::tempdir().unwrap();
    let file = write_black_box(folder.path());
    let text = printed(&file, &[]);
    assert!(text.lines().all(|line| line == line.trim_end()));
    assert!(text.starts_with("ticks             3000, number 1 to 3005, 3.004 s\n"), "{text}");
    assert!(text.contains("\ndevice errors     read: timed_out (100)\n"), "{text}");
    let rows = |text: &str| text.lines().skip_while(|line| !line.ends_with("  events")).count();
    assert_eq!(rows(&text), 13);
    assert!(text.lines().last().unwrap().trim_start().starts_with("3005     3.005 "), "{text}");
    assert_eq!(rows(&printed(&file, &["--last", "0"])), 0);
    let all = printed(&file, &["--last", "99999"]);
    assert_eq!(rows(&all), 3001);
    assert!(all.contains("  5 missed") && all.contains("  read: timed_out, gains+silent"), "{all}");
}

#[test]
fn writes_the_figure_to_the_given_file_and_folder() {
    let folder = tempfile::tempdir().unwrap();
    let (file, plot) = (write_black_box(folder.path()), folder.path().join("plots/box.svg"));
    printed(&file, &["--plot", plot.to_str().unwrap(), "--out", folder.path().to_str().unwrap()]);
    let svg = std::fs::read_to_string(&plot).unwrap();
    assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>") && !svg.contains("NaN"));
    for text in ["displacement, mm", "force, N", "lateness", "deadlines missed", "device error"] {
        assert!(svg.contains(text), "{text}");
    }
    assert_eq!(svg, std::fs::read_to_string(folder.path().join("blackbox.svg")).unwrap());
    let text = rejected(&file, &["--plot", folder.path().to_str().unwrap()]);
    assert!(text.contains("cannot be written"), "{text}");
    assert!(rejected(&file, &["--plot", "/"]).contains("it has no file name"));
}

/// The only tick has no reading and no local model.
#[test]
fn prints_and_draws_a_black_box_of_one_tick() {
    let folder = tempfile::tempdir().unwrap();
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), LoopSettings::default()).unwrap();
    let file = folder.path().join("one.csv");
    handle.black_box().write_csv(&file).unwrap();
    assert!(rejected(&file, &[]).contains("one.csv: the black box has no ticks"), "only a header");
    let output = haptic_loop.tick(1, Err(DeviceError::TimedOut));
    haptic_loop.finish_tick(output, None, Err(DeviceError::Disconnected));
    handle.black_box().write_csv(&file).unwrap();
    let plot = folder.path().join("one.svg");
    let text = printed(&file, &["--plot", plot.to_str().unwrap()]);
    assert!(text.contains("read: timed_out, write: disconnected"), "{text}");
    assert!(text.contains("local models      none"), "{text}");
    assert!(!std::fs::read_to_string(plot).unwrap().contains("NaN"));
}

#[test]
fn error_names_the_file_and_line_of_an_invalid_black_box() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("no.csv");
    let text = rejected(&missing, &[]);
    assert!(text.starts_with("error: the black box cannot be read: "), "{text}");
    assert!(text.contains("no.csv: "), "{text}");
    let file = write_black_box(folder.path());
    let broken = folder.path().join("broken.csv");
    std::fs::write(&broken, std::fs::read_to_string(&file).unwrap().replacen(",measured,", ",guessed,", 1))
        .unwrap();
    let text = rejected(&broken, &[]);
    assert!(text.contains("broken.csv:2: ") && text.contains("\"guessed\""), "{text}");
    assert!(rejected(&file, &["--last", "-1"]).contains("it must be a whole number"), "not a count");
}
