//! The last ticks of a tool's loop, as a file.

use crate::fault::HapticFaultKind;
use bevy::prelude::*;
use palpate_haptics::{BlackBoxWriter, HapticHandle};
use std::path::PathBuf;

/// Put it on a tool to have the last 4,096 ticks of its loop written to a folder when something goes wrong in it, a missed
/// deadline excepted, and whenever it is asked to. `palpate-lab blackbox FILE` reads them.
#[derive(Component, Debug)]
pub struct BlackBoxDump {
    keeper: BlackBoxWriter,
    files: Vec<PathBuf>,
    asked: Option<String>,
}

impl BlackBoxDump {
    /// In `folder`, which is made when the first file is written; 16 files at most.
    #[must_use]
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        Self { keeper: BlackBoxWriter::new(folder), files: Vec::new(), asked: None }
    }

    /// Asks for a file in the next frame; `reason` becomes a part of its name.
    pub fn request(&mut self, reason: impl Into<String>) {
        self.asked = Some(reason.into());
    }

    /// The files that have been written.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Writes what has been asked for, or for `fault`.
    pub(super) fn keep(
        &mut self,
        handle: &mut HapticHandle,
        fault: Option<String>,
    ) -> Option<HapticFaultKind> {
        let reason = self.asked.take().or(fault)?;
        match self.keeper.write(handle, &reason) {
            Ok(file) => {
                self.files.extend(file);
                None
            }
            Err(error) => Some(HapticFaultKind::BlackBox(error)),
        }
    }
}
