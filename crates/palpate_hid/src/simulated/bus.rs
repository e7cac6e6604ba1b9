//! A HID bus in memory.

use super::Firmware;
use crate::{HidBus, HidConnection, HidError, HidInfo};
use palpate_haptics::DeviceError;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A HID bus in memory, with devices that the program plugs in.
#[derive(Default)]
pub struct SimulatedBus {
    plugged: Mutex<Vec<Plugged>>,
}

impl fmt::Debug for SimulatedBus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plugged = self.plugged.lock().unwrap_or_else(PoisonError::into_inner);
        f.debug_list().entries(plugged.iter().map(|it| &it.info)).finish()
    }
}

#[derive(Clone)]
struct Plugged {
    info: HidInfo,
    descriptor: Vec<u8>,
    firmware: Arc<Mutex<dyn Firmware>>,
    is_plugged: Arc<AtomicBool>,
    is_open: Arc<AtomicBool>,
}

impl SimulatedBus {
    /// Plugs a device in at `info.path` and replaces the one there.
    pub fn plug(&self, info: HidInfo, descriptor: Vec<u8>, firmware: impl Firmware + 'static) {
        self.unplug(&info.path);
        let plugged = Plugged {
            info,
            descriptor,
            firmware: Arc::new(Mutex::new(firmware)),
            is_plugged: Arc::new(AtomicBool::new(true)),
            is_open: Arc::default(),
        };
        self.plugged.lock().unwrap_or_else(PoisonError::into_inner).push(plugged);
    }

    /// Unplugs the device at `path`, open or closed. Returns whether there was one.
    pub fn unplug(&self, path: &str) -> bool {
        let mut plugged = self.plugged.lock().unwrap_or_else(PoisonError::into_inner);
        let before = plugged.len();
        plugged.retain(|it| {
            let stays = it.info.path != path;
            it.is_plugged.store(stays, Ordering::Release);
            stays
        });
        plugged.len() < before
    }

    fn at(&self, info: &HidInfo) -> Result<Plugged, HidError> {
        let plugged = self.plugged.lock().unwrap_or_else(PoisonError::into_inner);
        let found = plugged.iter().find(|it| it.info.path == info.path).cloned();
        found.ok_or_else(|| HidError::Gone { device: info.label() })
    }
}

impl HidBus for SimulatedBus {
    fn list(&self) -> Result<Vec<HidInfo>, HidError> {
        let plugged = self.plugged.lock().unwrap_or_else(PoisonError::into_inner);
        let mut infos: Vec<HidInfo> = plugged.iter().map(|it| it.info.clone()).collect();
        infos.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(infos)
    }

    fn descriptor(&self, info: &HidInfo) -> Result<Vec<u8>, HidError> {
        Ok(self.at(info)?.descriptor)
    }

    fn open(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError> {
        let plugged = self.at(info)?;
        if plugged.is_open.swap(true, Ordering::AcqRel) {
            return Err(HidError::Busy { device: info.label() });
        }
        Ok(Box::new(SimulatedConnection { plugged, is_exclusive: true }))
    }

    fn open_shared(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError> {
        Ok(Box::new(SimulatedConnection { plugged: self.at(info)?, is_exclusive: false }))
    }
}

struct SimulatedConnection {
    plugged: Plugged,
    is_exclusive: bool,
}

impl SimulatedConnection {
    fn firmware<T>(&mut self, operation: impl FnOnce(&mut dyn Firmware) -> T) -> Result<T, DeviceError> {
        if !self.plugged.is_plugged.load(Ordering::Acquire) {
            return Err(DeviceError::Disconnected);
        }
        Ok(operation(&mut *self.plugged.firmware.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

impl Drop for SimulatedConnection {
    fn drop(&mut self) {
        if self.is_exclusive {
            self.plugged.is_open.store(false, Ordering::Release);
        }
    }
}

impl HidConnection for SimulatedConnection {
    fn read(&mut self, report: &mut [u8], _: Duration) -> Result<usize, DeviceError> {
        self.firmware(|firmware| firmware.input(report))
    }

    fn write(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        let is_accepted = self.firmware(|firmware| firmware.output(report))?;
        if is_accepted { Ok(()) } else { Err(DeviceError::Protocol("the device rejected an output report")) }
    }

    fn feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError> {
        match self.firmware(|firmware| firmware.feature(report))? {
            0 => Err(DeviceError::Protocol("the device rejected a feature report")),
            length => Ok(length),
        }
    }

    fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        let is_accepted = self.firmware(|firmware| firmware.set_feature(report))?;
        if is_accepted { Ok(()) } else { Err(DeviceError::Protocol("the device rejected a feature report")) }
    }
}
