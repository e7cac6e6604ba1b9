//! The commands of `palpate-lab` as a user runs them.

mod blackbox;
mod closeness;
mod devices;
mod organ;
mod paper_commands;
mod probe;
mod program;
mod soak;

use program::*;
use serde_json::Value;

const PROGRAM: &str = env!("CARGO_BIN_EXE_palpate-lab");

#[test]
fn what_makes_no_sense_is_refused_in_one_line_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("results");
    for (arguments, said) in [
        (
            &["fidelity", "--nodes", "6,6"][..],
            "error: invalid value '6,6' for '--nodes <X,Y,Z>': it must be three numbers",
        ),
        (&["fidelity", "--nodes", "1,6,6"], "error: --nodes is 1; it must be 2 to 24 along each axis"),
        (
            &["fidelity", "--scheme", "best"],
            "error: invalid value 'best' for '--scheme <SCHEME>': there is no such scheme",
        ),
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
        let text = refused(&[arguments, &["--out", out.to_str().unwrap()]].concat());
        assert!(text.starts_with(said), "{text}");
    }
    assert!(!out.exists());
}

#[test]
fn help_has_examples() {
    for command in ["fidelity", "blackbox", "probe"] {
        let output = run(&[command, "--help"]);
        assert!(output.status.success());
        assert!(String::from_utf8(output.stdout).unwrap().contains("Examples:"), "{command}");
    }
}
