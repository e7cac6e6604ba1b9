//! The commands of the unpublished crate `palpate_paper`, forwarded to its program.
//!
//! The experiments of the seed paper belong to the repository and not to the published tool. A published crate cannot depend on an
//! unpublished one, not even optionally. So `palpate_paper` depends on this crate, has a program of its own, `palpate-paper`, and
//! `palpate-lab paper` and its siblings run that program through cargo with the same arguments. In a clone all commands of
//! `palpate-lab` work; outside one these end with [`LabError::NoClone`].

use crate::error::LabError;
use clap::{Args, Subcommand};
use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::Path;
use std::process::{Command, ExitCode};

/// Commands of `palpate-paper`.
#[derive(Debug, Subcommand)]
pub(crate) enum PaperCommand {
    /// Section 2 of the seed paper: force between model steps on a nonlinear spring [in a clone]
    #[command(disable_help_flag = true)]
    Schemes(Forwarded),
    /// Section 5.1: a chain of four layers and its two local models [in a clone]
    #[command(disable_help_flag = true)]
    Chain(Forwarded),
    /// Sections 4 and 5: a mesh and its reduced models [in a clone]
    #[command(disable_help_flag = true)]
    Lattice(Forwarded),
    /// Section 5.2: stiffness of a block over the density of its mesh [in a clone]
    #[command(disable_help_flag = true)]
    Density(Forwarded),
    /// Section 6: force during manipulation of a block [in a clone]
    #[command(disable_help_flag = true)]
    Manipulate(Forwarded),
    /// Section 6: stability of a device under a loose grip [in a clone]
    #[command(disable_help_flag = true)]
    Grip(Forwarded),
    /// Every figure and number of the seed paper with the result here, as one page [in a clone]
    #[command(disable_help_flag = true)]
    Paper(Forwarded),
}

/// Arguments that `palpate-paper` parses.
#[derive(Debug, Args)]
pub(crate) struct Forwarded {
    /// Arguments of the command; --help lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGS")]
    arguments: Vec<OsString>,
}

/// Manifest of `palpate_paper` in a clone.
const MANIFEST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../palpate_paper/Cargo.toml");

/// Runs `palpate-paper` with the arguments of this process and returns its exit code.
///
/// # Errors
/// [`LabError::NoClone`] outside a clone; [`LabError::Cargo`] where cargo cannot be run.
pub(crate) fn run() -> Result<ExitCode, LabError> {
    if !Path::new(MANIFEST).is_file() {
        return Err(LabError::NoClone);
    }
    // Cargo sets the variable for the programs that it runs.
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["run", "--manifest-path", MANIFEST, "--bin", "palpate-paper"]);
    // With the profile of this program. The progress of the build is for a person.
    cargo.args((!cfg!(debug_assertions)).then_some("--release"));
    cargo.args((!std::io::stderr().is_terminal()).then_some("--quiet"));
    cargo.arg("--").args(std::env::args_os().skip(1));
    let status = cargo.status().map_err(LabError::Cargo)?;
    Ok(status.code().and_then(|code| u8::try_from(code).ok()).map_or(ExitCode::FAILURE, ExitCode::from))
}
