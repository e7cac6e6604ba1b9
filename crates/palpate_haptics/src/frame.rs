//! Transformation between the device's frame and the scene's.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::error::{check, check_positive};
use crate::{HapticsError, Reading};
use glam::{DQuat, DVec3};

/// Pose and scale of the device in the scene: x_scene = offset + rotation · (scale · x_device).
///
/// Velocities are rotated and scaled, orientations rotated. Forces are rotated back and not scaled: one newton in the scene is one
/// newton on the hand, and force limits apply unchanged. At scale s the hand feels s times the scene's stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceFrame {
    /// Rotation from the device's frame to the scene's.
    pub rotation: DQuat,
    /// Metres in the scene per metre of the device.
    pub scale: f64,
    /// Position of the device's origin in the scene, m.
    pub offset_m: DVec3,
}

impl Default for DeviceFrame {
    /// The identity: both frames coincide.
    fn default() -> Self {
        Self { rotation: DQuat::IDENTITY, scale: 1.0, offset_m: DVec3::ZERO }
    }
}

impl DeviceFrame {
    /// Rejects a rotation that is not a unit quaternion, a scale that is not positive, and an offset that is not finite.
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn validate(&self) -> Result<(), HapticsError> {
        let length = self.rotation.length();
        check("length of the device frame's rotation", length, (length - 1.0).abs() < 1e-6, "1 within 1e-6")?;
        check_positive("scale of the device frame", self.scale)?;
        let far = self.offset_m.abs().max_element();
        check("offset of the device frame, m", far, self.offset_m.is_finite(), "finite")
    }

    /// Transforms a reading to the scene's frame.
    #[must_use]
    pub fn to_scene(&self, reading: &Reading) -> Reading {
        let rotate = |v: DVec3| self.rotation * (self.scale * v);
        Reading {
            position_m: self.offset_m + rotate(reading.position_m),
            velocity_m_per_s: reading.velocity_m_per_s.map(rotate),
            orientation: self.rotation * reading.orientation,
            buttons: reading.buttons,
            sequence: reading.sequence,
        }
    }

    /// Transforms a position, m, to the device's frame.
    #[must_use]
    pub fn position_to_device_m(&self, scene_m: DVec3) -> DVec3 {
        self.rotation.conjugate() * (scene_m - self.offset_m) / self.scale
    }

    /// Transforms an orientation to the device's frame.
    #[must_use]
    pub fn orientation_to_device(&self, scene: DQuat) -> DQuat {
        (self.rotation.conjugate() * scene).normalize()
    }

    /// Transforms a force, N, to the device's frame.
    #[must_use]
    pub fn force_to_device(&self, force_n: DVec3) -> DVec3 {
        self.rotation.conjugate() * force_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_is_equal_in_both_frames_up_to_scale() {
        let frame = DeviceFrame {
            rotation: DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7),
            scale: 2.5,
            offset_m: DVec3::new(0.1, -0.2, 0.3),
        };
        frame.validate().unwrap();
        let (v, f) = (DVec3::new(0.1, -0.4, 0.2), DVec3::new(1.0, 2.0, -0.5));
        let reading = Reading { velocity_m_per_s: Some(v), ..Reading::at(DVec3::new(0.01, 0.02, 0.03)) };
        let scene = frame.to_scene(&reading);
        let power = f.dot(scene.velocity_m_per_s.unwrap());
        assert!((power - 2.5 * frame.force_to_device(f).dot(v)).abs() < 1e-12);
        let back = frame.position_to_device_m(scene.position_m);
        assert!((back - reading.position_m).length() < 1e-15);
        let rotated = frame.orientation_to_device(scene.orientation);
        assert!(rotated.angle_between(reading.orientation) < 1e-7);
    }

    #[test]
    fn rejects_invalid_frames() {
        let good = DeviceFrame::default();
        for bad in [
            DeviceFrame { scale: 0.0, ..good },
            DeviceFrame { scale: f64::NAN, ..good },
            DeviceFrame { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.9), ..good },
            DeviceFrame { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, f64::NAN), ..good },
            DeviceFrame { offset_m: DVec3::new(0.0, f64::INFINITY, 0.0), ..good },
        ] {
            assert!(matches!(bad.validate(), Err(HapticsError::Setting { .. })), "{bad:?}");
        }
    }
}
