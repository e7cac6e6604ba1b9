//! Reports that switch the actuators off, whichever way the firmware numbers its commands.

use super::array_base::{PidArrayBase, is_ambiguous};
use super::report_encoding::{UsageValue, blank};
use super::usages::{DISABLE_ACTUATORS, ENABLE_ACTUATORS};
use crate::driver::StopReport;
use crate::link::Link;
use crate::{Field, Report};
use palpate_haptics::DeviceError;

/// Reports that switch the actuators off: one, or for an ambiguous array one for each of its two readings, in an order that leaves the
/// actuators off in both. For the commands enable, disable, stop all and reset, the numbers are 1 and 2. Firmware that numbers from 0
/// disables the actuators and stops all effects; firmware that numbers from 1 enables and disables them.
#[derive(Clone, Debug)]
pub(super) struct OffReports {
    reports: Vec<StopReport>,
}

impl OffReports {
    /// The reports for the control array or bit `field` with the base `base`; `None` where it cannot represent the command.
    pub(super) fn of(report: &Report, field: &Field, base: Option<PidArrayBase>) -> Option<Self> {
        let command = |base| {
            let mut bytes = blank(report);
            UsageValue::of(field, DISABLE_ACTUATORS.usage, base)?.write(&mut bytes);
            Some(bytes)
        };
        let own = command(base)?;
        let required = |bytes: Vec<u8>| StopReport { is_optional: bytes != own, bytes };
        if !is_ambiguous(field) {
            return Some(Self { reports: vec![required(own.clone())] });
        }
        // The number of one base is that of the next command in the other.
        let mut readings = [PidArrayBase::LogicalMinimum, PidArrayBase::One];
        let next = field.value_of(DISABLE_ACTUATORS.usage).and_then(|value| field.usage_of(value + 1));
        if next == Some(ENABLE_ACTUATORS.usage) {
            readings.reverse();
        }
        let reports = readings.into_iter().filter_map(|base| command(Some(base))).map(required).collect();
        Some(Self { reports })
    }

    /// Whether there is a report for each of two readings.
    pub(super) fn is_ambiguous(&self) -> bool {
        self.reports.len() > 1
    }

    /// Sends the reports. The result is that of the reading that is set; the device may reject the other one.
    pub(super) fn send(&self, link: &mut Link) -> Result<(), DeviceError> {
        let mut switched_off = Ok(());
        for StopReport { bytes, is_optional } in &self.reports {
            // Send each report, even if one fails.
            let written = link.write(bytes);
            if !is_optional {
                switched_off = written;
            }
        }
        switched_off
    }

    /// The reports for another thread.
    pub(super) fn stop_reports(&self) -> Vec<StopReport> {
        self.reports.clone()
    }
}
