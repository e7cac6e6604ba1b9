//! Recorder of whole runs on the app's thread.

use crate::black_box::csv_rows::{write_header, write_row};
use crate::{BlackBoxError, BlackBoxTick, CsvError, HapticHandle};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes every tick of a run to a file, on the app's thread: the rows of [`crate::Recording`].
///
/// Set [`crate::LoopSettings::record`], and call [`Recorder::take`] before the queue of [`crate::LoopConfig::record_capacity`]
/// ticks (8 s by default) is full. The loop drops and counts records that do not fit. A recorder consumes all records of the queue,
/// which other readers then find only in the file.
///
/// One second takes half a megabyte.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    file: BufWriter<File>,
    written: u64,
    dropped: u64,
}

impl Recorder {
    /// Creates the file `path`.
    ///
    /// # Errors
    /// [`CsvError::File`], also if the file exists: a recording is never overwritten.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, BlackBoxError> {
        let path = path.as_ref().to_owned();
        let create = || -> std::io::Result<_> {
            let mut file = BufWriter::new(File::create_new(&path)?);
            write_header(&mut file)?;
            file.flush()?;
            Ok(file)
        };
        match create() {
            Ok(file) => Ok(Self { path, file, written: 0, dropped: 0 }),
            Err(error) => Err(CsvError::file(&path)(error).into()),
        }
    }

    /// Writes the ticks since the last call and returns their number. The file is flushed on return. Call once more after the loop has
    /// ended to write the remaining ticks.
    ///
    /// # Errors
    /// [`CsvError::File`]; the tick at which writing failed is lost.
    pub fn take(&mut self, handle: &mut HapticHandle) -> Result<u64, BlackBoxError> {
        let before = self.written;
        let tick_s = handle.config().hand_over.tick_s;
        let written = self.write(handle, tick_s).and_then(|()| self.file.flush());
        self.dropped = handle.report().dropped_records;
        written.map_err(CsvError::file(&self.path))?;
        Ok(self.written - before)
    }

    fn write(&mut self, handle: &mut HapticHandle, tick_s: f64) -> std::io::Result<()> {
        while let Some(record) = handle.next_record() {
            write_row(&mut self.file, &BlackBoxTick::of(&record, tick_s))?;
            self.written += 1;
        }
        Ok(())
    }

    /// Number of ticks written.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Number of ticks missing in the file because the queue was full, as of the last [`Recorder::take`]. It comes from the loop's
    /// report, which is updated every 64 ticks and at the end.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}
