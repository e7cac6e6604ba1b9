//! Reads files of black boxes and recordings.

use super::csv_rows::{COLUMNS, read_row};
use super::{BlackBoxError, BlackBoxTick};
use crate::CsvError;
use std::io::Read;
use std::path::Path;

/// The ticks in a file of a [`super::BlackBox`] or of a [`crate::Recorder`].
///
/// A file has this header and one row per tick, ascending. Forces act on the hand, in the scene's frame. Numbers round-trip
/// exactly.
///
/// | columns | content | empty |
/// | --- | --- | --- |
/// | `sequence`, `elapsed` | periods since the loop's start, and since the previous tick | |
/// | `time_s` | time since the loop's start, s | |
/// | `origin` | origin of the sample: `measured`, `interpolated`, `repeated` | before the first reading |
/// | `x_m` … `z_m`, `vx_m_per_s` … `vz_m_per_s` | position and velocity of the tool, m and m/s | likewise |
/// | `qx`, `qy`, `qz`, `qw`, `buttons` | orientation of the tool; buttons as bits | likewise |
/// | `model_sequence`, `model_body`, `model_epoch` | active local model | before the first |
/// | `before_x_n` … | force before the safety chain, N; may be infinite or NaN | |
/// | `gains_x_n` …, `velocity_guard_x_n` …, `passivity_x_n` …, `magnitude_x_n` … | force after these stages, N | |
/// | `written_x_n` … | force after the last stage, the growth limit, as written, N | |
/// | `gain` | product of the gains, 0 to 1 | |
/// | `acted` | active stages ([`super::SafetyAction::name`]), joined by `+` | if none |
/// | `lateness_ns`, `period_ns` | time from the deadline, and from the previous tick, to the start of the tick, ns | |
/// | `read_ns`, `write_ns`, `cost_ns` | duration of the device's read and write, and of the whole tick, ns | |
/// | `read_error`, `write_error` | error of the device ([`super::RecordedDeviceError`]) | if none |
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
        let file = std::fs::File::open(path).map_err(CsvError::file(path))?;
        Self::from_csv(file, path)
    }

    /// Reads CSV from `reader`; errors contain `name` in place of a path.
    ///
    /// # Errors
    /// [`BlackBoxError`], with `name` and line.
    pub fn from_csv(reader: impl Read, name: impl AsRef<Path>) -> Result<Self, BlackBoxError> {
        let name = name.as_ref();
        let csv_error = CsvError::reader(name);
        let mut rows = csv::ReaderBuilder::new().flexible(true).from_reader(reader);
        let header = rows.headers().map_err(&csv_error)?;
        for i in 0..header.len().max(COLUMNS.len()) {
            let (found, expected) = (header.get(i).unwrap_or_default(), COLUMNS.get(i).unwrap_or(&""));
            if found != *expected || i >= COLUMNS.len() {
                let (path, column, found) = (name.to_owned(), i + 1, found.to_owned());
                return Err(BlackBoxError::Header { path, column, found, expected });
            }
        }
        let mut ticks: Vec<BlackBoxTick> = Vec::new();
        for row in rows.records() {
            let row = row.map_err(&csv_error)?;
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
