//! `palpate-lab`: the experiments of the seed paper (M. C. Çavuşoğlu, UCB/ERL M00/5, 2000), with any parameters.
//!
//! Each command prints a table, or with `--json` one JSON object; with `--out DIR` it writes its data as CSV and its
//! figures as SVG. What makes no sense ends with exit code 2 and one line that says what is allowed; a run of the loop that
//! breaks what must hold ends with exit code 1.

#![forbid(unsafe_code)]

mod blackbox;
mod chain;
mod density;
mod devices;
mod error;
mod faults;
mod fidelity;
mod figure;
mod grip;
mod lattice;
mod manipulate;
mod organ;
mod output;
mod paper;
mod probe;
mod progress;
mod schemes;
mod soak;

use clap::{Args, Parser, Subcommand};
use error::LabError;
use output::Output;
use std::io::Write;
use std::process::ExitCode;

/// The experiments of the seed paper on multirate haptics, with any parameters.
#[derive(Debug, Parser)]
#[command(name = "palpate-lab", version, arg_required_else_help = true)]
struct Cli {
    #[command(flatten)]
    output: Output,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Schemes(schemes::Schemes),
    Chain(chain::Chain),
    Lattice(lattice::Lattice),
    Density(density::Density),
    Manipulate(manipulate::Manipulate),
    Grip(grip::Grip),
    Fidelity(fidelity::Fidelity),
    Probe(probe::Probe),
    Faults(faults::Faults),
    Soak(soak::Soak),
    Devices(devices::Devices),
    Paper(paper::Paper),
    Blackbox(blackbox::Blackbox),
    Organ(organ::Organ),
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error)
            if error.use_stderr()
                && error.kind() != clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand =>
        {
            // The message, and what is allowed where clap lists it; then it explains the usage.
            let text = error.to_string();
            let lines = text.lines().take_while(|line| !line.is_empty()).map(str::trim);
            return refuse(&(lines.collect::<Vec<_>>().join(" ") + "; see --help"));
        }
        // Help and version.
        Err(error) => error.exit(),
    };
    let done = match &cli.command {
        Command::Schemes(command) => command.run(&cli.output),
        Command::Chain(command) => command.run(&cli.output),
        Command::Lattice(command) => command.run(&cli.output),
        Command::Density(command) => command.run(&cli.output),
        Command::Manipulate(command) => command.run(&cli.output),
        Command::Grip(command) => command.run(&cli.output),
        Command::Fidelity(command) => command.run(&cli.output),
        Command::Probe(command) => command.run(&cli.output),
        Command::Faults(command) => command.run(&cli.output),
        Command::Soak(command) => command.run(&cli.output),
        Command::Devices(command) => command.run(&cli.output),
        Command::Paper(command) => command.run(&cli.output),
        Command::Blackbox(command) => command.run(&cli.output),
        Command::Organ(command) => command.run(&cli.output),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        // What was asked for was done, and showed that something does not hold.
        Err(error @ (LabError::NotSurvived { .. } | LabError::Broken(_))) => {
            refuse(&format!("error: {}", error.chain()));
            ExitCode::FAILURE
        }
        Err(error) => refuse(&format!("error: {}", error.chain())),
    }
}

/// A command with the values that a user gets who gives none.
fn defaults<T: Args>() -> T {
    let matches = T::augment_args(clap::Command::new("defaults")).get_matches_from(["defaults"]);
    T::from_arg_matches(&matches).expect("every argument has a default")
}

fn refuse(line: &str) -> ExitCode {
    // Where standard error is closed there is nobody to be told.
    let _ = writeln!(std::io::stderr(), "{line}");
    ExitCode::from(2)
}

impl LabError {
    /// The message and its causes, in one line.
    fn chain(&self) -> String {
        let mut text = self.to_string();
        let mut cause = std::error::Error::source(self);
        while let Some(error) = cause {
            text.push_str(": ");
            text.push_str(&error.to_string());
            cause = error.source();
        }
        text
    }
}
