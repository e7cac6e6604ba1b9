//! Why a black box or a recording cannot be written or read.

use std::path::PathBuf;
use thiserror::Error;

/// Why the file of a black box or of a whole run is not written or not taken. Lines count from 1, the header being line 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BlackBoxError {
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
    #[error("{}:1: column {column} is \"{found}\"; it must be \"{expected}\"", .path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// Number of the first column that is not as it must be, from 1.
        column: usize,
        /// What stands there; empty where the line has ended.
        found: String,
        /// What must stand there; empty where the line must have ended.
        expected: &'static str,
    },
    /// A row has too few or too many fields.
    #[error("{}:{line}: {found} fields; a row has {expected}", .path.display())]
    Fields {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// How many fields it has.
        found: usize,
        /// How many it must have.
        expected: usize,
    },
    /// A field is not what its column holds.
    #[error("{}:{line}: {column} is \"{found}\"; it must be {expected}", .path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// The column's name.
        column: &'static str,
        /// What stands there.
        found: String,
        /// What must stand there.
        expected: &'static str,
    },
    /// The rows are not in the order of time.
    #[error("{}:{line}: sequence is {found}; rows ascend, so it must be above {previous}", .path.display())]
    Order {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// The sequence number found.
        found: u64,
        /// That of the row before.
        previous: u64,
    },
}
