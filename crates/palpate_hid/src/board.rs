//! Open boards with three motors.

use crate::driver::Driver;
use crate::{HidError, HidInfo, ReportDescriptor, Usage};

/// What can be set for a 3-DOF board.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoardOptions {}

/// Whether its numbers are those of such a board.
pub(crate) fn is_one(info: &HidInfo, teensy_is_board: bool) -> bool {
    let numbers = (info.vendor, info.product);
    (numbers == (0x1234, 0x0006) || (teensy_is_board && numbers == (0x16C0, 0x0486)))
        && info.applications.contains(&Usage::new(0xFFAB, 0x0200))
}

pub(crate) fn driver(
    info: &HidInfo,
    _: &ReportDescriptor,
    _: BoardOptions,
) -> Result<Box<dyn Driver>, HidError> {
    Err(HidError::Unsupported { device: info.label(), lacks: "no driver yet".into() })
}
