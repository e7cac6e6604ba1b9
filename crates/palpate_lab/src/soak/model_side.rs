//! The model side, on a thread of its own: the body is stepped along the samples at 20 Hz and local models are built of it.

use super::deadline_audit::DeadlineAudit;
use super::memory::{SETTLED_AFTER_S, settle};
use crate::error::LabError;
use palpate_body::{Body, SemiImplicitEuler, ToolContact, ToolPoint};
use palpate_haptics::HapticHandle;
use palpate_local::{ModelId, Sample, Scheme};
use palpate_reduce::LocalModelBuilder;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two model steps, where the machine can do so many.
pub(super) const PERIOD: Duration = Duration::from_millis(50);
/// As few substeps as are stable: a body that keeps up has more to say than one that is exact.
const INTEGRATOR: SemiImplicitEuler =
    SemiImplicitEuler { tick_s: 1e-3, min_substeps: 1, max_substeps: 1000, stability_margin: 0.9 };
/// Samples that one step takes at most; older ones are lost to the body. More would make a model that is late still later.
const MOST_SAMPLES: u64 = 100;

/// A body, its tool, and the app's half of the loop.
pub(super) struct ModelSide {
    pub(super) body: Body,
    pub(super) contact: ToolContact,
    pub(super) builder: LocalModelBuilder,
    pub(super) handle: HapticHandle,
    pub(super) audit: DeadlineAudit,
    pub(super) done: Done,
    /// The sample that the body has been stepped to.
    pub(super) consumed: Option<u64>,
    pub(super) path: Vec<ToolPoint>,
}

/// What the model side has done.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Done {
    /// Model steps.
    pub(super) steps: u64,
    /// Time in them.
    pub(super) time: Duration,
    /// The longest.
    pub(super) longest: Duration,
    /// Samples that came faster than the body could be stepped, and were left out.
    pub(super) samples_lost: u64,
    /// Bytes that it has allocated and not freed; and those at the first step after ten seconds.
    pub(super) live_bytes: i64,
    pub(super) live_bytes_settled: Option<i64>,
}

impl Done {
    /// What it has kept since the tenth second, bytes.
    pub(super) fn kept_bytes(&self) -> Option<i64> {
        self.live_bytes_settled.map(|settled| self.live_bytes - settled)
    }
}

impl ModelSide {
    /// Steps until `ended`, then takes the loop's last words.
    #[expect(
        clippy::disallowed_methods,
        reason = "the model side keeps its own rate, and nothing hangs on it"
    )]
    pub(super) fn run(mut self, ended: &AtomicBool) -> Result<Self, LabError> {
        settle();
        let start = Instant::now();
        let mut next = start + PERIOD;
        while !ended.load(Ordering::Acquire) {
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
            let begun = Instant::now();
            let mut stepped = Ok(false);
            let allocated = allocation_counter::measure(|| {
                self.take_words();
                stepped = self.step();
            });
            self.done.live_bytes += allocated.bytes_current;
            if start.elapsed().as_secs() >= SETTLED_AFTER_S {
                self.done.live_bytes_settled.get_or_insert(self.done.live_bytes);
            }
            if stepped? {
                let took = begun.elapsed();
                self.done.steps += 1;
                self.done.time += took;
                self.done.longest = self.done.longest.max(took);
            }
            // Late steps are not made up for.
            next = (next + PERIOD).max(Instant::now());
        }
        self.take_words();
        Ok(self)
    }

    /// Empties the queues of events and records.
    fn take_words(&mut self) {
        while let Some(event) = self.handle.next_event() {
            self.audit.event(&event);
        }
        while let Some(record) = self.handle.next_record() {
            self.audit.tick(&record);
        }
    }

    /// Moves the body along the new samples and publishes a local model of it; returns whether there were any.
    fn step(&mut self) -> Result<bool, LabError> {
        let samples = self.handle.samples();
        let (Some(newest), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) else {
            return Ok(false);
        };
        let sequence = newest.sequence;
        let reach = oldest.max(sequence.saturating_sub(MOST_SAMPLES));
        let from = self.consumed.map_or(reach, |consumed| consumed.max(reach));
        let lost = self.consumed.map_or(0, |consumed| from.saturating_sub(consumed));
        self.path.clear();
        self.path.extend((from..=sequence).filter_map(|s| samples.get(s)).map(tool_point));
        self.consumed = Some(sequence);
        let Some(&last) = self.path.last().filter(|_| self.path.len() > 1) else { return Ok(false) };
        if lost > 0 {
            // The tool is elsewhere without having moved there: what it touched must not be thrown.
            self.contact.release();
            self.done.samples_lost += lost;
        }
        let along = Some((&mut self.contact, self.path.as_slice()));
        self.body.advance(along, self.path.len() - 1, INTEGRATOR)?;
        let id = ModelId { body: 1, epoch: 0, sequence };
        let model = self.handle.model_slot();
        self.builder.build(Scheme::default(), &self.body, &self.contact, last, id, model)?;
        self.handle.publish_model();
        Ok(true)
    }
}

fn tool_point(sample: &Sample) -> ToolPoint {
    ToolPoint { position_m: sample.position_m, velocity_m_per_s: sample.velocity_m_per_s }
}
