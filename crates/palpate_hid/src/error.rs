//! Errors of HID devices.

use crate::DescriptorError;
use palpate_haptics::DeviceError;
use std::io;
use thiserror::Error;

/// Error while listing, finding, opening or configuring a HID device.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum HidError {
    /// The operating system failed to list its devices.
    #[error("the HID devices cannot be listed: {0}")]
    List(String),
    /// No device matches the selector.
    #[error("no {requested} is plugged in; there {}{}", list(.present), hint(.teensy.as_deref()))]
    NotFound {
        /// Description of the selector.
        requested: String,
        /// Names of the devices that are plugged in.
        present: Vec<String>,
        /// Name of a Teensy that would match if it were treated as a board.
        teensy: Option<String>,
    },
    /// Several devices match the selector.
    #[error("{} devices match {requested}: {}; select one by serial number or path, or set `match_first`", .found.len(), .found.join(", "))]
    Several {
        /// Description of the selector.
        requested: String,
        /// Names and paths of the matching devices.
        found: Vec<String>,
    },
    /// The user lacks the permission to open the device.
    #[error(
        "{device}: permission to open {path} is denied; on Linux install assets/udev/70-palpate.rules (its first lines say how), add this line if the device is not listed there, and plug the device in again: {}",
        rule(*.vendor, *.product)
    )]
    Permission {
        /// Name of the device.
        device: String,
        /// Path of the device.
        path: String,
        /// USB vendor ID.
        vendor: u16,
        /// USB product ID.
        product: u16,
    },
    /// Another program or tool has opened the device.
    #[error(
        "{device}: already in use by another program or HapticTool; close that one, or select another device"
    )]
    Busy {
        /// Name of the device.
        device: String,
    },
    /// The device was unplugged.
    #[error("{device}: no longer plugged in")]
    Gone {
        /// Name of the device.
        device: String,
    },
    /// The operating system failed to open the device for another reason.
    #[error("{device}: cannot be opened")]
    Open {
        /// Name of the device.
        device: String,
        /// Cause.
        #[source]
        source: io::Error,
    },
    /// The report descriptor violates the HID standard.
    #[error("{device}: its report descriptor violates the HID standard")]
    Descriptor {
        /// Name of the device.
        device: String,
        /// Violation.
        #[source]
        source: DescriptorError,
    },
    /// The report descriptor has changed since the device was found, as after a firmware update.
    #[error(
        "{device}: its report descriptor has changed since the device was found; select the device again"
    )]
    Changed {
        /// Name of the device.
        device: String,
    },
    /// The device lacks something that its driver needs.
    #[error("{device}: {lacks}")]
    Unsupported {
        /// Name of the device.
        device: String,
        /// Description of what is missing.
        lacks: String,
    },
    /// The report descriptor has arrays with the Logical Minimum 0, which firmware numbers from 0 or from 1.
    #[error(
        "{device}: the array{} of {} begin{} with Logical Minimum 0, which firmware numbers from 0 or from 1; set `JoystickOptions::pid_arrays` to the base that gives a force (palpate-lab devices --test: --pid-arrays minimum, or one)",
        plural(.arrays), .arrays.join(", "), if .arrays.len() == 1 { "s" } else { "" }
    )]
    AmbiguousArrays {
        /// Name of the device.
        device: String,
        /// Reports with such an array.
        arrays: Vec<String>,
    },
    /// An option is out of range.
    #[error("{what} is {found}; it must be {allowed}")]
    Option {
        /// Name of the device.
        what: &'static str,
        /// Rejected value.
        found: String,
        /// Allowed range.
        allowed: &'static str,
    },
}

impl HidError {
    /// Converts the error for the haptic loop, which stores no text. Only a missing device is [`DeviceError::Disconnected`].
    #[must_use]
    pub fn for_loop(&self) -> DeviceError {
        match self {
            Self::NotFound { .. } | Self::Gone { .. } => DeviceError::Disconnected,
            Self::Several { .. } => DeviceError::Unavailable(
                "several devices match it and it has no serial number; unplug all but one, or select it by its path",
            ),
            Self::Permission { .. } => DeviceError::Unavailable(
                "permission to open it is denied; on Linux install assets/udev/70-palpate.rules with a line for it and plug it in again",
            ),
            Self::Busy { .. } => {
                DeviceError::Unavailable("already in use by another program or HapticTool; close that one")
            }
            Self::Changed { .. } => DeviceError::Unavailable(
                "its report descriptor has changed since the device was found; select the device again",
            ),
            Self::Descriptor { .. } | Self::Unsupported { .. } => {
                DeviceError::Protocol("its report descriptor lacks what the driver needs")
            }
            Self::AmbiguousArrays { .. } => DeviceError::Unavailable(
                "arrays of its report descriptor begin with 0 and can be read in two ways; set `JoystickOptions::pid_arrays`",
            ),
            Self::Open { source, .. } => source.raw_os_error().map_or(
                DeviceError::Unavailable("the operating system cannot open it; plug it in again"),
                DeviceError::Os,
            ),
            Self::List(_) => DeviceError::Unavailable(
                "the operating system cannot list its devices; restart the program if the error persists",
            ),
            Self::Option { .. } => {
                DeviceError::Unavailable("an option is out of range; create the device with a valid one")
            }
        }
    }
}

/// The udev rule that lets the logged-in user open the device.
fn rule(vendor: u16, product: u16) -> String {
    format!(
        r#"SUBSYSTEM=="hidraw", ATTRS{{idVendor}}=="{vendor:04x}", ATTRS{{idProduct}}=="{product:04x}", TAG+="uaccess""#
    )
}

/// Ending of a noun for `items`.
fn plural(items: &[String]) -> &'static str {
    if items.len() == 1 { "" } else { "s" }
}

fn hint(teensy: Option<&str>) -> String {
    teensy.map_or_else(String::new, |teensy| {
        format!(
            "; {teensy} may be a 3-DOF board, which its USB IDs do not show: if it is one, set `treat_teensy_as_board` (palpate-lab devices: --teensy-is-board)"
        )
    })
}

fn list(present: &[String]) -> String {
    match present {
        [] => "is no HID device at all".to_owned(),
        [one] => format!("is {one}"),
        several => format!("are {}", several.join(", ")),
    }
}
