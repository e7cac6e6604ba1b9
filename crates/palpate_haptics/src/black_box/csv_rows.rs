//! Conversion between ticks and CSV rows; [`super::Recording`] documents the columns.

use super::{BlackBoxError, BlackBoxTick, RecordedDeviceError, SafetyActions};
use crate::{CsvError, StageForces, TickTiming};
use csv::StringRecord;
use glam::{DQuat, DVec3};
use palpate_local::{ModelId, Sample, SampleOrigin};
use std::io::{Result as IoResult, Write};
use std::path::Path;

/// Names of the columns, in order.
#[rustfmt::skip]
pub(crate) const COLUMNS: [&str; 45] = [
    "sequence", "time_s", "elapsed",
    "origin", "x_m", "y_m", "z_m", "vx_m_per_s", "vy_m_per_s", "vz_m_per_s", "qx", "qy", "qz", "qw", "buttons",
    "model_sequence", "model_body", "model_epoch",
    "before_x_n", "before_y_n", "before_z_n",
    "gains_x_n", "gains_y_n", "gains_z_n",
    "velocity_guard_x_n", "velocity_guard_y_n", "velocity_guard_z_n",
    "passivity_x_n", "passivity_y_n", "passivity_z_n",
    "magnitude_x_n", "magnitude_y_n", "magnitude_z_n",
    "written_x_n", "written_y_n", "written_z_n",
    "gain", "acted",
    "lateness_ns", "period_ns", "read_ns", "write_ns", "cost_ns",
    "read_error", "write_error",
];

const ORIGINS: [(SampleOrigin, &str); 3] = [
    (SampleOrigin::Measured, "measured"),
    (SampleOrigin::Interpolated, "interpolated"),
    (SampleOrigin::Repeated, "repeated"),
];

pub(crate) fn write_header(writer: &mut impl Write) -> IoResult<()> {
    writeln!(writer, "{}", COLUMNS.join(","))
}

/// Writes one row, with enough digits for an exact round trip.
pub(crate) fn write_row(writer: &mut impl Write, tick: &BlackBoxTick) -> IoResult<()> {
    write!(writer, "{},{:?},{},", tick.sequence, tick.time_s, tick.elapsed)?;
    match &tick.sample {
        Some(sample) => {
            let origin = ORIGINS.iter().find(|(origin, _)| *origin == sample.origin);
            write!(writer, "{},", origin.map_or("", |(_, name)| name))?;
            let position = sample.position_m.to_array().into_iter();
            let velocity = sample.velocity_m_per_s.to_array().into_iter();
            numbers(writer, position.chain(velocity).chain(sample.orientation.to_array()))?;
            write!(writer, "{},", sample.buttons)?;
        }
        None => write!(writer, "{}", ",".repeat(12))?,
    }
    match tick.model {
        Some(ModelId { body, epoch, sequence }) => write!(writer, "{sequence},{body},{epoch},")?,
        None => write!(writer, ",,,")?,
    }
    numbers(writer, tick.before_n.to_array())?;
    let StageForces { gains_n, velocity_guard_n, passivity_n, magnitude_n, .. } = tick.after;
    for force_n in [gains_n, velocity_guard_n, passivity_n, magnitude_n] {
        numbers(writer, force_n.to_array())?;
    }
    numbers(writer, tick.written_n.to_array())?;
    let TickTiming { lateness_ns, period_ns, cost_ns, read_ns, write_ns } = tick.timing;
    write!(writer, "{:?},{},", tick.gain, tick.acted)?;
    write!(writer, "{lateness_ns},{period_ns},{read_ns},{write_ns},{cost_ns},")?;
    if let Some(fault) = tick.read_failed {
        write!(writer, "{fault}")?;
    }
    write!(writer, ",")?;
    if let Some(fault) = tick.write_failed {
        write!(writer, "{fault}")?;
    }
    writeln!(writer)
}

fn numbers(writer: &mut impl Write, values: impl IntoIterator<Item = f64>) -> IoResult<()> {
    values.into_iter().try_for_each(|value| write!(writer, "{value:?},"))
}

/// Parses the tick in `row`, which is at `line` of the file `path`.
pub(super) fn read_row(path: &Path, line: u64, row: &StringRecord) -> Result<BlackBoxTick, BlackBoxError> {
    if row.len() != COLUMNS.len() {
        let (path, found, expected) = (path.to_owned(), row.len(), COLUMNS.len());
        return Err(CsvError::Fields { path, line, found, expected }.into());
    }
    let mut fields = Fields { path, line, row, at: 0 };
    let (sequence, time_s, elapsed) = (fields.count()?, fields.number()?, fields.count()?);
    let sample = fields.optional(12, |fields| {
        let origin = "measured, interpolated or repeated";
        let origin = fields.parsed(origin, |text| ORIGINS.iter().find(|(_, name)| *name == text))?.0;
        let (position_m, velocity_m_per_s) = (fields.vector()?, fields.vector()?);
        let (x, y, z, w) = (fields.number()?, fields.number()?, fields.number()?, fields.number()?);
        let orientation = DQuat::from_xyzw(x, y, z, w);
        let buttons = fields.parsed("a whole number below 2^32", |text| text.parse().ok())?;
        // The file has no forces of other tools.
        Ok(Sample {
            sequence,
            time_s,
            position_m,
            velocity_m_per_s,
            orientation,
            buttons,
            origin,
            other: None,
        })
    })?;
    let model = fields.optional(3, |fields| {
        let (sequence, body, epoch) = (fields.count()?, fields.count()?, fields.count()?);
        Ok(ModelId { body, epoch, sequence })
    })?;
    let before_n = fields.vector()?;
    let (gains_n, velocity_guard_n) = (fields.vector()?, fields.vector()?);
    let (passivity_n, magnitude_n) = (fields.vector()?, fields.vector()?);
    let (written_n, gain) = (fields.vector()?, fields.number()?);
    let acted = fields.parsed("names of stages with + between them, or empty", SafetyActions::named)?;
    let (lateness_ns, period_ns) = (fields.count()?, fields.count()?);
    let (read_ns, write_ns, cost_ns) = (fields.count()?, fields.count()?, fields.count()?);
    let timing = TickTiming { lateness_ns, period_ns, cost_ns, read_ns, write_ns };
    let fault = |fields: &mut Fields| {
        fields.parsed("the name of a device error, or empty", RecordedDeviceError::named)
    };
    let (read_failed, write_failed) = (fields.optional(1, fault)?, fields.optional(1, fault)?);
    Ok(BlackBoxTick {
        sequence,
        time_s,
        elapsed,
        sample,
        model,
        before_n,
        after: StageForces { gains_n, velocity_guard_n, passivity_n, magnitude_n, slew_n: written_n },
        written_n,
        gain,
        acted,
        timing,
        read_failed,
        write_failed,
    })
}

/// Reads the fields of a row in order.
struct Fields<'a> {
    path: &'a Path,
    line: u64,
    row: &'a StringRecord,
    at: usize,
}

impl Fields<'_> {
    /// Parses the next field; `expected` describes the valid content in errors.
    fn parsed<T>(
        &mut self,
        expected: &'static str,
        parse: impl FnOnce(&str) -> Option<T>,
    ) -> Result<T, BlackBoxError> {
        let text = self.row.get(self.at).unwrap_or_default();
        let column = COLUMNS.get(self.at).copied().unwrap_or_default();
        self.at += 1;
        parse(text).ok_or_else(|| {
            let (path, line, found) = (self.path.to_owned(), self.line, text.to_owned());
            BlackBoxError::Field { path, line, column, found, expected }
        })
    }

    fn number(&mut self) -> Result<f64, BlackBoxError> {
        self.parsed("a number", |text| text.parse().ok())
    }

    fn count(&mut self) -> Result<u64, BlackBoxError> {
        self.parsed("a whole number", |text| text.parse().ok())
    }

    fn vector(&mut self) -> Result<DVec3, BlackBoxError> {
        Ok(DVec3::new(self.number()?, self.number()?, self.number()?))
    }

    /// Returns `None` if the next `fields` fields are empty, otherwise the result of `read`.
    fn optional<T>(
        &mut self,
        fields: usize,
        read: impl FnOnce(&mut Self) -> Result<T, BlackBoxError>,
    ) -> Result<Option<T>, BlackBoxError> {
        if self.row.iter().skip(self.at).take(fields).all(str::is_empty) {
            self.at += fields;
            return Ok(None);
        }
        read(self).map(Some)
    }
}
