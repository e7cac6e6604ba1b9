//! Ticks that were written to a file.

use super::table::{COLUMNS, read_row};
use super::{BlackBoxError, BlackBoxTick};
use std::io::Read;
use std::path::Path;

/// The ticks in the file of a [`super::BlackBox`] or of a [`crate::Recorder`].
///
/// A file has this header and one row for each tick, ascending. Forces are on the hand, in the scene's frame; numbers are
/// read back to the bit.
///
/// | columns | what | empty |
/// | --- | --- | --- |
/// | `sequence`, `elapsed` | periods since the loop's start, and since the tick before | |
/// | `time_s` | time since the loop's start, s | |
/// | `origin` | of the sample: `measured`, `interpolated`, `repeated` | before the first reading |
/// | `x_m` … `z_m`, `vx_m_per_s` … `vz_m_per_s` | position and velocity of the tool, m and m/s | likewise |
/// | `qx`, `qy`, `qz`, `qw`, `buttons` | its orientation, and its buttons as bits | likewise |
/// | `model_sequence`, `model_body`, `model_epoch` | the local model that spoke | before the first |
/// | `before_x_n` … | force before the safety chain, N; it need not be finite | |
/// | `gains_x_n` …, `velocity_guard_x_n` …, `passivity_x_n` …, `magnitude_x_n` … | force after these stages, N | |
/// | `written_x_n` … | force after the last stage, the limit of growth, as it was written, N | |
/// | `gain` | product of the gains, 0 to 1 | |
/// | `acted` | what acted ([`super::SafetyAction::name`]), with `+` between | where nothing did |
/// | `lateness_ns`, `period_ns` | from the deadline and from the tick before to its beginning, ns | |
/// | `read_ns`, `write_ns`, `cost_ns` | in the device's read and write, and in all, ns | |
/// | `read_error`, `write_error` | what the device failed with ([`super::DeviceFault`]) | where it did not |
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    ticks: Vec<BlackBoxTick>,
}

impl Recording {
    /// Reads the file `path`.
    ///
    /// # Errors
    /// [`BlackBoxError`], with file and line.
    pub fn read_csv(path: impl AsRef<Path>) -> Result<Self, BlackBoxError> {
        let path = path.as_ref();
        let file = std::fs::File::open(path)
            .map_err(|source| BlackBoxError::File { path: path.to_owned(), source })?;
        Self::from_csv(file, path)
    }

    /// Reads CSV from `reader`; `name` stands for the file in errors.
    ///
    /// # Errors
    /// [`BlackBoxError`], with `name` and line.
    pub fn from_csv(reader: impl Read, name: impl AsRef<Path>) -> Result<Self, BlackBoxError> {
        let name = name.as_ref();
        let csv_error = |source: csv::Error| {
            let (path, line) = (name.to_owned(), source.position().map_or(1, csv::Position::line));
            if let csv::ErrorKind::Io(error) = source.kind() {
                let source = std::io::Error::new(error.kind(), error.to_string());
                return BlackBoxError::File { path, source };
            }
            BlackBoxError::Csv { path, line, source }
        };
        let mut rows = csv::ReaderBuilder::new().flexible(true).from_reader(reader);
        let header = rows.headers().map_err(csv_error)?;
        for i in 0..header.len().max(COLUMNS.len()) {
            let (found, expected) = (header.get(i).unwrap_or_default(), COLUMNS.get(i).unwrap_or(&""));
            if found != *expected || i >= COLUMNS.len() {
                let (path, column, found) = (name.to_owned(), i + 1, found.to_owned());
                return Err(BlackBoxError::Header { path, column, found, expected });
            }
        }
        let mut ticks: Vec<BlackBoxTick> = Vec::new();
        for row in rows.records() {
            let row = row.map_err(csv_error)?;
            let line = row.position().map_or(0, csv::Position::line);
            let tick = read_row(name, line, &row)?;
            let previous = ticks.last().map(|tick| tick.sequence);
            if let Some(previous) = previous.filter(|previous| tick.sequence <= *previous) {
                let (path, found) = (name.to_owned(), tick.sequence);
                return Err(BlackBoxError::Order { path, line, found, previous });
            }
            ticks.push(tick);
        }
        Ok(Self { ticks })
    }

    /// The ticks, oldest first.
    #[must_use]
    pub fn ticks(&self) -> &[BlackBoxTick] {
        &self.ticks
    }
}
