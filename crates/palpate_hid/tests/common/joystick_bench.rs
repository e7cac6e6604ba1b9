//! Test bench for joysticks: three published layouts, plugged in, with a manual clock.

use crate::hex;
use crate::report_log::{RecordedFirmware, ReportLog};
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A joystick with a published layout.
#[derive(Clone, Debug)]
pub struct Kind {
    pub name: &'static str,
    pub descriptor: Vec<u8>,
    /// Expected reports between driver and device.
    pub reports: &'static str,
    /// Maximum magnitude of a constant force.
    pub full: f64,
    /// Fraction of a force along x that acts along y, by the resolution of directions.
    pub crossed: f64,
}

pub fn openffboard() -> Kind {
    Kind {
        name: "OpenFFBoard",
        descriptor: hex::bytes(include_str!("../data/openffboard_2axis.txt")),
        reports: include_str!("../data/openffboard_reports.txt"),
        full: 32767.0,
        crossed: 0.0,
    }
}

/// All three layouts.
pub fn kinds() -> [Kind; 3] {
    let arduino = Kind {
        name: "Arduino",
        descriptor: hex::bytes(include_str!("../data/arduino_ffb.txt")),
        reports: include_str!("../data/arduino_reports.txt"),
        full: 10000.0,
        crossed: 0.0,
    };
    let rhino = Kind {
        name: "Rhino",
        descriptor: hex::bytes(include_str!("../data/vpforce_rhino.txt")),
        reports: include_str!("../data/rhino_reports.txt"),
        full: 4096.0,
        // 191 of 255 is 269.65°.
        crossed: 0.0062,
    };
    [openffboard(), arduino, rhino]
}

/// The descriptor with the report IDs mapped by `number`.
pub fn renumbered(descriptor: &[u8], number: impl Fn(u8) -> u8) -> Vec<u8> {
    const REPORT_ID: u8 = 0x85;
    let (mut descriptor, mut at) = (descriptor.to_vec(), 0);
    while at < descriptor.len() {
        if descriptor[at] == REPORT_ID {
            descriptor[at + 1] = number(descriptor[at + 1]);
        }
        at += 1 + [0, 1, 2, 4][usize::from(descriptor[at] & 3)];
    }
    descriptor
}

/// A simulated joystick that is plugged in, and its log and clock.
pub struct Bench {
    pub bus: Arc<SimulatedBus>,
    pub firmware: Arc<Mutex<JoystickFirmware>>,
    pub log: ReportLog,
    pub now_us: Arc<AtomicU64>,
    descriptor: Vec<u8>,
}

pub const PATH: &str = "simulated/joystick";

pub fn info() -> HidInfo {
    HidInfo {
        path: PATH.into(),
        vendor: 0x1209,
        product: 0xFFB0,
        name: "Stick".into(),
        applications: vec![Usage::new(1, 4)],
        ..HidInfo::default()
    }
}

impl Bench {
    pub fn new(descriptor: &[u8], stick: SimulatedStick) -> Self {
        let firmware = Arc::new(Mutex::new(JoystickFirmware::new(descriptor, stick).unwrap()));
        let bench = Self {
            bus: Arc::default(),
            firmware,
            log: ReportLog::default(),
            now_us: Arc::default(),
            descriptor: descriptor.to_vec(),
        };
        bench.plug();
        bench
    }

    pub fn plug(&self) {
        let recorded = RecordedFirmware { firmware: Arc::clone(&self.firmware), log: self.log.clone() };
        self.bus.plug(info(), self.descriptor.clone(), recorded);
    }

    pub fn try_find(&self, options: JoystickOptions) -> Result<HidDevice, HidError> {
        let options = HidOptions { joystick: options, ..HidOptions::default() };
        let bus = Arc::clone(&self.bus) as Arc<dyn HidBus>;
        HidDevice::find(bus, &HidSelector::first(HidKind::Joystick), &options)
    }

    /// The joystick's device, on the clock of this bench.
    pub fn device(&self, options: JoystickOptions) -> HidDevice {
        let now_us = Arc::clone(&self.now_us);
        let device = self.try_find(options).unwrap();
        device.with_clock(move || Duration::from_micros(now_us.load(Ordering::SeqCst)))
    }

    pub fn advance_ms(&self, ms: u64) {
        self.now_us.fetch_add(1000 * ms, Ordering::SeqCst);
    }

    pub fn force_n(&self) -> [f64; 2] {
        self.firmware.lock().unwrap().force_n()
    }
}

/// Default options with the full scale of the simulated stick.
pub fn calibrated() -> JoystickOptions {
    let full_scale_n = SimulatedStick::default().full_scale_n;
    JoystickOptions { full_scale_n, ..JoystickOptions::default() }
}

/// Options with the full force of the simulated stick.
pub fn full_force() -> JoystickOptions {
    JoystickOptions { max_force_n: 50.0, ..calibrated() }
}
