//! Background tasks of the panel, for which neither frame nor model step waits.

use crate::cost::timed;
use crate::panel::scheme_comparison::{SchemeComparison, SchemeSample, StepInput};
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use palpate_body::{Body, ToolContact, ToolPoint};
use palpate_local::{HandOverSettings, Scheme};
use palpate_reduce::{Bode, BuilderOptions};

/// Computes all schemes on the samples of the loop.
#[derive(Default)]
pub(super) struct ComparisonTask {
    task: Option<Task<ComparisonOutput>>,
    comparison: Option<SchemeComparison>,
    queue: Vec<StepInput>,
    /// Time of the last model step, ms.
    pub(super) cost_ms: f64,
    /// Number of skipped model steps.
    pub(super) skipped: u64,
}

struct ComparisonOutput {
    comparison: Option<SchemeComparison>,
    samples: Vec<SchemeSample>,
    cost_ms: f64,
}

/// Maximum number of queued model steps. Beyond it the machine is too slow: all are skipped, and the schemes restart.
const MAX_QUEUED: usize = 6;

impl ComparisonTask {
    /// Discards task, comparison and queue.
    pub(super) fn reset(&mut self) {
        if self.task.is_some() || self.comparison.is_some() || !self.queue.is_empty() {
            *self = Self::default();
        }
    }

    /// Adds a model step of a loop with `settings`.
    pub(super) fn push(&mut self, input: StepInput, settings: HandOverSettings) {
        self.queue.push(input);
        if self.queue.len() > MAX_QUEUED {
            self.skipped += self.queue.len() as u64;
            self.queue.clear();
            self.comparison = None;
        }
        if self.task.is_none() && !self.queue.is_empty() {
            let (comparison, queue) = (self.comparison.take(), std::mem::take(&mut self.queue));
            let run = async move { compare(comparison, &queue, settings) };
            self.task = Some(AsyncComputeTaskPool::get().spawn(run));
        }
    }

    /// Returns the forces computed since the last call.
    pub(super) fn take(&mut self) -> Vec<SchemeSample> {
        let Some(done) = self.task.as_mut().and_then(check_ready) else { return Vec::new() };
        (self.task, self.comparison, self.cost_ms) = (None, done.comparison, done.cost_ms);
        done.samples
    }
}

fn compare(
    mut comparison: Option<SchemeComparison>,
    inputs: &[StepInput],
    settings: HandOverSettings,
) -> ComparisonOutput {
    let (samples, time) = timed(|| {
        let mut samples = Vec::new();
        for input in inputs {
            let kept = comparison.take().filter(|comparison| comparison.fits(input, &Scheme::ALL));
            match kept.map_or_else(|| SchemeComparison::new(input, &Scheme::ALL, settings), Ok) {
                Ok(mut fitting) => {
                    samples.extend(fitting.step(input));
                    comparison = Some(fitting);
                }
                Err(error) => samples.extend(Scheme::ALL.map(|scheme| (scheme, Err(error.to_string())))),
            }
        }
        samples
    });
    ComparisonOutput { comparison, samples, cost_ms: 1e3 * time.as_secs_f64() / inputs.len().max(1) as f64 }
}

/// Computes the frequency response.
#[derive(Default)]
pub(super) struct BodeTask {
    task: Option<Task<Result<Bode, String>>>,
    started_s: Option<f64>,
    pub(super) newest: Option<Result<Bode, String>>,
}

/// Maximum number of free nodes of a body whose frequency response is computed; beyond it takes too long.
const MAX_NODES: usize = 2000;
/// Minimum time between two starts, s.
const EVERY_S: f64 = 1.0;

impl BodeTask {
    /// Starts a computation, unless one is running or was started within the last second.
    pub(super) fn request(
        &mut self,
        now_s: f64,
        body: &Body,
        contact: &ToolContact,
        tool: ToolPoint,
        scheme: Scheme,
    ) {
        if self.task.is_some() || self.started_s.is_some_and(|started_s| now_s - started_s < EVERY_S) {
            return;
        }
        let free = body.network().free().len();
        if free > MAX_NODES {
            let reason = format!("The body has {free} free nodes; the plot needs at most {MAX_NODES}.");
            self.newest = Some(Err(reason));
        } else if Bode::driven_node(body, contact).is_none() {
            // The last response stays visible.
            self.newest.get_or_insert_with(|| Err("Touch the body: the plot shows the touched node.".into()));
        } else {
            self.started_s = Some(now_s);
            let (body, contact) = (body.clone(), contact.clone());
            let run = async move {
                let (options, hz) = (BuilderOptions::of(&body), Bode::frequencies_hz());
                let bode = Bode::compare(&body, &contact, tool, scheme, options, &hz);
                bode.map_err(|error| error.to_string())?.ok_or_else(|| "The tool has no contact.".into())
            };
            self.task = Some(AsyncComputeTaskPool::get().spawn(run));
        }
    }

    pub(super) fn take(&mut self) {
        if let Some(done) = self.task.as_mut().and_then(check_ready) {
            (self.task, self.newest) = (None, Some(done));
        }
    }
}
