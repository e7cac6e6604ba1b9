//! What is plugged in and out.

use super::listing::{Line, row};
use crate::error::LabError;
use crate::output::Output;
use palpate_hid::{HidBus, HidInfo};
use serde::Serialize;
use std::time::Duration;

/// How often it is looked: listing takes up to a tenth of a second.
const EVERY: Duration = Duration::from_millis(500);

#[derive(Serialize)]
struct Change<'a> {
    change: &'static str,
    device: &'a Line,
}

/// Prints each device as it comes and goes, those that are there already first; a line of JSON for each with `--json`.
#[expect(clippy::disallowed_methods, reason = "whoever watches waits; no loop runs here")]
pub(super) fn watch(
    bus: &dyn HidBus,
    seconds: Option<f64>,
    output: &Output,
    describe: impl Fn(&HidInfo) -> Line,
) -> Result<(), LabError> {
    let began = std::time::Instant::now();
    let mut known: Vec<(HidInfo, Line)> = Vec::new();
    loop {
        let present = bus.list()?;
        let gone = known.extract_if(.., |(info, _)| !present.contains(info));
        for (_, line) in gone.collect::<Vec<_>>() {
            tell(output, "out", &line)?;
        }
        // One that could not be opened may be by now: its rights come a moment after it.
        for (info, line) in known.iter_mut().filter(|(_, line)| !line.refused.is_empty()) {
            let now = describe(info);
            if now != *line {
                tell(output, "now", &now)?;
                *line = now;
            }
        }
        for info in present {
            if !known.iter().any(|(there, _)| *there == info) {
                let line = describe(&info);
                tell(output, "in", &line)?;
                known.push((info, line));
            }
        }
        let left = seconds.map(|seconds| seconds - began.elapsed().as_secs_f64());
        if left.is_some_and(|left| left <= 0.0) {
            return Ok(());
        }
        std::thread::sleep(left.map_or(EVERY, |left| EVERY.min(Duration::from_secs_f64(left))));
    }
}

fn tell(output: &Output, change: &'static str, device: &Line) -> Result<(), LabError> {
    output.print_line(&Change { change, device }, |out| {
        write!(out, "{change:<4}")?;
        row(device, out)
    })
}
