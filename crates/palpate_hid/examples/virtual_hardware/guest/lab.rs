//! `palpate-lab` lists the devices and tests a joystick, where the guest contains it.

use super::check::{Outcome, Unavailable, ensure};
use super::enumeration::plug_all;
use super::joystick;
use super::virtual_device::Pace;
use palpate_hid::simulated::SimulatedStick;
use std::error::Error;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Path at which `.ci/virtual-hardware` installs the program.
const PROGRAM: &str = "/bin/palpate-lab";

pub fn run() -> Outcome {
    if !Path::new(PROGRAM).exists() {
        return Err(Unavailable("the guest does not contain palpate-lab").into());
    }
    let plugged = plug_all()?;
    let listed = Command::new(PROGRAM).args(["devices", "--all"]).output()?;
    let output = String::from_utf8_lossy(&listed.stdout);
    ensure(listed.status.success(), || {
        format!("{}: {}", listed.status, String::from_utf8_lossy(&listed.stderr))
    })?;
    for (device, serial, _) in &plugged {
        ensure(output.contains(serial), || format!("{serial} at {} is not listed: {output}", device.node))?;
    }
    let watched = Command::new(PROGRAM).args(["devices", "--watch", "--seconds", "0.5"]).output()?;
    let output = String::from_utf8_lossy(&watched.stdout);
    let listed = output.lines().filter(|line| line.starts_with("in ")).count();
    ensure(watched.status.success() && listed >= plugged.len(), || {
        format!("{listed} devices appeared: {output}")
    })?;
    let count = plugged.len();
    drop(plugged);
    let (forces, max_n) = test_joystick()?;
    Ok(format!(
        "all {count} devices are listed by serial number; a joystick took {forces} forces up to {max_n:.2} N, and a reversed one names its option"
    ))
}

/// Force of the test, N.
const FORCE_N: f64 = 0.2;

/// Tests a joystick: the forces match the output of the program, none without confirmation, none afterwards. Returns their number and
/// the maximum, N.
#[expect(clippy::disallowed_methods, reason = "the program runs in real time")]
fn test_joystick() -> Result<(f64, f64), Box<dyn Error>> {
    let pace = Pace::Every(Duration::from_millis(2));
    // The emulated kernel takes about 150 reports a second, each of which advances the stick by a step.
    let own = SimulatedStick { step_s: 6e-3, ..SimulatedStick::default() };
    let descriptor = joystick::bytes(joystick::OPENFFBOARD.descriptor)?;
    let (_plugged, stick) = joystick::plug_with("tested", &joystick::OPENFFBOARD, descriptor, own, pace)?;
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
    let unconfirmed = Command::new(PROGRAM).args(of_test).stdin(Stdio::null()).output()?;
    ensure(!unconfirmed.status.success() && joystick::of(&stick, |stick| stick.effects()) == 0, || {
        format!("tested without confirmation: {}", String::from_utf8_lossy(&unconfirmed.stdout))
    })?;
    let mut testing =
        Command::new(PROGRAM).args(of_test).args(["--yes", "--json"]).stdout(Stdio::piped()).spawn()?;
    let mut applied_n = 0.0_f64;
    while testing.try_wait()?.is_none() {
        applied_n = applied_n.max(joystick::applied_force_n(&stick).length());
        std::thread::sleep(Duration::from_millis(5));
    }
    let tested = testing.wait_with_output()?;
    // The same with a motor that is wired the other way.
    joystick::of(&stick, |stick| stick.wire_motors([[-1.0, 0.0], [0.0, 1.0]]));
    let reversed = Command::new(PROGRAM).args(of_test).arg("--yes").output()?;
    let shown = String::from_utf8_lossy(&reversed.stdout);
    ensure(reversed.status.success() && shown.contains("(--reverse x)"), || {
        format!("a reversed motor gives {}: {shown}", reversed.status)
    })?;
    let output = String::from_utf8_lossy(&tested.stdout);
    let number = |name: &str| {
        let (_, rest) = output.split_once(&format!("\"{name}\":"))?;
        rest.split([',', '}']).next()?.trim().parse::<f64>().ok()
    };
    let (forces, max_n) =
        number("forces").zip(number("max_force_n")).ok_or_else(|| format!("the output is {output}"))?;
    ensure(tested.status.success() && forces > 20.0, || format!("{}: {output}", tested.status))?;
    ensure(output.contains("\"advice\":[]") || output.contains("\"advice\": []"), || {
        format!("a motor of the right sign gives advice: {output}")
    })?;
    ensure(
        max_n > 0.5 * FORCE_N && max_n <= FORCE_N && applied_n <= FORCE_N * 1.01 && applied_n > 0.0,
        || format!("up to {applied_n} N were applied: {output}"),
    )?;
    ensure(!joystick::of(&stick, |stick| stick.is_on()), || "its actuators are on afterwards".into())?;
    Ok((forces, max_n))
}
