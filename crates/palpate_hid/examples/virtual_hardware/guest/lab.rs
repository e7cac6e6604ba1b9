//! The real program lists what is plugged in and tests a joystick, where the guest has it.

use super::check::{NotHere, Outcome, ensure};
use super::enumeration::plug_all;
use super::joystick;
use super::virtual_device::Pace;
use std::error::Error;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Where `.ci/virtual-hardware` puts it.
const PROGRAM: &str = "/bin/palpate-lab";

pub fn run() -> Outcome {
    if !Path::new(PROGRAM).exists() {
        return Err(NotHere("the guest has no palpate-lab").into());
    }
    let plugged = plug_all()?;
    let listed = Command::new(PROGRAM).args(["devices", "--all"]).output()?;
    let says = String::from_utf8_lossy(&listed.stdout);
    ensure(listed.status.success(), || {
        format!("{}: {}", listed.status, String::from_utf8_lossy(&listed.stderr))
    })?;
    for (device, serial, _) in &plugged {
        ensure(says.contains(serial), || format!("{serial} at {} is not in its list: {says}", device.node))?;
    }
    let watched = Command::new(PROGRAM).args(["devices", "--watch", "--seconds", "0.5"]).output()?;
    let says = String::from_utf8_lossy(&watched.stdout);
    let come = says.lines().filter(|line| line.starts_with("in ")).count();
    ensure(watched.status.success() && come >= plugged.len(), || format!("{come} have come: {says}"))?;
    let count = plugged.len();
    drop(plugged);
    let (forces, most_n) = test_joystick()?;
    Ok(format!(
        "it lists all {count} devices by their serial numbers; a joystick took {forces} forces up to {most_n:.2} N"
    ))
}

/// The force that the test is asked for, N.
const FORCE_N: f64 = 0.2;

/// A joystick that is tested: forces as many and as large as the program says, none without a yes, and none afterwards. How many,
/// and the largest, N.
#[expect(clippy::disallowed_methods, reason = "the program runs in the time of the guest")]
fn test_joystick() -> Result<(f64, f64), Box<dyn Error>> {
    let pace = Pace::Every(Duration::from_millis(2));
    let (_plugged, stick) = joystick::plug("tested", &joystick::OPENFFBOARD, pace)?;
    let of_test = [
        "devices",
        "--test",
        "tested",
        "--force-n",
        &FORCE_N.to_string(),
        "--full-scale-n",
        "50",
        "--seconds",
        "2",
    ];
    let unasked = Command::new(PROGRAM).args(of_test).stdin(Stdio::null()).output()?;
    ensure(!unasked.status.success() && joystick::of(&stick, |stick| stick.effects()) == 0, || {
        format!("it was tested without a yes: {}", String::from_utf8_lossy(&unasked.stdout))
    })?;
    let mut testing =
        Command::new(PROGRAM).args(of_test).args(["--yes", "--json"]).stdout(Stdio::piped()).spawn()?;
    let mut felt_n = 0.0_f64;
    while testing.try_wait()?.is_none() {
        felt_n = felt_n.max(joystick::felt_n(&stick).length());
        std::thread::sleep(Duration::from_millis(5));
    }
    let tested = testing.wait_with_output()?;
    let says = String::from_utf8_lossy(&tested.stdout);
    let number = |name: &str| {
        let (_, rest) = says.split_once(&format!("\"{name}\":"))?;
        rest.split([',', '}']).next()?.trim().parse::<f64>().ok()
    };
    let (forces, most_n) =
        number("forces").zip(number("max_force_n")).ok_or_else(|| format!("it says {says}"))?;
    ensure(tested.status.success() && forces > 20.0, || format!("{}: {says}", tested.status))?;
    ensure(most_n > 0.5 * FORCE_N && most_n <= FORCE_N && felt_n <= FORCE_N * 1.01 && felt_n > 0.0, || {
        format!("up to {felt_n} N were felt: {says}")
    })?;
    ensure(!joystick::of(&stick, |stick| stick.is_on()), || "its actuators are on afterwards".into())?;
    Ok((forces, most_n))
}
