//! Runs a program as a user does. The tests of `palpate_paper` use this file too.

use serde_json::Value;
use std::process::{Command, Output, Stdio};

/// Output of the program with these arguments.
pub fn run(arguments: &[&str]) -> Output {
    Command::new(super::PROGRAM).args(arguments).stdin(Stdio::null()).output().unwrap()
}

/// JSON output of a successful command.
pub fn json(arguments: &[&str]) -> Value {
    let output = run(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Error line of a command that must end with exit code 2 and no output.
pub fn rejected(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(output.stdout.is_empty());
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(text.lines().count(), 1, "{text}");
    text
}

/// Reference data of the file `name`.
pub fn reference(name: &str) -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/");
    serde_json::from_str(&std::fs::read_to_string(format!("{path}{name}")).unwrap()).unwrap()
}

/// A number of a report.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// A list of numbers of a report.
pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

/// Asserts that `here` equals `expected` up to the relative `tolerance`.
#[track_caller]
pub fn close(here: f64, expected: f64, tolerance: f64) {
    assert!((here / expected - 1.0).abs() < tolerance, "{here}, expected {expected}");
}
