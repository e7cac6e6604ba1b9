//! A recorder for whole runs, off the loop.

use crate::black_box::table::{write_header, write_row};
use crate::{BlackBoxError, BlackBoxTick, HapticHandle};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes every tick of a run to a file as it comes, on the app's thread: the rows of [`crate::Recording`].
///
/// [`crate::LoopSettings::record`] must be set, and [`Recorder::take`] called often enough that the queue of
/// [`crate::LoopConfig::record_capacity`] ticks (8 s) does not fill up. What finds it full is dropped and counted. A recorder
/// takes every record that it finds: who wants to look at them otherwise reads the file.
///
/// A second takes half a megabyte.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    file: BufWriter<File>,
    written: u64,
    dropped: u64,
}

impl Recorder {
    /// Begins the file `path`.
    ///
    /// # Errors
    /// [`BlackBoxError::File`], also if there is a file already: a run cannot be had twice.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, BlackBoxError> {
        let path = path.as_ref().to_owned();
        let begin = || -> std::io::Result<_> {
            let mut file = BufWriter::new(File::create_new(&path)?);
            write_header(&mut file)?;
            file.flush()?;
            Ok(file)
        };
        match begin() {
            Ok(file) => Ok(Self { path, file, written: 0, dropped: 0 }),
            Err(source) => Err(BlackBoxError::File { path, source }),
        }
    }

    /// Writes the ticks that have come since the last call; returns how many. The file is whole when it returns. A last call
    /// after the loop has ended takes what is left.
    ///
    /// # Errors
    /// [`BlackBoxError::File`]; the tick at which writing failed is lost.
    pub fn take(&mut self, handle: &mut HapticHandle) -> Result<u64, BlackBoxError> {
        let before = self.written;
        let tick_s = handle.config().hand_over.tick_s;
        let written = self.write(handle, tick_s).and_then(|()| self.file.flush());
        self.dropped = handle.report().dropped_records;
        written.map_err(|source| BlackBoxError::File { path: self.path.clone(), source })?;
        Ok(self.written - before)
    }

    fn write(&mut self, handle: &mut HapticHandle, tick_s: f64) -> std::io::Result<()> {
        while let Some(record) = handle.next_record() {
            write_row(&mut self.file, &BlackBoxTick::of(&record, tick_s))?;
            self.written += 1;
        }
        Ok(())
    }

    /// Ticks written.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Ticks that found the queue full, since the loop's start: they are missing in the file. As of the last
    /// [`Recorder::take`], to the newest report of the loop, which comes every 64 ticks and at its end.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}
