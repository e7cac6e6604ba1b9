//! The commands of the program `palpate-lab`: devices, black boxes, accuracy of the schemes, mesh files, measured presses, injected
//! faults and the timing of the loop under load.
//!
//! Each command prints a table, or with `--json` one JSON object. With `--out DIR` it writes its data as CSV and its figures as
//! SVG. An invalid argument or a rejected file ends the program with exit code 2 and one line that states what is allowed. A run that
//! breaks a guarantee of the loop ends it with exit code 1.
//!
//! The library has no stable interface. It is public for the unpublished crate `palpate_paper`, which uses the same options,
//! output and figures.

#![forbid(unsafe_code)]

mod app_tool;
mod blackbox;
pub mod block_scene;
mod continuum;
mod devices;
pub mod element_options;
pub mod error;
mod faults;
mod fidelity;
pub mod figure;
mod mesh;
mod mesh_input;
mod multirate;
mod organ;
pub mod output;
mod paper_commands;
mod probe;
pub mod program;
pub mod progress;
mod soak;
mod top;

use clap::{Parser, Subcommand};
use output::Output;
use std::process::ExitCode;

/// Devices, black boxes, accuracy, mesh files, measured presses, faults and timing of haptic simulation with palpate
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
    Devices(devices::Devices),
    Blackbox(blackbox::Blackbox),
    Fidelity(fidelity::Fidelity),
    Continuum(continuum::Continuum),
    Mesh(mesh::Mesh),
    Probe(probe::Probe),
    Faults(faults::Faults),
    Soak(soak::Soak),
    Organ(organ::Organ),
    #[command(flatten)]
    Paper(paper_commands::PaperCommand),
}

/// Runs `palpate-lab` with the arguments of the process.
pub fn run() -> ExitCode {
    let cli: Cli = match program::parse() {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let result = match &cli.command {
        Command::Devices(command) => command.run(&cli.output),
        Command::Blackbox(command) => command.run(&cli.output),
        Command::Fidelity(command) => command.run(&cli.output),
        Command::Continuum(command) => command.run(&cli.output),
        Command::Mesh(command) => command.run(&cli.output),
        Command::Probe(command) => command.run(&cli.output),
        Command::Faults(command) => command.run(&cli.output),
        Command::Soak(command) => command.run(&cli.output),
        Command::Organ(command) => command.run(&cli.output),
        Command::Paper(_) => {
            return paper_commands::run().unwrap_or_else(|error| program::exit_code(Err(error)));
        }
    };
    program::exit_code(result)
}
