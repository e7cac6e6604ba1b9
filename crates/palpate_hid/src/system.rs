//! HID devices of the operating system, through `hidapi`.

use crate::{HidBus, HidConnection, HidError, HidInfo, MAX_DESCRIPTOR_BYTES, Usage};
use hidapi::HidApi;
use palpate_haptics::DeviceError;
use std::ffi::CString;
use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// HID devices of the operating system.
pub struct SystemBus {
    api: Mutex<HidApi>,
}

impl fmt::Debug for SystemBus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SystemBus").finish_non_exhaustive()
    }
}

impl SystemBus {
    /// Initialises `hidapi`.
    ///
    /// # Errors
    /// [`HidError::List`].
    pub fn new() -> Result<Self, HidError> {
        let api = HidApi::new().map_err(|error| HidError::List(error.to_string()))?;
        Ok(Self { api: Mutex::new(api) })
    }

    fn connect(&self, info: &HidInfo, is_exclusive: bool) -> Result<Box<dyn HidConnection>, HidError> {
        let lock = lock(info, is_exclusive)?;
        let path = CString::new(info.path.as_str()).map_err(|error| open_error(info, error.into()))?;
        let api = self.api.lock().unwrap_or_else(PoisonError::into_inner);
        let device =
            api.open_path(&path).map_err(|error| open_error(info, io::Error::other(error.to_string())))?;
        Ok(Box::new(SystemConnection { device, _lock: lock }))
    }
}

/// Opens the device file, locked for exclusive use: hidraw itself lets any number of programs write forces. On other systems the path
/// names no file, and exclusive access depends on the operating system.
#[cfg(target_os = "linux")]
fn lock(info: &HidInfo, is_exclusive: bool) -> Result<Option<File>, HidError> {
    use std::fs::TryLockError;
    // Open for reading and writing, which checks both permissions.
    let file =
        File::options().read(true).write(true).open(&info.path).map_err(|error| open_error(info, error))?;
    if is_exclusive {
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(HidError::Busy { device: info.label() }),
            Err(TryLockError::Error(error)) => return Err(open_error(info, error)),
        }
    }
    Ok(Some(file))
}

#[cfg(not(target_os = "linux"))]
fn lock(_: &HidInfo, _: bool) -> Result<Option<File>, HidError> {
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
        // The device file exists and the device does not.
        _ if matches!(source.raw_os_error(), Some(NO_DEVICE | NO_ADDRESS)) => HidError::Gone { device },
        _ => HidError::Open { device, source },
    }
}

impl HidBus for SystemBus {
    fn list(&self) -> Result<Vec<HidInfo>, HidError> {
        let mut api = self.api.lock().unwrap_or_else(PoisonError::into_inner);
        api.refresh_devices().map_err(|error| HidError::List(error.to_string()))?;
        let mut infos: Vec<HidInfo> = Vec::new();
        // hidapi returns one entry for each top-level collection.
        for entry in api.device_list() {
            let path = entry.path().to_string_lossy().into_owned();
            let application = Usage::new(entry.usage_page(), entry.usage());
            if let Some(listed) = infos.iter_mut().find(|info| info.path == path) {
                listed.applications.push(application);
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
        // On Linux every user may read the descriptor, also without permission to open the device.
        #[cfg(target_os = "linux")]
        if let Some(node) = info.path.strip_prefix("/dev/") {
            let file = format!("/sys/class/hidraw/{node}/device/report_descriptor");
            if let Ok(bytes) = std::fs::read(file) {
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

/// An open device of the operating system.
struct SystemConnection {
    device: hidapi::HidDevice,
    /// Lock on the device file, held while the device is open.
    _lock: Option<File>,
}

/// Linux error numbers `ENODEV` and `ENXIO`.
const NO_DEVICE: i32 = 19;
const NO_ADDRESS: i32 = 6;

/// Converts an error for the haptic loop. `hidapi` reports a missing device as an error without a number.
fn for_loop(error: &hidapi::HidError) -> DeviceError {
    match error {
        hidapi::HidError::IoError { error } => match error.raw_os_error() {
            Some(NO_DEVICE | NO_ADDRESS) | None => DeviceError::Disconnected,
            Some(number) => DeviceError::Os(number),
        },
        hidapi::HidError::InvalidZeroSizeData | hidapi::HidError::IncompleteSendError { .. } => {
            DeviceError::Protocol("the device accepted only a part of a report")
        }
        _ => DeviceError::Disconnected,
    }
}

/// Error text for a rejected feature report.
const FEATURE_REJECTED: &str = "the device rejected a feature report";

/// Like [`for_loop`], except that a connected device may reject a feature report.
fn feature_error(error: &hidapi::HidError) -> DeviceError {
    match error {
        hidapi::HidError::HidApiError { message } if !message.contains("ENODEV") => {
            DeviceError::Protocol(FEATURE_REJECTED)
        }
        error => for_loop(error),
    }
}

/// Whether a signal interrupted the call, which is no error of the device.
fn is_interrupted(error: &hidapi::HidError) -> bool {
    matches!(error, hidapi::HidError::IoError { error } if error.kind() == ErrorKind::Interrupted)
}

/// Number of bytes read; 0 if a signal interrupted the call.
fn bytes_read(read: Result<usize, hidapi::HidError>) -> Result<usize, DeviceError> {
    match read {
        Err(error) if is_interrupted(&error) => Ok(0),
        read => read.map_err(|error| for_loop(&error)),
    }
}

/// Calls `write`, and retries once after a signal.
fn send(mut write: impl FnMut() -> Result<usize, hidapi::HidError>) -> Result<(), DeviceError> {
    let sent = match write() {
        Err(error) if is_interrupted(&error) => write(),
        sent => sent,
    };
    // The returned length is ignored: for a device without report IDs it differs between systems.
    sent.map(|_| ()).map_err(|error| for_loop(&error))
}

impl HidConnection for SystemConnection {
    fn read(&mut self, report: &mut [u8], within: Duration) -> Result<usize, DeviceError> {
        let within_ms = i32::try_from(within.as_millis()).unwrap_or(i32::MAX);
        bytes_read(self.device.read_timeout(report, within_ms))
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

    /// `EINTR`, as after a signal of a timer or profiler.
    const INTERRUPTED: i32 = 4;
    const IO: i32 = 5;

    /// Missing permission, device in use, missing device, and other errors.
    #[test]
    fn open_errors_state_cause_and_remedy() {
        let info = HidInfo {
            path: "/dev/hidraw7".into(),
            vendor: 0x1234,
            product: 0xBEAD,
            name: "Stick".into(),
            ..HidInfo::default()
        };
        let error_of = |number| open_error(&info, io::Error::from_raw_os_error(number));
        let (access, busy) = (error_of(13), error_of(16));
        let text = access.to_string();
        let rule =
            r#"SUBSYSTEM=="hidraw", ATTRS{idVendor}=="1234", ATTRS{idProduct}=="bead", TAG+="uaccess""#;
        assert!(text.starts_with("Stick (1234:bead): permission to open /dev/hidraw7 is denied"), "{text}");
        assert!(text.ends_with(rule), "{text}");
        // The rule has the form of the installed ones.
        let installed = include_str!("../../../assets/udev/70-palpate.rules");
        assert!(installed.contains(&rule.replace("bead", "0006")), "{installed}");
        assert!(matches!(&busy, HidError::Busy { device } if device == "Stick (1234:bead)"), "{busy}");
        assert!(
            matches!(error_of(2), HidError::Gone { .. })
                && matches!(error_of(NO_DEVICE), HidError::Gone { .. })
        );
        assert!(matches!(error_of(INTERRUPTED), HidError::Open { .. }));
        // The error for the loop keeps the reason.
        for (error, reason) in [(access, "permission"), (busy, "another program")] {
            let DeviceError::Unavailable(text) = error.for_loop() else { panic!("{error}") };
            assert!(text.contains(reason), "{text}");
        }
        assert_eq!(error_of(INTERRUPTED).for_loop(), DeviceError::Os(INTERRUPTED));
        assert_eq!(error_of(2).for_loop(), DeviceError::Disconnected);
    }

    #[test]
    fn interrupted_calls_are_retried_or_empty() {
        assert_eq!(bytes_read(Err(os(INTERRUPTED))), Ok(0));
        assert_eq!(bytes_read(Err(os(IO))), Err(DeviceError::Os(IO)));
        assert_eq!(bytes_read(Err(os(NO_DEVICE))), Err(DeviceError::Disconnected));
        assert_eq!(bytes_read(Ok(7)), Ok(7));
        // Error numbers of successive writes, the result, and the number of writes.
        for (fails, sent, writes) in [
            (&[][..], Ok(()), 1),
            (&[INTERRUPTED][..], Ok(()), 2),
            (&[INTERRUPTED, INTERRUPTED], Err(DeviceError::Os(INTERRUPTED)), 2),
            (&[INTERRUPTED, IO], Err(DeviceError::Os(IO)), 2),
            (&[IO, IO], Err(DeviceError::Os(IO)), 1),
        ] {
            let mut count = 0;
            let result = send(|| {
                count += 1;
                fails.get(count - 1).map_or(Ok(8), |&number| Err(os(number)))
            });
            assert_eq!((result, count), (sent, writes), "{fails:?}");
        }
    }
}
