//! Devices over HID for the registry.

use super::{HidDeviceKind, HidSelector};
use palpate_hid::{
    BoardCalibration, FoundDevice, HidBus, HidCounters, HidDevice, HidError, HidKind, HidOptions, SystemBus,
};
use std::sync::{Arc, Mutex, PoisonError};

/// Vendor of the Teensy.
const TEENSY: u16 = 0x16C0;

/// The bus, its options, and what the devices have seen.
#[derive(Default)]
pub(super) struct Hid {
    /// The operating system's, from when it is first asked for, or one that was set.
    bus: Mutex<Option<Arc<dyn HidBus>>>,
    pub(super) options: HidOptions,
    /// The newest device that was made by each choice.
    made: Mutex<Vec<(HidSelector, OpenedDevice)>>,
}

/// What is kept of a device that a loop has.
#[derive(Clone)]
pub(super) struct OpenedDevice {
    pub(super) counters: HidCounters,
    pub(super) calibration: Option<BoardCalibration>,
}

impl Hid {
    pub(super) fn set_bus(&mut self, bus: Arc<dyn HidBus>) {
        *self.bus.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(bus);
    }

    fn bus(&self) -> Result<Arc<dyn HidBus>, HidError> {
        let mut bus = self.bus.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bus) = &*bus {
            return Ok(Arc::clone(bus));
        }
        let system: Arc<dyn HidBus> = Arc::new(SystemBus::new()?);
        Ok(Arc::clone(bus.insert(system)))
    }

    pub(super) fn present(&self) -> Result<Vec<(HidSelector, String)>, HidError> {
        let bus = self.bus()?;
        let known = |info| FoundDevice::known(&*bus, info, true);
        // Every sketch for a Teensy with raw HID looks like a board.
        let label = |found: &FoundDevice| match (found.kind, found.info.vendor) {
            (HidKind::Board, TEENSY) => {
                format!("Teensy, a 3-DOF board if you say so: {}", found.info.label())
            }
            (kind, _) => format!("{kind}: {}", found.info.label()),
        };
        let present = bus.list()?;
        let found: Vec<FoundDevice> = present.iter().filter_map(known).collect();
        let numbers = |found: &FoundDevice| (found.info.vendor, found.info.product);
        let is_alike =
            |a: &FoundDevice, b: &FoundDevice| numbers(a) == numbers(b) && a.info.serial == b.info.serial;
        let told = |one: &FoundDevice| {
            let is_alone = found.iter().filter(|other| is_alike(one, other)).count() == 1;
            let (label, path) = (label(one), &one.info.path);
            (HidSelector::of(one, is_alone), if is_alone { label } else { format!("{label} at {path}") })
        };
        Ok(found.iter().map(told).collect())
    }

    pub(super) fn make(&self, choice: &HidSelector) -> Result<HidDevice, HidError> {
        let device = HidDevice::find(self.bus()?, &choice.selector(), &self.options)?;
        let kept = OpenedDevice { counters: device.counters(), calibration: device.board_calibration() };
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        made.retain(|(known, _)| known != choice);
        made.push((choice.clone(), kept));
        Ok(device)
    }

    pub(super) fn opened(&self, choice: &HidSelector) -> Option<OpenedDevice> {
        let made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        made.iter().find(|(known, _)| known == choice).map(|(_, made)| made.clone())
    }
}

impl HidSelector {
    /// Exactly `found`: by its serial number where it has one of its own, otherwise by where it is.
    fn of(found: &FoundDevice, is_alone: bool) -> Self {
        let info = &found.info;
        Self {
            kind: Some(match found.kind {
                HidKind::Board => HidDeviceKind::Board,
                HidKind::Joystick => HidDeviceKind::Joystick,
                HidKind::SpaceMouse => HidDeviceKind::SpaceMouse,
            }),
            vendor: Some(info.vendor),
            product: Some(info.product),
            serial: (!info.serial.is_empty()).then(|| info.serial.clone()),
            path: (info.serial.is_empty() || !is_alone).then(|| info.path.clone()),
            match_first: false,
            treat_teensy_as_board: found.kind == HidKind::Board,
        }
    }

    fn selector(&self) -> palpate_hid::HidSelector {
        palpate_hid::HidSelector {
            kind: self.kind.map(|kind| match kind {
                HidDeviceKind::Board => HidKind::Board,
                HidDeviceKind::Joystick => HidKind::Joystick,
                HidDeviceKind::SpaceMouse => HidKind::SpaceMouse,
            }),
            vendor: self.vendor,
            product: self.product,
            serial: self.serial.clone(),
            path: self.path.clone(),
            match_first: self.match_first,
            treat_teensy_as_board: self.treat_teensy_as_board,
        }
    }
}
