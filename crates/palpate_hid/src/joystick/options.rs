//! What can be set for a force-feedback joystick.

use crate::HidError;
use glam::DVec3;

/// What can be set for a force-feedback joystick.
///
/// The protocol speaks of parts of the device's greatest force and of parts of an axis' range. Newtons and metres are what is said
/// here; measure them for a device whose forces matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JoystickOptions {
    /// What the greatest constant force of the device is at the grip, N. Set too high, the hand feels less than what was asked for,
    /// set too low, more: the limit below is that of a device of this full scale.
    pub full_scale_n: f64,
    /// The greatest force that palpate asks for, in the plane, N; at most the full scale.
    pub max_force_n: f64,
    /// How far the grip goes from the middle to either end of x and of y, m.
    pub travel_m: [f64; 2],
    /// Where the joystick's x and its y point to, in the device's frame: two unit vectors at a right angle. Positions lie in their
    /// plane, and forces are projected on it; what is at a right angle to it the device cannot show.
    pub plane: [DVec3; 2],
    /// Whether the force of x and of y goes the wrong way: motors may be wired either way. A joystick that is drawn to what it should
    /// be pushed away from needs it.
    pub reverse: [bool; 2],
    /// So long without an input report, s, a reading counts as timed out and the loop takes the force away; `None` for never. Many
    /// devices report changes only, so that silence may be a stick that is held still. OpenFFBoard says something every 100 ms all the
    /// same (FFBHIDMain.cpp, `reportSendCounter`), so that a longer silence is that of a device that hangs. One that says nothing while
    /// it is at rest needs `None`.
    pub silent_after_s: Option<f64>,
    /// Whether y is used, where the device has it. A wheel has one motor, and its y is a pedal. Without y the joystick is on a line.
    pub use_y: bool,
}

impl Default for JoystickOptions {
    /// [`JoystickOptions::CAREFUL_FULL_SCALE_N`] as the full scale, so that the hand feels less rather than more than what was asked
    /// for; 5 N, a hundredth of it, as the greatest force; ±60 mm; x to the right and y, as joysticks have
    /// it, towards the hand's owner; timed out after 0.25 s.
    fn default() -> Self {
        Self {
            full_scale_n: Self::CAREFUL_FULL_SCALE_N,
            max_force_n: 5.0,
            travel_m: [0.06; 2],
            plane: [DVec3::X, DVec3::Z],
            reverse: [false; 2],
            silent_after_s: Some(0.25),
            use_y: true,
        }
    }
}

/// How far the two directions may be from unit length and from a right angle.
const UNIT_VECTOR_TOLERANCE: f64 = 1e-6;

impl JoystickOptions {
    /// A full scale that is meant to be more than any joystick or wheel base has, N. Direct-drive bases have 25 N m and more, which
    /// is above 150 N at the rim of a wheel of 0.3 m. A desktop joystick then shows a tenth or less of what is asked for, until its
    /// own full scale is set.
    pub const CAREFUL_FULL_SCALE_N: f64 = 500.0;

    /// Refuses what makes no sense.
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
        check("largest force of the joystick, N", max_force_n, ok, "0 to its full scale")?;
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
        check(what, cosine, cosine.abs() <= UNIT_VECTOR_TOLERANCE, "0: they are at a right angle")?;
        if let Some(silent_s) = silent_after_s {
            let ok = silent_s > 0.0 && silent_s <= 3600.0;
            check(
                "silence of the joystick that counts as timed out, s",
                silent_s,
                ok,
                "above 0 and at most 3600",
            )?;
        }
        Ok(())
    }
}
