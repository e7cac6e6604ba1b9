//! The firmware side of a HID connection.

use std::sync::{Arc, Mutex, PoisonError};

/// What is inside a HID device: the other end of [`HidConnection`], whose words on report numbers hold here too. The same
/// firmware answers behind a [`SimulatedBus`] and behind a kernel's virtual device.
pub trait Firmware: Send {
    /// The next input report, if there is one by now: how many bytes of `report` it fills.
    fn input(&mut self, report: &mut [u8]) -> usize;

    /// Takes an output report. Whether it is one that it knows.
    fn output(&mut self, report: &[u8]) -> bool;

    /// Fills the feature report whose number is `report[0]`: how many bytes it has, 0 where there is none.
    fn feature(&mut self, report: &mut [u8]) -> usize {
        let _ = report;
        0
    }

    /// Takes a feature report. Whether it is one that it knows.
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
