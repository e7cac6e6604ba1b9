//! The operating system's HID devices, by way of `hidapi`.

use crate::{HidBus, HidConnection, HidError, HidInfo, MAX_DESCRIPTOR_BYTES, Usage};
use hidapi::HidApi;
use palpate_haptics::DeviceError;
use std::ffi::CString;
use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The operating system's HID devices.
pub struct SystemBus {
    api: Mutex<HidApi>,
}

impl fmt::Debug for SystemBus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SystemBus").finish_non_exhaustive()
    }
}

impl SystemBus {
    /// Makes ready to list and open.
    ///
    /// # Errors
    /// [`HidError::List`].
    pub fn new() -> Result<Self, HidError> {
        let api = HidApi::new().map_err(|error| HidError::List(error.to_string()))?;
        Ok(Self { api: Mutex::new(api) })
    }

    fn connect(&self, info: &HidInfo, is_alone: bool) -> Result<Box<dyn HidConnection>, HidError> {
        let held = hold(info, is_alone)?;
        let path = CString::new(info.path.as_str()).map_err(|error| open_error(info, error.into()))?;
        let api = self.api.lock().unwrap_or_else(PoisonError::into_inner);
        let device =
            api.open_path(&path).map_err(|error| open_error(info, io::Error::other(error.to_string())))?;
        Ok(Box::new(SystemConnection { device, _held: held }))
    }
}

/// The device's file with a lock on it if it is to be had alone: hidraw itself lets any number of programs write forces. On other
/// systems, where the path names no file, the operating system keeps others out or nothing does.
#[cfg(target_os = "linux")]
fn hold(info: &HidInfo, is_alone: bool) -> Result<Option<File>, HidError> {
    use std::fs::TryLockError;
    // Read and write, so that a lack of either permission is noticed here.
    let file =
        File::options().read(true).write(true).open(&info.path).map_err(|error| open_error(info, error))?;
    if is_alone {
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(HidError::Busy { device: info.label() }),
            Err(TryLockError::Error(error)) => return Err(open_error(info, error)),
        }
    }
    Ok(Some(file))
}

#[cfg(not(target_os = "linux"))]
fn hold(_: &HidInfo, _: bool) -> Result<Option<File>, HidError> {
    Ok(None)
}

fn open_error(info: &HidInfo, source: io::Error) -> HidError {
    let device = info.label();
    match source.kind() {
        ErrorKind::PermissionDenied => {
            let HidInfo { path, vendor, product, .. } = info.clone();
            HidError::Permission { device, path, vendor, product }
        }
        ErrorKind::NotFound => HidError::Gone { device },
        ErrorKind::ResourceBusy => HidError::Busy { device },
        // No such device: its file is still there and it is not.
        _ if matches!(source.raw_os_error(), Some(NO_DEVICE | NO_ADDRESS)) => HidError::Gone { device },
        _ => HidError::Open { device, source },
    }
}

impl HidBus for SystemBus {
    fn list(&self) -> Result<Vec<HidInfo>, HidError> {
        let mut api = self.api.lock().unwrap_or_else(PoisonError::into_inner);
        api.refresh_devices().map_err(|error| HidError::List(error.to_string()))?;
        let mut infos: Vec<HidInfo> = Vec::new();
        // One entry for each collection at the top.
        for entry in api.device_list() {
            let path = entry.path().to_string_lossy().into_owned();
            let application = Usage::new(entry.usage_page(), entry.usage());
            if let Some(known) = infos.iter_mut().find(|info| info.path == path) {
                known.applications.push(application);
                continue;
            }
            infos.push(HidInfo {
                path,
                vendor: entry.vendor_id(),
                product: entry.product_id(),
                serial: entry.serial_number().unwrap_or_default().to_owned(),
                name: entry.product_string().unwrap_or_default().trim().to_owned(),
                interface: u8::try_from(entry.interface_number()).ok(),
                applications: vec![application],
            });
        }
        infos.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(infos)
    }

    fn descriptor(&self, info: &HidInfo) -> Result<Vec<u8>, HidError> {
        // Linux shows it to everyone, so that a device is known before it may be opened.
        #[cfg(target_os = "linux")]
        if let Some(node) = info.path.strip_prefix("/dev/") {
            let shown = format!("/sys/class/hidraw/{node}/device/report_descriptor");
            if let Ok(bytes) = std::fs::read(shown) {
                return Ok(bytes);
            }
        }
        let path = CString::new(info.path.as_str()).map_err(|error| open_error(info, error.into()))?;
        let other = |error: hidapi::HidError| open_error(info, io::Error::other(error.to_string()));
        let api = self.api.lock().unwrap_or_else(PoisonError::into_inner);
        let device = api.open_path(&path).map_err(other)?;
        let mut bytes = vec![0; MAX_DESCRIPTOR_BYTES];
        let length = device.get_report_descriptor(&mut bytes).map_err(other)?;
        bytes.truncate(length);
        Ok(bytes)
    }

    fn open(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError> {
        self.connect(info, true)
    }

    fn open_shared(&self, info: &HidInfo) -> Result<Box<dyn HidConnection>, HidError> {
        self.connect(info, false)
    }
}

/// A device that is open.
struct SystemConnection {
    device: hidapi::HidDevice,
    /// Its lock, for as long as it is open.
    _held: Option<File>,
}

/// Error numbers of Linux: no such device; no such device or address.
const NO_DEVICE: i32 = 19;
const NO_ADDRESS: i32 = 6;

/// The same for the loop. What has no number of the operating system's is a device that is gone: `hidapi` says that in words.
fn for_loop(error: &hidapi::HidError) -> DeviceError {
    match error {
        hidapi::HidError::IoError { error } => match error.raw_os_error() {
            Some(NO_DEVICE | NO_ADDRESS) | None => DeviceError::Disconnected,
            Some(number) => DeviceError::Os(number),
        },
        hidapi::HidError::InvalidZeroSizeData | hidapi::HidError::IncompleteSendError { .. } => {
            DeviceError::Protocol("a report was not taken whole")
        }
        _ => DeviceError::Disconnected,
    }
}

/// As [`for_loop`]; a device that is there may refuse a feature report.
fn feature_error(error: &hidapi::HidError) -> DeviceError {
    match error {
        hidapi::HidError::HidApiError { message } if !message.contains("ENODEV") => {
            DeviceError::Protocol("it refused a feature report")
        }
        error => for_loop(error),
    }
}

/// Whether a signal came in between, which says nothing of the device.
fn is_interrupted(error: &hidapi::HidError) -> bool {
    matches!(error, hidapi::HidError::IoError { error } if error.kind() == ErrorKind::Interrupted)
}

/// How many bytes have come: none where a signal came first.
fn come(read: Result<usize, hidapi::HidError>) -> Result<usize, DeviceError> {
    match read {
        Err(error) if is_interrupted(&error) => Ok(0),
        read => read.map_err(|error| for_loop(&error)),
    }
}

/// Sends by `write`, once more where a signal came first.
fn send(mut write: impl FnMut() -> Result<usize, hidapi::HidError>) -> Result<(), DeviceError> {
    let sent = match write() {
        Err(error) if is_interrupted(&error) => write(),
        sent => sent,
    };
    // How much of it counts as sent differs between systems where there is no number.
    sent.map(|_| ()).map_err(|error| for_loop(&error))
}

impl HidConnection for SystemConnection {
    fn read(&mut self, report: &mut [u8], within: Duration) -> Result<usize, DeviceError> {
        let within_ms = i32::try_from(within.as_millis()).unwrap_or(i32::MAX);
        come(self.device.read_timeout(report, within_ms))
    }

    fn write(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        send(|| self.device.write(report))
    }

    fn feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError> {
        self.device.get_feature_report(report).map_err(|error| feature_error(&error))
    }

    fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.device.send_feature_report(report).map_err(|error| feature_error(&error))
    }
}

#[cfg(all(test, target_os = "linux"))]
mod test {
    use super::*;

    fn os(number: i32) -> hidapi::HidError {
        hidapi::HidError::IoError { error: io::Error::from_raw_os_error(number) }
    }

    /// A timer's or a profiler's signal.
    const INTERRUPTED: i32 = 4;
    const IO: i32 = 5;

    /// What the operating system says of a file that may not be opened, that is in use, that is gone, and else.
    #[test]
    fn why_it_cannot_be_opened_is_told_with_what_to_do() {
        let info = HidInfo {
            path: "/dev/hidraw7".into(),
            vendor: 0x1234,
            product: 0xBEAD,
            name: "Stick".into(),
            ..HidInfo::default()
        };
        let told = |number| open_error(&info, io::Error::from_raw_os_error(number));
        let (access, busy) = (told(13), told(16));
        let text = access.to_string();
        let rule =
            r#"SUBSYSTEM=="hidraw", ATTRS{idVendor}=="1234", ATTRS{idProduct}=="bead", TAG+="uaccess""#;
        assert!(text.starts_with("Stick (1234:bead): permission to open /dev/hidraw7 is denied"), "{text}");
        assert!(text.ends_with(rule), "{text}");
        // It is a line of the same form as those that are installed.
        let known = include_str!("../../../assets/udev/70-palpate.rules");
        assert!(known.contains(&rule.replace("bead", "0006")), "{known}");
        assert!(matches!(&busy, HidError::Busy { device } if device == "Stick (1234:bead)"), "{busy}");
        assert!(busy.to_string().contains("another program or tool uses it"), "{busy}");
        assert!(matches!(told(2), HidError::Gone { .. }) && matches!(told(NO_DEVICE), HidError::Gone { .. }));
        assert!(matches!(told(INTERRUPTED), HidError::Open { .. }));
        // The loop keeps the reason.
        for (error, reason) in [(access, "permission"), (busy, "another program")] {
            let DeviceError::Unavailable(told) = error.for_loop() else { panic!("{error}") };
            assert!(told.contains(reason), "{told}");
        }
        assert_eq!(told(INTERRUPTED).for_loop(), DeviceError::Os(INTERRUPTED));
        assert_eq!(told(2).for_loop(), DeviceError::Disconnected);
    }

    #[test]
    fn a_signal_is_no_failure_of_the_device() {
        assert_eq!(come(Err(os(INTERRUPTED))), Ok(0));
        assert_eq!(come(Err(os(IO))), Err(DeviceError::Os(IO)));
        assert_eq!(come(Err(os(NO_DEVICE))), Err(DeviceError::Disconnected));
        assert_eq!(come(Ok(7)), Ok(7));
        // Writes that fail with these, one after the other: what comes of it, and how many there were.
        for (fails, sent, writes) in [
            (&[][..], Ok(()), 1),
            (&[INTERRUPTED][..], Ok(()), 2),
            (&[INTERRUPTED, INTERRUPTED], Err(DeviceError::Os(INTERRUPTED)), 2),
            (&[INTERRUPTED, IO], Err(DeviceError::Os(IO)), 2),
            (&[IO, IO], Err(DeviceError::Os(IO)), 1),
        ] {
            let mut count = 0;
            let told = send(|| {
                count += 1;
                fails.get(count - 1).map_or(Ok(8), |&number| Err(os(number)))
            });
            assert_eq!((told, count), (sent, writes), "{fails:?}");
        }
    }
}
