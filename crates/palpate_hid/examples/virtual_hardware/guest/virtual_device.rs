//! A virtual device of the kernel: firmware behind `/dev/uhid`, with a thread that handles requests and one that sends reports.

use super::check::{pause, wait_until};
use super::uhid::{self, Event, Identity};
use palpate_hid::MAX_INPUT_REPORT_BYTES;
use palpate_hid::simulated::Firmware;
use std::error::Error;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// When a device sends reports. With `Every` and `InTurn` only an open device sends, as on a real bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// One report per period.
    Every(Duration),
    /// All pending reports after the opening and after each received report.
    InTurn,
    /// One report for each call of [`VirtualDevice::send_report`].
    Manual,
}

/// Firmware of a device.
pub type SharedFirmware = Arc<Mutex<dyn Firmware>>;

/// A plugged-in device, which is unplugged on drop.
pub struct VirtualDevice {
    at: Arc<Shared>,
    /// Path of the device file, such as `/dev/hidraw0`.
    pub node: String,
    threads: Vec<JoinHandle<()>>,
}

/// State shared with the threads.
struct Shared {
    file: File,
    firmware: SharedFirmware,
    pace: Pace,
    is_started: AtomicBool,
    is_open: AtomicBool,
    is_gone: AtomicBool,
    sent_reports: AtomicU64,
}

impl VirtualDevice {
    /// Plugs a device in and waits for its device file. Serial numbers must be unique among the plugged-in devices.
    pub fn plug(
        identity: &Identity,
        descriptor: &[u8],
        firmware: SharedFirmware,
        pace: Pace,
    ) -> Result<Self, Box<dyn Error>> {
        let file = File::options().read(true).write(true).open("/dev/uhid");
        let file = file.map_err(|error| format!("/dev/uhid: {error}"))?;
        (&file).write_all(&uhid::create(identity, descriptor))?;
        let at = Arc::new(Shared {
            file,
            firmware,
            pace,
            is_started: AtomicBool::new(false),
            is_open: AtomicBool::new(false),
            is_gone: AtomicBool::new(false),
            sent_reports: AtomicU64::new(0),
        });
        let mut threads = vec![spawn("requests", &at, Shared::handle_requests)?];
        if let Pace::Every(_) = pace {
            threads.push(spawn("reports", &at, Shared::send_periodically)?);
        }
        let mut device = Self { at, node: String::new(), threads };
        let what = format!("{} with serial number {} has a file", identity.name, identity.serial);
        wait_until(&what, || {
            device.node = node(&identity.serial).unwrap_or_default();
            device.at.is_started.load(Ordering::Acquire) && !device.node.is_empty()
        })?;
        Ok(device)
    }

    /// Sends the next report at once, open or closed. Returns whether there was one.
    pub fn send_report(&self) -> io::Result<bool> {
        self.at.send_report()
    }

    /// Number of sent reports, which can be read once the device is open.
    pub fn sent_reports(&self) -> u64 {
        self.at.sent_reports.load(Ordering::Acquire)
    }

    /// Unplugs the device, open or closed.
    pub fn unplug(self) {
        drop(self);
    }
}

impl Drop for VirtualDevice {
    fn drop(&mut self) {
        self.at.is_gone.store(true, Ordering::Release);
        let _ = (&self.at.file).write_all(&uhid::destroy());
        // The last event of the kernel ends the request thread.
        let _ = wait_until("its threads end", || self.threads.iter().all(JoinHandle::is_finished));
    }
}

fn spawn(name: &str, at: &Arc<Shared>, run: fn(&Shared)) -> io::Result<JoinHandle<()>> {
    let at = Arc::clone(at);
    std::thread::Builder::new().name(name.into()).spawn(move || run(&at))
}

impl Shared {
    fn with<T>(&self, operation: impl FnOnce(&mut dyn Firmware) -> T) -> T {
        operation(&mut *self.firmware.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn send_report(&self) -> io::Result<bool> {
        let mut report = [0; MAX_INPUT_REPORT_BYTES];
        let length = self.with(|firmware| firmware.input(&mut report));
        if length > 0 {
            (&self.file).write_all(&uhid::input(&report[..length]))?;
            self.sent_reports.fetch_add(1, Ordering::AcqRel);
        }
        Ok(length > 0)
    }

    /// Sends all pending reports.
    fn send_pending(&self) -> io::Result<()> {
        while self.pace == Pace::InTurn && self.send_report()? {}
        Ok(())
    }

    fn send_periodically(&self) {
        let Pace::Every(period) = self.pace else { return };
        while !self.is_gone.load(Ordering::Acquire) {
            pause(period);
            if self.is_open.load(Ordering::Acquire) && self.send_report().is_err() {
                return;
            }
        }
    }

    /// Handles requests until the kernel has unbound the driver.
    fn handle_requests(&self) {
        let mut bytes = [0; uhid::MAX_EVENT_BYTES];
        while let Ok(length) = (&self.file).read(&mut bytes) {
            let event = Event::parse(&bytes[..length]);
            if event == Some(Event::Stop) {
                return;
            }
            if event.is_some_and(|event| self.handle(event).is_err()) && self.is_gone.load(Ordering::Acquire)
            {
                return;
            }
        }
    }

    fn handle(&self, event: Event) -> io::Result<()> {
        match event {
            Event::Start => self.is_started.store(true, Ordering::Release),
            Event::Open => {
                self.is_open.store(true, Ordering::Release);
                // The program starts to read only after this event.
                pause(Duration::from_millis(2));
                self.send_pending()?;
            }
            Event::Close => self.is_open.store(false, Ordering::Release),
            Event::Output(report) => {
                // On a real bus a rejected report gives no error.
                self.with(|firmware| firmware.output(&report));
                self.send_pending()?;
            }
            Event::GetFeature { id, number } => {
                let mut report = [0; MAX_INPUT_REPORT_BYTES];
                report[0] = number;
                let length = self.with(|firmware| firmware.feature(&mut report));
                let reply = report.get(..length).filter(|reply| !reply.is_empty());
                (&self.file).write_all(&uhid::feature_reply(id, reply))?;
            }
            Event::SetFeature { id, report } => {
                let is_accepted = self.with(|firmware| firmware.set_feature(&report));
                (&self.file).write_all(&uhid::set_feature_reply(id, is_accepted))?;
            }
            Event::GetOther { id } => (&self.file).write_all(&uhid::feature_reply(id, None))?,
            Event::SetOther { id } => (&self.file).write_all(&uhid::set_feature_reply(id, false))?,
            Event::Stop | Event::Other(_) => {}
        }
        Ok(())
    }
}

/// Path of the device with this serial number, once it can be opened.
fn node(serial: &str) -> Option<String> {
    let entry_line = format!("HID_UNIQ={serial}");
    let shown = fs::read_dir("/sys/class/hidraw").ok()?.flatten().find(|entry| {
        let text = fs::read_to_string(entry.path().join("device/uevent")).unwrap_or_default();
        text.lines().any(|line| line == entry_line)
    })?;
    let node = format!("/dev/{}", shown.file_name().to_string_lossy());
    fs::exists(&node).is_ok_and(|is_there| is_there).then_some(node)
}
