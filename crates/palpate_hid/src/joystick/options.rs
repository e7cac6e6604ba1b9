//! Options of a force-feedback joystick.

use super::array_base::PidArrayBases;
use crate::HidError;
use glam::DVec3;

/// Options of a force-feedback joystick.
///
/// The protocol uses fractions of the device's maximum force and of the range of an axis. These options relate them to newtons and
/// metres; measure them for your device if its forces matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JoystickOptions {
    /// Maximum constant force of the device at the grip, N, above 0 and at most 1000. With a value above the true one the hand feels less
    /// than the computed force, with one below it more: `max_force_n` holds only for the true value.
    pub full_scale_n: f64,
    /// Maximum force that palpate sends, in the plane, N; at most the full scale.
    pub max_force_n: f64,
    /// Travel of the grip from the centre to either end of x and of y, m.
    pub travel_m: [f64; 2],
    /// Directions of the joystick's x and y in the device frame: two orthogonal unit vectors. Positions lie in their plane, and forces are
    /// projected onto it.
    pub plane: [DVec3; 2],
    /// Whether the force of x and of y is reversed, as the wiring of the motors differs. Set it for a joystick that is drawn towards what
    /// should push it away.
    pub reverse: [bool; 2],
    /// Time without an input report after which a reading times out and the loop removes the force, s; `None` for never.
    ///
    /// Many devices report only changes, and are silent while the stick is held still: they need `None`. OpenFFBoard reports at least every
    /// 100 ms (FFBHIDMain.cpp, `reportSendCounter`), so a longer silence means that it hangs.
    pub silent_after_s: Option<f64>,
    /// Whether y is used, if the device has it. Disable it for a wheel, which has one motor and whose y is a pedal; the joystick then moves
    /// on a line.
    pub use_y: bool,
    /// Whether the direction of the force is checked, once after each opening: while the hand presses in for the first time, the force
    /// alternates for about half a second between its value and a third of it. A joystick that moves against the changes of the force
    /// loses its force, and its error names the option to change.
    pub check_direction: bool,
    /// First numbers of PID arrays whose Logical Minimum is 0, which firmware numbers in one of two ways. By default a joystick with such
    /// an array is rejected. With the wrong value it shows no force or the wrong one; it is stopped in a form that both kinds of firmware
    /// execute.
    pub pid_arrays: PidArrayBases,
}

impl Default for JoystickOptions {
    /// Full scale [`JoystickOptions::CAREFUL_FULL_SCALE_N`], which makes the force too small rather than too large; maximum force 5 N, a
    /// hundredth of it; travel ±60 mm; x to the right and, as usual for joysticks, y towards the user; timeout 0.25 s; the direction
    /// is checked; arrays with the Logical Minimum 0 are rejected.
    fn default() -> Self {
        Self {
            full_scale_n: Self::CAREFUL_FULL_SCALE_N,
            max_force_n: 5.0,
            travel_m: [0.06; 2],
            plane: [DVec3::X, DVec3::Z],
            reverse: [false; 2],
            silent_after_s: Some(0.25),
            use_y: true,
            check_direction: true,
            pid_arrays: PidArrayBases::default(),
        }
    }
}

/// Tolerance for unit length and orthogonality of the two directions.
const UNIT_VECTOR_TOLERANCE: f64 = 1e-6;

impl JoystickOptions {
    /// Full scale above that of any joystick or wheel base, N. Direct-drive bases have 25 N m and more, which is above 150 N at the rim
    /// of a wheel of 0.3 m. With it a desktop joystick displays a tenth or less of the computed force, until its own full scale is set.
    pub const CAREFUL_FULL_SCALE_N: f64 = 500.0;

    /// Validates the options.
    ///
    /// # Errors
    /// [`HidError::Option`].
    pub fn validate(&self) -> Result<(), HidError> {
        let check = |what, value: f64, ok: bool, allowed| {
            if value.is_finite() && ok {
                return Ok(());
            }
            Err(HidError::Option { what, found: value.to_string(), allowed })
        };
        let Self { full_scale_n, max_force_n, travel_m, plane, silent_after_s, .. } = *self;
        let ok = full_scale_n > 0.0 && full_scale_n <= 1000.0;
        check("full scale of the joystick, N", full_scale_n, ok, "above 0 and at most 1000")?;
        let ok = max_force_n >= 0.0 && max_force_n <= full_scale_n;
        check("maximum force of the joystick, N", max_force_n, ok, "0 to its full scale")?;
        for travel_m in travel_m {
            let ok = travel_m > 0.0 && travel_m <= 10.0;
            check("travel of the joystick to either side, m", travel_m, ok, "above 0 and at most 10")?;
        }
        let [x, y] = plane;
        for direction in plane {
            let length = direction.length();
            let ok = (length - 1.0).abs() <= UNIT_VECTOR_TOLERANCE;
            check("length of a direction of the joystick's plane", length, ok, "1")?;
        }
        let cosine = x.dot(y);
        let what = "cosine between the directions of the joystick's plane";
        check(what, cosine, cosine.abs() <= UNIT_VECTOR_TOLERANCE, "0, as they are orthogonal")?;
        if let Some(silent_s) = silent_after_s {
            let ok = silent_s > 0.0 && silent_s <= 3600.0;
            check("timeout of the joystick, s", silent_s, ok, "above 0 and at most 3600")?;
        }
        Ok(())
    }
}
