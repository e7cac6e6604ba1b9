//! Errors of the commands.

use std::path::PathBuf;
use thiserror::Error;

/// Error of a command.
#[derive(Debug, Error)]
pub enum LabError {
    /// Tetrahedra in the cells of a surface mesh.
    #[error("--element tet is for blocks; use --element hex with --mesh")]
    TetrahedraInMesh,
    /// A parameter is outside its range.
    #[error("{flag} is {value}; it must be {allowed}")]
    Parameter {
        /// Flag of the parameter.
        flag: &'static str,
        /// Value given.
        value: f64,
        /// Allowed range.
        allowed: String,
    },
    /// A body could not be built.
    #[error("the body cannot be built")]
    Body(#[from] palpate_body::BodyError),
    /// A body has no equilibrium under a load, or it was not found.
    #[error("no equilibrium: {why}")]
    NoEquilibrium {
        /// Cause and remedy.
        why: String,
    },
    /// A system could not be analysed.
    #[error("the system cannot be analysed")]
    Reduce(#[from] palpate_reduce::ReduceError),
    /// A filter could not be created.
    #[error("the filter cannot be created")]
    Filter(#[from] palpate_local::LocalModelError),
    /// A trajectory could not be read.
    #[error("the trajectory cannot be read")]
    Trajectory(#[from] palpate_haptics::TrajectoryError),
    /// A mesh file cannot become a body.
    #[error("{flag}{}: {why}", .path.display())]
    Mesh {
        /// Flag of the file with a space after it; empty for a file without a flag.
        flag: &'static str,
        /// File of the mesh.
        path: PathBuf,
        /// Problem and remedy.
        why: String,
    },
    /// No surface lies below the tool at a place.
    #[error(
        "{flag} has the place {},{} mm, where no surface lies below the tool; it must be over the body, which spans {:.1} to {:.1} mm along x and {:.1} to {:.1} mm along z; change {flag}",
        .place[0], .place[1], .low[0], .high[0], .low[1], .high[1]
    )]
    NoSurface {
        /// Flag of the place.
        flag: &'static str,
        /// x and z, mm.
        place: [f64; 2],
        /// Lower bounds of the body along x and z, mm.
        low: [f64; 2],
        /// Upper bounds of the body along x and z, mm.
        high: [f64; 2],
    },
    /// A press failed.
    #[error("the press at {x_mm},{z_mm} mm cannot be computed")]
    Press {
        /// x of the press, mm.
        x_mm: f64,
        /// z of the press, mm.
        z_mm: f64,
        /// Cause.
        #[source]
        source: palpate_reduce::ReduceError,
    },
    /// A region of other tissue contains no part of the body.
    #[error(
        "--lump contains no part of the body: its radius is {radius_mm} mm and a cell of the body is {cell_mm:.1} mm; move it, enlarge it, or use smaller cells (--nodes, --cells)"
    )]
    EmptyLump {
        /// Radius of the region, mm.
        radius_mm: f64,
        /// Edge of a cell, mm.
        cell_mm: f64,
    },
    /// A black box could not be read.
    #[error("the black box cannot be read")]
    BlackBox(#[from] palpate_haptics::BlackBoxError),
    /// A black box has a header and no ticks.
    #[error("{}: the black box has no ticks; it was written before the loop's first tick", .path.display())]
    NoTicks {
        /// File of the black box.
        path: PathBuf,
    },
    /// The load of the machine could not be created.
    #[error("the load cannot be created")]
    Load(#[source] std::io::Error),
    /// A thread of the run ended too early.
    #[error("the {0} ended before the run")]
    Ended(&'static str),
    /// A run of the loop broke a guarantee.
    #[error("{0}")]
    Broken(String),
    /// The full body exerts no force to compare with.
    #[error(
        "the movement never presses the body after {from_s} s, so there is no force to compare; move it into the body"
    )]
    NoForce {
        /// Start of the comparison, s.
        from_s: f64,
    },
    /// The loop could not be set up.
    #[error("the loop cannot be set up")]
    Haptics(#[from] palpate_haptics::HapticsError),
    /// A HID device was not found or cannot be used.
    #[error(transparent)]
    Hid(#[from] palpate_hid::HidError),
    /// A confirmation is required and standard input is no terminal.
    #[error(
        "the test moves the device and standard input is no terminal to confirm it; pass --yes to run without confirmation"
    )]
    NoTerminal,
    /// The handler that ends a test in order could not be installed.
    #[error("interruptions cannot be handled, and a test that is cut off leaves its force on the device")]
    Interrupt(#[source] ctrlc::Error),
    /// The confirmation was declined.
    #[error("the test was not confirmed and has not started")]
    Declined,
    /// No fault has this text in its name.
    #[error("no fault has \"{name}\" in its name; `palpate-lab faults` lists them all")]
    NoFault {
        /// Text to search for.
        name: String,
    },
    /// Some faults were not survived.
    #[error("not survived: {names}")]
    NotSurvived {
        /// Names of the faults.
        names: String,
    },
    /// A command is part of the repository only.
    #[error(
        "the experiments of the seed paper are part of palpate's repository only; clone it and run `cargo run --release -p palpate_lab -- COMMAND` there"
    )]
    NoClone,
    /// Cargo could not be run.
    #[error("cargo cannot be run")]
    Cargo(#[source] std::io::Error),
    /// A file could not be written.
    #[error("{} cannot be written", .path.display())]
    Write {
        /// File to be written.
        path: PathBuf,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
    /// A figure could not be drawn.
    #[error("the figure cannot be drawn: {0}")]
    Figure(String),
    /// Standard output cannot be written.
    #[error("the result cannot be printed")]
    Print(#[from] std::io::Error),
    /// The result has no JSON form.
    #[error("the result cannot be printed as JSON")]
    Json(#[from] serde_json::Error),
}

/// Checks that `value` is finite and `ok`.
///
/// # Errors
/// [`LabError::Parameter`] naming `flag` otherwise.
pub fn check(flag: &'static str, value: f64, ok: bool, allowed: impl Into<String>) -> Result<(), LabError> {
    if value.is_finite() && ok {
        Ok(())
    } else {
        Err(LabError::Parameter { flag, value, allowed: allowed.into() })
    }
}

/// Parses a count of the command line.
///
/// # Errors
/// The allowed form, where `text` is no whole number of at least 0.
pub fn whole(text: &str) -> Result<usize, &'static str> {
    text.trim().parse().map_err(|_| "it must be a whole number, not below 0")
}

/// Parses a quantity of the command line.
///
/// # Errors
/// The allowed form, where `text` is no number.
pub fn number(text: &str) -> Result<f64, &'static str> {
    text.trim().parse().map_err(|_| "it must be a number")
}
