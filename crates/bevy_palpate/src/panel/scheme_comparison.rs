//! Computes all schemes on the samples of a running loop, for comparison.

use glam::DVec3;
use palpate_body::{Body, ToolContact, ToolPoint};
use palpate_local::{HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme, SubmitResult};
use palpate_reduce::{BuilderOptions, LocalModelBuilder, ReduceError};
use std::collections::VecDeque;

/// Data of a model step for the computation of all schemes.
#[derive(Clone, Debug)]
pub(super) struct StepInput {
    /// The body after the step.
    pub(super) body: Body,
    /// Contact of the tool with the body.
    pub(super) contact: ToolContact,
    /// Contacts of the other tools with the body.
    pub(super) others: Vec<ToolContact>,
    /// Samples of the step.
    pub(super) samples: Vec<Sample>,
    /// Adoptions of local models by the loop: (sample of the model, tick of the adoption).
    pub(super) adopted: Vec<(u64, u64)>,
    /// Local model of this step.
    pub(super) id: ModelId,
}

/// Schemes in lock step with a body.
///
/// Each scheme has a hand-over with the loop's settings. It receives the loop's samples, and at every model step a local model of the same
/// state. It adopts the model at the tick at which the loop adopts its own, with the same delay.
#[derive(Debug)]
pub(super) struct SchemeComparison {
    settings: HandOverSettings,
    builder: LocalModelBuilder,
    of: (u64, u64),
    /// The newest sample that has been rendered.
    newest: Option<u64>,
    runners: Vec<SchemeRunner>,
}

#[derive(Debug)]
struct SchemeRunner {
    scheme: Scheme,
    hand_over: HandOver,
    /// Models that are not adopted yet, with the tick at which the loop adopted its own, if it has.
    pending: VecDeque<(LocalModel, Option<u64>)>,
    /// Models for reuse.
    spare: Vec<LocalModel>,
    failed: Option<String>,
}

/// Force of a scheme at the samples of a step, N, or the reason why there is none.
pub(super) type SchemeSample = (Scheme, Result<Vec<(u64, DVec3)>, String>);

/// Maximum number of models that are not adopted yet.
const MAX_PENDING: usize = 8;

impl SchemeComparison {
    /// The comparison of `schemes` for a loop with `settings`, starting at the step `input`.
    pub(super) fn new(
        input: &StepInput,
        schemes: &[Scheme],
        settings: HandOverSettings,
    ) -> Result<Self, ReduceError> {
        let builder = LocalModelBuilder::new(&input.body, BuilderOptions::of(&input.body))?;
        let runner = |&scheme: &Scheme| -> Result<SchemeRunner, ReduceError> {
            let hand_over = HandOver::new(settings)?;
            Ok(SchemeRunner { scheme, hand_over, pending: VecDeque::new(), spare: Vec::new(), failed: None })
        };
        let runners = schemes.iter().map(runner).collect::<Result<_, _>>()?;
        let of = (input.id.body, input.id.epoch);
        Ok(Self { settings, builder, of, newest: None, runners })
    }

    /// Whether `input` is the next step of the same body, with the same `schemes`.
    pub(super) fn fits(&self, input: &StepInput, schemes: &[Scheme]) -> bool {
        let next = input.samples.first().map(|sample| sample.sequence);
        let follows = self.newest.is_none_or(|newest| next == Some(newest + 1));
        follows
            && self.of == (input.id.body, input.id.epoch)
            && self.runners.iter().map(|runner| runner.scheme).eq(schemes.iter().copied())
    }

    /// Renders the forces of the schemes at the samples of `input`; then builds a local model of its state for each.
    pub(super) fn step(&mut self, input: &StepInput) -> Vec<SchemeSample> {
        self.newest = input.samples.last().map(|sample| sample.sequence);
        let Self { settings, builder, runners, .. } = self;
        runners
            .iter_mut()
            .map(|runner| {
                let forces = runner.render(input);
                runner.failed = None;
                if let Err(error) = runner.build(input, builder, settings) {
                    runner.failed = Some(error.to_string());
                }
                (runner.scheme, forces)
            })
            .collect()
    }
}

impl SchemeRunner {
    fn render(&mut self, input: &StepInput) -> Result<Vec<(u64, DVec3)>, String> {
        for (model, arrived) in &mut self.pending {
            let adopted = input.adopted.iter().find(|(sample, _)| *sample >= model.id.sequence);
            *arrived = arrived.or(adopted.map(|(_, tick)| *tick));
        }
        let mut forces = Vec::with_capacity(input.samples.len());
        let mut rejected = self.failed.take();
        for sample in &input.samples {
            self.hand_over.push(*sample);
            if self.hand_over.is_ready() {
                // Submits the newest model that has arrived, like the loop's exchange.
                let has_arrived = |(_, arrived): &&(LocalModel, Option<u64>)| {
                    arrived.is_some_and(|tick| tick <= sample.sequence)
                };
                let arrived = self.pending.iter().take_while(has_arrived).count();
                if let Some((model, _)) = arrived.checked_sub(1).and_then(|newest| self.pending.get(newest))
                    && let SubmitResult::Rejected(error) = self.hand_over.submit(model)
                {
                    rejected = Some(error.to_string());
                }
                self.spare.extend(self.pending.drain(..arrived).map(|(model, _)| model));
            }
            let rendered = self.hand_over.render();
            if rendered.model.is_some() {
                forces.push((sample.sequence, rendered.force_n));
            }
        }
        rejected.map_or(Ok(forces), Err)
    }

    fn build(
        &mut self,
        input: &StepInput,
        builder: &mut LocalModelBuilder,
        settings: &HandOverSettings,
    ) -> Result<(), ReduceError> {
        let Some(newest) = input.samples.last() else { return Ok(()) };
        if self.pending.len() == MAX_PENDING {
            self.spare.extend(self.pending.pop_front().map(|(model, _)| model));
        }
        let mut model = self.spare.pop().unwrap_or_else(|| LocalModel::empty(settings.capacity));
        let tool = ToolPoint { position_m: newest.position_m, velocity_m_per_s: newest.velocity_m_per_s };
        let StepInput { body, contact, others, id, .. } = input;
        let others: Vec<&ToolContact> = others.iter().collect();
        builder.build_with_other_tools(self.scheme, body, (contact, tool), &others, *id, &mut model)?;
        self.pending.push_back((model, None));
        Ok(())
    }
}

#[cfg(test)]
mod tests;
