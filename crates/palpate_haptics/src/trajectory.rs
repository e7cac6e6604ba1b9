//! Recorded hands: readings at 1 kHz.

mod csv;
mod probe;

pub use probe::Probe;

use crate::error::check;
use crate::{HapticsError, Reading};
use glam::{DQuat, DVec3};

/// A hand, one reading each millisecond: positions, m, and buttons and orientations if they were recorded.
///
/// # File
/// CSV with one row each millisecond and the header `t_s,x_m,y_m,z_m`, after which there may be `buttons`, or `qx,qy,qz,qw`, or both
/// in this order:
///
/// | column | is |
/// | --- | --- |
/// | `t_s` | time, s; may begin anywhere |
/// | `x_m`, `y_m`, `z_m` | position in the device's frame, m, within 10 m of the origin |
/// | `buttons` | bit i is set while button i is pressed; without the column none ever is |
/// | `qx`, `qy`, `qz`, `qw` | orientation, a quaternion of length 1; without the columns there is no turning |
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    positions_m: Vec<DVec3>,
    /// One for each position, or none at all where no button is ever pressed.
    buttons: Vec<u32>,
    /// One for each position, or none at all where nothing ever turns.
    orientations: Vec<DQuat>,
}

/// The largest coordinate of a position, m.
const FARTHEST_M: f64 = 10.0;
/// How far a quaternion's length may be from 1: files have seven digits.
const OF_LENGTH_1: f64 = 1e-5;

impl Trajectory {
    /// Time between two rows, s.
    pub const PERIOD_S: f64 = 1e-3;

    /// A hand at `positions_m`, one each millisecond, that presses no button and never turns.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for fewer than two positions, or one that is not within 10 m of the origin.
    pub fn from_positions(positions_m: Vec<DVec3>) -> Result<Self, HapticsError> {
        let rows = positions_m.len();
        check("number of positions", rows as f64, rows >= 2, "at least 2")?;
        let far = |p: &DVec3| p.to_array().iter().map(|c| c.abs()).fold(0.0, f64::max);
        let beyond = |p: &&DVec3| !(p.is_finite() && far(p) <= FARTHEST_M);
        match positions_m.iter().find(beyond) {
            Some(p) => Err(HapticsError::Setting {
                what: "largest coordinate of a position, m",
                value: if p.is_finite() { far(p) } else { f64::NAN },
                allowed: "finite and at most 10",
            }),
            None => Ok(Self { positions_m, buttons: Vec::new(), orientations: Vec::new() }),
        }
    }

    /// A hand that is read as `readings`, one each millisecond: their positions, buttons and orientations.
    ///
    /// # Errors
    /// As [`Self::from_positions`], and where an orientation is not of length 1.
    pub fn from_readings(readings: &[Reading]) -> Result<Self, HapticsError> {
        let mut hand = Self::from_positions(readings.iter().map(|reading| reading.position_m).collect())?;
        for reading in readings {
            let length = reading.orientation.length();
            let is_one = (length - 1.0).abs() < OF_LENGTH_1;
            check("length of an orientation's quaternion", length, is_one, "1 within 1e-5")?;
        }
        if readings.iter().any(|reading| reading.buttons != 0) {
            hand.buttons = readings.iter().map(|reading| reading.buttons).collect();
        }
        if readings.iter().any(|reading| reading.orientation != DQuat::IDENTITY) {
            hand.orientations = readings.iter().map(|reading| reading.orientation.normalize()).collect();
        }
        Ok(hand)
    }

    /// The positions, m.
    #[must_use]
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// What the hand is read as at `row`, counted from 0; `None` after the last.
    #[must_use]
    pub fn reading(&self, row: usize) -> Option<Reading> {
        Some(Reading {
            buttons: self.buttons.get(row).copied().unwrap_or(0),
            orientation: self.orientations.get(row).copied().unwrap_or(DQuat::IDENTITY),
            ..Reading::at(*self.positions_m.get(row)?)
        })
    }

    /// From the first row to one period after the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.positions_m.len() as f64 * Self::PERIOD_S
    }
}
