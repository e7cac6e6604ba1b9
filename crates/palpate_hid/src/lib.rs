//! Haptic devices over HID, the only part of palpate that talks to hardware: SpaceMouse, force-feedback joysticks, open boards with
//! three motors.
//!
//! # Getting started
//!
//! ```no_run
//! use palpate_hid::{HidDevice, HidOptions, HidSelector, SystemBus};
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let bus = Arc::new(SystemBus::new()?);
//! let device = HidDevice::find(bus, &HidSelector::any(), &HidOptions::default())?;
//! println!("{}", device.found().info.label());
//! // `device` is a `HapticDevice`: a haptic loop takes it from here.
//! # Ok(())
//! # }
//! ```
//!
//! # Contents
//!
//! * Which device: [`HidSelector`], [`FoundDevice`], [`HidKind`]; what is there: [`HidBus`], [`SystemBus`], [`HidInfo`].
//! * The device: [`HidDevice`], with [`HidOptions`] for each kind; what it saw: [`HidCounters`].
//! * What a device says of its reports: [`ReportDescriptor`].
//! * A 3-DOF board: its arm [`BoardKinematics`], its home [`BoardHoming`], [`BoardCalibration`], its reports [`BoardForm`],
//!   [`BoardInput`], [`BoardOutput`].
//! * Without hardware: [`SimulatedBus`], [`Firmware`]; a cap [`SpaceMouseFirmware`]; a joystick in a hand
//!   [`JoystickFirmware`]; a board with an arm and a hand [`BoardFirmware`].
//!
//! # Units, frames, signs
//!
//! SI. Positions and forces are in the device's own frame: x to the right, y up, z towards the hand's owner. Force is what the
//! device does to the hand.

#![forbid(unsafe_code)]

mod board;
mod bus;
mod clock;
mod counters;
mod descriptor;
mod device;
mod driver;
mod error;
mod joystick;
mod link;
mod selector;
#[cfg(feature = "simulated")]
pub mod simulated;
mod space_mouse;
mod system;

pub use board::{
    BoardBytes, BoardCalibration, BoardForm, BoardHoming, BoardInput, BoardKinematics, BoardLinkage,
    BoardOptions, BoardOutput, BoardPacketError,
};
pub use bus::{HidBus, HidConnection, HidInfo, MAX_INPUT_REPORT_BYTES};
pub use clock::Clock;
pub use counters::HidCounters;
pub use descriptor::{
    Collection, DescriptorError, Field, MAX_DESCRIPTOR_BYTES, MAX_FIELDS, MAX_REPORT_BYTES, Report,
    ReportDescriptor, ReportKind, Usage, UsageRange,
};
pub use device::{HidDevice, HidOptions};
pub use error::HidError;
pub use joystick::JoystickOptions;
pub use selector::{FoundDevice, HidKind, HidSelector};
pub use space_mouse::{ParseReportError, SpaceMouseOptions, SpaceMouseReport};
pub use system::SystemBus;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadMe;
