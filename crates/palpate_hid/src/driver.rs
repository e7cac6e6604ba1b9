//! The interface of the drivers for the three kinds of device.

use crate::BoardCalibration;
use crate::link::Link;
use glam::DVec3;
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Counts the stop reports that another thread has sent.
#[derive(Clone, Debug, Default)]
pub(crate) struct StopCounter(Arc<AtomicU32>);

impl StopCounter {
    /// Counts one stop report.
    pub(crate) fn increment(&self) {
        self.0.fetch_add(1, Ordering::AcqRel);
    }

    /// Returns the count and resets it.
    pub(crate) fn take(&self) -> u32 {
        self.0.swap(0, Ordering::AcqRel)
    }
}

/// Output report that ends force.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct StopReport {
    pub(crate) bytes: Vec<u8>,
    /// Whether the device may reject the report.
    pub(crate) is_optional: bool,
}

impl StopReport {
    /// A report that the device must accept.
    pub(crate) fn required(bytes: Vec<u8>) -> Self {
        Self { bytes, is_optional: false }
    }
}

/// Protocol of one kind of device. The contract of [`HapticDevice`](palpate_haptics::HapticDevice) applies.
pub(crate) trait Driver: Send {
    /// Describes the device.
    fn describe(&self) -> DeviceDescription;

    /// Component of a force that the motors can display, N, in the device frame.
    fn displayed_force_n(&self, force_n: DVec3) -> DVec3 {
        force_n
    }

    /// A setting that the user should check for this device, and its remedy.
    fn notice(&self) -> Option<&'static str> {
        None
    }

    /// Initialises a newly opened device, at zero force.
    fn start(&mut self, link: &mut Link) -> Result<(), DeviceError>;

    /// Returns the latest reading.
    fn read(&mut self, link: &mut Link, within: Duration) -> Result<Reading, DeviceError>;

    /// Sends a force, N, in the device frame.
    fn write(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError>;

    /// Sets zero force and switches the actuators off.
    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError>;

    /// Notes that the device was unplugged: it was missing or has another path.
    fn mark_disconnected(&mut self) {}

    /// Whether the firmware is documented to end its force when reports stop.
    fn has_force_timeout(&self) -> bool;

    /// Output reports that end all force, independent of the protocol state; empty for a device without motors.
    fn stop_reports(&self) -> Vec<StopReport>;

    /// Counter for stop reports sent by other threads, if the driver needs it.
    fn stop_counter(&self) -> Option<StopCounter> {
        None
    }

    /// Calibration handle, for a device that needs one.
    fn calibration(&self) -> Option<BoardCalibration> {
        None
    }
}
