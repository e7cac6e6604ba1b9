//! A 3-DOF board in lockstep: the force on the hand is the sent force, to one count of the currents.

use super::check::{Outcome, ensure, wait_until};
use super::touch;
use super::uhid::Identity;
use super::virtual_device::{Pace, VirtualDevice};
use glam::DVec3;
use palpate_haptics::{HapticHandle, Lockstep, haptic_loop};
use palpate_hid::simulated::BoardFirmware;
use palpate_hid::{
    BoardForm, BoardHoming, BoardKinematics, BoardOptions, HidDevice, HidKind, HidOptions, HidSelector,
    SystemBus,
};
use std::error::Error;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A simulated board with its hand.
pub type Board = Arc<Mutex<BoardFirmware>>;

/// Number of compared ticks.
const TICKS: usize = 1000;
/// Stiffness of the virtual spring to the home position, N/m.
const STIFFNESS_N_PER_M: f64 = 300.0;
/// Number of reports before the hand starts to move; the board is calibrated by then.
const AT_REST: u64 = 200;

/// Plugs a board in.
pub fn plug(serial: &str, board: BoardFirmware) -> Result<(VirtualDevice, Board), Box<dyn Error>> {
    let (info, descriptor) = (board.info(""), board.descriptor());
    let identity =
        Identity { name: "Virtual board", serial: serial.into(), vendor: info.vendor, product: info.product };
    let board = Arc::new(Mutex::new(board));
    Ok((VirtualDevice::plug(&identity, &descriptor, board.clone(), Pace::InTurn)?, board))
}

/// Finds the board with this serial number.
pub fn find(serial: &str, homing: BoardHoming) -> Result<HidDevice, Box<dyn Error>> {
    let selector = HidSelector {
        kind: Some(HidKind::Board),
        serial: Some(serial.into()),
        treat_teensy_as_board: true,
        ..HidSelector::default()
    };
    let options =
        HidOptions { board: BoardOptions { homing, ..BoardOptions::default() }, ..HidOptions::default() };
    Ok(HidDevice::find(Arc::new(SystemBus::new()?), &selector, &options)?)
}

/// Accesses the firmware.
pub fn of<T>(board: &Board, operation: impl FnOnce(&mut BoardFirmware) -> T) -> T {
    operation(&mut board.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Reports of 14 bytes; the board requests calibration.
pub fn bytes_14() -> Outcome {
    run("board-14", BoardForm::Bytes14, BoardHoming::Awaited)
}

/// Reports of 64 bytes, those of a Teensy; the board requests calibration.
pub fn bytes_64() -> Outcome {
    run("board-64", BoardForm::Bytes64, BoardHoming::Awaited)
}

/// Reports of 8 bytes: the board cannot request calibration, and its arm is at home when it is opened.
pub fn bytes_8() -> Outcome {
    run("board-8", BoardForm::Bytes8, BoardHoming::AtOpen)
}

/// Runs one tick for each report of the board, which processes each report of the driver.
struct Exchange {
    plugged: VirtualDevice,
    board: Board,
    handle: HapticHandle,
    lockstep: Lockstep<HidDevice>,
    reports: u64,
    /// Clock of the driver: a tick counts as 1 ms, whatever its real time.
    ms: Arc<AtomicU64>,
}

impl Exchange {
    fn tick(&mut self) -> Result<(), Box<dyn Error>> {
        wait_until("the board sends a report", || self.plugged.sent_reports() > self.reports)?;
        self.reports = self.plugged.sent_reports();
        self.ms.fetch_add(1, Ordering::Relaxed);
        let processed = of(&self.board, |board| board.exchanged());
        self.lockstep.run(1);
        wait_until("the board processes a report", || of(&self.board, |board| board.exchanged() > processed))
    }
}

fn run(serial: &str, form: BoardForm, homing: BoardHoming) -> Outcome {
    let kinematics = BoardKinematics::default();
    let home_m = kinematics.position_m(kinematics.home_rad());
    // One circle per second, radius 6 mm.
    let board = BoardFirmware::at_home(form, &kinematics).with_hand(move |exchanged| {
        let turn = exchanged.saturating_sub(AT_REST) as f64 * 1e-3 * std::f64::consts::TAU;
        home_m + 0.006 * DVec3::new(turn.sin(), 1.0 - turn.cos(), -turn.sin())
    });
    let (plugged, board) = plug(serial, board)?;
    let device = find(serial, homing)?;
    let counters = device.counters();
    let calibration = device.board_calibration().ok_or("a board without calibration")?;
    let ms = Arc::<AtomicU64>::default();
    let of_driver = Arc::clone(&ms);
    let device = device.with_clock(move || Duration::from_millis(of_driver.load(Ordering::Relaxed)));
    let (config, settings) = touch::settings(&device);
    let (handle, haptic_loop) = haptic_loop(config, settings)?;
    let lockstep = Lockstep::new(haptic_loop, Box::new(device))?;
    let mut exchange = Exchange { plugged, board, handle, lockstep, reports: 0, ms };

    of(&exchange.board, |board| board.request_calibration());
    for tick in 0..AT_REST {
        ensure(tick < AT_REST / 2 || calibration.is_done(), || "the board was not calibrated".into())?;
        exchange.tick()?;
    }
    let (mut angles_rad, mut max_n, mut max_error_n, mut max_error_ma) =
        (kinematics.home_rad(), 0.0_f64, 0.0_f64, 0.0_f64);
    for tick in 0..TICKS {
        if tick % 50 == 0 {
            touch::attach_spring(&mut exchange.handle, home_m, STIFFNESS_N_PER_M);
        }
        exchange.tick()?;
        let record = exchange.handle.latest_tick().ok_or("no tick")?;
        let (reading, sent_n) = (record.reading?, record.force_n);
        let (felt_n, currents_ma) =
            of(&exchange.board, |board| (board.applied_force_n(), board.currents_ma()));
        angles_rad = angles_at(&kinematics, reading.position_m, angles_rad);
        let wanted_ma = 1e3 * kinematics.currents_a(angles_rad, sent_n);
        let off_ma = (wanted_ma - DVec3::from(currents_ma.map(f64::from))).abs().max_element();
        ensure(off_ma <= 1.0, || {
            format!("at tick {tick} {sent_n} N became {currents_ma:?} mA, not {wanted_ma}")
        })?;
        let off_n = (felt_n - sent_n).length();
        let count_n = one_count_n(&kinematics, angles_rad)?;
        ensure(off_n <= count_n, || {
            format!(
                "at tick {tick} {felt_n} N was applied for {sent_n} N; a count of each current is {count_n} N"
            )
        })?;
        (max_n, max_error_n, max_error_ma) =
            (max_n.max(felt_n.length()), max_error_n.max(off_n), max_error_ma.max(off_ma));
    }
    ensure(max_n > 0.5, || format!("the maximum applied force is {max_n} N"))?;
    let report = (counters.skipped(), counters.malformed());
    ensure(report == (0, 0), || format!("reports skipped and malformed: {report:?}"))?;

    let Exchange { plugged, board, lockstep, .. } = exchange;
    drop(lockstep);
    wait_until("no current is left", || of(&board, |board| board.currents_ma() == [0; 3]))?;
    plugged.unplug();
    Ok(format!(
        "{TICKS} ticks, up to {max_n:.2} N, errors up to {:.2} mN and {max_error_ma:.2} mA",
        max_error_n * 1e3
    ))
}

/// Angles for the tip position `tip_m`, by Newton's method from nearby angles.
fn angles_at(kinematics: &BoardKinematics, tip_m: DVec3, near_rad: DVec3) -> DVec3 {
    (0..20).fold(near_rad, |angles_rad, _| {
        let off_m = tip_m - kinematics.position_m(angles_rad);
        angles_rad + kinematics.jacobian(angles_rad).inverse() * off_m
    })
}

/// Upper bound of the force of one milliampere in each motor, N.
fn one_count_n(kinematics: &BoardKinematics, angles_rad: DVec3) -> Result<f64, Box<dyn Error>> {
    let mut sum_n = 0.0;
    for motor in [DVec3::X, DVec3::Y, DVec3::Z] {
        sum_n += kinematics.force_n(angles_rad, 1e-3 * motor).ok_or("the arm is singular")?.length();
    }
    Ok(sum_n)
}
