//! The real program lists what is plugged in, where the guest has it.

use super::check::{NotHere, Outcome, ensure};
use super::enumeration::plug_all;
use std::path::Path;
use std::process::Command;

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
    Ok(format!("it lists all {} devices by their serial numbers", plugged.len()))
}
