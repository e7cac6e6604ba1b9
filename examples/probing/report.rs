//! Report at the end: a table, the trace as CSV and a plot as SVG.

use super::options::Options;
use super::scene::AtRest;
use super::{comparable, plot, touches};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{LoopTiming, ModelRate, ModelStepCount, TickRecording};
use palpate_haptics::TickRecord;
use palpate_local::Sample;
use palpate_reduce::{BuilderOptions, Comparison, ComparisonOptions};
use std::io::{BufWriter, Write};

/// Writes the report when the app ends.
pub struct ReportPlugin;

impl Plugin for ReportPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Last, report.pipe(palpate_stage::exit_on_error).run_if(on_message::<AppExit>));
    }
}

/// Data of a run.
pub struct Run<'a> {
    pub samples: &'a [Sample],
    pub records: &'a [TickRecord],
    pub comparison: Comparison,
}

fn report(
    tools: Query<(&HapticTool, &TickRecording, &LoopTiming)>,
    at_rest: Option<Res<AtRest>>,
    steps: Res<ModelStepCount>,
    rate: Res<ModelRate>,
    options: Res<Options>,
    mut done: Local<bool>,
) -> Result {
    let (Ok((tool, recording, timing)), Some(at_rest)) = (tools.single(), at_rest) else { return Ok(()) };
    let at_rest = &at_rest.0;
    if std::mem::replace(&mut *done, true) || recording.samples.is_empty() {
        return Ok(());
    }
    let contact = tool.contact()?;
    let number = |record: &TickRecord| record.sample.map_or(0, |sample| sample.sequence);
    let records = comparable::of_last_loop(&recording.records, number);
    let touches = records.iter().filter(|record| record.rendered.force_n != DVec3::ZERO).map(number);
    let samples = &recording.samples[comparable::start(&recording.samples, touches)..];
    let builder = BuilderOptions::of(at_rest);
    let settings = ComparisonOptions { builder, period_ticks: rate.ticks() as usize, ..default() };
    let comparison = Comparison::run(at_rest, &contact, samples, &Scheme::ALL, &settings)?;
    let run = Run { samples, records, comparison };
    print_table(&run, recording, timing, steps.0, tool.scheme)?;
    let touches = touches::find(&run, at_rest, tool.shape.radius_m());
    touches::print(&touches)?;
    let trace = options.out.join("trace.csv");
    write_trace(&run, BufWriter::new(std::fs::File::create(&trace)?))?;
    let picture = options.out.join("force.svg");
    plot::force_over_time(&run, &picture)?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "\ntrace  {}\nplot   {}", trace.display(), picture.display())?;
    writeln!(out, r#"{{"errors":{},"touches":{}}}"#, errors_json(&run), touches::json(&touches))?;
    Ok(())
}

fn print_table(
    run: &Run,
    recording: &TickRecording,
    timing: &LoopTiming,
    model_steps: u64,
    scheme: Scheme,
) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    let peak = run.records.iter().map(|r| r.force_n.length()).fold(0.0, f64::max);
    // From the records, because the loop's report is updated only every 64 ticks.
    let missed: u64 = run.records.iter().map(|r| r.elapsed - 1).sum();
    writeln!(out, "\nticks                    {}", run.records.len())?;
    writeln!(out, "missed deadlines         {missed}")?;
    writeln!(
        out,
        "wake-up lateness, us     p50 {:.0}   p99 {:.0}   p99.9 {:.0}   max {:.0}",
        timing.lateness_p50_us, timing.lateness_p99_us, timing.lateness_p999_us, timing.lateness_max_us
    )?;
    writeln!(out, "tick cost, us            p50 {:.1}   p99 {:.1}", timing.cost_p50_us, timing.cost_p99_us)?;
    writeln!(out, "model steps              {model_steps}")?;
    writeln!(out, "peak force, N            {peak:.2}")?;
    if recording.dropped > 0 {
        writeln!(out, "tick records dropped     {}", recording.dropped)?;
    }
    writeln!(out, "\nforce error against the full body at 1 kHz, relative RMS")?;
    let percent = |error: Option<f64>| match error {
        Some(error) => format!("{:6.2} %", 100.0 * error),
        None => "-  (no contact)".into(),
    };
    for scheme in Scheme::ALL {
        writeln!(out, "  {:22} {}", scheme.name(), percent(run.comparison.relative_rms_error(scheme, 0)))?;
    }
    writeln!(
        out,
        "  {:22} {}   ({} on the thread)",
        "as rendered",
        percent(rendered_error(run)),
        scheme.name()
    )
}

/// The relative errors that have a reference, as JSON.
fn errors_json(run: &Run) -> String {
    let of_schemes = Scheme::ALL.map(|scheme| (scheme.name(), run.comparison.relative_rms_error(scheme, 0)));
    let all = of_schemes.into_iter().chain([("as_rendered", rendered_error(run))]);
    let fields = all.filter_map(|(name, error)| Some(format!(r#""{name}":{:.5}"#, error?)));
    format!("{{{}}}", fields.collect::<Vec<_>>().join(","))
}

/// Relative error of the force that the loop rendered, before the safety chain.
fn rendered_error(run: &Run) -> Option<f64> {
    let first = run.samples.first()?.sequence;
    let (mut error, mut reference) = (0.0, 0.0);
    for record in run.records {
        let Some(sample) = record.sample.filter(|s| s.sequence >= first) else { continue };
        let Some(oracle) = run.comparison.oracle_n.get((sample.sequence - first) as usize) else { continue };
        error += (record.rendered.force_n - *oracle).length_squared();
        reference += oracle.length_squared();
    }
    (reference > 0.0).then(|| (error / reference).sqrt())
}

/// One row for each tick: what came in, what went out, what the full body and every scheme say.
fn write_trace(run: &Run, mut out: impl Write) -> std::io::Result<()> {
    write!(out, "t_s,sequence,elapsed_ticks,x_m,y_m,z_m,model_sequence,gain,lateness_us,cost_us")?;
    let names = Scheme::ALL.map(Scheme::name);
    for name in ["force", "model_force", "oracle"].iter().chain(&names) {
        write!(out, ",{name}_x_n,{name}_y_n,{name}_z_n")?;
    }
    writeln!(out)?;
    let first = run.samples.first().map_or(0, |s| s.sequence);
    for record in run.records {
        let Some(sample) = record.sample.filter(|s| s.sequence >= first) else { continue };
        let at = (sample.sequence - first) as usize;
        let Some(&oracle) = run.comparison.oracle_n.get(at) else { continue };
        let [x, y, z] = sample.position_m.to_array();
        write!(out, "{:.3},{},{},{x},{y},{z},", sample.time_s, sample.sequence, record.elapsed)?;
        if let Some(model) = record.rendered.model {
            write!(out, "{}", model.sequence)?;
        }
        let microseconds = |ns: u64| ns as f64 * 1e-3;
        let (late, cost) = (microseconds(record.timing.lateness_ns), microseconds(record.timing.cost_ns));
        write!(out, ",{},{late},{cost}", record.safety.gain)?;
        let schemes = run.comparison.displayed_n.iter().filter_map(|(_, forces)| forces.get(at).copied());
        for force in [record.force_n, record.rendered.force_n, oracle].into_iter().chain(schemes) {
            write!(out, ",{},{},{}", force.x, force.y, force.z)?;
        }
        writeln!(out)?;
    }
    out.flush()
}
