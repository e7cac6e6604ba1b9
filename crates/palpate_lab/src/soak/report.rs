//! Report of a run and check of its guarantees.

use super::load::LoadKind;
use super::memory::Memory;
use super::model_side::ModelSide;
use super::probing_hand::ReceivedForces;
use crate::error::LabError;
use palpate_haptics::{BaselineReport, RealTimeReport, TimeHistogram};
use serde::Serialize;
use std::io::Write;

/// Result of a run.
pub(super) struct Outcome {
    pub(super) model_side: ModelSide,
    pub(super) felt: ReceivedForces,
    pub(super) allocations: u64,
    pub(super) bare: BaselineReport,
    pub(super) memory: Memory,
    pub(super) load_rounds: u64,
}

/// Report of `palpate-lab soak`.
#[derive(Default, Serialize)]
pub(super) struct Report {
    seconds: usize,
    load: &'static str,
    /// Completed rounds of the load; 0 without load.
    load_rounds: u64,
    ticks: u64,
    missed: u64,
    /// Number of gaps: so many missed deadlines in a row that sampling restarted.
    gaps: u64,
    /// Number of ticks that took longer than a period.
    overruns: u64,
    /// Whether report, records, events and clock agree that every period was a tick or a missed deadline.
    accounted: bool,
    dropped_records: u64,
    dropped_events: u64,
    /// Time from a deadline to the start of its tick.
    lateness_us: Percentiles,
    bare_lateness_us: Percentiles,
    bare_ticks: u64,
    bare_missed: u64,
    /// Number of deadlines of the bare thread during a tick of the loop; excluded from its lateness.
    bare_during_ticks: u64,
    /// Ratio of the two at p99; `null` if the bare thread was never late.
    lateness_ratio_p99: Option<f64>,
    /// Time from the start of a tick to the start of the next.
    period_us: Percentiles,
    /// Time from the start of a tick to the end of the device's write.
    cost_us: Percentiles,
    /// Number of allocations on the loop's thread, and of frees of memory allocated elsewhere.
    allocations_on_loop: u64,
    memory_bytes: Memory,
    forces_out_of_limits: u64,
    /// Maximum force at the device, N.
    peak_force_n: f64,
    /// Number of ticks with a nonzero force at the device.
    ticks_with_force: u64,
    model_steps: u64,
    model_step_ms: ModelStep,
    models_adopted: u64,
    models_rejected: u64,
    /// Maximum age of an active local model, ms.
    oldest_model_ms: f64,
    /// Number of samples that arrived faster than the body could be stepped.
    samples_lost: u64,
    real_time: RealTimeText,
    bare_real_time: RealTimeText,
}

#[derive(Default, Serialize)]
struct Percentiles {
    p50: f64,
    p99: f64,
    p999: f64,
    max: f64,
}

impl Percentiles {
    fn of(times: &TimeHistogram) -> Self {
        let at = |quantile| times.quantile_us(quantile);
        Self { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: times.max_us() }
    }

    fn text(&self) -> String {
        let Self { p50, p99, p999, max } = self;
        format!("p50 {p50:.1}   p99 {p99:.1}   p99.9 {p999:.1}   max {max:.1}")
    }
}

#[derive(Default, Serialize)]
struct ModelStep {
    mean: f64,
    max: f64,
}

#[derive(Default, Serialize)]
struct RealTimeText {
    priority: String,
    memory: String,
    core: String,
}

impl From<RealTimeReport> for RealTimeText {
    fn from(report: RealTimeReport) -> Self {
        let RealTimeReport { priority, memory, core } = report;
        Self { priority: priority.to_string(), memory: memory.to_string(), core: core.to_string() }
    }
}

impl Report {
    pub(super) fn of(seconds: usize, load: LoadKind, outcome: Outcome) -> Self {
        let Outcome { mut model_side, felt, allocations, bare, memory, load_rounds } = outcome;
        let newest = model_side.handle.samples().newest().map_or(0, |sample| sample.sequence);
        let (stats, audit) = (model_side.stats, model_side.audit);
        let tick_ms = 1e3 * model_side.handle.config().hand_over.tick_s;
        let report = model_side.handle.report();
        let (lateness_us, bare_lateness_us) =
            (Percentiles::of(&report.lateness), Percentiles::of(&bare.lateness));
        let ratio = lateness_us.p99 / bare_lateness_us.p99;
        Self {
            seconds,
            load: load.name(),
            load_rounds,
            ticks: report.ticks,
            missed: report.missed_deadlines,
            gaps: report.gaps,
            overruns: report.overruns,
            accounted: audit.is_complete(report, newest),
            dropped_records: report.dropped_records,
            dropped_events: report.dropped_events,
            lateness_us,
            bare_lateness_us,
            bare_ticks: bare.ticks,
            bare_missed: bare.missed_deadlines,
            bare_during_ticks: bare.during_ticks,
            lateness_ratio_p99: Some(ratio).filter(|ratio| ratio.is_finite()),
            period_us: Percentiles::of(&report.period),
            cost_us: Percentiles::of(&report.cost),
            allocations_on_loop: allocations,
            memory_bytes: Memory { kept_by_model_side: stats.kept_bytes(), ..memory },
            forces_out_of_limits: felt.out_of_limits + audit.grown_too_fast,
            peak_force_n: felt.peak_n,
            ticks_with_force: felt.not_zero,
            model_steps: stats.steps,
            model_step_ms: ModelStep {
                mean: 1e3 * stats.time.as_secs_f64() / stats.steps.max(1) as f64,
                max: 1e3 * stats.max_time.as_secs_f64(),
            },
            models_adopted: report.models_adopted,
            models_rejected: report.models_rejected,
            oldest_model_ms: audit.oldest_model_ticks as f64 * tick_ms,
            samples_lost: stats.samples_lost,
            real_time: report.real_time.into(),
            bare_real_time: bare.real_time.into(),
        }
    }

    pub(super) fn table(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let ratio = self.lateness_ratio_p99.map_or("-".into(), |ratio| format!("{ratio:.2}"));
        let mebibytes = |bytes: Option<u64>| {
            bytes.map_or("-".into(), |bytes| format!("{:.1}", bytes as f64 / f64::from(1 << 20)))
        };
        let Memory { start, after_10_s, end, growth, kept_by_model_side } = self.memory_bytes;
        let bytes = |bytes: Option<i64>| bytes.map_or("-".into(), |bytes| bytes.to_string());
        let RealTimeText { priority, memory, core } = &self.real_time;
        let (dropped, accounted) = (self.dropped_records + self.dropped_events, self.accounted);
        let rows = [
            ("load", format!("{} for {} s", self.load, self.seconds)),
            ("ticks", format!("{}, with force {}", self.ticks, self.ticks_with_force)),
            (
                "missed deadlines",
                format!("{}, accounted for: {}", self.missed, if accounted { "all" } else { "NOT ALL" }),
            ),
            ("records, events dropped", dropped.to_string()),
            ("lateness, us", self.lateness_us.text()),
            ("bare thread, us", self.bare_lateness_us.text()),
            ("ratio at p99", ratio),
            ("missed by bare thread", format!("{}, excluded {}", self.bare_missed, self.bare_during_ticks)),
            ("period, us", self.period_us.text()),
            ("tick cost, us", self.cost_us.text()),
            ("ticks over a period", self.overruns.to_string()),
            ("allocations on the loop", self.allocations_on_loop.to_string()),
            (
                "memory, MiB",
                format!("{}, after 10 s {}, end {}", mebibytes(start), mebibytes(after_10_s), mebibytes(end)),
            ),
            ("growth after 10 s, bytes", bytes(growth)),
            ("kept by the model side", bytes(kept_by_model_side)),
            (
                "forces out of limits",
                format!("{}, maximum {:.2} N", self.forces_out_of_limits, self.peak_force_n),
            ),
            (
                "model steps",
                format!(
                    "{}, mean {:.1} ms, maximum {:.1} ms, samples skipped {}",
                    self.model_steps, self.model_step_ms.mean, self.model_step_ms.max, self.samples_lost
                ),
            ),
            (
                "local models",
                format!(
                    "{} adopted, {} rejected, maximum age {:.0} ms",
                    self.models_adopted, self.models_rejected, self.oldest_model_ms
                ),
            ),
            ("real-time priority", priority.clone()),
            ("locked memory", memory.clone()),
            ("core", core.clone()),
        ];
        rows.iter().try_for_each(|(name, value)| writeln!(out, "{name:26}{value}"))
    }

    /// Checks the guarantees that hold under any load.
    pub(super) fn check_guarantees(&self) -> Result<(), LabError> {
        let mut violations = Vec::new();
        if !self.accounted {
            violations.push(format!(
                "not every deadline is accounted for ({} ticks, {} missed, {} records and {} events dropped)",
                self.ticks, self.missed, self.dropped_records, self.dropped_events
            ));
        }
        if self.forces_out_of_limits > 0 {
            violations.push(format!("{} forces exceeded their limits", self.forces_out_of_limits));
        }
        if self.allocations_on_loop > 0 {
            violations
                .push(format!("{} allocations happened on the loop's thread", self.allocations_on_loop));
        }
        if violations.is_empty() { Ok(()) } else { Err(LabError::Broken(violations.join("; "))) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_every_broken_guarantee() {
        let good = || Report { accounted: true, missed: 7, ..Report::default() };
        assert!(good().check_guarantees().is_ok());
        for (bad, expected) in [
            (Report { accounted: false, ..good() }, "not every deadline is accounted for (0 ticks, 7 missed"),
            (Report { forces_out_of_limits: 3, ..good() }, "3 forces exceeded their limits"),
            (Report { allocations_on_loop: 2, ..good() }, "2 allocations happened"),
            (Report { allocations_on_loop: 2, forces_out_of_limits: 1, ..good() }, "limits; 2 allocations"),
        ] {
            let message = bad.check_guarantees().unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
