//! Writes black boxes to files in a folder.

use super::BlackBoxError;
use crate::{CsvError, HapticHandle};
use std::fs::{DirEntry, File};
use std::io::ErrorKind;
use std::path::PathBuf;

/// Writes black boxes to numbered files in a folder, up to a maximum number, and never overwrites a file.
///
/// ```no_run
/// # use palpate_haptics::{BlackBoxError, BlackBoxWriter, HapticHandle};
/// # fn poll(handle: &mut HapticHandle, writer: &mut BlackBoxWriter) -> Result<(), BlackBoxError> {
/// while let Some(event) = handle.next_event() {
///     if event.kind.is_fault() {
///         writer.write(handle, &event.kind.to_string())?;
///     }
/// }
/// # Ok(())
/// # }
/// ```
///
/// A file contains the ticks that the loop has published at the call; to include ticks after a fault, call later. A file has 1 to
/// 2 MB and takes some tens of milliseconds to write, on the calling thread.
#[derive(Clone, Debug)]
pub struct BlackBoxWriter {
    folder: PathBuf,
    files_left: usize,
}

impl BlackBoxWriter {
    /// Default for the maximum number of files.
    pub const DEFAULT_MAX_FILES: usize = 16;

    /// A writer for `folder`, which is created with the first file.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), files_left: Self::DEFAULT_MAX_FILES }
    }

    /// Sets the maximum number of files.
    #[must_use]
    pub fn with_max_files(self, files: usize) -> Self {
        Self { files_left: files, ..self }
    }

    /// Writes the black box of `handle` to `blackbox-<n>-<reason>.csv`. The number n is one above the largest in the folder; in
    /// `reason`, hyphens replace all characters but letters and digits. Returns the path, or `None` if this writer has written its
    /// maximum number of files.
    ///
    /// # Errors
    /// [`CsvError::File`]; an incomplete file is removed.
    pub fn write(
        &mut self,
        handle: &mut HapticHandle,
        reason: &str,
    ) -> Result<Option<PathBuf>, BlackBoxError> {
        if self.files_left == 0 {
            return Ok(None);
        }
        std::fs::create_dir_all(&self.folder).map_err(CsvError::file(&self.folder))?;
        let entries = std::fs::read_dir(&self.folder).map_err(CsvError::file(&self.folder))?;
        let largest = entries.filter_map(|entry| number(&entry.ok()?)).max().unwrap_or(0);
        let reason = slug(reason);
        let mut n = largest.saturating_add(1);
        loop {
            let path = self.folder.join(format!("blackbox-{n}-{reason}.csv"));
            match File::create_new(&path) {
                Ok(file) => {
                    if let Err(error) = handle.black_box().write_to(file) {
                        // If removing the incomplete file fails too, the first error gives the cause.
                        let _ = std::fs::remove_file(&path);
                        return Err(CsvError::file(&path)(error).into());
                    }
                    self.files_left -= 1;
                    return Ok(Some(path));
                }
                // Another writer has created this file in the meantime.
                Err(error) if error.kind() == ErrorKind::AlreadyExists && n < u64::MAX => n += 1,
                Err(error) => return Err(CsvError::file(&path)(error).into()),
            }
        }
    }
}

/// The n of `blackbox-<n>-…`.
fn number(entry: &DirEntry) -> Option<u64> {
    let name = entry.file_name();
    name.to_str()?.strip_prefix("blackbox-")?.split('-').next()?.parse().ok()
}

/// `reason` as part of a file name: up to 60 lower-case letters, digits and hyphens.
fn slug(reason: &str) -> String {
    let words = reason.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    let mut text = words.collect::<Vec<_>>().join("-").to_ascii_lowercase();
    text.truncate(60);
    if text.is_empty() { "asked".into() } else { text }
}
