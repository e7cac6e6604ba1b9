//! Drivers against devices that exist only in a Linux kernel, by way of `uhid`: found, opened, read and written through hidraw as
//! real ones are. `.ci/virtual-hardware` boots a kernel that has it and runs this there; where `/dev/uhid` is there and may be
//! opened it runs on the machine itself as well. Every device it asks for it names by its serial number: real ones stay alone.
//!
//! Prints a line for each scenario and a last one with the word given as argument, by which it is known that all were run.

#![expect(clippy::print_stdout, reason = "whoever boots the guest reads what it prints")]

#[cfg(target_os = "linux")]
mod guest;

use std::process::ExitCode;

#[cfg(target_os = "linux")]
fn main() -> ExitCode {
    guest::run_all(&std::env::args().nth(1).unwrap_or_default())
}

#[cfg(not(target_os = "linux"))]
fn main() -> ExitCode {
    println!("virtual devices are those of Linux");
    ExitCode::FAILURE
}
