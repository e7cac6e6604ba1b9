//! Errors of devices.

use thiserror::Error;

/// Why a device operation failed or the loop rejected a reading. It holds no heap memory, so the loop can drop it.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeviceError {
    /// The device is not open.
    #[error("the device is not open; open it first")]
    NotOpen,
    /// The device is already open.
    #[error("the device is open already; close it first")]
    AlreadyOpen,
    /// No reading arrived in time.
    #[error("the device did not reply in time; check its cable and the load of the machine")]
    TimedOut,
    /// The device is disconnected.
    #[error("the device is disconnected; plug it in again")]
    Disconnected,
    /// The operating system returned this error number.
    #[error("the operating system returned an error: {}", std::io::Error::from_raw_os_error(*.0))]
    Os(i32),
    /// The device is present but cannot be used in its present state; the text gives the reason and the remedy.
    #[error("the device cannot be used: {0}")]
    Unavailable(&'static str),
    /// The device sent data that its protocol does not allow.
    #[error("the device broke its protocol: {0}; check that driver and firmware match")]
    Protocol(&'static str),
    /// The position jumped farther since the last reading than a hand can move. The loop accepts it once it has persisted.
    #[error(
        "the position jumped farther than a hand can move; it is accepted if it persists, otherwise check the sensor"
    )]
    Jumped,
    /// The same report has been repeated for more than ten ticks: the device or its driver hangs.
    #[error("the device repeats its last report; plug it in again, and check that its driver is up to date")]
    Repeated,
    /// A report arrived after a newer one.
    #[error("the device's reports came out of order; check the driver")]
    Reordered,
    /// The reading is not finite or out of bounds, or its orientation is not a rotation.
    #[error(
        "the reading is not finite or out of bounds, or its orientation is not a rotation; check the driver"
    )]
    Unusable,
}

impl DeviceError {
    /// Whether the loop rejected a reading, as opposed to a failure of the device.
    pub(crate) fn is_rejected_reading(self) -> bool {
        matches!(self, Self::Unusable | Self::Jumped | Self::Repeated | Self::Reordered)
    }
}
