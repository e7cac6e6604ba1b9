//! `palpate-lab devices` as a user runs it, whatever is plugged in here.

use std::process::{Command, Output, Stdio};

fn lab(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate-lab"));
    command.arg("devices").args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn refused(arguments: &[&str]) -> String {
    let output = lab(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(output.stdout.is_empty());
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(text.lines().count(), 1, "{text}");
    text
}

#[test]
fn devices_are_listed_as_a_table_or_as_json() {
    let output = lab(&["--json", "--all"]);
    assert!(output.status.success());
    let listed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for device in listed["devices"].as_array().unwrap() {
        assert!(["kind", "name", "vendor", "path", "refused"].iter().all(|key| device.get(key).is_some()));
    }
    let output = lab(&[]);
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.starts_with("no device of a known kind is plugged in") || text.starts_with("kind "),
        "{text}"
    );
}

#[test]
fn watching_ends_when_its_time_has_passed_and_tells_a_line_for_each() {
    let output = lab(&["--watch", "--seconds", "0.2", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for line in String::from_utf8(output.stdout).unwrap().lines() {
        let change: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(change["change"], "in");
    }
}

#[test]
fn what_makes_no_sense_is_refused_in_one_line() {
    let text = refused(&["--test", "no such serial number"]);
    assert!(
        text.contains("no supported device with serial number no such serial number is plugged in"),
        "{text}"
    );
    for force in ["0", "0.5", "-0.1", "nan"] {
        let text = refused(&["--test", "x", "--force-n", force]);
        assert!(text.contains("--force-n is") && text.contains("above 0 and below 0.5"), "{text}");
    }
    assert!(refused(&["--watch", "--seconds", "inf"]).contains("above 0 and at most 86400"));
    assert!(refused(&["--watch", "--test", "x"]).contains("cannot be used with"));
    assert!(refused(&["--yes"]).contains("--test"));
}
