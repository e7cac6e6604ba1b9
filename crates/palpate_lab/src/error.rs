//! Why an experiment is not run.

use std::path::PathBuf;
use thiserror::Error;

/// What went wrong.
#[derive(Debug, Error)]
pub(crate) enum LabError {
    /// A parameter is outside what is allowed.
    #[error("{flag} is {value}; it must be {allowed}")]
    Parameter { flag: &'static str, value: f64, allowed: String },
    /// A body could not be built.
    #[error("the body cannot be built")]
    Body(#[from] palpate_body::BodyError),
    /// A system could not be analysed.
    #[error("the system cannot be analysed")]
    Reduce(#[from] palpate_reduce::ReduceError),
    /// A filter could not be made.
    #[error("the filter cannot be made")]
    Filter(#[from] palpate_local::LocalModelError),
    /// A trajectory could not be read.
    #[error("the trajectory cannot be read")]
    Trajectory(#[from] palpate_haptics::TrajectoryError),
    /// A mesh could not be read from a file.
    #[error("--mesh {}: {why}", .path.display())]
    Mesh { path: PathBuf, why: String },
    /// A place without surface below it.
    #[error(
        "{flag} has the place {},{} mm, where no surface lies below the tool; it must be over the body, which spans {:.1} to {:.1} mm along x and {:.1} to {:.1} mm along z; change {flag}",
        .place[0], .place[1], .low[0], .high[0], .low[1], .high[1]
    )]
    NoSurface {
        flag: &'static str,
        /// x and z, mm.
        place: [f64; 2],
        /// Bounds of the body along x and z, mm.
        low: [f64; 2],
        high: [f64; 2],
    },
    /// A press failed.
    #[error("the press at {x_mm},{z_mm} mm cannot be computed")]
    Press {
        x_mm: f64,
        z_mm: f64,
        #[source]
        source: palpate_reduce::ReduceError,
    },
    /// A region of other tissue that holds no part of the body.
    #[error(
        "--lump holds no part of the body: its radius is {radius_mm} mm and a cell of the body is {cell_mm:.1} mm; move it, enlarge it, or use smaller cells (--nodes, --cells)"
    )]
    EmptyLump { radius_mm: f64, cell_mm: f64 },
    /// A black box could not be read.
    #[error("the black box cannot be read")]
    BlackBox(#[from] palpate_haptics::BlackBoxError),
    /// A black box has a header and no more.
    #[error("{}: there is no tick in it; it was written before the loop's first", .path.display())]
    NoTicks { path: PathBuf },
    /// The machine could not be kept busy.
    #[error("the load cannot be made")]
    Load(#[source] std::io::Error),
    /// A thread of the run ended before its time.
    #[error("the {0} ended before its time")]
    Ended(&'static str),
    /// A run of the loop broke what must hold under any load.
    #[error("{0}")]
    Broken(String),
    /// There is nothing to compare with.
    #[error(
        "the movement never presses the body after {from_s} s, so there is no force to compare; lead it into the body"
    )]
    NoForce { from_s: f64 },
    /// The loop could not be set up.
    #[error("the loop cannot be set up")]
    Haptics(#[from] palpate_haptics::HapticsError),
    /// A device over HID is not there, or cannot be used.
    #[error(transparent)]
    Hid(#[from] palpate_hid::HidError),
    /// Nobody is there to agree to a force.
    #[error(
        "a test pushes a hand, so it asks before it begins, and standard input is no terminal; say --yes if nobody is at the device or whoever is knows"
    )]
    NobodyToAsk,
    /// An interruption would not end it in order.
    #[error("interruptions cannot be waited for, and a test that is cut off leaves its force")]
    Interrupt(#[source] ctrlc::Error),
    /// Whoever was asked did not agree.
    #[error("not begun")]
    NotAgreed,
    /// There is no such fault.
    #[error("no fault has \"{name}\" in its name; `palpate-lab faults` lists them all")]
    NoFault { name: String },
    /// What must hold did not.
    #[error("not survived: {names}")]
    NotSurvived { names: String },
    /// A file could not be written.
    #[error("{} cannot be written", .path.display())]
    Write {
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    /// A figure could not be drawn.
    #[error("the figure cannot be drawn: {0}")]
    Figure(String),
    /// Standard output is closed.
    #[error("the result cannot be printed")]
    Print(#[from] std::io::Error),
    /// The result has no JSON form.
    #[error("the result cannot be printed as JSON")]
    Json(#[from] serde_json::Error),
}

/// An error naming `flag` unless `value` is finite and `ok`.
pub(crate) fn check(
    flag: &'static str,
    value: f64,
    ok: bool,
    allowed: impl Into<String>,
) -> Result<(), LabError> {
    if value.is_finite() && ok {
        Ok(())
    } else {
        Err(LabError::Parameter { flag, value, allowed: allowed.into() })
    }
}

/// Reads a count from the command line.
pub(crate) fn whole(text: &str) -> Result<usize, &'static str> {
    text.trim().parse().map_err(|_| "it must be a whole number, not below 0")
}

/// Reads a quantity from the command line.
pub(crate) fn number(text: &str) -> Result<f64, &'static str> {
    text.trim().parse().map_err(|_| "it must be a number")
}
