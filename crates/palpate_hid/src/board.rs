//! Open boards with three motors: WoodenHaptics, Polhem and compatible boards.
//!
//! # Report exchange
//!
//! Firmware with reports of 14 bytes sends one report and then waits for one. The driver therefore replies to each report that it has
//! read, with the latest force. A force without a pending report is dropped; the next tick has a newer one.
//!
//! Two kinds of force are sent early, without waiting: zero, and less than half of the displayed force. An early report counts as the
//! reply to the board's next report. No second one is sent before that report has arrived, so that no reports queue up in the board.
//!
//! A zero report sent by another thread, which stops a board whose loop hangs, counts as a reply too. After it the driver limits the
//! force to zero and raises the limit again.
//!
//! After 10 ms without a report in either direction, the driver sends a zero report to wake the board up, and reading
//! [times out](palpate_haptics::DeviceError::TimedOut) until the next report. Firmware for reports of 8 and 14 bytes has a watchdog: it
//! switches the motors off 0.5 s after the last report, which also bounds the force of a killed program. Firmware for reports of
//! 64 bytes is unpublished and may have no watchdog, so [`HidDevice::has_force_timeout`](crate::HidDevice::has_force_timeout) is `false`.
//!
//! Sources: forsslund/haptikfabrikenapi at b8d6c94, `src/fsusbhapticdevicethread.cpp` and `firmware/main.cpp`.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod calibration;
mod driver;
mod force_limits;
mod kinematics;
mod linkage;
mod options;
mod packet;
mod polhem_linkage;
mod presets;
mod reach;
mod report_credits;
mod woodenhaptics_linkage;

pub use calibration::{BoardCalibration, BoardHoming};
pub use kinematics::BoardKinematics;
pub use linkage::BoardLinkage;
pub use options::BoardOptions;
pub use packet::{BoardBytes, BoardForm, BoardInput, BoardOutput, BoardPacketError};

use crate::driver::Driver;
use crate::{HidError, HidInfo, ReportDescriptor, Usage};

/// Whether USB IDs and usage are those of a board.
pub(crate) fn is_board(info: &HidInfo, treat_teensy_as_board: bool) -> bool {
    let numbers = (info.vendor, info.product);
    (numbers == (0x1234, 0x0006) || (treat_teensy_as_board && numbers == (0x16C0, 0x0486)))
        && info.applications.contains(&Usage::new(0xFFAB, 0x0200))
}

pub(crate) fn driver(
    info: &HidInfo,
    descriptor: &ReportDescriptor,
    options: BoardOptions,
) -> Result<Box<dyn Driver>, HidError> {
    options.validate()?;
    let unsupported = |lacks: &str| HidError::Unsupported { device: info.label(), lacks: lacks.to_owned() };
    let form = BoardForm::of(descriptor).ok_or_else(|| {
        unsupported("its input and output reports must have 8, 14 or 64 bytes each, and no report IDs")
    })?;
    if options.homing == BoardHoming::Kept && !form.has_commands() {
        let allowed = "Awaited or AtOpen for reports of 8 bytes, whose counters cannot be set";
        return Err(HidError::Option { what: "homing of a board", found: "Kept".into(), allowed });
    }
    let zero = BoardOutput::ZERO.encode(form).map_err(|error| unsupported(&error.to_string()))?;
    Ok(Box::new(driver::BoardDriver::new(info.label(), options, form, zero)))
}
