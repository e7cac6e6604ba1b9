//! Firmware that records its reports and rejects chosen ones.

use crate::hex;
use palpate_hid::simulated::{Firmware, JoystickFirmware};
use std::sync::{Arc, Mutex};

/// Recorded reports, and prefixes of reports to reject.
#[derive(Clone, Debug, Default)]
pub struct ReportLog(Arc<Mutex<(Vec<String>, Vec<Vec<u8>>)>>);

impl ReportLog {
    /// Returns the reports since the last call.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap().0)
    }

    /// Rejects reports that begin with one of `prefixes` from now on.
    pub fn reject(&self, prefixes: &[&[u8]]) {
        self.0.lock().unwrap().1 = prefixes.iter().map(|prefix| prefix.to_vec()).collect();
    }

    /// Records a report. Returns whether it is accepted.
    fn record(&self, verb: &str, report: &[u8]) -> bool {
        let mut log = self.0.lock().unwrap();
        log.0.push(hex::line(verb, report));
        !log.1.iter().any(|prefix| report.starts_with(prefix))
    }
}

/// Firmware with a report log.
pub struct RecordedFirmware {
    pub firmware: Arc<Mutex<JoystickFirmware>>,
    pub log: ReportLog,
}

impl Firmware for RecordedFirmware {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.firmware.input(report)
    }

    fn output(&mut self, report: &[u8]) -> bool {
        self.log.record("write", report) && self.firmware.output(report)
    }

    fn feature(&mut self, report: &mut [u8]) -> usize {
        if self.log.record("feature", &report[..1]) { self.firmware.feature(report) } else { 0 }
    }

    fn set_feature(&mut self, report: &[u8]) -> bool {
        self.log.record("set_feature", report) && self.firmware.set_feature(report)
    }
}
