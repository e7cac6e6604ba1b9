//! `palpate-lab faults`: injects every fault that the loop must survive and checks the forces on the hand.

mod injected;
mod outcome;
mod scene;
mod threaded;

use crate::error::LabError;
use crate::output::Output;
use clap::Args;
use outcome::Outcome;
use serde::Serialize;
use std::io::Write;

/// Every fault that the 1 kHz loop must survive: forces on the hand and recovery
///
/// A simulated hand presses an elastic surface with 2 N, lifts and presses again, for at least 4 s. A fault occurs in the first touch:
/// in the device, its driver, the model side, a local model, the settings or the app. Most faults run in lock step, faults of threads
/// on real threads, all at once. Forces are compared with those of the same movement without a fault.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "It exits with 1 if a fault was not survived.\n\nExamples:\n  palpate-lab faults\n  palpate-lab faults --only jump --json"
)]
pub(crate) struct Faults {
    /// Run only the faults whose names contain this
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
}

#[derive(Serialize)]
struct Report {
    faults: Vec<Outcome>,
}

/// Allowed growth of a force on a thread after missed deadlines, as a multiple of the growth in a tick.
const THREAD_GROWTH: f64 = 4.0;

impl Faults {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let mut faults = Vec::new();
        for (name, expected, scene) in injected::all() {
            if name.contains(&self.only) {
                faults.push(Outcome::of(name, expected, &scene.run()?, 1.0));
            }
        }
        // The panics are intended; their messages are not printed.
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(|_| ()));
        let threaded = self.run_threaded();
        std::panic::set_hook(hook);
        faults.extend(threaded?);
        if faults.is_empty() {
            return Err(LabError::NoFault { name: self.only.clone() });
        }
        let failed: Vec<&str> = faults.iter().filter(|f| !f.survived).map(|f| f.name).collect();
        let names = failed.join(", ");
        let report = Report { faults };
        output.print(&report, |out| print(&report, out))?;
        if names.is_empty() { Ok(()) } else { Err(LabError::NotSurvived { names }) }
    }

    /// Runs the faults of threads at the same time: each lasts as long as its scene, and its loop is idle for most of that time.
    fn run_threaded(&self) -> Result<Vec<Outcome>, LabError> {
        let mut selected = threaded::all();
        selected.retain(|(name, ..)| name.contains(&self.only));
        std::thread::scope(|scope| {
            let runs: Vec<_> = selected.iter().map(|(.., run)| scope.spawn(run)).collect();
            let outcomes = selected.iter().zip(runs).map(|((name, expected, _), run)| {
                let run = run.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
                Ok(Outcome::of(name, *expected, &run, THREAD_GROWTH))
            });
            outcomes.collect()
        })
    }
}

/// Prints a line for each fault.
fn print(report: &Report, out: &mut dyn Write) -> std::io::Result<()> {
    let head = ["fault", "survived", "max, N", "slew, N/ms", "ticks to zero", "recovered"];
    let [fault, survived, force, slew, ticks, recovered] = head;
    writeln!(out, "{fault:<36}{survived:>9}{force:>8}{slew:>12}{ticks:>15}{recovered:>11}  report")?;
    for f in &report.faults {
        let yes_no = |value: bool| if value { "yes" } else { "no" };
        let ticks = if f.is_bridged { "bridged".to_owned() } else { f.ticks_to_safe.to_string() };
        let (survived, recovered) = (yes_no(f.survived), yes_no(f.recovered));
        let (force, slew) = (f.max_force_n, f.max_slew_n_per_ms);
        let name = f.name;
        let reported = &f.reported;
        writeln!(
            out,
            "{name:<36}{survived:>9}{force:>8.2}{slew:>12.3}{ticks:>15}{recovered:>11}  {reported}"
        )?;
        if let Some(why) = &f.why {
            writeln!(out, "    {why}")?;
        }
    }
    Ok(())
}
