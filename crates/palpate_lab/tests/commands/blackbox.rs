//! The command that reads black boxes, as a user runs it.

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

fn refused(file: &Path, arguments: &[&str]) -> String {
    super::refused(&with_file(file, arguments))
}

/// A box of a hand that presses on something, whose device fails from tick 1300 on for 100 ticks, with a tick that comes 5
/// periods late, and the times of a machine.
fn kept(folder: &Path) -> PathBuf {
    // Force begins as it is, and nothing is taken back of what the late models of this hand give.
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
        let ticked = haptic_loop.tick(elapsed, reading);
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
        haptic_loop.finish_tick(&ticked, Some(timing), Ok(()));
    }
    let path = folder.join("blackbox-1-the-device-failed.csv");
    handle.black_box().write_csv(&path).unwrap();
    path
}

#[test]
fn the_summary_says_what_the_box_holds() {
    let folder = tempfile::tempdir().unwrap();
    let file = kept(folder.path());
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
    assert!(here["cost_us"]["p99"].as_f64().unwrap() > 60.0, "one in fifty is dear");
    let acted = here["acted"].as_array().unwrap();
    let ticks = |stage: &str| acted.iter().find(|acted| acted["stage"] == stage).map(|a| a["ticks"].clone());
    assert_eq!(ticks("silent"), Some(json!(80)), "from the 21st tick without an answer on");
    assert!(ticks("gains").is_some() && ticks("magnitude").is_some() && ticks("not_finite").is_none());
}

#[test]
fn the_last_ticks_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let file = kept(folder.path());
    let text = printed(&file, &[]);
    assert!(text.lines().all(|line| line == line.trim_end()));
    assert!(text.starts_with("ticks             3000, number 1 to 3005, 3.004 s\n"), "{text}");
    assert!(text.contains("\ndevice errors     read: timed_out (100)\n"), "{text}");
    let rows = |text: &str| text.lines().skip_while(|line| !line.contains("what happened")).count();
    assert_eq!(rows(&text), 13);
    assert!(text.lines().last().unwrap().trim_start().starts_with("3005     3.005 "), "{text}");
    assert_eq!(rows(&printed(&file, &["--last", "0"])), 0);
    let all = printed(&file, &["--last", "99999"]);
    assert_eq!(rows(&all), 3001);
    assert!(all.contains("  5 missed") && all.contains("  read: timed_out, gains+silent"), "{all}");
}

#[test]
fn the_figure_is_written_where_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let (file, plot) = (kept(folder.path()), folder.path().join("plots/box.svg"));
    printed(&file, &["--plot", plot.to_str().unwrap(), "--out", folder.path().to_str().unwrap()]);
    let svg = std::fs::read_to_string(&plot).unwrap();
    assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>") && !svg.contains("NaN"));
    for text in ["displacement, mm", "force, N", "lateness", "deadlines missed", "the device failed"] {
        assert!(svg.contains(text), "{text}");
    }
    assert_eq!(svg, std::fs::read_to_string(folder.path().join("blackbox.svg")).unwrap());
    let text = refused(&file, &["--plot", folder.path().to_str().unwrap()]);
    assert!(text.contains("cannot be written"), "{text}");
    assert!(refused(&file, &["--plot", "/"]).contains("it is no name of a file"));
}

/// A box of a single tick, before anything was read or heard, is a box.
#[test]
fn a_box_of_one_tick_is_printed_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let (mut handle, mut haptic_loop) = haptic_loop(LoopConfig::default(), LoopSettings::default()).unwrap();
    let file = folder.path().join("one.csv");
    handle.black_box().write_csv(&file).unwrap();
    assert!(refused(&file, &[]).contains("one.csv: the black box has no ticks"), "a header and no more");
    let ticked = haptic_loop.tick(1, Err(DeviceError::TimedOut));
    haptic_loop.finish_tick(&ticked, None, Err(DeviceError::Disconnected));
    handle.black_box().write_csv(&file).unwrap();
    let plot = folder.path().join("one.svg");
    let text = printed(&file, &["--plot", plot.to_str().unwrap()]);
    assert!(text.contains("read: timed_out, write: disconnected"), "{text}");
    assert!(text.contains("local models      none"), "{text}");
    assert!(!std::fs::read_to_string(plot).unwrap().contains("NaN"));
}

#[test]
fn a_file_that_is_no_black_box_is_named_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("no.csv");
    let text = refused(&missing, &[]);
    assert!(text.starts_with("error: the black box cannot be read: "), "{text}");
    assert!(text.contains("no.csv: cannot be read or written: "), "{text}");
    let file = kept(folder.path());
    let broken = folder.path().join("broken.csv");
    std::fs::write(&broken, std::fs::read_to_string(&file).unwrap().replacen(",measured,", ",guessed,", 1))
        .unwrap();
    let text = refused(&broken, &[]);
    assert!(text.contains("broken.csv:2: origin is \"guessed\"; it must be measured, "), "{text}");
    assert!(refused(&file, &["--last", "-1"]).contains("it must be a whole number"), "a count");
}
