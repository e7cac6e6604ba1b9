//! The experiments as a user runs them, and the systems behind them.

mod experiments;
#[path = "../../../palpate_lab/tests/commands/program.rs"]
mod program;
mod specimen;

use program::*;
use serde_json::Value;

const PROGRAM: &str = env!("CARGO_BIN_EXE_palpate-paper");

#[test]
fn commands_write_complete_files_only() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new").join("results");
    let mut expected = 0;
    for (arguments, names) in [
        (&["schemes"][..], &["schemes"][..]),
        (&["chain"], &["chain"]),
        (
            &["lattice", "--cells", "6"],
            &["lattice_response", "lattice_hankel", "lattice_states", "lattice_mesh"],
        ),
        (&["density", "--to", "3"], &["density"]),
        (&["manipulate", "--nodes", "4"], &["manipulate"]),
        (&["grip", "--duration-s", "1"], &["grip"]),
    ] {
        let output = run(&[arguments, &["--out", out.to_str().unwrap()]].concat());
        assert!(output.status.success() && !output.stdout.is_empty(), "{arguments:?}");
        assert!(output.stderr.is_empty(), "no progress bar without a terminal");
        for name in names {
            let svg = std::fs::read_to_string(out.join(format!("{name}.svg"))).unwrap();
            assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"));
            expected += 1;
            if *name != "lattice_mesh" {
                let csv = std::fs::read_to_string(out.join(format!("{name}.csv"))).unwrap();
                let columns = csv.lines().next().unwrap().split(',').count();
                assert!(
                    csv.lines().count() > 3 && csv.lines().all(|line| line.split(',').count() == columns)
                );
                assert!(!csv.contains("NaN") && !csv.contains("inf"));
                expected += 1;
            }
        }
    }
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), expected, "no temporary files remain");
}

#[test]
fn error_names_a_folder_that_cannot_be_written() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let text = rejected(&["chain", "--out", file.path().to_str().unwrap()]);
    assert!(text.contains("cannot be written") && text.contains(file.path().to_str().unwrap()), "{text}");
    // An obstacle for the second file prevents the first.
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("chain.svg")).unwrap();
    assert!(
        rejected(&["chain", "--out", folder.path().to_str().unwrap()])
            .contains("chain.svg cannot be written")
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let inside = file.path().join("deeper");
    assert!(rejected(&["chain", "--out", inside.to_str().unwrap()]).contains("cannot be written"));
}

#[test]
fn rejects_invalid_arguments_in_one_line_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("results");
    for (arguments, expected) in [
        (
            &["schemes", "--model-rate-hz", "0"][..],
            "error: --model-rate-hz is 0; it must be finite and above 0",
        ),
        (&["schemes", "--cutoff-hz", "-1"], "error: --cutoff-hz is -1; it must be finite and above 0"),
        (&["schemes", "--duration-s", "NaN"], "error: --duration-s is NaN; it must be 1 to 600"),
        (
            &["schemes", "--model-rate-hz", "2000"],
            "error: --model-rate-hz is 2000; it must be at most the haptic rate, 1000",
        ),
        (&["schemes", "--offset-mm", "35"], "error: --offset-mm is 35; it must be at least 0 and such that"),
        (&["chain", "--mass", "0"], "error: --mass is 0; it must be 1e-9 to 1e9"),
        (&["chain", "--stiffness", "inf"], "error: --stiffness is inf; it must be 1e-9 to 1e9"),
        (
            &["chain", "--damping", "abc"],
            "error: invalid value 'abc' for '--damping <DAMPING>': it must be a number",
        ),
        (&["nonsense"], "error: unrecognized subcommand 'nonsense'"),
        (
            &["lattice", "--order", "525"],
            "error: --order is 525; it must be 1 to 524, the order of the system",
        ),
        (&["lattice", "--order", "0"], "error: --order is 0; it must be 1 to 524"),
        (
            &["lattice", "--order", "-3"],
            "error: invalid value '-3' for '--order <ORDER>': it must be a whole number",
        ),
        (&["lattice", "--method", "modal", "--order", "5"], "error: --order is 5; it must be even"),
        (
            &["lattice", "--method", "fast"],
            "error: invalid value 'fast' for '--method <METHOD>' [possible values: full, ",
        ),
        (&["lattice", "--dimension", "4"], "error: --dimension is 4; it must be 1, 2 or 3"),
        (&["lattice", "--cells", "1"], "error: --cells is 1; it must be at least 2"),
        (&["lattice", "--cells", "60"], "error: --cells is 60; it must be so few that"),
        (&["lattice", "--damping", "0"], "error: --damping is 0; it must be 1e-9 to 1e9"),
        (
            &["lattice", "--band-hz", "1000,10"],
            "error: high end of --band-hz is 10; it must be above its low end, 1000",
        ),
        (&["lattice", "--band-hz", "NaN,10"], "error: low end of --band-hz is NaN"),
        (&["lattice", "--band-hz", "10"], "error: number of frequencies of --band-hz is 1; it must be 2"),
        (&["lattice", "--shifts-hz", "5,-20"], "error: --shifts-hz is -20; it must be 1e-6 to 1e9"),
        (&["lattice", "--method", "scaled", "--rings", "0"], "error: --rings is 0; it must be 1 to 12"),
        (&["lattice", "--stiffness", "-inf"], "error: --stiffness is -inf; it must be 1e-9 to 1e9"),
        (&["schemes", "--amplitude-mm", "1e3"], "error: --amplitude-mm is 1000; it must be 0.001 to 38.36"),
        (
            &["schemes", "--frequency-hz", "600"],
            "error: --frequency-hz is 600; it must be above 0 and at most half",
        ),
        (&["schemes", "--force-step-n", "1e-310"], "error: --force-step-n is "),
        (&["density", "--dimension", "2,5"], "error: --dimension is 5; it must be 1, 2 or 3"),
        (&["density", "--from", "7", "--to", "6"], "error: --to is 6; it must be at least --from, 7"),
        (&["density", "--to", "1000"], "error: --to is 1000; it must be at most 200 in dimension 2"),
        (&["manipulate", "--nodes", "1"], "error: --nodes is 1; it must be 2 to 24"),
        (&["manipulate", "--model-rate-hz", "2000"], "error: --model-rate-hz is 2000; it must be 1 to 1000"),
        (&["manipulate", "--trajectory", "no/such.csv"], "error: the trajectory cannot be read: no/such.csv"),
        (&["grip", "--device-mass-kg", "0"], "error: --device-mass-kg is 0; it must be 0.001 to 100"),
        (&["paper", "--nonsense"], "error: unexpected argument '--nonsense' found"),
    ] {
        let text = rejected(&[arguments, &["--out", out.to_str().unwrap()]].concat());
        assert!(text.starts_with(expected), "{text}");
    }
    assert!(!out.exists());
}

#[test]
fn help_has_examples() {
    for command in ["schemes", "chain", "lattice", "density", "manipulate", "grip", "paper"] {
        let output = run(&[command, "--help"]);
        assert!(output.status.success());
        assert!(String::from_utf8(output.stdout).unwrap().contains("Examples:"), "{command}");
    }
}
