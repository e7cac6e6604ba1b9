//! Selection among the devices that are plugged in.

use crate::{HidBus, HidError, HidInfo, ReportDescriptor, board, joystick, space_mouse};
use std::fmt;

/// A kind of device, with a driver of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum HidKind {
    /// 3Dconnexion SpaceMouse: a cap with six axes, without motors.
    SpaceMouse,
    /// Force-feedback joystick with two axes, USB physical interface device class (PID).
    Joystick,
    /// Open board with three motors: WoodenHaptics, AluHaptics, Polhem. Their USB IDs are equal and their linkages differ: set
    /// [`BoardOptions::kinematics`](crate::BoardOptions::kinematics).
    Board,
}

impl HidKind {
    /// All kinds, in the order of preference of a selector without a kind.
    pub const ALL: [Self; 3] = [Self::Board, Self::Joystick, Self::SpaceMouse];
}

impl fmt::Display for HidKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SpaceMouse => "SpaceMouse",
            Self::Joystick => "force-feedback joystick",
            Self::Board => "3-DOF board",
        })
    }
}

/// Criteria for a device; `None` matches everything.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct HidSelector {
    /// Kind of the device.
    pub kind: Option<HidKind>,
    /// USB vendor ID.
    pub vendor: Option<u16>,
    /// USB product ID.
    pub product: Option<u16>,
    /// Serial number.
    pub serial: Option<String>,
    /// Path, as [`HidInfo::path`]. It changes when the device is unplugged and plugged in again.
    pub path: Option<String>,
    /// Whether to use the first of several matching devices instead of returning an error. Devices are ordered by kind (see
    /// [`HidKind::ALL`]), then by path; devices in use are skipped.
    pub match_first: bool,
    /// Whether a device with the IDs 16C0:0486 is a board. Every Teensy sketch with raw HID has these IDs.
    pub treat_teensy_as_board: bool,
}

impl HidSelector {
    /// Matches the first device of `kind`.
    #[must_use]
    pub fn first(kind: HidKind) -> Self {
        Self { kind: Some(kind), match_first: true, ..Self::default() }
    }

    /// Matches the first device of any kind; devices with motors come first.
    #[must_use]
    pub fn any() -> Self {
        Self { match_first: true, ..Self::default() }
    }

    fn matches(&self, kind: HidKind, info: &HidInfo) -> bool {
        self.kind.is_none_or(|required| required == kind)
            && self.vendor.is_none_or(|vendor| vendor == info.vendor)
            && self.product.is_none_or(|product| product == info.product)
            && self.serial.as_ref().is_none_or(|serial| *serial == info.serial)
            && self.path.as_ref().is_none_or(|path| *path == info.path)
    }

    /// Finds the matching device.
    ///
    /// # Errors
    /// [`HidError::NotFound`], [`HidError::Several`], [`HidError::List`].
    pub fn find(&self, bus: &dyn HidBus) -> Result<FoundDevice, HidError> {
        self.find_all(bus).map(|(first, _)| first)
    }

    /// Finds the matching device, and the further matches in their order if `match_first` is set.
    pub(crate) fn find_all(&self, bus: &dyn HidBus) -> Result<(FoundDevice, Vec<FoundDevice>), HidError> {
        let present = bus.list()?;
        let mut found: Vec<FoundDevice> = present
            .iter()
            .filter_map(|info| FoundDevice::identify(bus, info, self.treat_teensy_as_board))
            .collect();
        found.retain(|found| self.matches(found.kind, &found.info));
        let rank = |found: &FoundDevice| HidKind::ALL.iter().position(|&kind| kind == found.kind);
        found.sort_by(|a, b| rank(a).cmp(&rank(b)).then_with(|| a.info.path.cmp(&b.info.path)));
        if found.len() > 1 && !self.match_first {
            // Equal devices without serial number differ only in their paths.
            let found = found.iter().map(|it| format!("{} at {}", it.info.label(), it.info.path)).collect();
            return Err(HidError::Several { requested: self.to_string(), found });
        }
        let mut found = found.into_iter();
        match found.next() {
            Some(first) => Ok((first, found.collect())),
            None => Err(HidError::NotFound {
                requested: self.to_string(),
                present: present.iter().map(HidInfo::label).collect(),
                teensy: present.iter().find(|info| self.may_be_board(info)).map(HidInfo::label),
            }),
        }
    }

    /// Whether `info` is a Teensy that would match if it were treated as a board.
    fn may_be_board(&self, info: &HidInfo) -> bool {
        !self.treat_teensy_as_board && board::is_board(info, true) && self.matches(HidKind::Board, info)
    }
}

impl fmt::Display for HidSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            Some(kind) => kind.fmt(f)?,
            None => f.write_str("supported device")?,
        }
        if let Some(vendor) = self.vendor {
            write!(f, " of vendor {vendor:04x}")?;
        }
        if let Some(product) = self.product {
            write!(f, " with product ID {product:04x}")?;
        }
        if let Some(serial) = &self.serial {
            write!(f, " with serial number {serial}")?;
        }
        if let Some(path) = &self.path {
            write!(f, " at {path}")?;
        }
        Ok(())
    }
}

/// A supported device that is plugged in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundDevice {
    /// Kind of the device.
    pub kind: HidKind,
    /// Description by the operating system.
    pub info: HidInfo,
}

impl FoundDevice {
    /// Identifies the kind of `info`; `None` for an unsupported device. The report descriptor is read only where IDs and usages are not
    /// sufficient.
    #[must_use]
    pub fn identify(bus: &dyn HidBus, info: &HidInfo, treat_teensy_as_board: bool) -> Option<Self> {
        let descriptor = || bus.descriptor(info).ok().and_then(|bytes| ReportDescriptor::parse(&bytes).ok());
        let kind = if space_mouse::is_space_mouse(info) {
            HidKind::SpaceMouse
        } else if board::is_board(info, treat_teensy_as_board) {
            HidKind::Board
        } else if joystick::may_be_joystick(info)
            && descriptor().is_some_and(|it| joystick::has_constant_force(&it))
        {
            HidKind::Joystick
        } else {
            return None;
        };
        Some(Self { kind, info: info.clone() })
    }
}
