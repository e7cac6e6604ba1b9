//! Recorded hands: positions at 1 kHz.

mod probe;

pub use probe::Probe;

use crate::error::check;
use crate::{HapticsError, TrajectoryError};
use glam::DVec3;
use std::io::{Read, Write};
use std::path::Path;

/// The columns of a trajectory file.
const HEADER: [&str; 4] = ["t_s", "x_m", "y_m", "z_m"];

/// Positions of a hand, one each millisecond, m.
///
/// A file has the header `t_s,x_m,y_m,z_m` and one row each millisecond; `t_s` may begin anywhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    positions_m: Vec<DVec3>,
}

impl Trajectory {
    /// Time between two rows, s.
    pub const PERIOD_S: f64 = 1e-3;

    /// Reads the file `path`.
    ///
    /// # Errors
    /// [`TrajectoryError`], with file and line.
    pub fn from_csv_file(path: impl AsRef<Path>) -> Result<Self, TrajectoryError> {
        let path = path.as_ref();
        let file = std::fs::File::open(path)
            .map_err(|source| TrajectoryError::File { path: path.to_owned(), source })?;
        Self::from_csv(file, path)
    }

    /// Reads CSV from `reader`; `name` stands for the file in errors.
    ///
    /// # Errors
    /// [`TrajectoryError`], with `name` and line.
    pub fn from_csv(reader: impl Read, name: impl AsRef<Path>) -> Result<Self, TrajectoryError> {
        let path = || name.as_ref().to_owned();
        let csv_error = |source: csv::Error| {
            let line = source.position().map_or(1, csv::Position::line);
            TrajectoryError::Csv { path: path(), line, source }
        };
        let mut rows = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(reader);
        let header = rows.headers().map_err(csv_error)?;
        if header.iter().ne(HEADER) {
            let found = header.iter().collect::<Vec<_>>().join(",");
            return Err(TrajectoryError::Header { path: path(), found });
        }
        let mut positions_m = Vec::new();
        let mut start = 0.0;
        for row in rows.records() {
            let row = row.map_err(csv_error)?;
            let line = row.position().map_or(0, csv::Position::line);
            if row.len() != HEADER.len() {
                return Err(TrajectoryError::Fields { path: path(), line, found: row.len() });
            }
            let number = |i: usize| {
                let finite = row[i].parse().ok().filter(|v: &f64| v.is_finite());
                let (column, found) = (HEADER[i], || row[i].to_owned());
                finite.ok_or_else(|| TrajectoryError::Number { path: path(), line, column, found: found() })
            };
            let (t, position) = (number(0)?, DVec3::new(number(1)?, number(2)?, number(3)?));
            if let Some(axis) = (0..3).find(|&axis| position[axis].abs() > 10.0) {
                let (column, found) = (HEADER[axis + 1], position[axis]);
                return Err(TrajectoryError::Far { path: path(), line, column, found });
            }
            if positions_m.is_empty() {
                start = t;
            }
            let expected = start + positions_m.len() as f64 * Self::PERIOD_S;
            // A microsecond, and what rounding does to large times.
            if (t - expected).abs() > 1e-6 + 4.0 * f64::EPSILON * expected.abs() {
                return Err(TrajectoryError::Time { path: path(), line, found: t, expected });
            }
            positions_m.push(position);
        }
        if positions_m.len() < 2 {
            return Err(TrajectoryError::TooShort { path: path(), rows: positions_m.len() });
        }
        Ok(Self { positions_m })
    }

    /// A hand at `positions_m`, one each millisecond.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for fewer than two positions, or one that is not within 10 m of the origin.
    pub fn from_positions(positions_m: Vec<DVec3>) -> Result<Self, HapticsError> {
        let rows = positions_m.len();
        check("number of positions", rows as f64, rows >= 2, "at least 2")?;
        let far = |p: &DVec3| p.to_array().iter().map(|c| c.abs()).fold(0.0, f64::max);
        let beyond = |p: &&DVec3| !(p.is_finite() && far(p) <= 10.0);
        match positions_m.iter().find(beyond) {
            Some(p) => Err(HapticsError::Setting {
                what: "largest coordinate of a position, m",
                value: if p.is_finite() { far(p) } else { f64::NAN },
                allowed: "finite and at most 10",
            }),
            None => Ok(Self { positions_m }),
        }
    }

    /// Writes the file's text, times from zero, positions to the nearest 0.1 µm.
    ///
    /// # Errors
    /// What `writer` returns.
    pub fn to_csv(&self, mut writer: impl Write) -> std::io::Result<()> {
        writeln!(writer, "{}", HEADER.join(","))?;
        for (i, p) in self.positions_m.iter().enumerate() {
            // Adding zero turns −0 into 0.
            let [x, y, z] = p.to_array().map(|v| (v * 1e7).round() / 1e7 + 0.0);
            writeln!(writer, "{:.3},{x:.7},{y:.7},{z:.7}", i as f64 * Self::PERIOD_S)?;
        }
        Ok(())
    }

    /// The positions, m.
    #[must_use]
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// From the first row to one period after the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.positions_m.len() as f64 * Self::PERIOD_S
    }
}
