//! Trajectory files.

use super::{MAX_COORDINATE_M, Trajectory, TrajectoryError, UNIT_TOLERANCE};
use crate::CsvError;
use glam::{DQuat, DVec3};
use std::io::{Read, Write};
use std::path::Path;

/// Columns of every file, then the optional ones.
const POSITION: [&str; 4] = ["t_s", "x_m", "y_m", "z_m"];
const BUTTONS: &str = "buttons";
const ORIENTATION: [&str; 4] = ["qx", "qy", "qz", "qw"];

impl Trajectory {
    /// Reads the file `path`.
    ///
    /// # Errors
    /// [`TrajectoryError`], with file and line.
    pub fn from_csv_file(path: impl AsRef<Path>) -> Result<Self, TrajectoryError> {
        let path = path.as_ref();
        let file = std::fs::File::open(path).map_err(CsvError::file(path))?;
        Self::from_csv(file, path)
    }

    /// Reads CSV from `reader`; errors contain `name` in place of a path.
    ///
    /// # Errors
    /// [`TrajectoryError`], with `name` and line.
    pub fn from_csv(reader: impl Read, name: impl AsRef<Path>) -> Result<Self, TrajectoryError> {
        let path = || name.as_ref().to_owned();
        let csv_error = CsvError::reader(name.as_ref());
        let mut rows = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(reader);
        let columns: Vec<String> = rows.headers().map_err(&csv_error)?.iter().map(str::to_owned).collect();
        let Some(Columns { buttons, orientation }) = Columns::of(&columns) else {
            return Err(TrajectoryError::Header { path: path(), found: columns.join(",") });
        };
        let mut trajectory = Self { positions_m: Vec::new(), buttons: Vec::new(), orientations: Vec::new() };
        let mut start = 0.0;
        for row in rows.records() {
            let row = row.map_err(&csv_error)?;
            let line = row.position().map_or(0, csv::Position::line);
            if row.len() != columns.len() {
                let (found, expected) = (row.len(), columns.len());
                return Err(CsvError::Fields { path: path(), line, found, expected }.into());
            }
            let number = |i: usize| {
                let finite = row[i].parse().ok().filter(|v: &f64| v.is_finite());
                let (column, found) = (columns[i].clone(), || row[i].to_owned());
                finite.ok_or_else(|| TrajectoryError::Number { path: path(), line, column, found: found() })
            };
            let (t, position) = (number(0)?, DVec3::new(number(1)?, number(2)?, number(3)?));
            if let Some(axis) = (0..3).find(|&axis| position[axis].abs() > MAX_COORDINATE_M) {
                let (column, found) = (POSITION[axis + 1], position[axis]);
                return Err(TrajectoryError::Far { path: path(), line, column, found });
            }
            if trajectory.positions_m.is_empty() {
                start = t;
            }
            let expected = start + trajectory.positions_m.len() as f64 * Self::PERIOD_S;
            // One microsecond, and the rounding of large times.
            if (t - expected).abs() > 1e-6 + 4.0 * f64::EPSILON * expected.abs() {
                return Err(TrajectoryError::Time { path: path(), line, found: t, expected });
            }
            trajectory.positions_m.push(position);
            if let Some(at) = buttons {
                let bits = row[at].parse::<u32>();
                let found = || row[at].to_owned();
                trajectory.buttons.push(bits.map_err(|_| TrajectoryError::Buttons {
                    path: path(),
                    line,
                    found: found(),
                })?);
            }
            if let Some(at) = orientation {
                let orientation =
                    DQuat::from_xyzw(number(at)?, number(at + 1)?, number(at + 2)?, number(at + 3)?);
                let found = orientation.length();
                if (found - 1.0).abs() >= UNIT_TOLERANCE {
                    return Err(TrajectoryError::Orientation { path: path(), line, found });
                }
                trajectory.orientations.push(orientation.normalize());
            }
        }
        if trajectory.positions_m.len() < 2 {
            return Err(TrajectoryError::TooShort { path: path(), rows: trajectory.positions_m.len() });
        }
        Ok(trajectory)
    }

    /// Writes CSV: times from zero, positions rounded to 0.1 µm, and buttons and orientations if there are any.
    ///
    /// # Errors
    /// Errors of `writer`.
    pub fn to_csv(&self, mut writer: impl Write) -> std::io::Result<()> {
        write!(writer, "{}", POSITION.join(","))?;
        if !self.buttons.is_empty() {
            write!(writer, ",{BUTTONS}")?;
        }
        if !self.orientations.is_empty() {
            write!(writer, ",{}", ORIENTATION.join(","))?;
        }
        writeln!(writer)?;
        // Adding zero turns −0 into 0.
        let rounded = |v: f64| (v * 1e7).round() / 1e7 + 0.0;
        for (i, p) in self.positions_m.iter().enumerate() {
            let [x, y, z] = p.to_array().map(rounded);
            write!(writer, "{:.3},{x:.7},{y:.7},{z:.7}", i as f64 * Self::PERIOD_S)?;
            if let Some(buttons) = self.buttons.get(i) {
                write!(writer, ",{buttons}")?;
            }
            if let Some(turn) = self.orientations.get(i) {
                let [x, y, z, w] = turn.to_array().map(rounded);
                write!(writer, ",{x:.7},{y:.7},{z:.7},{w:.7}")?;
            }
            writeln!(writer)?;
        }
        Ok(())
    }
}

/// Indices of the optional columns.
struct Columns {
    buttons: Option<usize>,
    orientation: Option<usize>,
}

impl Columns {
    /// Parses a header; `None` if it is invalid.
    fn of(header: &[String]) -> Option<Self> {
        let (place, rest) = header.split_at_checked(POSITION.len())?;
        let (buttons, rest) = match rest {
            [first, rest @ ..] if first == BUTTONS => (Some(POSITION.len()), rest),
            rest => (None, rest),
        };
        let orientation = (rest == ORIENTATION).then_some(header.len() - rest.len());
        (place == POSITION && (rest.is_empty() || orientation.is_some()))
            .then_some(Self { buttons, orientation })
    }
}
