//! Test bench: a simulated board on a bus, its device, and a manual clock.

use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

pub const PATH: &str = "board";
/// Maximum error of a force, N, by half a milliampere for each motor and half a count for each encoder at 5 N.
pub const ROUNDING_N: f64 = 3e-3;

/// A simulated board that is plugged in, its device, and a manual clock.
pub struct Bench {
    pub bus: Arc<SimulatedBus>,
    pub firmware: Arc<Mutex<BoardFirmware>>,
    pub device: Option<HidDevice>,
    pub ms: Arc<AtomicU64>,
}

pub fn kinematics() -> BoardKinematics {
    BoardKinematics::woodenhaptics_v2015()
}

pub fn kept() -> BoardOptions {
    BoardOptions { homing: BoardHoming::Kept, ..BoardOptions::default() }
}

pub fn homed() -> BoardOptions {
    BoardOptions { homing: BoardHoming::AtOpen, ..BoardOptions::default() }
}

pub fn find(bus: Arc<SimulatedBus>, options: BoardOptions) -> Result<HidDevice, HidError> {
    let selector = HidSelector { treat_teensy_as_board: true, ..HidSelector::first(HidKind::Board) };
    HidDevice::find(bus, &selector, &HidOptions { board: options, ..HidOptions::default() })
}

impl Bench {
    pub fn new(firmware: BoardFirmware, options: BoardOptions) -> Self {
        let bus = Arc::new(SimulatedBus::default());
        let firmware = Arc::new(Mutex::new(firmware));
        let mut bench = Self { bus, firmware, device: None, ms: Arc::default() };
        bench.plug();
        let ms = bench.ms.clone();
        let clock = move || Duration::from_millis(ms.load(Ordering::Relaxed));
        bench.device = Some(find(bench.bus.clone(), options).unwrap().with_clock(clock));
        bench
    }

    pub fn open(firmware: BoardFirmware, options: BoardOptions) -> Self {
        let mut bench = Self::new(firmware, options);
        bench.device().open().unwrap();
        bench
    }

    pub fn plug(&self) {
        let (info, descriptor) = (self.board(|it| it.info(PATH)), self.board(|it| it.descriptor()));
        self.bus.plug(info, descriptor, self.firmware.clone());
    }

    pub fn board<T>(&self, operation: impl FnOnce(&mut BoardFirmware) -> T) -> T {
        operation(&mut self.firmware.lock().unwrap())
    }

    pub fn device(&mut self) -> &mut HidDevice {
        self.device.as_mut().unwrap()
    }

    pub fn advance_ms(&self, ms: u64) {
        self.ms.fetch_add(ms, Ordering::Relaxed);
    }

    /// Runs one tick of 1 ms and returns the reading.
    pub fn tick(&mut self, force_n: DVec3) -> Reading {
        self.advance_ms(1);
        let reading = self.device().read(Duration::ZERO).unwrap();
        self.device().write(force_n).unwrap();
        reading
    }

    pub fn ticks(&mut self, ticks: usize, force_n: DVec3) -> Reading {
        (0..ticks).map(|_| self.tick(force_n)).last().unwrap()
    }

    pub fn applied_force_n(&self) -> DVec3 {
        self.board(|it| it.applied_force_n())
    }
}

pub fn at_home(form: BoardForm) -> BoardFirmware {
    BoardFirmware::at_home(form, &kinematics())
}

/// A hand that moves from home to the workspace centre within 400 reports, and then in circles.
pub fn moving(form: BoardForm) -> BoardFirmware {
    let board = at_home(form);
    let from_m = board.tip_m();
    board.with_hand(move |n| {
        let (n, turn) = (n as f64, 0.01 * n as f64);
        let circle_m = 0.03 * DVec3::new(turn.sin(), (1.3 * turn).sin(), turn.cos() - 1.0);
        from_m * (1.0 - n / 400.0).max(0.0) + circle_m
    })
}
