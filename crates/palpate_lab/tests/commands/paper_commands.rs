//! Commands of `palpate_paper`, forwarded through cargo. A stand-in takes cargo's place and prints its arguments.

use super::PROGRAM;
use std::process::{Command, Output};

fn forwarded(cargo: &str, arguments: &[&str]) -> Output {
    Command::new(PROGRAM).args(arguments).env("CARGO", cargo).output().unwrap()
}

#[cfg(unix)]
#[test]
fn paper_commands_pass_every_argument_to_palpate_paper() {
    for arguments in [
        &["paper"][..],
        &["--json", "chain", "--stiffness", "-3", "--out", "results"],
        &["schemes", "--help"],
        &["lattice", "--json", "--band-hz", "10,1000", "-h"],
        &["density", "--to", "3"],
        &["manipulate", "--no-such-flag"],
        &["grip", "extra"],
    ] {
        let output = forwarded("echo", arguments);
        let text = String::from_utf8(output.stdout).unwrap();
        let (build, rest) = text.trim_end().split_once(" -- ").unwrap();
        assert!(output.status.success() && build.starts_with("run --manifest-path "), "{text}");
        assert!(build.contains("palpate_paper/Cargo.toml --bin palpate-paper"), "{text}");
        assert_eq!(build.contains("--release"), !cfg!(debug_assertions), "{text}");
        assert_eq!(rest, arguments.join(" "));
    }
}

#[cfg(unix)]
#[test]
fn paper_commands_return_the_exit_code_of_palpate_paper() {
    assert_eq!(forwarded("false", &["chain"]).status.code(), Some(1));
    let output = forwarded("no/such/cargo", &["chain"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().starts_with("error: cargo cannot be run: "));
}

#[test]
fn help_lists_the_paper_commands() {
    let output = super::run(&["--help"]);
    let text = String::from_utf8(output.stdout).unwrap();
    for command in ["schemes", "chain", "lattice", "density", "manipulate", "grip", "paper"] {
        assert!(text.lines().any(|line| line.trim_start().starts_with(command)), "{command}");
    }
}
