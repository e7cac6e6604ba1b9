//! What the three kinds of device have in common, once one of them is open.

use crate::BoardCalibration;
use crate::link::Link;
use glam::DVec3;
use palpate_haptics::{DeviceDescription, DeviceError, Reading};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// How often a device was stopped by another thread since its driver last asked.
#[derive(Clone, Debug, Default)]
pub(crate) struct StopCounter(Arc<AtomicU32>);

impl StopCounter {
    /// A report that ends all force has been sent.
    pub(crate) fn note(&self) {
        self.0.fetch_add(1, Ordering::AcqRel);
    }

    /// How many there were, which are forgotten with that.
    pub(crate) fn take(&self) -> u32 {
        self.0.swap(0, Ordering::AcqRel)
    }
}

/// The protocol of one kind of device. The promises of [`HapticDevice`](palpate_haptics::HapticDevice) hold for it.
pub(crate) trait Driver: Send {
    /// What it is and what it can do.
    fn describe(&self) -> DeviceDescription;

    /// The part of a force that its motors can show, N, in the device's frame.
    fn displayed_force_n(&self, force_n: DVec3) -> DVec3 {
        force_n
    }

    /// Makes a device that has just been opened ready, at zero force.
    fn start(&mut self, link: &mut Link) -> Result<(), DeviceError>;

    /// The newest reading.
    fn read(&mut self, link: &mut Link, within: Duration) -> Result<Reading, DeviceError>;

    /// Shows a force, N, in the device's frame.
    fn write(&mut self, link: &mut Link, force_n: DVec3) -> Result<(), DeviceError>;

    /// Zero force, actuators off.
    fn stop(&mut self, link: &mut Link) -> Result<(), DeviceError>;

    /// The device was not there when it was looked for, or is somewhere else by now: it has been unplugged.
    fn mark_disconnected(&mut self) {}

    /// Whether it is known to end its force by itself when nobody writes to it any more.
    fn ends_by_itself(&self) -> bool;

    /// The output reports that end all force, for a thread that has no part in the protocol; none for a device without motors.
    fn stop_reports(&self) -> Vec<Vec<u8>>;

    /// Where such a thread counts the reports that it has sent, for a driver that has to know.
    fn stop_counter(&self) -> Option<StopCounter> {
        None
    }

    /// A way to have it calibrated, for a device that needs it.
    fn calibration(&self) -> Option<BoardCalibration> {
        None
    }
}
