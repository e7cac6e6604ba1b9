//! The device: what gives samples and takes forces.

mod following;
mod replay;
mod scripted;

pub use following::{FollowerDevice, FollowerSettings, FollowerTarget};
pub use replay::{ReplayDevice, ReplayEnd};
pub use scripted::ScriptedDevice;

use crate::error::{check, check_positive};
use crate::{EmergencyStop, HapticsError, SafetySettings};
use glam::{DQuat, DVec3};
use std::time::Duration;
use thiserror::Error;

/// A force-feedback device, or a stand-in.
///
/// # Contract
///
/// * All methods but `describe` are called on the loop's thread, one at a time: `open` once, then `read` and
///   `write` in turn at every tick, then `close` once. `describe` may also be called before `open`.
/// * `read` and `write` must not allocate, log, or block longer than the time they are given: a tick is 1 ms.
/// * Positions and forces are in the device's own frame, in metres and newtons.
/// * `close` and dropping leave the actuators at zero force, whatever happened before; the loop also writes
///   zero before it closes.
/// * A device is made closed. One that has been closed can be opened again: after [`DeviceError::Disconnected`] the loop closes
///   it and tries to open it twice a second, which may take longer than a tick.
pub trait HapticDevice: Send {
    /// What it is and what it can do.
    fn describe(&self) -> DeviceDescription;

    /// Makes it ready, at zero force.
    ///
    /// # Errors
    /// [`DeviceError::AlreadyOpen`], [`DeviceError::Disconnected`], [`DeviceError::Os`].
    fn open(&mut self) -> Result<(), DeviceError>;

    /// The newest reading, waiting `within` for it at most.
    ///
    /// # Errors
    /// [`DeviceError::NotOpen`], [`DeviceError::TimedOut`], [`DeviceError::Disconnected`],
    /// [`DeviceError::Os`], [`DeviceError::Protocol`]. The loop repeats the last reading and fades the force if
    /// errors go on.
    fn read(&mut self, within: Duration) -> Result<Reading, DeviceError>;

    /// Shows `force_n` to the hand until the next call.
    ///
    /// # Errors
    /// As `read`. The device then goes on with the force that it had, as far as the loop knows: growth is counted from that.
    /// The loop fades the force if errors go on, and has the device stopped beside it if that is possible.
    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError>;

    /// The part of `force_n` that its motors can show whatever their limits, N, its own frame: a linear projection, which leaves out the
    /// axes without a motor. By default all of it. A tool whose force lies along such axes is reported by the app.
    fn quantized_force_n(&self, force_n: DVec3) -> DVec3 {
        force_n
    }

    /// A way to its actuators from another thread, for a watchdog that stops it when the loop hangs in it. Asked for after every
    /// `open`. Without one, which is the default, only the device's own firmware ends the force then.
    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        None
    }

    /// Zero force, and lets go of the hardware.
    ///
    /// # Errors
    /// As `read`. The device counts as closed even then.
    fn close(&mut self) -> Result<(), DeviceError>;
}

/// What a device is and can do.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceDescription {
    /// A name for people.
    pub name: String,
    /// Corners of the box in which it can be moved, m, its own frame.
    pub workspace_m: [DVec3; 2],
    /// The largest force it can or should show, N; zero for a device without motors.
    pub max_force_n: f64,
    /// How often it can be read and written, Hz.
    pub rate_hz: f64,
}

impl DeviceDescription {
    /// What the safety chain makes of it.
    #[must_use]
    pub fn limits(&self) -> DeviceLimits {
        DeviceLimits::of_force(self.max_force_n)
    }

    /// The safety chain's settings for it, where ticks last `tick_s`: the defaults, with
    ///
    /// * its largest force, and the whole of it in 20 ms at the soonest. Both hold whatever is set;
    /// * a twentieth of its largest force as the force with which it may begin, if that is less than the default 0.5 N: what is
    ///   little for an arm is all that a weak device has;
    /// * a silence of three of its own periods, if that is more than the default 20 ticks: a slow device is not silent.
    ///
    /// It says nothing of how fast it may be moved or of its damping; those stay as they are.
    #[must_use]
    pub fn safety(&self, tick_s: f64) -> SafetySettings {
        let DeviceLimits { force_n, slew_n_per_s } = self.limits();
        let good = SafetySettings::default();
        SafetySettings {
            max_force_n: force_n,
            max_slew_n_per_s: if slew_n_per_s > 0.0 {
                good.max_slew_n_per_s.min(slew_n_per_s)
            } else {
                good.max_slew_n_per_s
            },
            arm_below_n: good.arm_below_n.min(force_n / 20.0),
            // What is not finite becomes the largest number there is.
            device_timeout_ticks: good
                .device_timeout_ticks
                .max((3.0 / (self.rate_hz * tick_s)).ceil() as u64),
            ..good
        }
    }

    /// Refuses a description that makes no sense: a driver's mistake must not become a force limit.
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn validate(&self) -> Result<(), HapticsError> {
        let [low, high] = self.workspace_m;
        let size = (high - low).min_element();
        let ok = low.is_finite() && high.is_finite() && size >= 0.0;
        check("smallest side of the device's workspace, m", size, ok, "finite and at least 0")?;
        let force = self.max_force_n;
        let ok = force.is_finite() && force >= 0.0;
        check("largest force of the device, N", force, ok, "finite and at least 0")?;
        check_positive("rate of the device, Hz", self.rate_hz)
    }
}

/// What the safety chain never exceeds, whatever the user sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceLimits {
    /// The largest force, N; zero for a device without motors.
    pub force_n: f64,
    /// Its largest growth, N/s.
    pub slew_n_per_s: f64,
}

impl DeviceLimits {
    /// Of a device whose largest force is `force_n`: that may come within 20 ms.
    #[must_use]
    pub fn of_force(force_n: f64) -> Self {
        Self { force_n, slew_n_per_s: force_n / 0.02 }
    }

    /// Refuses what is no limit.
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn validate(&self) -> Result<(), HapticsError> {
        for (what, value) in [
            ("largest force of the device, N", self.force_n),
            ("largest growth of the device's force, N/s", self.slew_n_per_s),
        ] {
            check(what, value, value.is_finite() && value >= 0.0, "finite and at least 0")?;
        }
        Ok(())
    }
}

/// One reading, in the device's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Position, m.
    pub position_m: DVec3,
    /// Velocity as the device itself knows it, m/s.
    pub velocity_m_per_s: Option<DVec3>,
    /// Orientation.
    pub orientation: DQuat,
    /// Bit i is set while button i is pressed.
    pub buttons: u32,
    /// The number of the device's report, where it counts them: each newer one has a larger number, until the device is opened
    /// anew. Without, a device that repeats itself or whose reports overtake each other cannot be told from a hand.
    pub sequence: Option<u64>,
}

impl Reading {
    /// A reading at `position_m`, with nothing else to say.
    #[must_use]
    pub fn at(position_m: DVec3) -> Self {
        let orientation = DQuat::IDENTITY;
        Self { position_m, velocity_m_per_s: None, orientation, buttons: 0, sequence: None }
    }

    /// Whether every number is one that a hand can have, and the orientation a rotation: positions within 1 km of
    /// the origin, velocities up to 10 km/s. That is far beyond any hand in any scene, and near enough that nothing
    /// computed from it can overflow.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        // Not a number is not at most anything.
        let within = |v: DVec3, limit: f64| v.to_array().iter().all(|c| c.abs() <= limit);
        within(self.position_m, 1e3)
            && self.velocity_m_per_s.is_none_or(|v| within(v, 1e4))
            && self.orientation.is_finite()
            && self.orientation.is_normalized()
    }
}

/// Why a device could not do what it was asked. It carries no heap, so the loop can throw it away.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeviceError {
    /// It is not open. Open it first.
    #[error("the device is not open; open it first")]
    NotOpen,
    /// It is open already. Close it first.
    #[error("the device is open already; close it first")]
    AlreadyOpen,
    /// No reading came in time. Check the cable and the load of the machine.
    #[error("the device did not answer in time; check its cable and the load of the machine")]
    TimedOut,
    /// It is gone. Plug it in again.
    #[error("the device is disconnected; plug it in again")]
    Disconnected,
    /// The operating system refused; its error number says why.
    #[error("the operating system refused: {}", std::io::Error::from_raw_os_error(*.0))]
    Os(i32),
    /// It is there and cannot be used as it is; the text says why and what to do.
    #[error("the device cannot be used: {0}")]
    Unavailable(&'static str),
    /// What the device sent is not what its protocol allows.
    #[error("the device broke its protocol: {0}; check that driver and firmware belong together")]
    Protocol(&'static str),
    /// The hand cannot have moved that far since the last reading. If it stays there it is believed.
    #[error(
        "the position jumped farther than a hand can move; if it stays there it is believed, if not check the sensor"
    )]
    Jumped,
    /// The same report has come for more than ten ticks. What hangs is the device or its driver.
    #[error("the device repeats its last report; plug it in again, and check that its driver is up to date")]
    Repeated,
    /// A report has come after a newer one.
    #[error("the device's reports came out of order; check the driver")]
    Reordered,
    /// The reading has a number that is not finite or beyond all bounds, or an orientation that is no rotation.
    #[error(
        "the reading is not finite or beyond all bounds, or its orientation is no rotation; check the driver"
    )]
    Unusable,
}

impl DeviceError {
    /// Whether it is the loop that found fault with a reading, and not the device that failed.
    pub(crate) fn is_of_the_loop(self) -> bool {
        matches!(self, Self::Unusable | Self::Jumped | Self::Repeated | Self::Reordered)
    }
}
