//! Which of the devices that are plugged in, as plain data.

use bevy::prelude::*;

/// A kind of device over HID.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum HidDeviceKind {
    /// An open board with three motors: WoodenHaptics, AluHaptics, Polhem. All have the same numbers on USB; which one it is has to be
    /// said, in the options that `HapticDevices::set_hid_options` takes.
    Board,
    /// A force-feedback joystick with USB's physical interface device class.
    Joystick,
    /// A cap of 3Dconnexion, without motors.
    SpaceMouse,
}

/// Which device over HID. What is not named may be anything.
///
/// ```
/// use bevy_palpate::{DeviceSelector, HidSelector, HidDeviceKind};
///
/// // Any, one with motors before one without.
/// let any = DeviceSelector::Hid(HidSelector::first());
/// let joystick = HidSelector { kind: Some(HidDeviceKind::Joystick), ..HidSelector::first() };
/// let mine = HidSelector { serial: Some("A1B2".into()), ..HidSelector::default() };
/// # assert!(joystick != mine && any == DeviceSelector::Hid(HidSelector::first()));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Default, PartialEq, Hash, Clone)]
pub struct HidSelector {
    /// Its kind.
    pub kind: Option<HidDeviceKind>,
    /// Number of its vendor.
    pub vendor: Option<u16>,
    /// Number of its product.
    pub product: Option<u16>,
    /// Its serial number.
    pub serial: Option<String>,
    /// Where it is, in the operating system's words, for devices without a serial number. It changes when the device is plugged in
    /// anew.
    pub path: Option<String>,
    /// Where several are like that, whether the first that nobody has is meant; without it that is a fault, which lists them.
    pub match_first: bool,
    /// Whether 16C0:0486 is a 3-DOF board. Every sketch for a Teensy with raw HID has these numbers, so that somebody has to say it.
    pub treat_teensy_as_board: bool,
}

impl HidSelector {
    /// The first of any kind: boards before joysticks before caps.
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
