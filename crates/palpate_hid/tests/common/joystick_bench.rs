//! Joysticks to be tested with: three layouts, plugged in, on a clock that stands until it is moved.

use crate::hex;
use crate::report_log::{Ear, Recorded};
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A kind of joystick.
#[derive(Clone, Debug)]
pub struct Kind {
    pub name: &'static str,
    pub descriptor: Vec<u8>,
    /// What passes between it and the driver.
    pub reports: &'static str,
    /// The greatest magnitude of its constant forces.
    pub full: f64,
    /// What of a force along x it shows along y, as its directions are coarse.
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

/// All three.
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

/// A descriptor with other report numbers: `number` of each.
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

/// A joystick that is plugged in.
pub struct Bench {
    pub bus: Arc<SimulatedBus>,
    pub firmware: Arc<Mutex<JoystickFirmware>>,
    pub ear: Ear,
    pub now_us: Arc<AtomicU64>,
    descriptor: Vec<u8>,
}

pub const PATH: &str = "stand-in/joystick";

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
            ear: Ear::default(),
            now_us: Arc::default(),
            descriptor: descriptor.to_vec(),
        };
        bench.plug();
        bench
    }

    pub fn plug(&self) {
        let recorded = Recorded { firmware: Arc::clone(&self.firmware), ear: self.ear.clone() };
        self.bus.plug(info(), self.descriptor.clone(), recorded);
    }

    pub fn try_find(&self, options: JoystickOptions) -> Result<HidDevice, HidError> {
        let options = HidOptions { joystick: options, ..HidOptions::default() };
        let bus = Arc::clone(&self.bus) as Arc<dyn HidBus>;
        HidDevice::find(bus, &HidSelector::first(HidKind::Joystick), &options)
    }

    /// The driver for it, on this bench's clock.
    pub fn device(&self, options: JoystickOptions) -> HidDevice {
        let now_us = Arc::clone(&self.now_us);
        let device = self.try_find(options).unwrap();
        device.with_clock(move || Duration::from_micros(now_us.load(Ordering::SeqCst)))
    }

    pub fn wait_ms(&self, ms: u64) {
        self.now_us.fetch_add(1000 * ms, Ordering::SeqCst);
    }

    pub fn force_n(&self) -> [f64; 2] {
        self.firmware.lock().unwrap().force_n()
    }
}

/// The defaults, with the stand-in's own full scale.
pub fn known_scale() -> JoystickOptions {
    let full_scale_n = SimulatedStick::default().full_scale_n;
    JoystickOptions { full_scale_n, ..JoystickOptions::default() }
}

/// All that the joystick has.
pub fn whole_force() -> JoystickOptions {
    JoystickOptions { max_force_n: 50.0, ..known_scale() }
}
