//! Interface of simulated firmware.

use std::sync::{Arc, Mutex, PoisonError};

/// Firmware of a HID device: the device side of [`HidConnection`](crate::HidConnection), with the same rules for report IDs. The same
/// firmware runs behind a [`SimulatedBus`](crate::simulated::SimulatedBus) and behind a virtual device of the kernel.
pub trait Firmware: Send {
    /// Writes the next input report to `report` and returns its length in bytes; 0 without one.
    fn input(&mut self, report: &mut [u8]) -> usize;

    /// Processes an output report. Returns whether the firmware supports it.
    fn output(&mut self, report: &[u8]) -> bool;

    /// Writes the feature report with the ID `report[0]` to `report` and returns its length in bytes; 0 without one.
    fn feature(&mut self, report: &mut [u8]) -> usize {
        let _ = report;
        0
    }

    /// Processes a feature report. Returns whether the firmware supports it.
    fn set_feature(&mut self, report: &[u8]) -> bool {
        let _ = report;
        false
    }
}

impl<F: Firmware + ?Sized> Firmware for Arc<Mutex<F>> {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.lock().unwrap_or_else(PoisonError::into_inner).input(report)
    }

    fn output(&mut self, report: &[u8]) -> bool {
        self.lock().unwrap_or_else(PoisonError::into_inner).output(report)
    }

    fn feature(&mut self, report: &mut [u8]) -> usize {
        self.lock().unwrap_or_else(PoisonError::into_inner).feature(report)
    }

    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.lock().unwrap_or_else(PoisonError::into_inner).set_feature(report)
    }
}
