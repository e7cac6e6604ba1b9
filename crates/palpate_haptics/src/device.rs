//! Haptic devices: the trait, readings, simulated devices.

mod description;
mod error;
mod follower;
mod open_state;
mod replay;
mod scripted;

pub use description::{DeviceDescription, DeviceLimits};
pub use error::DeviceError;
pub use follower::{FollowerDevice, FollowerSettings, FollowerTarget};
pub use replay::{ReplayDevice, ReplayEnd};
pub use scripted::ScriptedDevice;

use glam::{DQuat, DVec3};
use std::time::Duration;

/// A force-feedback device, real or simulated.
///
/// # Contract
///
/// * The loop's thread calls all methods but `describe`, one at a time: `open` once, then `read` and `write` in every tick, then
///   `close` once. `describe` may also be called before `open`.
/// * `read` and `write` must not allocate or log. They must not block longer than the given time: a tick is 1 ms.
/// * Positions and forces are in the device's own frame, in metres and newtons.
/// * `close` and `Drop` leave the actuators at zero force in every case. The loop also writes zero force before it closes.
/// * A device is created closed, and can be opened again after it was closed. A loop on a thread tries twice a second to open a device that
///   cannot be opened, at the start and after [`DeviceError::Disconnected`], when it closes the device first. Opening may take longer than
///   a tick.
pub trait HapticDevice: Send {
    /// Name, workspace, maximum force and rate of the device.
    fn describe(&self) -> DeviceDescription;

    /// Opens the device with zero force.
    ///
    /// # Errors
    /// [`DeviceError::AlreadyOpen`], [`DeviceError::Disconnected`], [`DeviceError::Os`].
    fn open(&mut self) -> Result<(), DeviceError>;

    /// Returns the newest reading; waits at most `within` for it.
    ///
    /// # Errors
    /// [`DeviceError::NotOpen`], [`DeviceError::TimedOut`], [`DeviceError::Disconnected`],
    /// [`DeviceError::Os`], [`DeviceError::Protocol`]. The loop then repeats the last sample, and fades the force if the errors
    /// persist.
    fn read(&mut self, within: Duration) -> Result<Reading, DeviceError>;

    /// Applies `force_n`, N, device frame, until the next call.
    ///
    /// # Errors
    /// As for `read`. The loop then assumes that the device keeps its previous force, and limits growth relative to that. If the
    /// errors persist, the loop fades the force and the watchdog calls the [`EmergencyStop`], if there is one.
    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError>;

    /// The component of `force_n` along the actuated axes, N, device frame: a linear projection that ignores force limits.
    /// The default returns `force_n`. An app can use it to report a force that lies along axes without a motor.
    fn displayable_force_n(&self, force_n: DVec3) -> DVec3 {
        force_n
    }

    /// A setting that the user should check for this device, and its remedy, if there is one. The loop reports it once the device is
    /// open ([`crate::LoopEventKind::DeviceNotice`]).
    fn notice(&self) -> Option<&'static str> {
        None
    }

    /// A second path to the actuators, for a watchdog on another thread. The loop requests it after every `open`. Without one,
    /// which is the default, only the device's firmware can end the force of a blocked loop.
    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        None
    }

    /// Sets zero force and releases the hardware.
    ///
    /// # Errors
    /// As for `read`. The device counts as closed in any case.
    fn close(&mut self) -> Result<(), DeviceError>;
}

/// A path to a device's actuators besides [`HapticDevice`], used from a separate thread.
pub trait EmergencyStop: Send {
    /// Sets zero force at once: the loop's thread is blocked in the device, was not scheduled for too long, or cannot write to
    /// the device.
    ///
    /// # Errors
    /// [`DeviceError`] if the stop fails; the watchdog then tries again. After a panic it does not try again until the loop has
    /// resumed.
    fn stop(&mut self) -> Result<(), DeviceError>;
}

/// One reading of a device, in the device's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Position, m.
    pub position_m: DVec3,
    /// Velocity measured by the device, m/s; `None` if the device measures none.
    pub velocity_m_per_s: Option<DVec3>,
    /// Orientation, a unit quaternion.
    pub orientation: DQuat,
    /// Bit i is set while button i is pressed.
    pub buttons: u32,
    /// Sequence number of the device's report, if the device counts its reports: newer reports have larger numbers until the
    /// device is opened again. Without it the loop can detect neither repeated nor reordered reports.
    pub sequence: Option<u64>,
}

impl Reading {
    /// A reading at `position_m`, m, without rotation, buttons, velocity and sequence number.
    #[must_use]
    pub fn at(position_m: DVec3) -> Self {
        let orientation = DQuat::IDENTITY;
        Self { position_m, velocity_m_per_s: None, orientation, buttons: 0, sequence: None }
    }

    /// Whether all numbers are within bounds and the orientation is a rotation: coordinates up to 1 km, velocities up to 10 km/s.
    /// The bounds are far beyond any hand, and small enough that no later computation overflows.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        // The comparison is false for NaN.
        let within = |v: DVec3, limit: f64| v.to_array().iter().all(|c| c.abs() <= limit);
        within(self.position_m, 1e3)
            && self.velocity_m_per_s.is_none_or(|v| within(v, 1e4))
            && self.orientation.is_finite()
            && self.orientation.is_normalized()
    }
}
