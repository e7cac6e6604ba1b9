//! Force-feedback joysticks of three makes: effects are created from their report descriptors, and the force on the hand is the sent
//! force, to one count of each magnitude.

use super::check::{Outcome, ensure, wait_until};
use super::touch;
use super::uhid::Identity;
use super::virtual_device::{Pace, VirtualDevice};
use glam::DVec3;
use palpate_haptics::{Lockstep, haptic_loop};
use palpate_hid::simulated::{JoystickFirmware, SimulatedStick};
use palpate_hid::{HidDevice, HidKind, HidOptions, HidSelector, JoystickOptions, SystemBus};
use std::error::Error;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A simulated joystick with its hand.
pub type Joystick = Arc<Mutex<JoystickFirmware>>;

/// A make of joystick.
pub struct Make {
    vendor: u16,
    product: u16,
    /// Report descriptor, in hexadecimal.
    descriptor: &'static str,
    /// Maximum magnitude of a constant force.
    full: f64,
    /// Fraction of a force along one axis that acts along the other, by the resolution of directions.
    crossed: f64,
}

pub const OPENFFBOARD: Make = Make {
    vendor: 0x1209,
    product: 0xFFB0,
    descriptor: include_str!("../../../tests/data/openffboard_2axis.txt"),
    full: 32767.0,
    crossed: 0.0,
};
const RHINO: Make = Make {
    vendor: 0xFFFF,
    product: 0x2055,
    descriptor: include_str!("../../../tests/data/vpforce_rhino.txt"),
    full: 4096.0,
    // 191 of 255 parts of a turn are 269.65°.
    crossed: 0.0062,
};
const ARDUINO: Make = Make {
    vendor: 0x2341,
    product: 0x8036,
    descriptor: include_str!("../../../tests/data/arduino_ffb.txt"),
    full: 10_000.0,
    crossed: 0.0,
};

/// Number of compared ticks.
const TICKS: u64 = 500;
/// Stiffness of the virtual spring to the centre, N/m.
const STIFFNESS_N_PER_M: f64 = 100.0;

/// Plugs a joystick in.
pub fn plug(serial: &str, make: &Make, pace: Pace) -> Result<(VirtualDevice, Joystick), Box<dyn Error>> {
    let words = make
        .descriptor
        .lines()
        .flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace());
    let descriptor = words.map(|word| u8::from_str_radix(word, 16)).collect::<Result<Vec<u8>, _>>()?;
    let joystick = Arc::new(Mutex::new(JoystickFirmware::new(&descriptor, SimulatedStick::default())?));
    let identity = Identity {
        name: "Virtual joystick",
        serial: serial.into(),
        vendor: make.vendor,
        product: make.product,
    };
    Ok((VirtualDevice::plug(&identity, &descriptor, joystick.clone(), pace)?, joystick))
}

/// Finds the joystick with this serial number.
pub fn find(serial: &str) -> Result<HidDevice, Box<dyn Error>> {
    let selector =
        HidSelector { kind: Some(HidKind::Joystick), serial: Some(serial.into()), ..HidSelector::default() };
    // Full scale of the simulated stick, so that the applied force is the sent one.
    let full_scale_n = SimulatedStick::default().full_scale_n;
    let joystick = JoystickOptions { full_scale_n, ..JoystickOptions::default() };
    let options = HidOptions { joystick, ..HidOptions::default() };
    Ok(HidDevice::find(Arc::new(SystemBus::new()?), &selector, &options)?)
}

/// Accesses the firmware.
pub fn of<T>(joystick: &Joystick, operation: impl FnOnce(&mut JoystickFirmware) -> T) -> T {
    operation(&mut joystick.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Force on the hand, N, in the device frame: the stick's x points to the right, its y towards the user.
pub fn applied_force_n(joystick: &Joystick) -> DVec3 {
    let [x, y] = of(joystick, |joystick| joystick.force_n());
    DVec3::new(x, 0.0, y)
}

pub fn openffboard() -> Outcome {
    run("openffboard", &OPENFFBOARD)
}

pub fn rhino() -> Outcome {
    run("rhino", &RHINO)
}

pub fn arduino() -> Outcome {
    run("arduino", &ARDUINO)
}

fn run(serial: &str, make: &Make) -> Outcome {
    let (plugged, joystick) = plug(serial, make, Pace::Manual)?;
    let device = find(serial)?;
    let counters = device.counters();
    // A tick counts as 1 ms, whatever its real time.
    let ms = Arc::<AtomicU64>::default();
    let of_driver = Arc::clone(&ms);
    let device = device.with_clock(move || Duration::from_millis(of_driver.load(Ordering::Relaxed)));
    let (config, settings) = touch::settings(&device);
    let (mut handle, haptic_loop) = haptic_loop(config, settings)?;
    let mut lockstep = Lockstep::new(haptic_loop, Box::new(device))?;
    wait_until("it has two effects and its actuators are on", || {
        of(&joystick, |joystick| joystick.effects() == 2 && joystick.is_on())
    })?;

    // One count of each magnitude.
    let count_n = SimulatedStick::default().full_scale_n / make.full * f64::sqrt(2.0);
    let (mut max_n, mut max_error_n) = (0.0_f64, 0.0_f64);
    for number in 0..TICKS {
        ms.fetch_add(1, Ordering::Relaxed);
        let turn = number as f64 * 1e-3 * std::f64::consts::TAU * 2.0;
        of(&joystick, |joystick| joystick.move_hand([0.03 * turn.sin(), 0.03 * (1.0 - turn.cos())]));
        // The firmware returns a report only at every second poll.
        while !plugged.send_report()? {}
        if number % 50 == 0 {
            touch::attach_spring(&mut handle, DVec3::ZERO, STIFFNESS_N_PER_M);
        }
        lockstep.run(1);
        let record = handle.latest_tick().ok_or("no tick")?;
        let (reading, sent_n) = (record.reading?, record.force_n);
        let off = || applied_force_n(&joystick).distance(sent_n);
        let allowed_n = count_n + make.crossed * sent_n.length();
        wait_until("its motors apply the sent force", || off() <= allowed_n).map_err(|why| {
            format!("{why}: at tick {number} {} N of {sent_n} N", applied_force_n(&joystick))
        })?;
        ensure(reading.position_m.y == 0.0, || format!("a stick cannot be at {}", reading.position_m))?;
        (max_n, max_error_n) = (max_n.max(applied_force_n(&joystick).length()), max_error_n.max(off()));
    }
    ensure(max_n > 0.5, || format!("the maximum applied force is {max_n} N"))?;
    let counted = (counters.skipped(), counters.malformed());
    ensure(counted == (0, 0), || format!("reports skipped and malformed: {counted:?}"))?;
    drop(lockstep);
    wait_until("its actuators are off and its effects gone", || {
        of(&joystick, |joystick| !joystick.is_on() && joystick.effects() == 0)
    })?;
    plugged.unplug();
    Ok(format!(
        "two effects created, {TICKS} ticks, up to {max_n:.2} N, errors up to {:.2} mN; actuators off at the end",
        max_error_n * 1e3
    ))
}
