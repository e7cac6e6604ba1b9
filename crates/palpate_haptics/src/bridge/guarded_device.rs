//! The device behind a peer: catches its panics, and after a failure writes zero force until that succeeds or closes the device.

use crate::{DeviceError, HapticDevice, Reading};
use glam::DVec3;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

/// Time without a successful write of zero force after which the device is closed, which must also set zero force.
const ZERO_TIMEOUT: Duration = Duration::from_millis(100);

/// Operational state of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Can be written and read.
    Ready,
    /// Accepts only zero force until it is reopened.
    Failed,
    /// Closed until it is reopened.
    Closed,
}

/// A device that has been opened, with its state.
pub(super) struct GuardedDevice {
    device: Box<dyn HapticDevice>,
    state: State,
    /// Time of the first failed write of zero force, if none has succeeded since.
    unzeroed_since: Option<Duration>,
}

impl GuardedDevice {
    /// Opens `device`.
    pub(super) fn open(mut device: Box<dyn HapticDevice>) -> Result<Self, DeviceError> {
        device.open()?;
        Ok(Self { device, state: State::Ready, unzeroed_since: None })
    }

    /// Whether the device can be written and read; otherwise a new session has to reopen it.
    pub(super) fn is_ready(&self) -> bool {
        self.state == State::Ready
    }

    /// Marks the device as failed: from now on it gets only zero force.
    pub(super) fn fail(&mut self) {
        if self.is_ready() {
            self.state = State::Failed;
        }
    }

    pub(super) fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        self.call(|device| device.write(force_n))
    }

    pub(super) fn read(&mut self, within: Duration) -> Result<Reading, DeviceError> {
        self.call(|device| device.read(within))
    }

    /// Tries to write zero force at time `now`.
    pub(super) fn zero(&mut self, now: Duration) {
        if self.state != State::Closed {
            let written = self.write(DVec3::ZERO);
            self.note_zero(written, now);
        }
    }

    /// Records the result of writing zero force at time `now`, and closes the device if the writes have failed for too long.
    pub(super) fn note_zero(&mut self, written: Result<(), DeviceError>, now: Duration) {
        if written.is_ok() {
            self.unzeroed_since = None;
            return;
        }
        let since = *self.unzeroed_since.get_or_insert(now);
        if now.saturating_sub(since) >= ZERO_TIMEOUT {
            self.close();
        }
    }

    /// Starts a session: the device no longer has to be at zero force.
    pub(super) fn start_session(&mut self) {
        self.unzeroed_since = None;
    }

    /// Closes the device if it is open, and opens it.
    pub(super) fn reopen(&mut self) -> Result<(), DeviceError> {
        self.close();
        self.call(|device| device.open())?;
        (self.state, self.unzeroed_since) = (State::Ready, None);
        Ok(())
    }

    /// Closes the device once. It counts as closed even if closing fails.
    pub(super) fn close(&mut self) {
        if self.state != State::Closed {
            self.state = State::Closed;
            // An error has no receiver.
            let _ = self.call(|device| device.close());
        }
    }

    /// Calls `operation` on the device; a panic becomes an error.
    fn call<T>(
        &mut self,
        operation: impl FnOnce(&mut dyn HapticDevice) -> Result<T, DeviceError>,
    ) -> Result<T, DeviceError> {
        // Unwind safety: after a panic only zero force, close and open are called on the device.
        let result = catch_unwind(AssertUnwindSafe(|| operation(self.device.as_mut())));
        result.unwrap_or(Err(DeviceError::Protocol("its driver panicked")))
    }
}
