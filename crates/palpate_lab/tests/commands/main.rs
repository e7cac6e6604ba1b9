//! The commands of `palpate-lab` as a user runs them.

mod blackbox;
mod closeness;
mod continuum;
mod devices;
mod mesh;
mod organ;
mod paper_commands;
mod probe;
mod program;
mod soak;

use program::*;
use serde_json::Value;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Serialises the tests that measure wall-clock time: a busy machine of one would delay the threads of another.
static TIMED: Mutex<()> = Mutex::new(());

fn timed() -> MutexGuard<'static, ()> {
    TIMED.lock().unwrap_or_else(PoisonError::into_inner)
}

const PROGRAM: &str = env!("CARGO_BIN_EXE_palpate-lab");

#[test]
fn rejects_invalid_arguments_in_one_line_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("results");
    for (arguments, expected) in [
        (
            &["fidelity", "--nodes", "6,6"][..],
            "error: invalid value '6,6' for '--nodes <X,Y,Z>': it must be three numbers",
        ),
        (&["fidelity", "--nodes", "1,6,6"], "error: --nodes is 1; it must be 2 to 24 along each axis"),
        (&["fidelity", "--scheme", "best"], "error: invalid value 'best' for '--scheme <SCHEME>': "),
        (
            &["fidelity", "--velocity", "two-pole:-1"],
            "error: invalid value 'two-pole:-1' for '--velocity <VELOCITY>': ",
        ),
        (
            &["fidelity", "--integrator", "implicit:0"],
            "error: invalid value 'implicit:0' for '--integrator <INTEGRATOR>': ",
        ),
        (&["fidelity", "--position-step-mm", "-1"], "error: --position-step-mm is -1; it must be 0 to 10"),
        (&["nonsense"], "error: unrecognized subcommand 'nonsense'"),
    ] {
        let text = rejected(&[arguments, &["--out", out.to_str().unwrap()]].concat());
        assert!(text.starts_with(expected), "{text}");
    }
    assert!(!out.exists());
}

#[test]
fn help_has_examples() {
    for command in ["fidelity", "blackbox", "probe", "mesh"] {
        let output = run(&[command, "--help"]);
        assert!(output.status.success());
        assert!(String::from_utf8(output.stdout).unwrap().contains("Examples:"), "{command}");
    }
}
