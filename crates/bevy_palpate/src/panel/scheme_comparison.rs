//! The schemes that do not run, computed beside the one that does, on the same samples.

use glam::DVec3;
use palpate_body::{Body, ToolContact, ToolPoint};
use palpate_local::{HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme, SubmitResult};
use palpate_reduce::{BuilderOptions, LocalModelBuilder, ReduceError};
use std::collections::VecDeque;

/// What a model step leaves for the schemes that do not run.
#[derive(Clone, Debug)]
pub(super) struct StepInput {
    /// The body after the step.
    pub(super) body: Body,
    /// How the tool acts on it.
    pub(super) contact: ToolContact,
    /// What the other tools on the body do.
    pub(super) beside: Vec<ToolContact>,
    /// The samples of the step.
    pub(super) samples: Vec<Sample>,
    /// At which tick the loop began to speak by the local model of which sample: (sample, tick).
    pub(super) adopted: Vec<(u64, u64)>,
    /// The local model of this step.
    pub(super) id: ModelId,
}

/// Schemes in lock step with a body.
///
/// Each has a hand-over of its own, with the loop's settings, gets the loop's samples, and at every model step a local model
/// of the same state as the running scheme. It takes that at the tick at which the loop took its own, so that all are late
/// alike.
#[derive(Debug)]
pub(super) struct SchemeComparison {
    settings: HandOverSettings,
    builder: LocalModelBuilder,
    of: (u64, u64),
    /// The newest sample that has been felt.
    newest: Option<u64>,
    runners: Vec<SchemeRunner>,
}

#[derive(Debug)]
struct SchemeRunner {
    scheme: Scheme,
    hand_over: HandOver,
    /// Models on their way, with the tick at which the loop's own arrived, once that is known.
    pending: VecDeque<(LocalModel, Option<u64>)>,
    /// Models to be used again.
    spare: Vec<LocalModel>,
    failed: Option<String>,
}

/// The force of a scheme at the samples of a step, N, or why there is none.
pub(super) type SchemeSample = (Scheme, Result<Vec<(u64, DVec3)>, String>);

/// The model side is never that many steps behind.
const MOST_PENDING: usize = 8;

impl SchemeComparison {
    /// The schemes `schemes` beside a loop with `settings`, beginning at `moment`.
    pub(super) fn new(
        moment: &StepInput,
        schemes: &[Scheme],
        settings: HandOverSettings,
    ) -> Result<Self, ReduceError> {
        let builder = LocalModelBuilder::new(&moment.body, BuilderOptions::of(&moment.body))?;
        let runner = |&scheme: &Scheme| -> Result<SchemeRunner, ReduceError> {
            let hand_over = HandOver::new(settings)?;
            Ok(SchemeRunner { scheme, hand_over, pending: VecDeque::new(), spare: Vec::new(), failed: None })
        };
        let runners = schemes.iter().map(runner).collect::<Result<_, _>>()?;
        let of = (moment.id.body, moment.id.epoch);
        Ok(Self { settings, builder, of, newest: None, runners })
    }

    /// Whether it can go on with `moment` and `schemes`: it is of that body, and of the step before.
    pub(super) fn fits(&self, moment: &StepInput, schemes: &[Scheme]) -> bool {
        let next = moment.samples.first().map(|sample| sample.sequence);
        let follows = self.newest.is_none_or(|newest| next == Some(newest + 1));
        follows
            && self.of == (moment.id.body, moment.id.epoch)
            && self.runners.iter().map(|runner| runner.scheme).eq(schemes.iter().copied())
    }

    /// What the schemes display at the samples of `moment`; then gives each a local model of it.
    pub(super) fn step(&mut self, moment: &StepInput) -> Vec<SchemeSample> {
        self.newest = moment.samples.last().map(|sample| sample.sequence);
        let Self { settings, builder, runners, .. } = self;
        runners
            .iter_mut()
            .map(|runner| {
                let told = runner.render(moment);
                runner.failed = None;
                if let Err(error) = runner.build(moment, builder, settings) {
                    runner.failed = Some(error.to_string());
                }
                (runner.scheme, told)
            })
            .collect()
    }
}

impl SchemeRunner {
    fn render(&mut self, moment: &StepInput) -> Result<Vec<(u64, DVec3)>, String> {
        for (model, arrived) in &mut self.pending {
            let adopted = moment.adopted.iter().find(|(sample, _)| *sample >= model.id.sequence);
            *arrived = arrived.or(adopted.map(|(_, tick)| *tick));
        }
        let mut forces = Vec::with_capacity(moment.samples.len());
        let mut refused = self.failed.take();
        for sample in &moment.samples {
            self.hand_over.push(*sample);
            if self.hand_over.is_ready() {
                // The newest that has arrived counts, as in the loop's exchange.
                let is_there = |(_, arrived): &&(LocalModel, Option<u64>)| {
                    arrived.is_some_and(|tick| tick <= sample.sequence)
                };
                let arrived = self.pending.iter().take_while(is_there).count();
                if let Some((model, _)) = arrived.checked_sub(1).and_then(|newest| self.pending.get(newest))
                    && let SubmitResult::Rejected(error) = self.hand_over.submit(model)
                {
                    refused = Some(error.to_string());
                }
                self.spare.extend(self.pending.drain(..arrived).map(|(model, _)| model));
            }
            let spoken = self.hand_over.render();
            if spoken.model.is_some() {
                forces.push((sample.sequence, spoken.force_n));
            }
        }
        refused.map_or(Ok(forces), Err)
    }

    fn build(
        &mut self,
        moment: &StepInput,
        builder: &mut LocalModelBuilder,
        settings: &HandOverSettings,
    ) -> Result<(), ReduceError> {
        let Some(newest) = moment.samples.last() else { return Ok(()) };
        if self.pending.len() == MOST_PENDING {
            self.spare.extend(self.pending.pop_front().map(|(model, _)| model));
        }
        let mut model = self.spare.pop().unwrap_or_else(|| LocalModel::empty(settings.capacity));
        let tool = ToolPoint { position_m: newest.position_m, velocity_m_per_s: newest.velocity_m_per_s };
        let StepInput { body, contact, beside, id, .. } = moment;
        let beside: Vec<&ToolContact> = beside.iter().collect();
        builder.build_with_other_tools(self.scheme, body, (contact, tool), &beside, *id, &mut model)?;
        self.pending.push_back((model, None));
        Ok(())
    }
}

#[cfg(test)]
mod tests;
