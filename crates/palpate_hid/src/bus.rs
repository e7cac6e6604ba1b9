//! Access to HID devices: enumeration, connections, reports.

use crate::{HidError, Usage};
use palpate_haptics::DeviceError;
use std::fmt;
use std::time::Duration;

/// Maximum length of an input report, bytes, including its report ID. The supported devices use at most 64.
pub const MAX_INPUT_REPORT_BYTES: usize = 256;

/// A source of HID devices: the operating system ([`SystemBus`](crate::SystemBus)), or simulated devices (`SimulatedBus` of the
/// feature `simulated`).
pub trait HidBus: Send + Sync + fmt::Debug {
    /// Lists all HID devices that are plugged in. The call may take 0.1 s.
    ///
    /// # Errors
    /// [`HidError`].
    fn list(&self) -> Result<Vec<HidInfo>, HidError>;

    /// Reads the report descriptor of a device.
    ///
    /// # Errors
    /// [`HidError`].
    fn descriptor(&self, info: &HidInfo) -> Result<Vec<u8>, HidError>;

    /// Opens a device for exclusive use.
    ///
    /// # Errors
    /// [`HidError`]; [`HidError::Busy`] where another program or tool has opened the device.
    fn open(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError>;

    /// Opens a second connection to an open device, from which another thread can stop it.
    ///
    /// # Errors
    /// [`HidError`].
    fn open_shared(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError>;
}

impl<B: HidBus + ?Sized> HidBus for std::sync::Arc<B> {
    fn list(&self) -> Result<Vec<HidInfo>, HidError> {
        (**self).list()
    }

    fn descriptor(&self, info: &HidInfo) -> Result<Vec<u8>, HidError> {
        (**self).descriptor(info)
    }

    fn open(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError> {
        (**self).open(info)
    }

    fn open_shared(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError> {
        (**self).open_shared(info)
    }
}

/// An open HID device. Output and feature reports begin with their report ID, which is 0 for a device without report IDs. Input
/// reports begin with it only where the device uses report IDs. Successful calls must not allocate.
pub trait HidConnection: Send {
    /// Copies the oldest unread input report to `report` and returns its length in bytes, or 0 without one. Waits at most `within`, and
    /// not at all if that is below a millisecond.
    ///
    /// # Errors
    /// [`DeviceError::Disconnected`], [`DeviceError::Os`].
    fn read(&mut self, report: &mut [u8], within: Duration) -> Result<usize, DeviceError>;

    /// Sends an output report.
    ///
    /// # Errors
    /// As [`HidConnection::read`].
    fn write(&mut self, report: &[u8]) -> Result<(), DeviceError>;

    /// Reads the feature report with the ID `report[0]` into `report` and returns its length in bytes.
    ///
    /// # Errors
    /// As [`HidConnection::read`].
    fn feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError>;

    /// Sends a feature report.
    ///
    /// # Errors
    /// As [`HidConnection::read`].
    fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError>;
}

/// Description of a HID device by the operating system.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HidInfo {
    /// Path of the device in the operating system. It changes when the device is unplugged and plugged in again.
    pub path: String,
    /// USB vendor ID.
    pub vendor: u16,
    /// USB product ID.
    pub product: u16,
    /// Serial number; empty without one.
    pub serial: String,
    /// Product name.
    pub name: String,
    /// Number of the USB interface, if available.
    pub interface: Option<u8>,
    /// Usages of the top-level collections.
    pub applications: Vec<Usage>,
}

impl HidInfo {
    /// Display name from product name, IDs and serial number; never empty.
    #[must_use]
    pub fn label(&self) -> String {
        let numbers = format!("{:04x}:{:04x}", self.vendor, self.product);
        match (self.name.as_str(), self.serial.as_str()) {
            ("", "") => numbers,
            ("", serial) => format!("{numbers}, serial {serial}"),
            (name, "") => format!("{name} ({numbers})"),
            (name, serial) => format!("{name} ({numbers}, serial {serial})"),
        }
    }

    /// Whether `other` can be the same device at another path: equal IDs, interface and serial number.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        let of = |info: &Self| (info.vendor, info.product, info.interface);
        of(self) == of(other) && self.serial == other.serial
    }
}
