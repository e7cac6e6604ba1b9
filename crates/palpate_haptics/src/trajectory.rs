//! Trajectories of a hand: readings at 1 kHz.

mod csv;
mod error;
mod probe;

pub use error::TrajectoryError;
pub use probe::Probe;

use crate::error::check;
use crate::{HapticsError, Reading};
use glam::{DQuat, DVec3};

/// Trajectory of a hand with one reading per millisecond: positions, m, device frame, and optionally buttons and orientations.
///
/// # File
/// CSV with one row per millisecond and the header `t_s,x_m,y_m,z_m`, optionally followed by `buttons`, by `qx,qy,qz,qw`, or by both
/// in this order:
///
/// | column | content |
/// | --- | --- |
/// | `t_s` | time, s, with any start |
/// | `x_m`, `y_m`, `z_m` | position in the device's frame, m, within 10 m of the origin |
/// | `buttons` | bit i is set while button i is pressed; without this column no button is pressed |
/// | `qx`, `qy`, `qz`, `qw` | orientation, a unit quaternion; without these columns it is the identity |
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    positions_m: Vec<DVec3>,
    /// One per position; empty if no button is ever pressed.
    buttons: Vec<u32>,
    /// One per position; empty if all are the identity.
    orientations: Vec<DQuat>,
}

/// Maximum coordinate of a position, m.
const MAX_COORDINATE_M: f64 = 10.0;
/// Allowed deviation of a quaternion's length from 1: files have seven digits.
const UNIT_TOLERANCE: f64 = 1e-5;

impl Trajectory {
    /// Time between two rows, s.
    pub const PERIOD_S: f64 = 1e-3;

    /// A trajectory through `positions_m`, one per millisecond, without buttons and rotation.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for fewer than two positions, or one that is not within 10 m of the origin.
    pub fn from_positions(positions_m: Vec<DVec3>) -> Result<Self, HapticsError> {
        let rows = positions_m.len();
        check("number of positions", rows as f64, rows >= 2, "at least 2")?;
        let far = |p: &DVec3| p.to_array().iter().map(|c| c.abs()).fold(0.0, f64::max);
        let beyond = |p: &&DVec3| !(p.is_finite() && far(p) <= MAX_COORDINATE_M);
        match positions_m.iter().find(beyond) {
            Some(p) => Err(HapticsError::Setting {
                what: "largest coordinate of a position, m",
                value: if p.is_finite() { far(p) } else { f64::NAN },
                allowed: "finite and at most 10",
            }),
            None => Ok(Self { positions_m, buttons: Vec::new(), orientations: Vec::new() }),
        }
    }

    /// A trajectory with the positions, buttons and orientations of `readings`, one per millisecond.
    ///
    /// # Errors
    /// As for [`Self::from_positions`], and for an orientation that is not a unit quaternion.
    pub fn from_readings(readings: &[Reading]) -> Result<Self, HapticsError> {
        let mut trajectory =
            Self::from_positions(readings.iter().map(|reading| reading.position_m).collect())?;
        for reading in readings {
            let length = reading.orientation.length();
            let is_one = (length - 1.0).abs() < UNIT_TOLERANCE;
            check("length of an orientation's quaternion", length, is_one, "1 within 1e-5")?;
        }
        if readings.iter().any(|reading| reading.buttons != 0) {
            trajectory.buttons = readings.iter().map(|reading| reading.buttons).collect();
        }
        if readings.iter().any(|reading| reading.orientation != DQuat::IDENTITY) {
            trajectory.orientations =
                readings.iter().map(|reading| reading.orientation.normalize()).collect();
        }
        Ok(trajectory)
    }

    /// Positions, m, device frame.
    #[must_use]
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// The reading at `row`, from 0; `None` after the last row.
    #[must_use]
    pub fn reading(&self, row: usize) -> Option<Reading> {
        Some(Reading {
            buttons: self.buttons.get(row).copied().unwrap_or(0),
            orientation: self.orientations.get(row).copied().unwrap_or(DQuat::IDENTITY),
            ..Reading::at(*self.positions_m.get(row)?)
        })
    }

    /// Time from the first row to one period after the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.positions_m.len() as f64 * Self::PERIOD_S
    }
}
