//! Options of a board.

use super::{BoardHoming, BoardKinematics};
use crate::HidError;

/// Options of a 3-DOF board.
///
/// With any options, the force is zero until the counters are calibrated: see [`BoardHoming`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardOptions {
    /// Linkage, sizes, motors and home pose. The default is a WoodenHaptics of 2015. A Polhem 2 or 3 needs another linkage:
    /// [`BoardKinematics::polhem_v3`]. An AluHaptics and a Polhem 1 have the linkage of a WoodenHaptics with other sizes.
    pub kinematics: BoardKinematics,
    /// Assumption about the counters when the board is opened.
    pub homing: BoardHoming,
    /// Maximum current of a motor, A, 0 to 3. A force that needs more is scaled down as a whole and keeps its direction. In the weakest
    /// direction of a WoodenHaptics, that in which body C moves, 2 A are 2.5 N: k D/d / L_c for each ampere.
    pub max_current_a: f64,
    /// Distance from the workspace centre beyond which the force is zero, m. The home pose of a WoodenHaptics is 0.207 m away.
    pub reach_m: f64,
}

impl Default for BoardOptions {
    /// A WoodenHaptics of 2015 that waits for calibration; 2 A, the limit in `src/fsusbhapticdevicethread.cpp` of haptikfabrikenapi, whose
    /// amplifiers endure more for 4 s only; 0.25 m.
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
    /// Validates the options.
    ///
    /// # Errors
    /// [`HidError::Option`].
    pub fn validate(&self) -> Result<(), HidError> {
        self.kinematics.validate()?;
        let check = |what, value: f64, ok: bool, allowed| {
            if ok { Ok(()) } else { Err(HidError::Option { what, found: value.to_string(), allowed }) }
        };
        // 3 A is the limit of the firmware.
        let (current, reach) = (self.max_current_a, self.reach_m);
        check("maximum current of a board's motor, A", current, (0.0..=3.0).contains(&current), "0 to 3")?;
        check("reach of a board, m", reach, (1e-3..=10.0).contains(&reach), "0.001 to 10")
    }
}
