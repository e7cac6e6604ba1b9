//! HID haptic devices: 3Dconnexion SpaceMouse, force-feedback joysticks, open boards with three motors. The only crate of palpate
//! that accesses hardware.
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
//! // `device` is a `HapticDevice`: pass it to a haptic loop.
//! # Ok(())
//! # }
//! ```
//!
//! # Contents
//!
//! * Selection and enumeration: [`HidSelector`], [`FoundDevice`], [`HidKind`]; [`HidBus`], [`SystemBus`], [`HidInfo`].
//! * The device: [`HidDevice`], with [`HidOptions`] for each kind and the statistics [`HidCounters`].
//! * Report descriptors: [`ReportDescriptor`].
//! * 3-DOF boards: kinematics [`BoardKinematics`], calibration [`BoardHoming`] and [`BoardCalibration`], reports [`BoardForm`],
//!   [`BoardInput`] and [`BoardOutput`].
//! * Simulated devices: the module `simulated` of the feature with the same name.
//!
//! # Units, frames, signs
//!
//! SI units. Positions and forces are in the device frame: x to the right, y up, z towards the user. Forces are those
//! exerted by the device on the hand.

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
pub use joystick::{JoystickOptions, PidArrayBase, PidArrayBases};
pub use selector::{FoundDevice, HidKind, HidSelector};
pub use space_mouse::{ParseReportError, SpaceMouseOptions, SpaceMouseReport};
pub use system::SystemBus;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadMe;
