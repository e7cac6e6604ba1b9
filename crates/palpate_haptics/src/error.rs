//! What can go wrong on the 1 kHz side.

use palpate_local::LocalModelError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a loop, a device or a setting is refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum HapticsError {
    /// A setting is outside what is allowed. The old settings stay in force.
    #[error("{what} is {value}; it must be {allowed}")]
    Setting {
        /// The setting with its unit.
        what: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The sizes or rates of the hand-over make no sense.
    #[error("the hand-over cannot be set up")]
    HandOver(#[from] LocalModelError),
    /// The operating system refused a thread.
    #[error("the haptic thread could not be started")]
    Thread(#[source] std::io::Error),
}

/// Why a trajectory file is not taken. Lines count from 1, the header being line 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// The file could not be read or written.
    #[error("{}: cannot be read or written", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The text is not CSV.
    #[error("{}:{line}: not a row of comma-separated values", .path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// The line, or the last one read.
        line: u64,
        /// Why.
        #[source]
        source: csv::Error,
    },
    /// The first line is not the header.
    #[error(
        "{}:1: the header is \"{found}\"; it must be \"t_s,x_m,y_m,z_m\", after which \"buttons\" and \"qx,qy,qz,qw\" may follow",
        .path.display()
    )]
    Header {
        /// The file.
        path: PathBuf,
        /// What stands there.
        found: String,
    },
    /// A row has too few or too many fields.
    #[error("{}:{line}: {found} fields; a row has {}: {}", .path.display(), .columns.len(), .columns.join(","))]
    Fields {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// How many fields it has.
        found: usize,
        /// The file's columns.
        columns: Vec<String>,
    },
    /// What stands for the buttons is no number of bits.
    #[error("{}:{line}: buttons is \"{found}\"; it must be a whole number from 0 to 4294967295", .path.display())]
    Buttons {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// What stands there.
        found: String,
    },
    /// A quaternion that is no rotation.
    #[error("{}:{line}: the length of qx,qy,qz,qw is {found}; it must be 1", .path.display())]
    Orientation {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// Its length.
        found: f64,
    },
    /// A field is not a finite number.
    #[error("{}:{line}: {column} is \"{found}\"; it must be a finite number", .path.display())]
    Number {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// The column's name.
        column: String,
        /// What stands there.
        found: String,
    },
    /// A position is so far away that it cannot be in metres.
    #[error("{}:{line}: {column} is {found} m; positions lie within 10 m of the origin", .path.display())]
    Far {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// The column's name.
        column: &'static str,
        /// The coordinate, m.
        found: f64,
    },
    /// The rows are not one millisecond apart.
    #[error("{}:{line}: t_s is {found}; rows are 1 ms apart, so it must be {expected}", .path.display())]
    Time {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// The time found, s.
        found: f64,
        /// The time expected, s.
        expected: f64,
    },
    /// There are too few rows to be a movement.
    #[error("{}: {rows} rows; a trajectory has at least 2", .path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// How many rows there are.
        rows: usize,
    },
}

/// `value` if it is finite and above zero.
pub(crate) fn check_positive(what: &'static str, value: f64) -> Result<(), HapticsError> {
    check(what, value, value.is_finite() && value > 0.0, "finite and above 0")
}

/// An error naming `what` unless `ok`.
pub(crate) fn check(
    what: &'static str,
    value: f64,
    ok: bool,
    allowed: &'static str,
) -> Result<(), HapticsError> {
    if ok { Ok(()) } else { Err(HapticsError::Setting { what, value, allowed }) }
}
