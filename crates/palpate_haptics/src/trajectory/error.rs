//! Errors of trajectory files.

use crate::CsvError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a trajectory file was rejected. Lines count from 1; the header is line 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// The file could not be read or is not a CSV table.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// The first line is not the header.
    #[error(
        "{}:1: the header is \"{found}\"; it must be \"t_s,x_m,y_m,z_m\", after which \"buttons\" and \"qx,qy,qz,qw\" may follow",
        .path.display()
    )]
    Header {
        /// Path of the file.
        path: PathBuf,
        /// First line of the file.
        found: String,
    },
    /// The buttons are not a whole number below 2³².
    #[error("{}:{line}: buttons is \"{found}\"; it must be a whole number from 0 to 4294967295", .path.display())]
    Buttons {
        /// Path of the file.
        path: PathBuf,
        /// Line of the row.
        line: u64,
        /// Content of the field.
        found: String,
    },
    /// A quaternion is not of length 1.
    #[error("{}:{line}: the length of qx,qy,qz,qw is {found}; it must be 1", .path.display())]
    Orientation {
        /// Path of the file.
        path: PathBuf,
        /// Line of the row.
        line: u64,
        /// Length of the quaternion.
        found: f64,
    },
    /// A field is not a finite number.
    #[error("{}:{line}: {column} is \"{found}\"; it must be a finite number", .path.display())]
    Number {
        /// Path of the file.
        path: PathBuf,
        /// Line of the row.
        line: u64,
        /// Name of the column.
        column: String,
        /// Content of the field.
        found: String,
    },
    /// A position is so far away that its unit cannot be the metre.
    #[error("{}:{line}: {column} is {found} m; positions lie within 10 m of the origin", .path.display())]
    Far {
        /// Path of the file.
        path: PathBuf,
        /// Line of the row.
        line: u64,
        /// Name of the column.
        column: &'static str,
        /// Coordinate, m.
        found: f64,
    },
    /// The rows are not one millisecond apart.
    #[error("{}:{line}: t_s is {found}; rows are 1 ms apart, so it must be {expected}", .path.display())]
    Time {
        /// Path of the file.
        path: PathBuf,
        /// Line of the row.
        line: u64,
        /// Time in the row, s.
        found: f64,
        /// Expected time, s.
        expected: f64,
    },
    /// The file has fewer than two rows.
    #[error("{}: {rows} rows; a trajectory has at least 2", .path.display())]
    TooShort {
        /// Path of the file.
        path: PathBuf,
        /// Number of rows.
        rows: usize,
    },
}
