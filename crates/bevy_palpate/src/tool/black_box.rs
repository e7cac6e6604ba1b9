//! The last ticks of a tool's loop, as a file.

use crate::fault::HapticFaultKind;
use bevy::prelude::*;
use palpate_haptics::{BlackBoxWriter, HapticHandle};
use std::path::PathBuf;

/// Put it on a tool to have the last 4,096 ticks of its loop written to a folder when something goes wrong in it, a missed
/// deadline excepted, and whenever it is asked to. `palpate-lab blackbox FILE` reads them.
#[derive(Component, Debug)]
pub struct BlackBoxDump {
    writer: BlackBoxWriter,
    files: Vec<PathBuf>,
    requested: Option<String>,
}

impl BlackBoxDump {
    /// In `folder`, which is made when the first file is written; 16 files at most.
    #[must_use]
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        Self { writer: BlackBoxWriter::new(folder), files: Vec::new(), requested: None }
    }

    /// Asks for a file in the next frame; `reason` becomes a part of its name.
    pub fn request(&mut self, reason: impl Into<String>) {
        self.requested = Some(reason.into());
    }

    /// The files that have been written.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Writes what has been asked for, or for `fault`.
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
