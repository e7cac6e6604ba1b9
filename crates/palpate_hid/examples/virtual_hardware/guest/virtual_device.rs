//! A device that is plugged into the kernel: firmware behind `/dev/uhid`, with a thread that answers what it is asked and one that
//! lets it speak.

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

/// When a device says what it has to say. Only one that is open says anything, as on a real bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// A report whenever so much time has passed.
    Every(Duration),
    /// What it has to say when it has been opened and after each report that it gets.
    InTurn,
    /// A report when [`VirtualDevice::speak`] is called.
    WhenTold,
}

/// What is inside a device.
pub type Inside = Arc<Mutex<dyn Firmware>>;

/// A device that is plugged in; unplugged when it is dropped.
pub struct VirtualDevice {
    at: Arc<At>,
    /// Its file, such as `/dev/hidraw0`.
    pub node: String,
    threads: Vec<JoinHandle<()>>,
}

/// What its threads share.
struct At {
    file: File,
    inside: Inside,
    pace: Pace,
    is_started: AtomicBool,
    is_open: AtomicBool,
    is_gone: AtomicBool,
    said: AtomicU64,
}

impl VirtualDevice {
    /// Plugs a device in, and waits until it has a file. Serial numbers are taken to be unique among what is plugged in.
    pub fn plug(
        identity: &Identity,
        descriptor: &[u8],
        inside: Inside,
        pace: Pace,
    ) -> Result<Self, Box<dyn Error>> {
        let file = File::options().read(true).write(true).open("/dev/uhid");
        let file = file.map_err(|error| format!("/dev/uhid: {error}"))?;
        (&file).write_all(&uhid::create(identity, descriptor))?;
        let at = Arc::new(At {
            file,
            inside,
            pace,
            is_started: AtomicBool::new(false),
            is_open: AtomicBool::new(false),
            is_gone: AtomicBool::new(false),
            said: AtomicU64::new(0),
        });
        let mut threads = vec![spawn("answers", &at, At::answer)?];
        if let Pace::Every(_) = pace {
            threads.push(spawn("speaks", &at, At::speak_at_its_pace)?);
        }
        let mut device = Self { at, node: String::new(), threads };
        let what = format!("{} with serial number {} has a file", identity.name, identity.serial);
        wait_until(&what, || {
            device.node = node(&identity.serial).unwrap_or_default();
            device.at.is_started.load(Ordering::Acquire) && !device.node.is_empty()
        })?;
        Ok(device)
    }

    /// It says its next report, at once, whether it is open or not. Whether it had one.
    pub fn speak(&self) -> io::Result<bool> {
        self.at.speak()
    }

    /// Reports that it has said; whoever has it open can read them.
    pub fn said(&self) -> u64 {
        self.at.said.load(Ordering::Acquire)
    }

    /// Pulls it out, whoever has it open.
    pub fn unplug(self) {
        drop(self);
    }
}

impl Drop for VirtualDevice {
    fn drop(&mut self) {
        self.at.is_gone.store(true, Ordering::Release);
        let _ = (&self.at.file).write_all(&uhid::destroy());
        // The kernel's last word lets the answering thread go.
        let _ = wait_until("its threads end", || self.threads.iter().all(JoinHandle::is_finished));
    }
}

fn spawn(name: &str, at: &Arc<At>, run: fn(&At)) -> io::Result<JoinHandle<()>> {
    let at = Arc::clone(at);
    std::thread::Builder::new().name(name.into()).spawn(move || run(&at))
}

impl At {
    fn with<T>(&self, ask: impl FnOnce(&mut dyn Firmware) -> T) -> T {
        ask(&mut *self.inside.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn speak(&self) -> io::Result<bool> {
        let mut report = [0; MAX_INPUT_REPORT_BYTES];
        let length = self.with(|firmware| firmware.input(&mut report));
        if length > 0 {
            (&self.file).write_all(&uhid::input(&report[..length]))?;
            self.said.fetch_add(1, Ordering::AcqRel);
        }
        Ok(length > 0)
    }

    /// Says all that it has to say now.
    fn answer_in_turn(&self) -> io::Result<()> {
        while self.pace == Pace::InTurn && self.speak()? {}
        Ok(())
    }

    fn speak_at_its_pace(&self) {
        let Pace::Every(period) = self.pace else { return };
        while !self.is_gone.load(Ordering::Acquire) {
            pause(period);
            if self.is_open.load(Ordering::Acquire) && self.speak().is_err() {
                return;
            }
        }
    }

    /// Answers until the kernel has let go of it.
    fn answer(&self) {
        let mut bytes = [0; uhid::LONGEST_EVENT];
        while let Ok(length) = (&self.file).read(&mut bytes) {
            let event = Event::parse(&bytes[..length]);
            if event == Some(Event::Stop) {
                return;
            }
            if event.is_some_and(|event| self.take(event).is_err()) && self.is_gone.load(Ordering::Acquire) {
                return;
            }
        }
    }

    fn take(&self, event: Event) -> io::Result<()> {
        match event {
            Event::Start => self.is_started.store(true, Ordering::Release),
            Event::Open => {
                self.is_open.store(true, Ordering::Release);
                // Whoever opens it can only now begin to listen.
                pause(Duration::from_millis(2));
                self.answer_in_turn()?;
            }
            Event::Close => self.is_open.store(false, Ordering::Release),
            Event::Output(report) => {
                // On a real bus nobody learns that a device does not know a report.
                self.with(|firmware| firmware.output(&report));
                self.answer_in_turn()?;
            }
            Event::GetFeature { id, number } => {
                let mut report = [0; MAX_INPUT_REPORT_BYTES];
                report[0] = number;
                let length = self.with(|firmware| firmware.feature(&mut report));
                let reply = report.get(..length).filter(|reply| !reply.is_empty());
                (&self.file).write_all(&uhid::feature_reply(id, reply))?;
            }
            Event::SetFeature { id, report } => {
                let is_taken = self.with(|firmware| firmware.set_feature(&report));
                (&self.file).write_all(&uhid::set_feature_reply(id, is_taken))?;
            }
            Event::GetOther { id } => (&self.file).write_all(&uhid::feature_reply(id, None))?,
            Event::SetOther { id } => (&self.file).write_all(&uhid::set_feature_reply(id, false))?,
            Event::Stop | Event::Other(_) => {}
        }
        Ok(())
    }
}

/// The file of the device with that serial number, once it can be opened.
fn node(serial: &str) -> Option<String> {
    let says = format!("HID_UNIQ={serial}");
    let shown = fs::read_dir("/sys/class/hidraw").ok()?.flatten().find(|entry| {
        let told = fs::read_to_string(entry.path().join("device/uevent")).unwrap_or_default();
        told.lines().any(|line| line == says)
    })?;
    let node = format!("/dev/{}", shown.file_name().to_string_lossy());
    fs::exists(&node).is_ok_and(|is_there| is_there).then_some(node)
}
