//! Devices as they are plugged in and out.

use super::listing::{Line, row};
use crate::error::LabError;
use crate::output::Output;
use palpate_hid::{HidBus, HidInfo};
use serde::Serialize;
use std::time::Duration;

/// Polling period; listing takes up to a tenth of a second.
const PERIOD: Duration = Duration::from_millis(500);

#[derive(Serialize)]
struct Change<'a> {
    change: &'static str,
    device: &'a Line,
}

/// Prints the present devices and then each change; a line of JSON each with `--json`.
#[expect(clippy::disallowed_methods, reason = "polls in wall-clock time; no loop runs here")]
pub(super) fn watch(
    bus: &dyn HidBus,
    seconds: Option<f64>,
    output: &Output,
    describe: impl Fn(&HidInfo) -> Line,
) -> Result<(), LabError> {
    let start = std::time::Instant::now();
    let mut listed: Vec<(HidInfo, Line)> = Vec::new();
    loop {
        let present = bus.list()?;
        let gone = listed.extract_if(.., |(info, _)| !present.contains(info));
        for (_, line) in gone.collect::<Vec<_>>() {
            print_change(output, "out", &line)?;
        }
        // Access rights are granted a moment after a device appears.
        for (info, line) in listed.iter_mut().filter(|(_, line)| !line.error.is_empty()) {
            let now = describe(info);
            if now != *line {
                print_change(output, "now", &now)?;
                *line = now;
            }
        }
        for info in present {
            if !listed.iter().any(|(other, _)| *other == info) {
                let line = describe(&info);
                print_change(output, "in", &line)?;
                listed.push((info, line));
            }
        }
        let left = seconds.map(|seconds| seconds - start.elapsed().as_secs_f64());
        if left.is_some_and(|left| left <= 0.0) {
            return Ok(());
        }
        std::thread::sleep(left.map_or(PERIOD, |left| PERIOD.min(Duration::from_secs_f64(left))));
    }
}

fn print_change(output: &Output, change: &'static str, device: &Line) -> Result<(), LabError> {
    output.print_line(&Change { change, device }, |out| {
        write!(out, "{change:<4}")?;
        row(device, out)
    })
}
