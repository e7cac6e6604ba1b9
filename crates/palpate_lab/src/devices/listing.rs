//! Devices as a table or as JSON.

use palpate_hid::{FoundDevice, HidBus, HidInfo};
use serde::Serialize;
use std::io::Write;

/// Devices that are plugged in.
#[derive(Serialize)]
pub(super) struct Listed {
    pub(super) devices: Vec<Line>,
    /// Number of devices of unsupported kinds.
    pub(super) others: usize,
    /// Paths of devices that are boards with `--teensy-is-board`.
    pub(super) may_be_boards: Vec<String>,
}

/// Device in a list.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub(super) struct Line {
    pub(super) kind: Option<String>,
    pub(super) name: String,
    pub(super) vendor: String,
    pub(super) product: String,
    pub(super) serial: String,
    pub(super) path: String,
    /// Error when opening the device; empty without error and for unsupported kinds.
    pub(super) error: String,
}

/// Entry of the device `info`.
pub(super) fn line(bus: &dyn HidBus, info: &HidInfo, teensy_is_board: bool) -> Line {
    let found = FoundDevice::identify(bus, info, teensy_is_board);
    let error = match &found {
        Some(_) => bus.open(info).err().map(|error| error.to_string()).unwrap_or_default(),
        None => String::new(),
    };
    Line {
        kind: found.map(|found| found.kind.to_string()),
        name: info.name.clone(),
        vendor: format!("{:04x}", info.vendor),
        product: format!("{:04x}", info.product),
        serial: info.serial.clone(),
        path: info.path.clone(),
        error,
    }
}

/// Prints the table.
pub(super) fn print(listed: &Listed, all: bool, out: &mut dyn Write) -> std::io::Result<()> {
    if listed.devices.is_empty() {
        writeln!(out, "no device of a supported kind is plugged in")?;
    } else {
        head(out)?;
        for line in &listed.devices {
            row(line, out)?;
        }
    }
    for path in &listed.may_be_boards {
        writeln!(out, "{path} is a Teensy that may be a 3-DOF board; if it is one, pass --teensy-is-board")?;
    }
    match listed.others {
        0 => Ok(()),
        _ if all => Ok(()),
        1 => writeln!(out, "1 other HID device; --all lists it"),
        others => writeln!(out, "{others} other HID devices; --all lists them"),
    }
}

fn head(out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(out, "{:<24}{:<11}{:<16}{:<16}name", "kind", "numbers", "serial", "path")
}

/// Prints a device.
pub(super) fn row(line: &Line, out: &mut dyn Write) -> std::io::Result<()> {
    let Line { kind, name, vendor, product, serial, path, error } = line;
    let kind = kind.as_deref().unwrap_or("unsupported");
    let numbers = format!("{vendor}:{product}");
    let or = |text: &str| if text.is_empty() { "-".to_owned() } else { text.to_owned() };
    writeln!(out, "{kind:<24}{numbers:<11}{:<16}{path:<16}{}", or(serial), or(name))?;
    if error.is_empty() { Ok(()) } else { writeln!(out, "    {error}") }
}
