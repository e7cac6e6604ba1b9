//! Force-feedback joysticks with USB's physical interface device class.

use crate::driver::Driver;
use crate::{HidError, HidInfo, ReportDescriptor, ReportKind, Usage};

/// What can be set for a force-feedback joystick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JoystickOptions {}

/// Whether its applications allow it: a joystick, or a game pad.
pub(crate) fn may_be_one(info: &HidInfo) -> bool {
    info.applications.iter().any(|usage| *usage == Usage::new(1, 4) || *usage == Usage::new(1, 5))
}

/// Whether it has a report that sets a constant force.
pub(crate) fn is_one(descriptor: &ReportDescriptor) -> bool {
    descriptor.find(ReportKind::Output, Usage::new(0x0F, 0x73), Usage::new(0x0F, 0x70)).is_some()
}

pub(crate) fn driver(
    info: &HidInfo,
    _: &ReportDescriptor,
    _: JoystickOptions,
) -> Result<Box<dyn Driver>, HidError> {
    Err(HidError::Unsupported { device: info.label(), lacks: "no driver yet".into() })
}
