//! `palpate-lab blackbox`: a black box, or a recording of a whole run, in numbers and as a figure.

mod plot;
mod summary;

use crate::error::{LabError, whole};
use crate::output::{Output, write_files};
use clap::Args;
use palpate_haptics::{BlackBoxTick, Recording};
use std::io::{Result as IoResult, Write};
use std::path::{Path, PathBuf};
use summary::{Summary, Times};

/// Contents of a black box, the loop's last ticks, or of a recording of a whole run
///
/// Prints a summary and the last ticks: position of the tool, force before and after the safety chain, active stages of the chain,
/// lateness and cost, active local model, device errors. With `--plot` it draws position, force and times over time, with missed
/// deadlines and device errors shaded.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate-lab blackbox blackbox-1-the-device-failed.csv\n  palpate-lab blackbox run.csv --json\n  palpate-lab blackbox run.csv --plot run.svg --last 40"
)]
pub(crate) struct Blackbox {
    /// File written by a black box or a recorder
    file: PathBuf,
    /// Write the figure to this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Number of last ticks to print
    #[arg(value_parser = whole, allow_hyphen_values = true, long, default_value_t = 12)]
    last: usize,
}

impl Blackbox {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let recording = Recording::read_csv(&self.file)?;
        let ticks = recording.ticks();
        let summary = Summary::of(ticks).ok_or_else(|| LabError::NoTicks { path: self.file.clone() })?;
        if self.plot.is_some() || output.folder().is_some() {
            let figure = plot::figure(ticks)?;
            if let Some(folder) = output.folder() {
                write_files(folder, &[("blackbox.svg", figure.clone())])?;
            }
            if let Some(path) = &self.plot {
                write_file(path, figure)?;
            }
        }
        output.print(&summary, |out| {
            summarise(out, &summary)?;
            list(out, &ticks[ticks.len().saturating_sub(self.last)..])
        })
    }
}

/// Writes `contents` to `path` atomically.
fn write_file(path: &Path, contents: String) -> Result<(), LabError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match path.file_name().and_then(|name| name.to_str()) {
        Some(name) => write_files(folder, &[(name, contents)]),
        None => Err(LabError::Write {
            path: path.to_owned(),
            source: std::io::Error::new(std::io::ErrorKind::InvalidInput, "it has no file name"),
        }),
    }
}

fn summarise(out: &mut dyn Write, summary: &Summary) -> IoResult<()> {
    let Summary { ticks, first_sequence, last_sequence, span_s, missed_deadlines, .. } = summary;
    let mut line = |name: &str, text: String| writeln!(out, "{name:18}{text}");
    line("ticks", format!("{ticks}, number {first_sequence} to {last_sequence}, {span_s:.3} s"))?;
    line("missed deadlines", missed_deadlines.to_string())?;
    if summary.periods_not_in_file > 0 {
        line("not in the file", format!("{} periods", summary.periods_not_in_file))?;
    }
    let samples = &summary.samples;
    let named = [("measured", samples.measured), ("repeated", samples.repeated), ("none", samples.none)];
    line("samples", counts(named.into_iter()))?;
    let (before, written) = (summary.peak_force_before_n, summary.peak_force_written_n);
    line("maximum force", format!("{before:.3} N before the safety chain, {written:.3} N written"))?;
    line("safety chain", counts(summary.acted.iter().map(|acted| (acted.stage, acted.ticks))))?;
    for (name, times) in [("lateness", &summary.lateness_us), ("cost", &summary.cost_us)] {
        let Times { p50, p99, max } = times;
        line(name, format!("{p50:.1} µs median, {p99:.1} µs at p99, {max:.1} µs maximum"))?;
    }
    let models = summary.models.iter();
    let models = models.map(|body| {
        let (models, body, epoch) = (body.models, body.body, body.epoch);
        format!("{models} of body {body}, epoch {epoch}")
    });
    line("local models", or_none(models.collect()))?;
    let errors = summary.device_errors.iter();
    let errors = errors.map(|(name, ticks)| format!("{name} ({ticks})"));
    line("device errors", or_none(errors.collect()))
}

/// Nonzero counts with their names: `measured 3, repeated 1`.
fn counts<'a>(named: impl Iterator<Item = (&'a str, u64)>) -> String {
    or_none(named.filter(|(_, n)| *n > 0).map(|(name, n)| format!("{name} {n}")).collect())
}

fn or_none(parts: Vec<String>) -> String {
    if parts.is_empty() { "none".into() } else { parts.join(", ") }
}

/// A row for each of `ticks`.
fn list(out: &mut dyn Write, ticks: &[BlackBoxTick]) -> IoResult<()> {
    if ticks.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "\n{:>8} {:>9} {:>26} {:>9} {:>9} {:>6} {:>9} {:>9} {:>8}  events",
        "tick", "time, s", "position, mm", "before, N", "after, N", "gain", "late, µs", "cost, µs", "model"
    )?;
    for tick in ticks {
        let position = tick.sample.map_or("-".into(), |sample| {
            let [x, y, z] = sample.position_m.to_array().map(|v| v * 1e3);
            format!("{x:.2} {y:.2} {z:.2}")
        });
        let model = tick.model.map_or("-".into(), |model| model.sequence.to_string());
        let [before_n, written_n] = [tick.before_n, tick.written_n].map(|force| force.length());
        let [late, cost] = [tick.timing.lateness_ns, tick.timing.cost_ns].map(|ns| ns as f64 * 1e-3);
        let row = format!(
            "{:>8} {:>9.3} {position:>26} {before_n:>9.3} {written_n:>9.3} {:>6.3} {late:>9.1} {cost:>9.1} {model:>8}  {}",
            tick.sequence,
            tick.time_s,
            tick.gain,
            unusual(tick)
        );
        writeln!(out, "{}", row.trim_end())?;
    }
    Ok(())
}

/// Everything unusual about `tick`.
fn unusual(tick: &BlackBoxTick) -> String {
    let mut words = Vec::new();
    if tick.elapsed > 1 {
        words.push(format!("{} missed", tick.elapsed - 1));
    }
    words.extend(tick.read_failed.map(|fault| format!("read: {fault}")));
    words.extend(tick.write_failed.map(|fault| format!("write: {fault}")));
    words.extend((!tick.acted.is_empty()).then(|| tick.acted.to_string()));
    words.join(", ")
}
