//! Open or closed state of a simulated device.

use super::DeviceError;

/// Whether a simulated device is open.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct OpenState {
    is_open: bool,
}

impl OpenState {
    /// Opens the device.
    ///
    /// # Errors
    /// [`DeviceError::AlreadyOpen`].
    pub(super) fn open(&mut self) -> Result<(), DeviceError> {
        if self.is_open {
            return Err(DeviceError::AlreadyOpen);
        }
        self.is_open = true;
        Ok(())
    }

    /// Rejects access to a device that is closed.
    ///
    /// # Errors
    /// [`DeviceError::NotOpen`].
    pub(super) fn check(self) -> Result<(), DeviceError> {
        if self.is_open { Ok(()) } else { Err(DeviceError::NotOpen) }
    }

    /// Closes the device.
    pub(super) fn close(&mut self) {
        self.is_open = false;
    }
}
