//! Selector of HID devices, as plain data.

use bevy::prelude::*;

/// Kind of a HID device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum HidDeviceKind {
    /// An open 3-DOF board: WoodenHaptics, AluHaptics, Polhem. All have the same USB numbers; the options of
    /// `HapticDevices::set_hid_options` select the kinematics.
    Board,
    /// A force-feedback joystick of USB's physical interface device class (PID).
    Joystick,
    /// A 3Dconnexion SpaceMouse, without motors.
    SpaceMouse,
}

/// Selects a connected HID device. A field of `None` matches any device.
///
/// ```
/// use bevy_palpate::{DeviceSelector, HidSelector, HidDeviceKind};
///
/// // The first of any kind, with motors before without.
/// let any = DeviceSelector::Hid(HidSelector::first());
/// let joystick = HidSelector { kind: Some(HidDeviceKind::Joystick), ..HidSelector::first() };
/// let mine = HidSelector { serial: Some("A1B2".into()), ..HidSelector::default() };
/// # assert!(joystick != mine && any == DeviceSelector::Hid(HidSelector::first()));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Default, PartialEq, Hash, Clone)]
pub struct HidSelector {
    /// Kind of the device.
    pub kind: Option<HidDeviceKind>,
    /// USB vendor number.
    pub vendor: Option<u16>,
    /// USB product number.
    pub product: Option<u16>,
    /// Serial number.
    pub serial: Option<String>,
    /// Path given by the operating system, for devices without a serial number. It changes when the device is connected again.
    pub path: Option<String>,
    /// Whether to take the first unused device if several match. Otherwise several matches are a fault that lists them.
    pub match_first: bool,
    /// Whether a device 16C0:0486 is a 3-DOF board. Every Teensy program with raw HID has these numbers, so this must be set explicitly.
    pub treat_teensy_as_board: bool,
}

impl HidSelector {
    /// Selects the first device of any kind: boards before joysticks before SpaceMice.
    #[must_use]
    pub fn first() -> Self {
        Self { match_first: true, ..Self::default() }
    }
}

impl core::fmt::Display for HidDeviceKind {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Board => "3-DOF board",
            Self::Joystick => "force-feedback joystick",
            Self::SpaceMouse => "SpaceMouse",
        })
    }
}

impl core::fmt::Display for HidSelector {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.match_first {
            f.write_str("first ")?;
        }
        match self.kind {
            Some(kind) => kind.fmt(f)?,
            None => f.write_str("HID device")?,
        }
        if let Some(vendor) = self.vendor {
            write!(f, " {vendor:04x}:")?;
            match self.product {
                Some(product) => write!(f, "{product:04x}")?,
                None => f.write_str("*")?,
            }
        }
        if let Some(serial) = &self.serial {
            write!(f, " {serial}")?;
        }
        self.path.as_ref().map_or(Ok(()), |path| write!(f, " at {path}"))
    }
}
