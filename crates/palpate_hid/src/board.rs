//! Open boards with three motors: WoodenHaptics, Polhem, and what speaks as they do.
//!
//! # How a board and its driver take turns
//!
//! The firmware of boards with reports of 14 bytes sends one report and then waits for one. So each report that is read is answered
//! by one, with the newest force. A force for which there is no report to answer is passed over: with the next tick comes a newer
//! one. Only one that is zero, or less than half of what is shown, does not wait. It answers the board's next report, and until that
//! has come there is no other such, so that nothing piles up at the board.
//!
//! A zero that another thread sends to stop a board whose loop hangs answers a report too. It is counted like the driver's own, and
//! force begins from nothing when the loop goes on.
//!
//! Where nothing has gone either way for 10 ms a zero report is sent to wake the board up, and force begins from nothing; reading
//! [times out](palpate_haptics::DeviceError::TimedOut) from then on, until the board speaks again. The watchdog of firmware for reports of 8
//! and 14 bytes switches the motors off after half a second without a report, which is also how long a force may last when a program is
//! killed. Firmware for reports of 64 bytes has not been published: nobody knows here whether it has a watchdog, and
//! [`HidDevice::ends_by_itself`](crate::HidDevice::ends_by_itself) says no.
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

/// Whether its numbers are those of such a board.
pub(crate) fn is_one(info: &HidInfo, treat_teensy_as_board: bool) -> bool {
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
        unsupported("its input and output reports have to have 8, 14 or 64 bytes each, and no numbers")
    })?;
    if options.homing == BoardHoming::Kept && !form.has_commands() {
        let allowed = "Awaited or AtOpen where reports have 8 bytes: such a board cannot keep it";
        return Err(HidError::Option { what: "homing of a board", found: "Kept".into(), allowed });
    }
    let zero = BoardOutput::ZERO.encode(form).map_err(|error| unsupported(&error.to_string()))?;
    Ok(Box::new(driver::Board::new(info.label(), options, form, zero)))
}
