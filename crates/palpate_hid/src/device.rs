//! A HID device as a haptic device: finding, opening and reopening.

use crate::driver::{Driver, StopCounter, StopReport};
use crate::link::Link;
use crate::{
    BoardCalibration, BoardOptions, Clock, FoundDevice, HidBus, HidConnection, HidCounters, HidError,
    HidInfo, HidKind, HidSelector, JoystickOptions, ReportDescriptor, SpaceMouseOptions, board, clock,
    joystick, space_mouse,
};
use glam::DVec3;
use palpate_haptics::{DeviceDescription, DeviceError, EmergencyStop, HapticDevice, Reading};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// Options for each kind of device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HidOptions {
    /// Options of a SpaceMouse.
    pub space_mouse: SpaceMouseOptions,
    /// Options of a force-feedback joystick.
    pub joystick: JoystickOptions,
    /// Options of a 3-DOF board.
    pub board: BoardOptions,
}

/// A HID device for the haptic loop.
///
/// The constructor looks for the device, so its description is available before it is opened. After the device was unplugged, `open`
/// looks for it at any path, by vendor, product, interface and serial number.
///
/// Without a serial number, `open` takes only a matching device that is new: one that was not present when the device was last found
/// or opened. With several new ones it returns [`DeviceError::Unavailable`] until one is left. It returns the same error for a device
/// whose report descriptor has changed, as after a firmware update, for one without permission, and for one in use by another
/// program. After a firmware update, create a new `HidDevice`.
pub struct HidDevice {
    bus: Arc<dyn HidBus>,
    found: FoundDevice,
    /// Paths of other matching devices when this one was last found.
    other_paths: Vec<String>,
    /// Alternatives to `found` before the first opening, for a selector with `match_first`.
    others: Vec<FoundDevice>,
    driver: Box<dyn Driver>,
    /// Report descriptor from which the driver was created.
    descriptor: Vec<u8>,
    /// Clock; the link owns it while the device is open.
    clock: Option<Box<dyn Clock>>,
    link: Option<Link>,
    counters: HidCounters,
}

impl fmt::Debug for HidDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HidDevice").field("found", &self.found).finish_non_exhaustive()
    }
}

impl HidDevice {
    /// Finds the device that `selector` matches and checks that it can be opened; it is closed again. With `match_first`, devices in use
    /// are skipped.
    ///
    /// # Errors
    /// [`HidError`]: no device matches, several match, the permission is missing, another program uses the device, it lacks what its
    /// driver needs, or an option is out of range.
    pub fn find(
        bus: Arc<dyn HidBus>,
        selector: &HidSelector,
        options: &HidOptions,
    ) -> Result<Self, HidError> {
        let (first, others) = selector.find_all(&*bus)?;
        let mut others = others.into_iter();
        let mut device = match Self::new(Arc::clone(&bus), first, options) {
            // Report the first device if none is free.
            Err(busy @ HidError::Busy { .. }) => {
                let free = others.by_ref().find_map(|it| Self::new(Arc::clone(&bus), it, options).ok());
                free.ok_or(busy)?
            }
            result => result?,
        };
        device.others = others.collect();
        Ok(device)
    }

    /// Creates the device for `found`; otherwise like [`HidDevice::find`].
    ///
    /// # Errors
    /// [`HidError`].
    pub fn new(bus: Arc<dyn HidBus>, found: FoundDevice, options: &HidOptions) -> Result<Self, HidError> {
        let device = || found.info.label();
        let bytes = bus.descriptor(&found.info)?;
        let parsed = ReportDescriptor::parse(&bytes)
            .map_err(|source| HidError::Descriptor { device: device(), source })?;
        let driver = new_driver(found.kind, &found.info, &parsed, options)?;
        drop(bus.open(&found.info)?);
        let counters = HidCounters::default();
        let other_paths = other_paths(&found.info, &bus.list()?);
        let clock = Some(clock::monotonic());
        let others = Vec::new();
        Ok(Self { bus, found, other_paths, others, driver, descriptor: bytes, clock, link: None, counters })
    }

    /// Sets the clock, for tests.
    #[must_use]
    pub fn with_clock(mut self, clock: impl Clock + 'static) -> Self {
        self.clock = Some(Box::new(clock));
        self
    }

    /// The device found by the selector or by the latest `open`.
    #[must_use]
    pub fn found(&self) -> &FoundDevice {
        &self.found
    }

    /// Report statistics. The handle stays valid while the loop owns the device.
    #[must_use]
    pub fn counters(&self) -> HidCounters {
        self.counters.clone()
    }

    /// Whether the firmware is documented to end its force within one second after the controlling program was killed. `false` for a
    /// joystick whose effects cannot have a duration of 0.25 to 1 s, and for a board with reports of 64 bytes, whose firmware is
    /// unpublished.
    #[must_use]
    pub fn has_force_timeout(&self) -> bool {
        self.driver.has_force_timeout()
    }

    /// Calibration handle of a board, which stays valid while the loop owns the device; `None` for other kinds.
    #[must_use]
    pub fn board_calibration(&self) -> Option<BoardCalibration> {
        self.driver.calibration()
    }

    /// Opens a free alternative with the same report descriptor, as the driver has been created already.
    fn open_another(&self) -> Option<(FoundDevice, Box<dyn HidConnection>)> {
        let is_same = |other: &&FoundDevice| {
            other.kind == self.found.kind
                && self.bus.descriptor(&other.info).is_ok_and(|bytes| bytes == self.descriptor)
        };
        let open = |other: &FoundDevice| Some((other.clone(), self.bus.open(&other.info).ok()?));
        self.others.iter().filter(is_same).find_map(open)
    }

    /// Locates the device: at its last path, or at the path of a matching device.
    fn find_again(&mut self) -> Result<FoundDevice, HidError> {
        let present = self.bus.list()?;
        let expected = &self.found.info;
        // The path of an unplugged device may be reassigned to this one.
        self.other_paths.retain(|path| present.iter().any(|info| info.path == *path));
        let here = present.iter().find(|info| info.path == expected.path && info.is_like(expected));
        let info = match here {
            Some(info) => info,
            None => self.moved(&present)?,
        };
        let found = FoundDevice { kind: self.found.kind, info: info.clone() };
        self.other_paths = other_paths(info, &present);
        Ok(found)
    }

    /// The device in `present` that may be this one at another path: the one with the same serial number, or without one the only new
    /// match.
    fn moved<'a>(&self, present: &'a [HidInfo]) -> Result<&'a HidInfo, HidError> {
        let expected = &self.found.info;
        let has_serial = !expected.serial.is_empty();
        let may_be = |info: &&HidInfo| {
            info.is_like(expected) && (has_serial || !self.other_paths.contains(&info.path))
        };
        let found: Vec<&HidInfo> = present.iter().filter(may_be).collect();
        match *found {
            [] => Err(HidError::Gone { device: expected.label() }),
            [one] => Ok(one),
            [first, ..] if has_serial => Ok(first),
            _ => Err(HidError::Several {
                requested: format!("like {}, which has no serial number", expected.label()),
                found: found.iter().map(|info| info.path.clone()).collect(),
            }),
        }
    }
}

/// Paths of the devices in `present` that match `info`, except its own.
fn other_paths(info: &HidInfo, present: &[HidInfo]) -> Vec<String> {
    let others = present.iter().filter(|other| other.path != info.path && other.is_like(info));
    others.map(|other| other.path.clone()).collect()
}

impl HapticDevice for HidDevice {
    fn describe(&self) -> DeviceDescription {
        self.driver.describe()
    }

    fn displayable_force_n(&self, force_n: DVec3) -> DVec3 {
        self.driver.displayed_force_n(force_n)
    }

    fn notice(&self) -> Option<&'static str> {
        self.driver.notice()
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        if self.link.is_some() {
            return Err(DeviceError::AlreadyOpen);
        }
        let mut open = || {
            let found = self.find_again()?;
            if self.bus.descriptor(&found.info)? != self.descriptor {
                return Err(HidError::Changed { device: found.info.label() });
            }
            match self.bus.open(&found.info) {
                Ok(connection) => Ok((found, connection)),
                // Another tool has opened the device in the meantime.
                Err(busy @ HidError::Busy { .. }) => {
                    let (found, connection) = self.open_another().ok_or(busy)?;
                    self.other_paths = other_paths(&found.info, &self.bus.list()?);
                    Ok((found, connection))
                }
                Err(error) => Err(error),
            }
        };
        let opened = open();
        let is_gone = match &opened {
            // Several candidates exist only after the device was unplugged.
            Err(HidError::Gone { .. } | HidError::Several { .. } | HidError::List(_)) => true,
            Err(HidError::Open { source, .. }) => source.raw_os_error().is_none(),
            _ => false,
        };
        let is_elsewhere = opened.as_ref().is_ok_and(|(found, _)| found.info.path != self.found.info.path);
        if is_gone || is_elsewhere {
            self.driver.mark_disconnected();
        }
        let (found, connection) = opened.map_err(|error: HidError| error.for_loop())?;
        self.found = found;
        self.others.clear();
        self.counters.opened();
        let clock = self.clock.take().unwrap_or_else(clock::monotonic);
        let mut link = Link::new(connection, clock, self.counters.clone());
        let started = self.driver.start(&mut link);
        if started.is_err() {
            // Undo a partial start.
            let _ = self.driver.stop(&mut link);
            self.clock = Some(link.into_clock());
        } else {
            self.link = Some(link);
        }
        started
    }

    fn read(&mut self, within: Duration) -> Result<Reading, DeviceError> {
        let link = self.link.as_mut().ok_or(DeviceError::NotOpen)?;
        self.driver.read(link, within)
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        let link = self.link.as_mut().ok_or(DeviceError::NotOpen)?;
        self.driver.write(link, force_n)
    }

    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        let reports = self.driver.stop_reports();
        if reports.is_empty() || self.link.is_none() {
            return None;
        }
        let connection = self.bus.open_shared(&self.found.info).ok()?;
        Some(Box::new(SharedStop { connection, reports, sent: self.driver.stop_counter() }))
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        let mut link = self.link.take().ok_or(DeviceError::NotOpen)?;
        let stopped = self.driver.stop(&mut link);
        self.clock = Some(link.into_clock());
        stopped
    }
}

impl Drop for HidDevice {
    fn drop(&mut self) {
        if self.link.is_some() {
            let _ = self.close();
        }
    }
}

/// Stops a device from another thread through a second connection.
struct SharedStop {
    connection: Box<dyn HidConnection>,
    reports: Vec<StopReport>,
    sent: Option<StopCounter>,
}

impl EmergencyStop for SharedStop {
    fn stop(&mut self) -> Result<(), DeviceError> {
        let mut stopped = Ok(());
        for StopReport { bytes, is_optional } in &self.reports {
            // Send all reports, even if one fails.
            let written = self.connection.write(bytes);
            if let (Ok(()), Some(sent)) = (written, &self.sent) {
                sent.increment();
            }
            if !is_optional {
                stopped = written.and(stopped);
            }
        }
        stopped
    }
}

/// Creates the driver for a device of `kind`.
///
/// # Errors
/// [`HidError::Unsupported`], [`HidError::Option`].
fn new_driver(
    kind: HidKind,
    info: &HidInfo,
    descriptor: &ReportDescriptor,
    options: &HidOptions,
) -> Result<Box<dyn Driver>, HidError> {
    Ok(match kind {
        HidKind::SpaceMouse => space_mouse::driver(info, options.space_mouse)?,
        HidKind::Joystick => joystick::driver(info, descriptor, options.joystick)?,
        HidKind::Board => board::driver(info, descriptor, options.board)?,
    })
}
