//! Errors of files of black boxes and recordings.

use crate::CsvError;
use std::path::PathBuf;
use thiserror::Error;

/// Why the file of a black box or of a whole run could not be written or was rejected. Lines count from 1; the header is line 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BlackBoxError {
    /// The file could not be read or written, or is not a CSV table.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// The first line is not the header.
    #[error("{}:1: column {column} is \"{found}\"; it must be \"{expected}\"", .path.display())]
    Header {
        /// Path of the file.
        path: PathBuf,
        /// Number of the first wrong column, from 1.
        column: usize,
        /// Name of the column in the file; empty after the end of the line.
        found: String,
        /// Expected name; empty where the line must end.
        expected: &'static str,
    },
    /// The content of a field does not match its column.
    #[error("{}:{line}: {column} is \"{found}\"; it must be {expected}", .path.display())]
    Field {
        /// Path of the file.
        path: PathBuf,
        /// Line of the row.
        line: u64,
        /// Name of the column.
        column: &'static str,
        /// Content of the field.
        found: String,
        /// Expected content.
        expected: &'static str,
    },
    /// The rows are not in ascending order.
    #[error("{}:{line}: sequence is {found}; rows ascend, so it must be above {previous}", .path.display())]
    Order {
        /// Path of the file.
        path: PathBuf,
        /// Line of the row.
        line: u64,
        /// Sequence number of the row.
        found: u64,
        /// Sequence number of the previous row.
        previous: u64,
    },
}
