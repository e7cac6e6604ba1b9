//! Start, interruptions and end of a loop, as seen by its runner.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::HapticLoop;
use crate::frozen_position::FrozenPosition;
use crate::plausibility::Plausibility;
use crate::real_time;
use crate::{DeviceError, LoopEventKind};

impl HapticLoop {
    /// Applies the real-time requests to the current thread, which is the loop's.
    pub(crate) fn set_up_thread(&mut self) {
        let granted = real_time::apply(self.config.real_time);
        real_time::touch_stack();
        self.report.real_time = granted;
        self.emit(LoopEventKind::RealTime(granted));
    }

    /// Reports that the device is open and the first tick follows, and the `notice` of the device.
    pub(crate) fn start(&mut self, notice: Option<&'static str>) {
        self.emit(LoopEventKind::Started);
        if let Some(notice) = notice {
            self.emit(LoopEventKind::DeviceNotice(notice));
        }
    }

    /// Reports that the device runs without a watchdog.
    pub(crate) fn no_emergency_stop(&mut self) {
        self.emit(LoopEventKind::NoEmergencyStop);
    }

    /// Notes that the watchdog stopped the device: the start stage is armed again, and growth counts from zero force.
    pub(crate) fn emergency_stopped(&mut self) {
        self.rearm = true;
        self.safety.reset_output();
        self.emit(LoopEventKind::EmergencyStopped);
    }

    /// Notes that the device was opened again: the hand may be anywhere, and the start stage is armed again.
    pub(crate) fn reconnected(&mut self) {
        (self.rearm, self.plausibility) = (true, Plausibility::default());
        self.frozen = FrozenPosition::default();
        self.safety.reset_output();
        self.emit(LoopEventKind::Reconnected);
    }

    /// Reports that the device could not be opened at the start of the loop.
    pub(crate) fn open_failed(&mut self, error: DeviceError) {
        self.report.device_errors += 1;
        self.emit(LoopEventKind::OpenFailed(error));
        self.publish_report();
    }

    /// Reports that a disconnected device could not be opened again.
    pub(crate) fn reopen_failed(&mut self, error: DeviceError) {
        self.emit(LoopEventKind::ReopenFailed(error));
    }

    /// Reports that the driver or the loop panicked, after zero force was written and the device closed.
    pub(crate) fn panicked(&mut self) {
        self.emit(LoopEventKind::Panicked);
        self.report.ended = true;
        self.publish_report();
    }

    /// Reports the end of the loop; `closed` is the result of closing the device.
    pub(crate) fn end(&mut self, closed: Result<(), DeviceError>) {
        if let Err(error) = closed {
            self.report.device_errors += 1;
            self.emit(LoopEventKind::DeviceFailed(error));
        }
        self.emit(LoopEventKind::Stopped);
        self.report.ended = true;
        self.publish_report();
    }
}
