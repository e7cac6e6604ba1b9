//! A folder with a few black boxes.

use super::BlackBoxError;
use crate::HapticHandle;
use std::fs::{DirEntry, File};
use std::io::ErrorKind;
use std::path::PathBuf;

/// Writes black boxes to a folder when it is asked to: a few files, none in the place of another.
///
/// Nothing is written unless an app makes a keeper and asks it:
///
/// ```no_run
/// # use palpate_haptics::{BlackBoxError, BlackBoxKeeper, HapticHandle};
/// # fn look(handle: &mut HapticHandle, keeper: &mut BlackBoxKeeper) -> Result<(), BlackBoxError> {
/// while let Some(event) = handle.next_event() {
///     if event.kind.is_fault() {
///         keeper.keep(handle, &event.kind.to_string())?;
///     }
/// }
/// # Ok(())
/// # }
/// ```
///
/// What the box holds is what the loop has published when it is asked; who wants the ticks after a fault asks later.
/// A file has 1 to 2 MB and takes some hundredths of a second to write, on the thread that asks.
#[derive(Clone, Debug)]
pub struct BlackBoxWriter {
    folder: PathBuf,
    room: usize,
}

impl BlackBoxWriter {
    /// How many files a keeper writes, unless it is told otherwise.
    pub const DEFAULT_MAX_FILES: usize = 16;

    /// A keeper for `folder`, which is made when the first box is kept.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), room: Self::DEFAULT_MAX_FILES }
    }

    /// The same, but for the number of files that it writes.
    #[must_use]
    pub fn with_max_files(self, files: usize) -> Self {
        Self { room: files, ..self }
    }

    /// Writes the black box of `handle` to `blackbox-<n>-<reason>.csv`, where n is one more than the largest in the folder
    /// and all but letters and digits of `reason` becomes a hyphen. Returns the file, or `None` where this keeper has
    /// written as many as it may.
    ///
    /// # Errors
    /// [`BlackBoxError::File`]; what was begun is removed.
    pub fn write(
        &mut self,
        handle: &mut HapticHandle,
        reason: &str,
    ) -> Result<Option<PathBuf>, BlackBoxError> {
        if self.room == 0 {
            return Ok(None);
        }
        let failed = |path: &PathBuf| {
            let path = path.clone();
            move |source| BlackBoxError::File { path, source }
        };
        std::fs::create_dir_all(&self.folder).map_err(failed(&self.folder))?;
        let entries = std::fs::read_dir(&self.folder).map_err(failed(&self.folder))?;
        let largest = entries.filter_map(|entry| number(&entry.ok()?)).max().unwrap_or(0);
        let reason = plain(reason);
        let mut n = largest.saturating_add(1);
        loop {
            let path = self.folder.join(format!("blackbox-{n}-{reason}.csv"));
            match File::create_new(&path) {
                Ok(file) => {
                    if let Err(source) = handle.black_box().write_to(file) {
                        // Half a box is none. If it cannot be removed either, the first error says why.
                        let _ = std::fs::remove_file(&path);
                        return Err(BlackBoxError::File { path, source });
                    }
                    self.room -= 1;
                    return Ok(Some(path));
                }
                // Another keeper was faster.
                Err(error) if error.kind() == ErrorKind::AlreadyExists && n < u64::MAX => n += 1,
                Err(source) => return Err(BlackBoxError::File { path, source }),
            }
        }
    }
}

/// The n of `blackbox-<n>-…`.
fn number(entry: &DirEntry) -> Option<u64> {
    let name = entry.file_name();
    name.to_str()?.strip_prefix("blackbox-")?.split('-').next()?.parse().ok()
}

/// `reason` as part of a file's name: lower-case letters, digits and hyphens, 60 at most.
fn plain(reason: &str) -> String {
    let words = reason.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    let mut text = words.collect::<Vec<_>>().join("-").to_ascii_lowercase();
    text.truncate(60);
    if text.is_empty() { "asked".into() } else { text }
}
