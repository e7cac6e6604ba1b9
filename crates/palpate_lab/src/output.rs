//! Where results go: a table or JSON on standard output, CSV and SVG in a folder.

use crate::error::LabError;
use clap::Args;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Options that every command has.
#[derive(Clone, Debug, Args)]
pub(crate) struct Output {
    /// Print one JSON object and nothing else
    #[arg(long, global = true)]
    json: bool,
    /// Write data as CSV and figures as SVG to this folder
    #[arg(long, global = true, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Output {
    /// The folder for files, if there is one.
    pub(crate) fn folder(&self) -> Option<&Path> {
        self.out.as_deref()
    }

    /// Prints `result` as JSON if that is asked for, else the text that `table` writes.
    pub(crate) fn print<T: Serialize>(
        &self,
        result: &T,
        table: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
    ) -> Result<(), LabError> {
        let mut out = std::io::stdout().lock();
        if self.json {
            serde_json::to_writer_pretty(&mut out, result)?;
            writeln!(out)?;
        } else {
            table(&mut out)?;
        }
        Ok(out.flush()?)
    }
}

/// Writes `contents` to `folder/name`, whole or not at all.
pub(crate) fn write_file(folder: &Path, name: &str, contents: &str) -> Result<(), LabError> {
    let path = folder.join(name);
    let written = || -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(contents.as_bytes())?;
        file.persist(&path).map_err(|error| error.error)?;
        Ok(())
    };
    written().map_err(|source| LabError::Write { path: path.clone(), source })
}
