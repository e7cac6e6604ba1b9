//! Summary of a black box.

use palpate_haptics::{BlackBoxTick, SafetyAction};
use palpate_local::SampleOrigin;
use serde::Serialize;
use std::collections::BTreeMap;

#[derive(Serialize)]
pub(super) struct Summary {
    pub(super) ticks: u64,
    pub(super) first_sequence: u64,
    pub(super) last_sequence: u64,
    /// From the first tick to the last, s.
    pub(super) span_s: f64,
    pub(super) missed_deadlines: u64,
    /// Number of periods without a row and without a missed deadline: their ticks found the recorder's queue full.
    pub(super) periods_not_in_file: u64,
    pub(super) samples: Samples,
    /// Maximum finite force before the safety chain, N.
    pub(super) peak_force_before_n: f64,
    pub(super) peak_force_written_n: f64,
    /// Stages that acted, in the order of the chain.
    pub(super) acted: Vec<Acted>,
    pub(super) lateness_us: Times,
    pub(super) cost_us: Times,
    pub(super) models: Vec<Models>,
    /// Number of ticks by device error, for example `read: timed_out`.
    pub(super) device_errors: BTreeMap<String, u64>,
}

/// Number of ticks by origin of their sample.
#[derive(Default, Serialize)]
pub(super) struct Samples {
    pub(super) measured: u64,
    pub(super) repeated: u64,
    pub(super) none: u64,
}

#[derive(Serialize)]
pub(super) struct Acted {
    pub(super) stage: &'static str,
    pub(super) ticks: u64,
}

#[derive(Serialize)]
pub(super) struct Times {
    pub(super) p50: f64,
    pub(super) p99: f64,
    pub(super) max: f64,
}

/// Number of active local models of a body.
#[derive(Serialize)]
pub(super) struct Models {
    pub(super) body: u64,
    pub(super) epoch: u64,
    pub(super) models: u64,
}

impl Summary {
    /// Summary of `ticks`; `None` without ticks.
    pub(super) fn of(ticks: &[BlackBoxTick]) -> Option<Self> {
        let (first, last) = (ticks.first()?, ticks.last()?);
        let count = |test: &dyn Fn(&BlackBoxTick) -> bool| ticks.iter().filter(|t| test(t)).count() as u64;
        let origin = |origin| count(&|tick| tick.sample.is_some_and(|sample| sample.origin == origin));
        let peak = |force: fn(&BlackBoxTick) -> f64| {
            ticks.iter().map(force).filter(|force| force.is_finite()).fold(0.0, f64::max)
        };
        let missing =
            |pair: &[BlackBoxTick]| (pair[1].sequence - pair[0].sequence).saturating_sub(pair[1].elapsed);
        let mut device_errors = BTreeMap::new();
        for tick in ticks {
            let (read, write) = (tick.read_failed, tick.write_failed);
            let names =
                [read.map(|fault| format!("read: {fault}")), write.map(|fault| format!("write: {fault}"))];
            for name in names.into_iter().flatten() {
                *device_errors.entry(name).or_insert(0) += 1;
            }
        }
        let acted = SafetyAction::ALL
            .map(|action| Acted { stage: action.name(), ticks: count(&|tick| tick.acted.contains(action)) });
        Some(Self {
            ticks: ticks.len() as u64,
            first_sequence: first.sequence,
            last_sequence: last.sequence,
            span_s: last.time_s - first.time_s,
            missed_deadlines: ticks.iter().map(|tick| tick.elapsed.saturating_sub(1)).sum(),
            periods_not_in_file: ticks.windows(2).map(missing).sum(),
            samples: Samples {
                measured: origin(SampleOrigin::Measured),
                repeated: origin(SampleOrigin::Repeated),
                none: count(&|tick| tick.sample.is_none()),
            },
            peak_force_before_n: peak(|tick| tick.before_n.length()),
            peak_force_written_n: peak(|tick| tick.written_n.length()),
            acted: acted.into_iter().filter(|acted| acted.ticks > 0).collect(),
            lateness_us: Times::of(ticks.iter().map(|tick| tick.timing.lateness_ns).collect()),
            cost_us: Times::of(ticks.iter().map(|tick| tick.timing.cost_ns).collect()),
            models: models(ticks),
            device_errors,
        })
    }
}

impl Times {
    /// Percentiles of `ns`, µs.
    fn of(mut ns: Vec<u64>) -> Self {
        ns.sort_unstable();
        let share = |share: f64| {
            let rank = (share * ns.len() as f64).ceil() as usize;
            ns.get(rank.saturating_sub(1)).map_or(0.0, |ns| *ns as f64 * 1e-3)
        };
        Self { p50: share(0.5), p99: share(0.99), max: share(1.0) }
    }
}

/// Number of active models by body and epoch. A model that was active, inactive and active again counts twice.
fn models(ticks: &[BlackBoxTick]) -> Vec<Models> {
    let mut counts = BTreeMap::new();
    let mut last = None;
    for model in ticks.iter().map(|tick| tick.model) {
        if let Some(model) = model.filter(|_| model != last) {
            *counts.entry((model.body, model.epoch)).or_insert(0) += 1;
        }
        last = model;
    }
    counts.into_iter().map(|((body, epoch), models)| Models { body, epoch, models }).collect()
}
