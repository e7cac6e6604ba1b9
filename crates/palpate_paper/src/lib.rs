//! The experiments of the seed paper (M. C. Çavuşoğlu, *Multirate Simulation for High Fidelity Haptic Interaction with Deformable
//! Objects in Virtual Environments*, UCB/ERL M00/5, 2000), with any parameters: the commands of the program `palpate-paper`.
//!
//! Options, output and exit codes are those of `palpate-lab`, which forwards these commands from a clone of the repository.
//!
//! * [`Specimen`]: the mesh of the paper's sections 4 and 5 and its local models.
//! * [`block_scaling()`]: stiffness of a block over the density of its mesh, Fig. 16.

#![forbid(unsafe_code)]

mod block_scaling;
mod chain;
mod density;
mod grip;
mod lattice;
mod manipulate;
mod paper;
mod schemes;
mod specimen;

pub use block_scaling::block_scaling;
pub use specimen::Specimen;

use clap::{Parser, Subcommand};
use palpate_lab::output::Output;
use palpate_lab::program;
use std::process::ExitCode;

/// The experiments of the seed paper on multirate haptics, with any parameters
#[derive(Debug, Parser)]
#[command(name = "palpate-paper", version, arg_required_else_help = true)]
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
    Paper(paper::Paper),
}

/// Runs `palpate-paper` with the arguments of the process.
pub fn run() -> ExitCode {
    let cli: Cli = match program::parse() {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    program::exit_code(match &cli.command {
        Command::Schemes(command) => command.run(&cli.output),
        Command::Chain(command) => command.run(&cli.output),
        Command::Lattice(command) => command.run(&cli.output),
        Command::Density(command) => command.run(&cli.output),
        Command::Manipulate(command) => command.run(&cli.output),
        Command::Grip(command) => command.run(&cli.output),
        Command::Paper(command) => command.run(&cli.output),
    })
}
