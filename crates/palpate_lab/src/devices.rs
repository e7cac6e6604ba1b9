//! `palpate-lab devices`: lists HID devices and tests one gently.

mod arm;
mod device_test;
mod joystick_flags;
mod listing;
mod response;
mod watch;

use crate::error::{LabError, check};
use crate::output::Output;
use arm::Arm;
use clap::Args;
use joystick_flags::Reverse;
use listing::{Line, Listed, line, print};
use palpate_hid::{
    FoundDevice, HidBus, HidError, HidInfo, HidSelector, JoystickOptions, PidArrayBases, SystemBus,
};
use std::sync::Arc;

/// HID devices: list, watch, or test one gently
///
/// Without an option the devices are listed. A test reads the device for some seconds and lets it push and pull gently along each of
/// its axes, below 0.5 N, with the loop and safety chain of an app. It states which axes move and in which direction, and names the
/// option to change for a reversed or missing motor. It requires a confirmation.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab devices\n  palpate-lab devices --watch\n  palpate-lab devices --test 256f:c635\n  palpate-lab devices --test /dev/hidraw3 --force-n 0.2\n  palpate-lab devices --test 1234:0006 --board polhem-v3"
)]
pub(crate) struct Devices {
    /// List devices as they are plugged in and out, until interrupted or for --seconds
    #[arg(long)]
    watch: bool,
    /// Test the device with this path, serial number, or VENDOR:PRODUCT
    #[arg(long, value_name = "ID", conflicts_with = "watch")]
    test: Option<String>,
    /// Maximum force of the test, N: below 0.5
    #[arg(long, default_value_t = 0.3, allow_hyphen_values = true, requires = "test")]
    force_n: f64,
    /// Assumed maximum force of a joystick, N. No protocol reports it; if the real one is larger, the test is stronger in
    /// proportion
    #[arg(long, default_value_t = JoystickOptions::CAREFUL_FULL_SCALE_N, allow_hyphen_values = true, requires = "test")]
    full_scale_n: f64,
    /// First number of a joystick's PID arrays with Logical Minimum 0: minimum (0) or one; or a list for single arrays, such as
    /// control=one,operation=minimum, with the names control, operation, type and status
    #[arg(long, value_name = "BASE", value_parser = joystick_flags::pid_arrays, requires = "test")]
    pid_arrays: Option<PidArrayBases>,
    /// Use only x of a joystick, for a wheel: it has one motor, and its y is a pedal
    #[arg(long, requires = "test")]
    no_y: bool,
    /// Reverse the force of a joystick along x, along y, or both
    #[arg(long, value_name = "AXES", requires = "test", value_enum)]
    reverse: Option<Reverse>,
    /// Arm of a board. No board reports it, and with the dimensions of another arm a force may be several times as large. A board
    /// without this flag is read and exerts no force
    #[arg(long, value_enum, requires = "test")]
    board: Option<Arm>,
    /// Duration of a test or watch, s [default: 6 for a test]
    #[arg(long, allow_hyphen_values = true)]
    seconds: Option<f64>,
    /// Test without confirmation
    #[arg(long, requires = "test")]
    yes: bool,
    /// Treat 16C0:0486, the numbers of every Teensy with raw HID, as a 3-DOF board
    #[arg(long)]
    teensy_is_board: bool,
    /// List devices of unknown kinds too
    #[arg(long)]
    all: bool,
}

/// Maximum duration of a test or watch, s.
const MAX_S: f64 = 86_400.0;

impl Devices {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        if let Some(seconds) = self.seconds {
            let ok = seconds > 0.0 && seconds <= MAX_S;
            check("--seconds", seconds, ok, format!("above 0 and at most {MAX_S}"))?;
        }
        let ok = self.force_n > 0.0 && self.force_n < 0.5;
        check("--force-n", self.force_n, ok, "above 0 and below 0.5")?;
        let ok = self.full_scale_n >= self.force_n && self.full_scale_n <= 1000.0;
        check("--full-scale-n", self.full_scale_n, ok, "at least --force-n and at most 1000")?;
        let bus: Arc<dyn HidBus> = Arc::new(SystemBus::new()?);
        match &self.test {
            Some(id) => device_test::DeviceTest {
                selector: selector(id, self.teensy_is_board, &*bus)?,
                force_n: self.force_n,
                joystick: JoystickOptions {
                    full_scale_n: self.full_scale_n,
                    pid_arrays: self.pid_arrays.unwrap_or_default(),
                    use_y: !self.no_y,
                    reverse: self.reverse.map_or([false; 2], Reverse::axes),
                    // The test states the directions itself.
                    check_direction: false,
                    ..JoystickOptions::default()
                },
                arm: self.board,
                seconds: self.seconds.unwrap_or(6.0),
                needs_confirmation: !self.yes,
            }
            .run(bus, output),
            None if self.watch => {
                watch::watch(&*bus, self.seconds, output, |info| line(&*bus, info, self.teensy_is_board))
            }
            None => self.list(&*bus, output),
        }
    }

    fn list(&self, bus: &dyn HidBus, output: &Output) -> Result<(), LabError> {
        let infos = bus.list()?;
        let lines: Vec<Line> = infos.iter().map(|info| line(bus, info, self.teensy_is_board)).collect();
        let is_supported = |info: &&HidInfo, is_board| FoundDevice::identify(bus, info, is_board).is_some();
        let may_be = infos.iter().filter(|info| !self.teensy_is_board && !is_supported(info, false));
        let may_be_boards =
            may_be.filter(|info| is_supported(info, true)).map(|info| info.path.clone()).collect();
        let (mut supported, others): (Vec<Line>, Vec<Line>) =
            lines.into_iter().partition(|line| line.kind.is_some());
        let count = others.len();
        if self.all {
            supported.extend(others);
        }
        let listed = Listed { devices: supported, others: count, may_be_boards };
        output.print(&listed, |out| print(&listed, self.all, out))
    }
}

/// Selector for `id`: a path, a serial number, or VENDOR:PRODUCT.
fn selector(id: &str, teensy_is_board: bool, bus: &dyn HidBus) -> Result<HidSelector, HidError> {
    let base = HidSelector { treat_teensy_as_board: teensy_is_board, ..HidSelector::default() };
    let present = bus.list()?;
    if present.iter().any(|info| info.path == id) || id.starts_with('/') {
        return Ok(HidSelector { path: Some(id.into()), ..base });
    }
    let number = |text: &str| u16::from_str_radix(text, 16).ok();
    let numbers = id.split_once(':').and_then(|(vendor, product)| Some((number(vendor)?, number(product)?)));
    Ok(match numbers {
        Some((vendor, product)) => HidSelector { vendor: Some(vendor), product: Some(product), ..base },
        None => HidSelector { serial: Some(id.into()), ..base },
    })
}

#[cfg(test)]
mod tests;
