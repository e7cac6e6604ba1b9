//! Black box of a tool: the last ticks of its loop, written to files.

use crate::fault::HapticFaultKind;
use bevy::prelude::*;
use palpate_haptics::{BlackBoxWriter, HapticHandle};
use std::path::PathBuf;

/// Black box of a tool: writes the last 4,096 ticks of its loop to a file at every fault of the loop except missed deadlines, and on
/// request. `palpate-lab blackbox FILE` reads the files.
#[derive(Component, Debug)]
pub struct BlackBoxDump {
    writer: BlackBoxWriter,
    files: Vec<PathBuf>,
    requested: Option<String>,
}

impl BlackBoxDump {
    /// Returns a black box that writes to `folder`, at most 16 files. The folder is created with the first file.
    #[must_use]
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        Self { writer: BlackBoxWriter::new(folder), files: Vec::new(), requested: None }
    }

    /// Requests a file in the next frame; `reason` becomes a part of its name.
    pub fn request(&mut self, reason: impl Into<String>) {
        self.requested = Some(reason.into());
    }

    /// Returns the files that have been written.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Writes a file if one was requested, or for `fault`.
    pub(super) fn write(
        &mut self,
        handle: &mut HapticHandle,
        fault: Option<String>,
    ) -> Option<HapticFaultKind> {
        let reason = self.requested.take().or(fault)?;
        match self.writer.write(handle, &reason) {
            Ok(file) => {
                self.files.extend(file);
                None
            }
            Err(error) => Some(HapticFaultKind::BlackBox(error.into())),
        }
    }
}
