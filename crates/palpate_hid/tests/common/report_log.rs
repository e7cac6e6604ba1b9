//! A firmware that is listened to, and that can be made to refuse.

use crate::hex;
use palpate_hid::simulated::{Firmware, JoystickFirmware};
use std::sync::{Arc, Mutex};

/// What was said to a firmware, and what it shall refuse.
#[derive(Clone, Debug, Default)]
pub struct Ear(Arc<Mutex<(Vec<String>, Vec<Vec<u8>>)>>);

impl Ear {
    /// What was said since the last time.
    pub fn heard(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap().0)
    }

    /// From now on reports that begin with one of `beginnings` are refused.
    pub fn refuse(&self, beginnings: &[&[u8]]) {
        self.0.lock().unwrap().1 = beginnings.iter().map(|beginning| beginning.to_vec()).collect();
    }

    /// Notes a report. Whether it may pass.
    fn note(&self, verb: &str, report: &[u8]) -> bool {
        let mut ear = self.0.lock().unwrap();
        ear.0.push(hex::line(verb, report));
        !ear.1.iter().any(|beginning| report.starts_with(beginning))
    }
}

/// The firmware behind an ear.
pub struct Recorded {
    pub firmware: Arc<Mutex<JoystickFirmware>>,
    pub ear: Ear,
}

impl Firmware for Recorded {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.firmware.input(report)
    }

    fn output(&mut self, report: &[u8]) -> bool {
        self.ear.note("write", report) && self.firmware.output(report)
    }

    fn feature(&mut self, report: &mut [u8]) -> usize {
        if self.ear.note("feature", &report[..1]) { self.firmware.feature(report) } else { 0 }
    }

    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.ear.note("set_feature", report) && self.firmware.set_feature(report)
    }
}
