//! A HID device as a haptic device: found, opened, lost and found again.

use crate::driver::{Driver, StopCounter};
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

/// What can be set, for each kind of device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HidOptions {
    /// For a SpaceMouse.
    pub space_mouse: SpaceMouseOptions,
    /// For a force-feedback joystick.
    pub joystick: JoystickOptions,
    /// For a 3-DOF board.
    pub board: BoardOptions,
}

/// A HID device that gives samples and takes forces.
///
/// It is looked for when this is made, so that what it is and can do is known before it is opened. When it has been unplugged the
/// next `open` looks for the same one (vendor, product, interface, serial number), wherever it is plugged in by then. Without a
/// serial number that is the only device like it that is new: none that was there beside it when it was last found or opened, and
/// none at all where there are several; until one is left `open` says [`DeviceError::Unavailable`]. So it does of one whose report
/// descriptor is another by then, as after an update of its firmware: make this anew; and of one that may not be opened, or that
/// another program has.
pub struct HidDevice {
    bus: Arc<dyn HidBus>,
    found: FoundDevice,
    /// Where devices like it were when it was last found, which are others.
    beside: Vec<String>,
    /// Until it is opened: those that would do as well, where the first of several was meant.
    others: Vec<FoundDevice>,
    driver: Box<dyn Driver>,
    /// The bytes of the report descriptor that the driver was made from.
    descriptor: Vec<u8>,
    /// Here while it is closed.
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
    /// Looks for the device that `selector` means and sees whether it can be opened; it is closed again. Where the first is meant and
    /// another program or tool has it, it is the next one.
    ///
    /// # Errors
    /// [`HidError`]: it is not there, there are several, it may not be opened, another program has it, it lacks what its driver
    /// needs, or an option is out of bounds.
    pub fn find(
        bus: Arc<dyn HidBus>,
        selector: &HidSelector,
        options: &HidOptions,
    ) -> Result<Self, HidError> {
        let (first, others) = selector.find_all(&*bus)?;
        let mut others = others.into_iter();
        let mut device = match Self::new(Arc::clone(&bus), first, options) {
            // Where none is free the first is the one to be told of.
            Err(busy @ HidError::Busy { .. }) => {
                let free = others.by_ref().find_map(|it| Self::new(Arc::clone(&bus), it, options).ok());
                free.ok_or(busy)?
            }
            made => made?,
        };
        device.others = others.collect();
        Ok(device)
    }

    /// The device `found`; otherwise as [`HidDevice::find`].
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
        let beside = beside(&found.info, &bus.list()?);
        let clock = Some(clock::monotonic());
        let others = Vec::new();
        Ok(Self { bus, found, beside, others, driver, descriptor: bytes, clock, link: None, counters })
    }

    /// The same with another clock, for tests.
    #[must_use]
    pub fn with_clock(mut self, clock: impl Clock + 'static) -> Self {
        self.clock = Some(Box::new(clock));
        self
    }

    /// Which device it is.
    #[must_use]
    pub fn found(&self) -> &FoundDevice {
        &self.found
    }

    /// What has been seen of it: kept by whoever asks, also while the loop has the device.
    #[must_use]
    pub fn counters(&self) -> HidCounters {
        self.counters.clone()
    }

    /// Whether it is known to end its force by itself, within a second, when the program that drives it is killed. It is not of a
    /// joystick for whose effects no duration of 0.25 to 1 s can be written, and of a board with reports of 64 bytes, whose firmware has
    /// not been published.
    #[must_use]
    pub fn ends_by_itself(&self) -> bool {
        self.driver.ends_by_itself()
    }

    /// A way to have a board calibrated, also while the loop has the device; `None` for other kinds.
    #[must_use]
    pub fn board_calibration(&self) -> Option<BoardCalibration> {
        self.driver.calibration()
    }

    /// One of those that would do as well and that nobody has. Its reports have to be the same, as the driver is made already.
    fn open_another(&self) -> Option<(FoundDevice, Box<dyn HidConnection>)> {
        let is_same = |other: &&FoundDevice| {
            other.kind == self.found.kind
                && self.bus.descriptor(&other.info).is_ok_and(|bytes| bytes == self.descriptor)
        };
        let open = |other: &FoundDevice| Some((other.clone(), self.bus.open(&other.info).ok()?));
        self.others.iter().filter(is_same).find_map(open)
    }

    /// Where the device is now: where it was, or where one like it is that may be it.
    fn find_again(&mut self) -> Result<FoundDevice, HidError> {
        let present = self.bus.list()?;
        let known = &self.found.info;
        // A path from which a device was unplugged is free, and may be given to this one.
        self.beside.retain(|path| present.iter().any(|info| info.path == *path));
        let here = present.iter().find(|info| info.path == known.path && info.is_like(known));
        let info = match here {
            Some(info) => info,
            None => self.moved(&present)?,
        };
        let found = FoundDevice { kind: self.found.kind, info: info.clone() };
        self.beside = beside(info, &present);
        Ok(found)
    }

    /// The one of `present` that may be the device at another path. A serial number tells; without one it is none of those that were
    /// there before.
    fn moved<'a>(&self, present: &'a [HidInfo]) -> Result<&'a HidInfo, HidError> {
        let known = &self.found.info;
        let has_serial = !known.serial.is_empty();
        let may_be =
            |info: &&HidInfo| info.is_like(known) && (has_serial || !self.beside.contains(&info.path));
        let found: Vec<&HidInfo> = present.iter().filter(may_be).collect();
        match *found {
            [] => Err(HidError::Gone { device: known.label() }),
            [one] => Ok(one),
            [first, ..] if has_serial => Ok(first),
            _ => Err(HidError::Several {
                requested: format!("like {}, which has no serial number", known.label()),
                found: found.iter().map(|info| info.path.clone()).collect(),
            }),
        }
    }
}

/// Where the devices of `present` are that are like `info`, and are others.
fn beside(info: &HidInfo, present: &[HidInfo]) -> Vec<String> {
    let others = present.iter().filter(|other| other.path != info.path && other.is_like(info));
    others.map(|other| other.path.clone()).collect()
}

impl HapticDevice for HidDevice {
    fn describe(&self) -> DeviceDescription {
        self.driver.describe()
    }

    fn quantized_force_n(&self, force_n: DVec3) -> DVec3 {
        self.driver.displayed_force_n(force_n)
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
                // Another tool that meant the first was faster.
                Err(busy @ HidError::Busy { .. }) => {
                    let (found, connection) = self.open_another().ok_or(busy)?;
                    self.beside = beside(&found.info, &self.bus.list()?);
                    Ok((found, connection))
                }
                Err(error) => Err(error),
            }
        };
        let opened = open();
        let is_gone = match &opened {
            // Where several may be it, it was unplugged.
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
            // What it has begun must not stay.
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

/// Stops a device from another thread.
struct SharedStop {
    connection: Box<dyn HidConnection>,
    reports: Vec<Vec<u8>>,
    sent: Option<StopCounter>,
}

impl EmergencyStop for SharedStop {
    fn stop(&mut self) -> Result<(), DeviceError> {
        let mut stopped = Ok(());
        for report in &self.reports {
            // Each of them, even if one fails.
            let written = self.connection.write(report);
            if let (Ok(()), Some(sent)) = (written, &self.sent) {
                sent.note();
            }
            stopped = written.and(stopped);
        }
        stopped
    }
}

/// The driver for a device of `kind`.
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
