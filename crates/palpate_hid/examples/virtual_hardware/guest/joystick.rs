//! Force-feedback joysticks of three makes: effects are created from their report descriptors, and the force on the hand is the sent
//! force, to one count of each magnitude.

use super::check::{Outcome, ensure, pause, wait_until};
use super::touch;
use super::uhid::Identity;
use super::virtual_device::{Pace, VirtualDevice};
use glam::DVec3;
use palpate_haptics::{HapticDevice, Lockstep, haptic_loop};
use palpate_hid::simulated::{JoystickFirmware, SimulatedStick};
use palpate_hid::{
    HidDevice, HidKind, HidOptions, HidSelector, JoystickOptions, PidArrayBase, PidArrayBases, SystemBus,
};
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
    pub descriptor: &'static str,
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
pub const ARDUINO: Make = Make {
    vendor: 0x2341,
    product: 0x8036,
    descriptor: include_str!("../../../tests/data/arduino_ffb.txt"),
    full: 10_000.0,
    crossed: 0.0,
};

/// Force of the scenarios without a loop, N.
pub const FORCE_N: DVec3 = DVec3::new(0.4, 0.0, -0.2);
/// Number of compared ticks.
const TICKS: u64 = 500;
/// Stiffness of the virtual spring to the centre, N/m.
const STIFFNESS_N_PER_M: f64 = 100.0;

/// Bytes of a text in hexadecimal; comments follow a #.
pub fn bytes(text: &str) -> Result<Vec<u8>, Box<dyn Error>> {
    let words = text.lines().flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace());
    Ok(words.map(|word| u8::from_str_radix(word, 16)).collect::<Result<_, _>>()?)
}

/// Plugs a joystick in.
pub fn plug(serial: &str, make: &Make, pace: Pace) -> Result<(VirtualDevice, Joystick), Box<dyn Error>> {
    plug_with(serial, make, bytes(make.descriptor)?, SimulatedStick::default(), pace)
}

/// Plugs a joystick in with another report descriptor and another stick.
pub fn plug_with(
    serial: &str,
    make: &Make,
    descriptor: Vec<u8>,
    stick: SimulatedStick,
    pace: Pace,
) -> Result<(VirtualDevice, Joystick), Box<dyn Error>> {
    let joystick = Arc::new(Mutex::new(JoystickFirmware::new(&descriptor, stick)?));
    let identity = Identity {
        name: "Virtual joystick",
        serial: serial.into(),
        vendor: make.vendor,
        product: make.product,
    };
    Ok((VirtualDevice::plug(&identity, &descriptor, joystick.clone(), pace)?, joystick))
}

/// Finds the joystick with this serial number.
///
/// The direction of its force is not checked, so that the applied force is the sent one at every tick.
pub fn find(serial: &str) -> Result<HidDevice, Box<dyn Error>> {
    find_with(serial, JoystickOptions { check_direction: false, ..JoystickOptions::default() })
}

/// Finds the joystick with this serial number. Its full scale is that of the simulated stick, so that the applied force is the sent one.
fn find_with(serial: &str, joystick: JoystickOptions) -> Result<HidDevice, Box<dyn Error>> {
    let selector =
        HidSelector { kind: Some(HidKind::Joystick), serial: Some(serial.into()), ..HidSelector::default() };
    let full_scale_n = SimulatedStick::default().full_scale_n;
    let options =
        HidOptions { joystick: JoystickOptions { full_scale_n, ..joystick }, ..HidOptions::default() };
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

/// A control array with the Logical Minimum 0, whose firmware numbers from 1, and whose actuators the system's driver has left on. The
/// device is rejected without the option, has its force with the right one, and is off at the end with the wrong one, too.
pub fn arrays() -> Outcome {
    let (old, new) = (bytes("09 9b 09 9c 15 01 25 06")?, bytes("09 9b 09 9c 15 00 25 05")?);
    let mut descriptor = bytes(ARDUINO.descriptor)?;
    let at = descriptor.windows(old.len()).position(|items| items == old).ok_or("no control array")?;
    descriptor[at..at + old.len()].copy_from_slice(&new);
    let (plugged, joystick) =
        plug_with("arrays", &ARDUINO, descriptor, SimulatedStick::default(), Pace::Manual)?;
    of(&joystick, |joystick| {
        joystick.number_arrays(PidArrayBases::all(PidArrayBase::One));
        joystick.switch_on();
    });
    let rejected = find("arrays").err().map(|error| error.to_string()).unwrap_or_default();
    ensure(rejected.contains("JoystickOptions::pid_arrays"), || format!("it is not rejected: {rejected}"))?;
    let open = |base| -> Result<HidDevice, Box<dyn Error>> {
        let pid_arrays = PidArrayBases::all(base);
        let mut device = find_with("arrays", JoystickOptions { pid_arrays, ..JoystickOptions::default() })?;
        device.open()?;
        device.write(FORCE_N)?;
        Ok(device)
    };
    let is_off = || of(&joystick, |joystick| !joystick.is_on()) && applied_force_n(&joystick) == DVec3::ZERO;
    let mut device = open(PidArrayBase::One)?;
    wait_until("its motors apply the force", || applied_force_n(&joystick).distance(FORCE_N) < 0.005)?;
    let applied_n = applied_force_n(&joystick);
    device.close()?;
    wait_until("it is off", is_off)?;
    of(&joystick, JoystickFirmware::switch_on);
    open(PidArrayBase::LogicalMinimum)?.close()?;
    wait_until("it is off with the wrong option", is_off)?;
    plugged.unplug();
    Ok(format!(
        "rejected without the option; {} and {} N of 0.4 and -0.2 N with it; off at the end",
        applied_n.x, applied_n.z
    ))
}

/// A motor of x that is wired the other way, a plane at 5 mm, and a hand that goes to 15 mm: the joystick loses its force, and the error
/// names the option.
pub fn reversed() -> Outcome {
    let (plugged, joystick) = plug("reversed", &ARDUINO, Pace::Manual)?;
    of(&joystick, |joystick| joystick.wire_motors([[-1.0, 0.0], [0.0, 1.0]]));
    let device = find_with("reversed", JoystickOptions::default())?;
    // A tick counts as 1 ms, whatever its real time.
    let ms = Arc::<AtomicU64>::default();
    let of_driver = Arc::clone(&ms);
    let mut device = device.with_clock(move || Duration::from_millis(of_driver.load(Ordering::Relaxed)));
    device.open()?;
    let mut error = None;
    while error.is_none() && ms.fetch_add(1, Ordering::Relaxed) < 3000 {
        let time_s = 1e-3 * ms.load(Ordering::Relaxed) as f64;
        of(&joystick, |joystick| joystick.move_hand([0.015 * (2.0 * time_s).min(1.0), 0.0]));
        // The firmware returns a report only at every second poll.
        while !plugged.send_report()? {}
        let at_m = device.read(Duration::ZERO)?.position_m;
        error = device.write(DVec3::X * (-400.0 * (at_m.x - 0.005)).clamp(-5.0, 0.0)).err();
        // The report passes through the kernel.
        pause(Duration::from_micros(300));
    }
    let text = error.map(|error| error.to_string()).unwrap_or_default();
    ensure(text.contains("`JoystickOptions::reverse`"), || format!("a reversed motor gives {text:?}"))?;
    wait_until("it is off", || of(&joystick, |joystick| !joystick.is_on()))?;
    let reported_ms = ms.load(Ordering::Relaxed);
    device.close()?;
    plugged.unplug();
    Ok(format!("without force after {reported_ms} ms, off, and the option is named"))
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
