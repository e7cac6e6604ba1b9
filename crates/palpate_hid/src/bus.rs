//! HID devices as the operating system shows them: listed, opened, read and written.

use crate::{HidError, Usage};
use palpate_haptics::DeviceError;
use std::fmt;
use std::time::Duration;

/// The longest input report that is read, bytes, its number included. Those of the devices known here have 64.
pub const MAX_INPUT_REPORT_BYTES: usize = 256;

/// Where HID devices come from: the operating system ([`SystemBus`](crate::SystemBus)), or a stand-in for tests
/// ([`SimulatedBus`](crate::SimulatedBus)).
pub trait HidBus: Send + Sync + fmt::Debug {
    /// What is plugged in, of every kind. It may take a tenth of a second.
    ///
    /// # Errors
    /// [`HidError`].
    fn list(&self) -> Result<Vec<HidInfo>, HidError>;

    /// The report descriptor of one of them.
    ///
    /// # Errors
    /// [`HidError`].
    fn descriptor(&self, info: &HidInfo) -> Result<Vec<u8>, HidError>;

    /// Opens one for a driver, which then has it alone.
    ///
    /// # Errors
    /// [`HidError`], among them [`HidError::Busy`].
    fn open(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError>;

    /// A second way to one that is open, by which another thread can stop it.
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

/// An open HID device. Output and feature reports begin with their number, 0 where the device's reports have none; input reports
/// begin with it only where there is one. Nothing here may allocate while all is well.
pub trait HidConnection: Send {
    /// The oldest input report that has not been read, waiting `within` for it at most, and not at all where that is less than a
    /// millisecond. How many bytes of `report` it fills, 0 when there is none.
    ///
    /// # Errors
    /// [`DeviceError::Disconnected`], [`DeviceError::Os`].
    fn read(&mut self, report: &mut [u8], within: Duration) -> Result<usize, DeviceError>;

    /// Sends an output report.
    ///
    /// # Errors
    /// As [`HidConnection::read`].
    fn write(&mut self, report: &[u8]) -> Result<(), DeviceError>;

    /// Asks for the feature report whose number is `report[0]`, and how many bytes of `report` it fills.
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

/// What the operating system knows of a HID device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HidInfo {
    /// Where it is, in the operating system's words; another one after it has been plugged in anew.
    pub path: String,
    /// Number of its vendor.
    pub vendor: u16,
    /// Number of its product.
    pub product: u16,
    /// Its serial number; empty where it has none.
    pub serial: String,
    /// The name that it gives itself.
    pub name: String,
    /// Which of its USB interfaces this is, where that is known.
    pub interface: Option<u8>,
    /// What its collections at the top are.
    pub applications: Vec<Usage>,
}

impl HidInfo {
    /// A name for people, never empty.
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

    /// Whether it may be the same device as `other`, plugged in anew.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        let of = |info: &Self| (info.vendor, info.product, info.interface);
        of(self) == of(other) && self.serial == other.serial
    }
}
