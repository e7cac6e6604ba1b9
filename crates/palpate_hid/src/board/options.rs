//! What can be set for a board.

use super::{BoardHoming, BoardKinematics};
use crate::HidError;

/// What can be set for a 3-DOF board.
///
/// Whatever is set, there is no force before the board knows where its arm is: see [`BoardHoming`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardOptions {
    /// Its linkage, sizes, motors and home. Those of a WoodenHaptics of 2015 unless you say otherwise, as you must for a Polhem 2 or 3,
    /// whose linkage is another: [`BoardKinematics::polhem_v3`]. An AluHaptics and a Polhem 1 have the linkage of a WoodenHaptics, and
    /// sizes of their own.
    pub kinematics: BoardKinematics,
    /// What is believed of its counters when it is opened.
    pub homing: BoardHoming,
    /// The most current that a motor gets, A. Where a force takes more it is made smaller as a whole, and keeps its direction. In the
    /// weakest direction of a WoodenHaptics, that in which body C moves, 2 A are 2.5 N: k D/d / L_c for each ampere.
    pub max_current_a: f64,
    /// Farther than this from the middle of the workspace, m, there is no force. The home of a WoodenHaptics is 0.207 m away.
    pub reach_m: f64,
}

impl Default for BoardOptions {
    /// A WoodenHaptics of 2015 that waits for its calibration; 2 A, the bound of `src/fsusbhapticdevicethread.cpp` in
    /// haptikfabrikenapi, as its amplifiers bear no more for more than 4 s; 0.25 m.
    fn default() -> Self {
        Self {
            kinematics: BoardKinematics::default(),
            homing: BoardHoming::default(),
            max_current_a: 2.0,
            reach_m: 0.25,
        }
    }
}

impl BoardOptions {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// [`HidError::Option`].
    pub fn validate(&self) -> Result<(), HidError> {
        self.kinematics.validate()?;
        let check = |what, value: f64, ok: bool, allowed| {
            if ok { Ok(()) } else { Err(HidError::Option { what, found: value.to_string(), allowed }) }
        };
        // The firmware's own bound.
        let (current, reach) = (self.max_current_a, self.reach_m);
        check("most current of a board's motor, A", current, (0.0..=3.0).contains(&current), "0 to 3")?;
        check("reach of a board, m", reach, (1e-3..=10.0).contains(&reach), "0.001 to 10")
    }
}
