//! Tests the drivers with virtual devices of a Linux kernel, created through `uhid`: they are found, opened, read and written through
//! hidraw like real ones. `.ci/virtual-hardware` boots a kernel with uhid and runs this program in it. It also runs on a machine where
//! `/dev/uhid` exists and can be opened. Each selector has a serial number, so real devices are not touched.
//!
//! Prints a line for each scenario, and a last line that ends with the argument, which shows that all scenarios ran.

#![expect(clippy::print_stdout, reason = "the output is read by the script that boots the guest")]

#[cfg(target_os = "linux")]
mod guest;

use std::process::ExitCode;

#[cfg(target_os = "linux")]
fn main() -> ExitCode {
    guest::run_all(&std::env::args().nth(1).unwrap_or_default())
}

#[cfg(not(target_os = "linux"))]
fn main() -> ExitCode {
    println!("virtual devices need Linux");
    ExitCode::FAILURE
}
