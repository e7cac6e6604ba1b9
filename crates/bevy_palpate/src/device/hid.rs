//! HID devices of the registry.

use super::{HidDeviceKind, HidSelector};
use palpate_hid::{
    BoardCalibration, FoundDevice, HidBus, HidCounters, HidDevice, HidError, HidKind, HidOptions, SystemBus,
};
use std::sync::{Arc, Mutex, PoisonError};

/// USB vendor number of the Teensy.
const TEENSY: u16 = 0x16C0;

/// The bus, the options, and handles of the created devices.
#[derive(Default)]
pub(super) struct Hid {
    /// The bus that was set, or that of the operating system from its first use on.
    bus: Mutex<Option<Arc<dyn HidBus>>>,
    pub(super) options: HidOptions,
    /// The newest device created for each selector.
    created: Mutex<Vec<(HidSelector, CreatedDevice)>>,
}

/// Handles of a device that a loop owns.
#[derive(Clone)]
pub(super) struct CreatedDevice {
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
        let supported = |info| FoundDevice::identify(&*bus, info, true);
        // Every Teensy program with raw HID has the numbers of a board.
        let label = |found: &FoundDevice| match (found.kind, found.info.vendor) {
            (HidKind::Board, TEENSY) => {
                format!("Teensy, possibly a 3-DOF board: {}", found.info.label())
            }
            (kind, _) => format!("{kind}: {}", found.info.label()),
        };
        let present = bus.list()?;
        let found: Vec<FoundDevice> = present.iter().filter_map(supported).collect();
        let numbers = |found: &FoundDevice| (found.info.vendor, found.info.product);
        let is_alike =
            |a: &FoundDevice, b: &FoundDevice| numbers(a) == numbers(b) && a.info.serial == b.info.serial;
        let entry = |one: &FoundDevice| {
            let is_unique = found.iter().filter(|other| is_alike(one, other)).count() == 1;
            let (label, path) = (label(one), &one.info.path);
            (HidSelector::of(one, is_unique), if is_unique { label } else { format!("{label} at {path}") })
        };
        Ok(found.iter().map(entry).collect())
    }

    pub(super) fn make(&self, selector: &HidSelector) -> Result<HidDevice, HidError> {
        let device = HidDevice::find(self.bus()?, &selector.selector(), &self.options)?;
        let newest = CreatedDevice { counters: device.counters(), calibration: device.board_calibration() };
        let mut created = self.created.lock().unwrap_or_else(PoisonError::into_inner);
        created.retain(|(other, _)| other != selector);
        created.push((selector.clone(), newest));
        Ok(device)
    }

    /// The newest device created for `selector`.
    pub(super) fn newest(&self, selector: &HidSelector) -> Option<CreatedDevice> {
        let created = self.created.lock().unwrap_or_else(PoisonError::into_inner);
        created.iter().find(|(other, _)| other == selector).map(|(_, newest)| newest.clone())
    }
}

impl HidSelector {
    /// Selects exactly `found`: by its serial number if it is unique, otherwise by its path.
    fn of(found: &FoundDevice, is_unique: bool) -> Self {
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
            path: (info.serial.is_empty() || !is_unique).then(|| info.path.clone()),
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
