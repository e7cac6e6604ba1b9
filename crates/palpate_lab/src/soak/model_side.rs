//! The model side on its own thread: it steps the body along the samples at 20 Hz and builds local models.

use super::deadline_audit::DeadlineAudit;
use super::memory::{SETTLED_AFTER_S, reserve};
use crate::error::LabError;
use palpate_body::{Body, SemiImplicitEuler, ToolContact, ToolPoint};
use palpate_haptics::HapticHandle;
use palpate_local::{ModelId, Sample, Scheme};
use palpate_reduce::LocalModelBuilder;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two model steps, where the machine is fast enough.
pub(super) const PERIOD: Duration = Duration::from_millis(50);
/// Minimum number of stable substeps: keeping up matters more here than accuracy.
const INTEGRATOR: SemiImplicitEuler =
    SemiImplicitEuler { tick_s: 1e-3, min_substeps: 1, max_substeps: 1000, stability_margin: 0.9 };
/// Maximum number of samples of a step; older ones are skipped. More would delay a late model further.
const MAX_SAMPLES: u64 = 100;

/// Body, tool, and the application's side of the loop.
pub(super) struct ModelSide {
    pub(super) body: Body,
    pub(super) contact: ToolContact,
    pub(super) builder: LocalModelBuilder,
    pub(super) handle: HapticHandle,
    pub(super) audit: DeadlineAudit,
    pub(super) stats: ModelSideStats,
    /// Sample up to which the body has been stepped.
    pub(super) consumed: Option<u64>,
    pub(super) path: Vec<ToolPoint>,
}

/// Statistics of the model side.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ModelSideStats {
    /// Number of model steps.
    pub(super) steps: u64,
    /// Total time of the model steps.
    pub(super) time: Duration,
    /// Maximum time of a model step.
    pub(super) max_time: Duration,
    /// Number of samples skipped because they arrived faster than the body could be stepped.
    pub(super) samples_lost: u64,
    /// Bytes allocated and not freed.
    pub(super) live_bytes: i64,
    /// Bytes allocated and not freed at the first step after ten seconds.
    pub(super) live_bytes_settled: Option<i64>,
}

impl ModelSideStats {
    /// Bytes allocated since ten seconds and not freed.
    pub(super) fn kept_bytes(&self) -> Option<i64> {
        self.live_bytes_settled.map(|settled| self.live_bytes - settled)
    }
}

impl ModelSide {
    /// Steps until `ended`, then reads the loop's last events and records.
    #[expect(
        clippy::disallowed_methods,
        reason = "the model side keeps its own rate, which affects no result"
    )]
    pub(super) fn run(mut self, ended: &AtomicBool) -> Result<Self, LabError> {
        reserve();
        let start = Instant::now();
        let mut next = start + PERIOD;
        while !ended.load(Ordering::Acquire) {
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
            let step_start = Instant::now();
            let mut stepped = Ok(false);
            let allocated = allocation_counter::measure(|| {
                self.read_queues();
                stepped = self.step();
            });
            self.stats.live_bytes += allocated.bytes_current;
            if start.elapsed().as_secs() >= SETTLED_AFTER_S {
                self.stats.live_bytes_settled.get_or_insert(self.stats.live_bytes);
            }
            if stepped? {
                let step_time = step_start.elapsed();
                self.stats.steps += 1;
                self.stats.time += step_time;
                self.stats.max_time = self.stats.max_time.max(step_time);
            }
            // Late steps are skipped.
            next = (next + PERIOD).max(Instant::now());
        }
        self.read_queues();
        Ok(self)
    }

    /// Reads all queued events and records.
    fn read_queues(&mut self) {
        while let Some(event) = self.handle.next_event() {
            self.audit.event(&event);
        }
        while let Some(record) = self.handle.next_record() {
            self.audit.tick(&record);
        }
    }

    /// Moves the body along the new samples and publishes a local model. Returns whether there were new samples.
    fn step(&mut self) -> Result<bool, LabError> {
        let samples = self.handle.samples();
        let (Some(newest), Some(oldest)) = (samples.newest(), samples.oldest_sequence()) else {
            return Ok(false);
        };
        let sequence = newest.sequence;
        let reach = oldest.max(sequence.saturating_sub(MAX_SAMPLES));
        let from = self.consumed.map_or(reach, |consumed| consumed.max(reach));
        let skipped = self.consumed.map_or(0, |consumed| from.saturating_sub(consumed));
        self.path.clear();
        self.path.extend((from..=sequence).filter_map(|s| samples.get(s)).map(tool_point));
        self.consumed = Some(sequence);
        let Some(&last) = self.path.last().filter(|_| self.path.len() > 1) else { return Ok(false) };
        if skipped > 0 {
            // The tool has jumped: releasing the contact keeps the touched body from being thrown.
            self.contact.release();
            self.stats.samples_lost += skipped;
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
