//! Output of results: a table or JSON on standard output, CSV and SVG in a folder.

use crate::error::LabError;
use clap::Args;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Output options of every command.
#[derive(Clone, Debug, Args)]
pub struct Output {
    /// Print one JSON object and nothing else
    #[arg(long, global = true, help_heading = "Output")]
    json: bool,
    /// Write data as CSV and figures as SVG to this folder
    #[arg(long, global = true, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,
}

impl Output {
    /// Folder for files, if `--out` is given.
    pub fn folder(&self) -> Option<&Path> {
        self.out.as_deref()
    }

    /// Prints `result` as JSON with `--json`, and otherwise the text that `table` writes.
    ///
    /// # Errors
    /// [`LabError::Json`] when `result` has no JSON form; [`LabError::Print`] when standard output cannot be written.
    pub fn print<T: Serialize>(
        &self,
        result: &T,
        table: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
    ) -> Result<(), LabError> {
        let text = if self.json { serde_json::to_string_pretty(result)? + "\n" } else { String::new() };
        self.write(&text, table)
    }

    /// Prints one of many results, its JSON in one line.
    ///
    /// # Errors
    /// As [`Output::print`].
    pub fn print_line<T: Serialize>(
        &self,
        result: &T,
        table: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
    ) -> Result<(), LabError> {
        let text = if self.json { serde_json::to_string(result)? + "\n" } else { String::new() };
        self.write(&text, table)
    }

    fn write(
        &self,
        text: &str,
        table: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
    ) -> Result<(), LabError> {
        let mut out = std::io::stdout().lock();
        let printed = if self.json { out.write_all(text.as_bytes()) } else { table(&mut out) };
        match printed.and_then(|()| out.flush()) {
            // The reader has closed the pipe.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            printed => Ok(printed?),
        }
    }
}

/// Columns as CSV: a row of names, then a row for each index. A value that is not finite is an empty field.
pub fn csv(columns: &[(String, Vec<f64>)]) -> String {
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let rows = columns.iter().map(|(_, values)| values.len()).min().unwrap_or(0);
    let row = |i: usize| {
        let text = |v: f64| if v.is_finite() { v.to_string() } else { String::new() };
        columns.iter().map(|(_, values)| text(values[i])).collect::<Vec<_>>().join(",")
    };
    let lines = std::iter::once(names.join(",")).chain((0..rows).map(row));
    lines.map(|line| line + "\n").collect()
}

/// Writes all `files` (name and contents) to `folder` atomically: each first to a temporary file, renamed when all are complete.
///
/// # Errors
/// [`LabError::Write`] with the first file that cannot be written.
pub fn write_files(folder: &Path, files: &[(&str, impl AsRef<[u8]>)]) -> Result<(), LabError> {
    let failed = |name: &str| {
        let path = folder.join(name);
        move |source| LabError::Write { path, source }
    };
    // Obstacles are detected before anything is written.
    if let Some((name, _)) = files.iter().find(|(name, _)| folder.join(name).is_dir()) {
        return Err(failed(name)(std::io::ErrorKind::IsADirectory.into()));
    }
    std::fs::create_dir_all(folder).map_err(failed(""))?;
    let mut written = Vec::with_capacity(files.len());
    for (name, contents) in files {
        let write = || -> std::io::Result<_> {
            let mut file = tempfile::NamedTempFile::new_in(folder)?;
            file.write_all(contents.as_ref())?;
            // A temporary file is readable by its owner only; a result by everyone.
            set_readable(file.as_file())?;
            Ok(file)
        };
        written.push((name, write().map_err(failed(name))?));
    }
    for (name, file) in written {
        file.persist(folder.join(name)).map_err(|error| failed(name)(error.error))?;
    }
    Ok(())
}

#[cfg(unix)]
fn set_readable(file: &std::fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn set_readable(_: &std::fs::File) -> std::io::Result<()> {
    Ok(())
}
