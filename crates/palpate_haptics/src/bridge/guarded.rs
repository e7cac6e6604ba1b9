//! The device behind a peer: no panic of it comes through, and once it has failed it is zeroed until it obeys, or closed.

use crate::{DeviceError, HapticDevice, Reading};
use glam::DVec3;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

/// A device that has not taken zero force for so long is closed, which is to leave it with zero force too.
const UNZEROED_AT_MOST: Duration = Duration::from_millis(100);

/// What the device is fit for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// To be written and read.
    Ready,
    /// Only for zero force, until it is opened anew.
    Failed,
    /// For nothing, until it is opened anew.
    Closed,
}

/// A device that is open, or was.
pub(super) struct Guarded {
    device: Box<dyn HapticDevice>,
    state: State,
    /// When it was first told to show zero force and did not, if it has not since.
    unzeroed_since: Option<Duration>,
}

impl Guarded {
    /// Opens `device`.
    pub(super) fn open(mut device: Box<dyn HapticDevice>) -> Result<Self, DeviceError> {
        device.open()?;
        Ok(Self { device, state: State::Ready, unzeroed_since: None })
    }

    /// Whether it may be written and read; if not, a session needs it opened anew.
    pub(super) fn is_ready(&self) -> bool {
        self.state == State::Ready
    }

    /// It is shown zero force from now on, and nothing else.
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

    /// Tries to show zero force, at the time `now`.
    pub(super) fn zero(&mut self, now: Duration) {
        if self.state != State::Closed {
            let written = self.write(DVec3::ZERO);
            self.note_zero(written, now);
        }
    }

    /// Notes what became of a zero force that was written at the time `now`, and closes what has not taken one for too long.
    pub(super) fn note_zero(&mut self, written: Result<(), DeviceError>, now: Duration) {
        if written.is_ok() {
            self.unzeroed_since = None;
            return;
        }
        let since = *self.unzeroed_since.get_or_insert(now);
        if now.saturating_sub(since) >= UNZEROED_AT_MOST {
            self.close();
        }
    }

    /// A force is shown again: what is not zero need not be.
    pub(super) fn begin(&mut self) {
        self.unzeroed_since = None;
    }

    /// Closes it if it is open, and opens it.
    pub(super) fn reopen(&mut self) -> Result<(), DeviceError> {
        self.close();
        self.call(|device| device.open())?;
        (self.state, self.unzeroed_since) = (State::Ready, None);
        Ok(())
    }

    /// Closes it, once. It counts as closed even if it says that it failed.
    pub(super) fn close(&mut self) {
        if self.state != State::Closed {
            self.state = State::Closed;
            // Nobody is left to be told of an error.
            let _ = self.call(|device| device.close());
        }
    }

    /// What `ask` gives; a panic is an error like any other.
    fn call<T>(
        &mut self,
        ask: impl FnOnce(&mut dyn HapticDevice) -> Result<T, DeviceError>,
    ) -> Result<T, DeviceError> {
        // Of a device that panicked nothing is asked but zero force, close and open.
        let asked = catch_unwind(AssertUnwindSafe(|| ask(self.device.as_mut())));
        asked.unwrap_or(Err(DeviceError::Protocol("its driver panicked")))
    }
}
