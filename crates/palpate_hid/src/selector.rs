//! Which of the devices that are plugged in.

use crate::{HidBus, HidError, HidInfo, ReportDescriptor, board, joystick, space_mouse};
use std::fmt;

/// A kind of device with a protocol of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum HidKind {
    /// A cap that is pushed and turned, of 3Dconnexion. It has no motors.
    SpaceMouse,
    /// A force-feedback joystick with USB's physical interface device class (PID), two axes.
    Joystick,
    /// An open board with three motors: WoodenHaptics, AluHaptics, Polhem. All have the same numbers, and not all the same linkage:
    /// which it is has to be said, with [`BoardOptions::kinematics`](crate::BoardOptions::kinematics).
    Board,
}

impl HidKind {
    /// All of them; where a device is asked for and no kind is named, the earlier goes before the later.
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

/// What a device must be. What is not named may be anything.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct HidSelector {
    /// Its kind.
    pub kind: Option<HidKind>,
    /// Number of its vendor.
    pub vendor: Option<u16>,
    /// Number of its product.
    pub product: Option<u16>,
    /// Its serial number.
    pub serial: Option<String>,
    /// Where it is, as [`HidInfo::path`]. It changes when the device is plugged in anew.
    pub path: Option<String>,
    /// Where there are several, whether the first is meant and not an error: forces before none (see [`HidKind::ALL`]), then by
    /// path; one that another program or tool has is passed over.
    pub match_first: bool,
    /// Whether 16C0:0486 is a board. Every sketch for a Teensy with raw HID has these numbers, so that somebody has to say it.
    pub treat_teensy_as_board: bool,
}

impl HidSelector {
    /// The first of `kind`.
    #[must_use]
    pub fn first(kind: HidKind) -> Self {
        Self { kind: Some(kind), match_first: true, ..Self::default() }
    }

    /// The first device of any kind, one with motors before one without.
    #[must_use]
    pub fn any() -> Self {
        Self { match_first: true, ..Self::default() }
    }

    fn admits(&self, kind: HidKind, info: &HidInfo) -> bool {
        self.kind.is_none_or(|asked| asked == kind)
            && self.vendor.is_none_or(|vendor| vendor == info.vendor)
            && self.product.is_none_or(|product| product == info.product)
            && self.serial.as_ref().is_none_or(|serial| *serial == info.serial)
            && self.path.as_ref().is_none_or(|path| *path == info.path)
    }

    /// The device that is meant.
    ///
    /// # Errors
    /// [`HidError::NotFound`], [`HidError::Several`], [`HidError::List`].
    pub fn find(&self, bus: &dyn HidBus) -> Result<FoundDevice, HidError> {
        self.find_all(bus).map(|(first, _)| first)
    }

    /// The device that is meant, and, where the first is meant, the others after it in their order.
    pub(crate) fn find_all(&self, bus: &dyn HidBus) -> Result<(FoundDevice, Vec<FoundDevice>), HidError> {
        let present = bus.list()?;
        let mut found: Vec<FoundDevice> = present
            .iter()
            .filter_map(|info| FoundDevice::known(bus, info, self.treat_teensy_as_board))
            .collect();
        found.retain(|found| self.admits(found.kind, &found.info));
        let rank = |found: &FoundDevice| HidKind::ALL.iter().position(|&kind| kind == found.kind);
        found.sort_by(|a, b| rank(a).cmp(&rank(b)).then_with(|| a.info.path.cmp(&b.info.path)));
        if found.len() > 1 && !self.match_first {
            // Those that are alike and have no serial number differ in their paths only.
            let found = found.iter().map(|it| format!("{} at {}", it.info.label(), it.info.path)).collect();
            return Err(HidError::Several { requested: self.to_string(), found });
        }
        let mut found = found.into_iter();
        match found.next() {
            Some(first) => Ok((first, found.collect())),
            None => Err(HidError::NotFound {
                requested: self.to_string(),
                present: present.iter().map(HidInfo::label).collect(),
                teensy: present.iter().find(|info| self.may_mean(info)).map(HidInfo::label),
            }),
        }
    }

    /// Whether `info` is a Teensy that would be meant if it were a board.
    fn may_mean(&self, info: &HidInfo) -> bool {
        !self.treat_teensy_as_board && board::is_one(info, true) && self.admits(HidKind::Board, info)
    }
}

impl fmt::Display for HidSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            Some(kind) => kind.fmt(f)?,
            None => f.write_str("device of a known kind")?,
        }
        if let Some(vendor) = self.vendor {
            write!(f, " of vendor {vendor:04x}")?;
        }
        if let Some(product) = self.product {
            write!(f, " with product number {product:04x}")?;
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

/// A device that is plugged in and known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundDevice {
    /// Its kind.
    pub kind: HidKind,
    /// What the operating system knows of it.
    pub info: HidInfo,
}

impl FoundDevice {
    /// `info` with its kind, if it is of one. The descriptor is looked at only where numbers and applications do not tell.
    #[must_use]
    pub fn known(bus: &dyn HidBus, info: &HidInfo, treat_teensy_as_board: bool) -> Option<Self> {
        let descriptor = || bus.descriptor(info).ok().and_then(|bytes| ReportDescriptor::parse(&bytes).ok());
        let kind = if space_mouse::is_one(info) {
            HidKind::SpaceMouse
        } else if board::is_one(info, treat_teensy_as_board) {
            HidKind::Board
        } else if joystick::may_be_one(info) && descriptor().is_some_and(|it| joystick::is_one(&it)) {
            HidKind::Joystick
        } else {
            return None;
        };
        Some(Self { kind, info: info.clone() })
    }
}
