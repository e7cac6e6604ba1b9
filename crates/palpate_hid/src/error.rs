//! Why a HID device cannot be found or used.

use crate::DescriptorError;
use palpate_haptics::DeviceError;
use std::io;
use thiserror::Error;

/// Why a HID device cannot be listed, found, opened or understood.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum HidError {
    /// The operating system does not list its devices.
    #[error("the HID devices cannot be listed: {0}")]
    List(String),
    /// Nothing that is plugged in is what was asked for.
    #[error("no {requested} is plugged in; there {}{}", list(.present), hint(.teensy.as_deref()))]
    NotFound {
        /// What was asked for.
        requested: String,
        /// What there is.
        present: Vec<String>,
        /// A Teensy among it that is what was asked for, if it is a board.
        teensy: Option<String>,
    },
    /// More than one is what was asked for.
    #[error("{} devices are {requested}: {}; name one by its serial number or its path, or ask for the first", .found.len(), .found.join(", "))]
    Several {
        /// What was asked for.
        requested: String,
        /// What there is of it.
        found: Vec<String>,
    },
    /// The user may not open it.
    #[error(
        "{device}: permission to open {path} is denied; on Linux install assets/udev/70-palpate.rules, whose first lines say how, with this line for it if it has none, and plug it in anew: {}",
        rule(*.vendor, *.product)
    )]
    Permission {
        /// Which.
        device: String,
        /// What could not be opened.
        path: String,
        /// Number of its vendor.
        vendor: u16,
        /// Number of its product.
        product: u16,
    },
    /// Another program, or another tool of this one, has it.
    #[error("{device}: another program or tool uses it; one device has one hand")]
    Busy {
        /// Which.
        device: String,
    },
    /// It was unplugged in the meantime.
    #[error("{device}: it is not plugged in any more")]
    Gone {
        /// Which.
        device: String,
    },
    /// The operating system refused for another reason.
    #[error("{device}: it cannot be opened")]
    Open {
        /// Which.
        device: String,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// Its report descriptor breaks the standard.
    #[error("{device}: its report descriptor breaks the standard")]
    Descriptor {
        /// Which.
        device: String,
        /// How.
        #[source]
        source: DescriptorError,
    },
    /// Its report descriptor is another than when it was found: another firmware, or another device that says that it is the same.
    #[error("{device}: its report descriptor is not the one it was found with; choose it anew")]
    Changed {
        /// Which.
        device: String,
    },
    /// It is none of the kinds that are known here, or lacks what a driver needs.
    #[error("{device}: {lacks}")]
    Unsupported {
        /// Which.
        device: String,
        /// What it would need.
        lacks: String,
    },
    /// An option is out of bounds.
    #[error("{what} is {found}; it must be {allowed}")]
    Option {
        /// Which.
        what: &'static str,
        /// What was given.
        found: String,
        /// What is allowed.
        allowed: &'static str,
    },
}

impl HidError {
    /// The same for the loop, which keeps no text. Only what is not plugged in is [`DeviceError::Disconnected`].
    #[must_use]
    pub fn for_loop(&self) -> DeviceError {
        match self {
            Self::NotFound { .. } | Self::Gone { .. } => DeviceError::Disconnected,
            Self::Several { .. } => DeviceError::Unavailable(
                "several are like it, which has no serial number; unplug all but one, or choose it anew by its path",
            ),
            Self::Permission { .. } => DeviceError::Unavailable(
                "permission to open it is denied; on Linux install assets/udev/70-palpate.rules with a line for it and plug it in anew",
            ),
            Self::Busy { .. } => DeviceError::Unavailable("another program or tool uses it; close that one"),
            Self::Changed { .. } => DeviceError::Unavailable(
                "its report descriptor is not the one it was found with; choose it anew",
            ),
            Self::Descriptor { .. } | Self::Unsupported { .. } => {
                DeviceError::Protocol("its report descriptor is not what the driver needs")
            }
            Self::Open { source, .. } => source.raw_os_error().map_or(
                DeviceError::Unavailable("the operating system does not open it; plug it in anew"),
                DeviceError::Os,
            ),
            Self::List(_) => DeviceError::Unavailable(
                "the operating system does not list its devices; restart the program if that stays",
            ),
            Self::Option { .. } => {
                DeviceError::Unavailable("an option is out of bounds; choose it anew with another")
            }
        }
    }
}

/// The line of udev's rules by which who is logged in may open such a device.
fn rule(vendor: u16, product: u16) -> String {
    format!(
        r#"SUBSYSTEM=="hidraw", ATTRS{{idVendor}}=="{vendor:04x}", ATTRS{{idProduct}}=="{product:04x}", TAG+="uaccess""#
    )
}

fn hint(teensy: Option<&str>) -> String {
    teensy.map_or_else(String::new, |teensy| {
        format!(
            "; {teensy} may be a 3-DOF board, which no Teensy can tell: if it is one, say so with `treat_teensy_as_board`, or --teensy-is-board of palpate-lab devices"
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
