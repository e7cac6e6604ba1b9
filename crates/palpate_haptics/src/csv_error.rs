//! Errors common to all files of comma-separated values.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file of comma-separated values could not be read or written. Lines count from 1; the header is line 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CsvError {
    /// The file could not be read or written.
    #[error("{}: cannot be read or written", .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: std::io::Error,
    },
    /// The text is not CSV.
    #[error("{}:{line}: not a row of comma-separated values", .path.display())]
    Syntax {
        /// Path of the file.
        path: PathBuf,
        /// Line of the error, or the last line read.
        line: u64,
        /// Error of the CSV reader.
        #[source]
        source: csv::Error,
    },
    /// A row has too few or too many fields.
    #[error("{}:{line}: {found} fields; a row has {expected}", .path.display())]
    Fields {
        /// Path of the file.
        path: PathBuf,
        /// Line of the row.
        line: u64,
        /// Number of fields in the row.
        found: usize,
        /// Number of columns of the file.
        expected: usize,
    },
}

impl CsvError {
    /// Maps errors of the operating system on `path` to [`CsvError::File`].
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::File { path: path.to_owned(), source }
    }

    /// Maps errors of the CSV reader on `path`, whose cause may be the operating system.
    pub(crate) fn reader(path: &Path) -> impl Fn(csv::Error) -> Self {
        move |source| {
            let (path, line) = (path.to_owned(), source.position().map_or(1, csv::Position::line));
            if let csv::ErrorKind::Io(error) = source.kind() {
                let source = std::io::Error::new(error.kind(), error.to_string());
                return Self::File { path, source };
            }
            Self::Syntax { path, line, source }
        }
    }
}
