//! What is computed beside the app, so that neither frame nor model step waits for it.

use crate::cost::timed;
use crate::panel::scheme_comparison::{SchemeComparison, SchemeSample, StepInput};
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use palpate_body::{Body, ToolContact, ToolPoint};
use palpate_local::{HandOverSettings, Scheme};
use palpate_reduce::{Bode, BuilderOptions};

/// The schemes that do not run.
#[derive(Default)]
pub(super) struct ComparisonTask {
    task: Option<Task<ComparisonOutput>>,
    shadow: Option<SchemeComparison>,
    queue: Vec<StepInput>,
    /// Of the last model step, ms.
    pub(super) cost_ms: f64,
    /// Model steps that were left out.
    pub(super) skipped: u64,
}

struct ComparisonOutput {
    shadow: Option<SchemeComparison>,
    told: Vec<SchemeSample>,
    cost_ms: f64,
}

/// Model steps that may wait. When there are more the machine is too slow: all are left out, and the schemes begin anew.
const MOST_WAITING: usize = 6;

impl ComparisonTask {
    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        if self.task.is_some() || self.shadow.is_some() || !self.queue.is_empty() {
            *self = Self::default();
        }
    }

    /// Adds a model step of a loop with `settings`.
    pub(super) fn push(&mut self, moment: StepInput, settings: HandOverSettings) {
        self.queue.push(moment);
        if self.queue.len() > MOST_WAITING {
            self.skipped += self.queue.len() as u64;
            self.queue.clear();
            self.shadow = None;
        }
        if self.task.is_none() && !self.queue.is_empty() {
            let (shadow, queue) = (self.shadow.take(), std::mem::take(&mut self.queue));
            let run = async move { compare(shadow, &queue, settings) };
            self.task = Some(AsyncComputeTaskPool::get().spawn(run));
        }
    }

    /// What has been computed since the last call.
    pub(super) fn take(&mut self) -> Vec<SchemeSample> {
        let Some(done) = self.task.as_mut().and_then(check_ready) else { return Vec::new() };
        (self.task, self.shadow, self.cost_ms) = (None, done.shadow, done.cost_ms);
        done.told
    }
}

fn compare(
    mut shadow: Option<SchemeComparison>,
    moments: &[StepInput],
    settings: HandOverSettings,
) -> ComparisonOutput {
    let (told, time) = timed(|| {
        let mut told = Vec::new();
        for moment in moments {
            let kept = shadow.take().filter(|shadow| shadow.fits(moment, &Scheme::ALL));
            match kept.map_or_else(|| SchemeComparison::new(moment, &Scheme::ALL, settings), Ok) {
                Ok(mut fitting) => {
                    told.extend(fitting.step(moment));
                    shadow = Some(fitting);
                }
                Err(error) => told.extend(Scheme::ALL.map(|scheme| (scheme, Err(error.to_string())))),
            }
        }
        told
    });
    ComparisonOutput { shadow, told, cost_ms: 1e3 * time.as_secs_f64() / moments.len().max(1) as f64 }
}

/// The answer over frequency.
#[derive(Default)]
pub(super) struct BodeTask {
    task: Option<Task<Result<Bode, String>>>,
    asked_s: Option<f64>,
    pub(super) newest: Option<Result<Bode, String>>,
}

/// Most free nodes of a body whose answer is computed: beyond, it takes longer than anybody waits.
const MAX_NODES: usize = 2000;
/// Time between two questions, s.
const EVERY_S: f64 = 1.0;

impl BodeTask {
    /// Asks, unless the last question is not answered yet or was asked within the last second.
    pub(super) fn request(
        &mut self,
        now_s: f64,
        body: &Body,
        contact: &ToolContact,
        tool: ToolPoint,
        scheme: Scheme,
    ) {
        if self.task.is_some() || self.asked_s.is_some_and(|asked| now_s - asked < EVERY_S) {
            return;
        }
        let free = body.network().free().len();
        if free > MAX_NODES {
            let why = format!("The body has {free} free nodes; the plot is made for up to {MAX_NODES}.");
            self.newest = Some(Err(why));
        } else if Bode::driven_node(body, contact).is_none() {
            // The last answer stays to be read.
            self.newest.get_or_insert_with(|| Err("Touch the body: the plot is of the touched node.".into()));
        } else {
            self.asked_s = Some(now_s);
            let (body, contact) = (body.clone(), contact.clone());
            let run = async move {
                let (options, hz) = (BuilderOptions::of(&body), Bode::frequencies_hz());
                let bode = Bode::compare(&body, &contact, tool, scheme, options, &hz);
                bode.map_err(|error| error.to_string())?.ok_or_else(|| "Nothing is touched.".into())
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
