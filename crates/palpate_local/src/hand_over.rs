//! Hand-over: a new local model is brought up to now before it speaks.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{
    Capacity, Contact, LocalModel, LocalModelError, LocalState, LowPass, ModelId, Sample, SampleHistory,
    Scheme,
};
use glam::DVec3;
use palpate_laws::unilateral_force;

/// When a slice of the replay has taken that many multiplications it is over: that is about a quarter of a millisecond.
const MAX_REPLAY_WORK: usize = 1_500_000;

/// Sizes and rates of a hand-over, fixed at construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandOverSettings {
    /// Length of a tick, s.
    pub tick_s: f64,
    /// What a model can hold at most.
    pub capacity: Capacity,
    /// Samples kept for replay.
    pub history: usize,
    /// Missed samples replayed into a new model in one tick, at most, and fewer where they take more than about a quarter of a
    /// millisecond; the samples of the tick itself come on top, so that a model always catches up.
    pub replay_per_tick: usize,
    /// Cut-off of the low-pass of [`Scheme::LowPass`], Hz.
    pub cutoff_hz: f64,
}

impl Default for HandOverSettings {
    /// 1 ms, room for a support set of sixteen nodes, 512 samples, 8 a tick, 10 Hz.
    fn default() -> Self {
        let capacity = Capacity::default();
        Self { tick_s: 1e-3, capacity, history: 512, replay_per_tick: 8, cutoff_hz: 10.0 }
    }
}

impl HandOverSettings {
    /// Refuses sizes and rates that make no sense.
    ///
    /// # Errors
    /// [`LocalModelError::Setting`] for a tick that is not 10 µs to 0.1 s, a cut-off that is not finite and above
    /// zero, a size above 4096, a replay that is not 1 to 10000 samples a tick, or a history that is not 1 to
    /// 1000000 samples.
    pub fn validate(&self) -> Result<(), LocalModelError> {
        let Self { tick_s, capacity, history, replay_per_tick, cutoff_hz } = *self;
        let near = capacity.near;
        let largest =
            [capacity.order, near.nodes, near.order, near.ring, near.springs, near.points, near.triangles];
        let largest = largest.into_iter().max().unwrap_or(0);
        for (what, value, ok, allowed) in [
            ("tick, s", tick_s, (1e-5..=0.1).contains(&tick_s), "1e-5 to 0.1"),
            ("largest size of a local model", largest as f64, largest <= 4096, "at most 4096"),
            ("samples kept", history as f64, (1..=1_000_000).contains(&history), "1 to 1000000"),
            (
                "samples replayed in a tick",
                replay_per_tick as f64,
                (1..=10_000).contains(&replay_per_tick),
                "1 to 10000",
            ),
            (
                "low-pass cut-off, Hz",
                cutoff_hz,
                cutoff_hz.is_finite() && cutoff_hz > 0.0,
                "finite and above 0",
            ),
        ] {
            if !ok {
                return Err(LocalModelError::Setting { what, value, allowed });
            }
        }
        Ok(())
    }
}

/// A model with its state.
#[derive(Clone, Debug)]
struct ModelInstance {
    model: LocalModel,
    state: LocalState,
}

/// The speaking local model, the one that catches up, and the samples to catch up with.
///
/// At every tick: [`HandOver::push`] the sample, [`HandOver::offer`] a model if one has arrived and
/// [`HandOver::is_catching_up`] is false, then [`HandOver::speak`].
///
/// A model built at sample N and offered at sample n > N has missed n − N samples. They are replayed into it,
/// at most [`HandOverSettings::replay_per_tick`] a tick, while the old model goes on speaking; when it has
/// caught up the two change places. So a model that took 40 ms to compute is not 40 ms late. Models without a
/// state have nothing to catch up and speak at once.
///
/// Where ticks were missed, the speaking model is stepped along the bridging samples too, the last `replay_per_tick`
/// of them; it skips those before.
#[derive(Clone, Debug)]
pub struct HandOver {
    settings: HandOverSettings,
    history: SampleHistory,
    active: ModelInstance,
    /// Sample at which `speaking` spoke last; `None` before the first model.
    rendered_at: Option<u64>,
    incoming: ModelInstance,
    /// Next sample to be replayed into `incoming`, and how many have been; `None` when it holds no model.
    replay: Option<(u64, u64)>,
    /// Samples pushed since the last word.
    fresh: u64,
    low_pass: LowPass,
}

/// What came of an offered model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SubmitResult {
    /// It has been copied and will speak when it has caught up.
    Accepted,
    /// Another one is catching up, or there is no sample yet; offer again later.
    Busy,
    /// It is refused, and the one in use goes on speaking.
    Rejected(LocalModelError),
}

/// What the hand-over has to say at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderedForce {
    /// Force on the hand, N, scene frame, before the safety chain.
    pub force_n: DVec3,
    /// The model that spoke; `None` before the first.
    pub model: Option<ModelId>,
    /// The change of model at this tick, if there was one.
    pub swap: Option<ModelSwap>,
    /// Whether the impulses of the tool's contacts were not found as well as they should be; see
    /// [`LocalState::is_unsolved`].
    pub unconverged: bool,
    /// Why a model that was catching up had to be given up at this tick.
    pub abandoned: Option<LocalModelError>,
}

/// A change of model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelSwap {
    /// The model that speaks from this tick on.
    pub to: ModelId,
    /// Samples that were replayed into it.
    pub replayed_samples: u64,
    /// Its force minus what the old model would have displayed at this tick, N, both before the filter of
    /// [`Scheme::LowPass`].
    pub force_jump_n: DVec3,
    /// The body's energy as it has it minus that as the old model has it, J: what the hand-over brings in, or takes where it
    /// is negative. `None` where one of them knows none.
    pub energy_jump_j: Option<f64>,
}

impl HandOver {
    /// A silent hand-over.
    ///
    /// # Errors
    /// As [`HandOverSettings::validate`].
    pub fn new(settings: HandOverSettings) -> Result<Self, LocalModelError> {
        settings.validate()?;
        let speaker = ModelInstance {
            model: LocalModel::empty(settings.capacity),
            state: LocalState::with_capacity(settings.capacity),
        };
        Ok(Self {
            settings,
            history: SampleHistory::with_capacity(settings.history)?,
            active: speaker.clone(),
            rendered_at: None,
            incoming: speaker,
            replay: None,
            fresh: 0,
            low_pass: LowPass::new(settings.cutoff_hz, settings.tick_s)?,
        })
    }

    /// The samples pushed so far.
    #[must_use]
    pub fn history(&self) -> &SampleHistory {
        &self.history
    }

    /// Adds the newest sample.
    pub fn push(&mut self, sample: Sample) {
        self.history.push(sample);
        self.fresh = self.fresh.saturating_add(1);
    }

    /// Whether a model is being brought up to now.
    #[must_use]
    pub fn is_catching_up(&self) -> bool {
        self.replay.is_some()
    }

    /// Whether a model can be offered: there is a sample, and no other model is catching up.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        !self.is_catching_up() && !self.history.is_empty()
    }

    /// Forgets the models of all bodies but `body`: from the next word on they are not heard.
    pub fn retain_body(&mut self, body: u64) {
        if self.rendered_at.is_some() && self.active.model.id.body != body {
            self.rendered_at = None;
        }
        if self.incoming.model.id.body != body {
            self.replay = None;
        }
    }

    /// The model that speaks; `None` before the first.
    #[must_use]
    pub fn active(&self) -> Option<&LocalModel> {
        self.rendered_at.map(|_| &self.active.model)
    }

    /// Offers a new model, which is checked and copied.
    pub fn submit(&mut self, model: &LocalModel) -> SubmitResult {
        if !self.is_ready() {
            return SubmitResult::Busy;
        }
        match self.accept(model) {
            Ok(()) => SubmitResult::Accepted,
            Err(error) => SubmitResult::Rejected(error),
        }
    }

    fn accept(&mut self, model: &LocalModel) -> Result<(), LocalModelError> {
        model.validate()?;
        let sequence = model.id.sequence;
        let newest = self.history.newest().map_or(0, |s| s.sequence);
        if sequence > newest {
            return Err(LocalModelError::FromTheFuture { model: sequence, newest });
        }
        if self.rendered_at.is_some() {
            let active = self.active.model.id;
            let same_body = active.body == model.id.body;
            if same_body && model.id.epoch < active.epoch {
                return Err(LocalModelError::OldEpoch { model: model.id.epoch, active: active.epoch });
            }
            // That there is nothing to be felt may be said twice.
            let newer =
                sequence > active.sequence || sequence == active.sequence && active.body == ModelId::NO_BODY;
            if same_body && model.id.epoch == active.epoch && !newer {
                return Err(LocalModelError::NotNewer { model: sequence, active: active.sequence });
            }
        }
        // A model without a state has nothing to catch up: it begins behind the newest sample.
        let mut first = newest.saturating_add(1);
        if model.has_state() {
            let (found, needed) = (model.step_s(), self.settings.tick_s);
            if (found / needed - 1.0).abs() > 1e-9 {
                return Err(LocalModelError::Step { found, needed });
            }
            first = sequence.saturating_add(1);
            let oldest = self.history.oldest_sequence().unwrap_or(0);
            if first < oldest {
                return Err(LocalModelError::TooOld { model: sequence, oldest });
            }
        }
        self.incoming.model.copy_from(model)?;
        self.incoming.state.start(&self.incoming.model);
        self.replay = Some((first, 0));
        Ok(())
    }

    /// The force at the newest sample: steps the speaking model, catches up the incoming one, and changes
    /// over when it has caught up.
    pub fn render(&mut self) -> RenderedForce {
        let Some(&newest) = self.history.newest() else {
            return RenderedForce::default();
        };
        let mut force = self.step_active(&newest);
        let mut out = RenderedForce::default();
        match self.catch_up(newest.sequence) {
            Ok(None) => {}
            Ok(Some(replayed)) => {
                let energy = |speaker: &ModelInstance| speaker.state.energy_j(&speaker.model);
                let (from, to) = (self.active.model.id, self.incoming.model.id);
                let is_same = self.rendered_at.is_some() && (from.body, from.epoch) == (to.body, to.epoch);
                let old = energy(&self.active).filter(|_| is_same);
                let energy_step_j = energy(&self.incoming).zip(old).map(|(new, old)| new - old);
                std::mem::swap(&mut self.active, &mut self.incoming);
                self.replay = None;
                self.rendered_at = Some(newest.sequence);
                let new = self.active.state.force_n(&self.active.model, &newest);
                let to = self.active.model.id;
                out.swap = Some(ModelSwap {
                    to,
                    replayed_samples: replayed,
                    force_jump_n: new - force,
                    energy_jump_j: energy_step_j,
                });
                force = new;
            }
            Err(error) => {
                self.replay = None;
                out.abandoned = Some(error);
            }
        }
        let fresh = std::mem::take(&mut self.fresh);
        force = self.filter(force, fresh);
        out.force_n = force;
        out.model = self.rendered_at.map(|_| self.active.model.id);
        out.unconverged = out.model.is_some() && self.active.state.is_unconverged(&self.active.model);
        out
    }

    /// The low-pass of [`Scheme::LowPass`], with `fresh` samples since the last word. What touches nothing is
    /// silent at once, and a surface does not pull, whatever the filter remembers.
    fn filter(&mut self, force: DVec3, fresh: u64) -> DVec3 {
        let model = &self.active.model;
        let filtered = self.rendered_at.is_some() && model.scheme == Scheme::LowPass;
        match model.contact {
            Contact::Held if filtered => self.low_pass.advance(force, fresh),
            Contact::Touching { normal } if filtered => {
                unilateral_force(self.low_pass.advance(force, fresh), normal)
            }
            _ => {
                self.low_pass.reset(force);
                force
            }
        }
    }

    /// Steps the speaking model over the samples since it spoke last: one, or a few where ticks were missed,
    /// and never more than a slice.
    fn step_active(&mut self, newest: &Sample) -> DVec3 {
        let Some(spoken) = self.rendered_at else {
            return DVec3::ZERO;
        };
        let slice = self.settings.replay_per_tick as u64;
        let first = spoken.saturating_add(1).max(newest.sequence.saturating_add(1).saturating_sub(slice));
        let ModelInstance { model, state } = &mut self.active;
        for sequence in first..=newest.sequence {
            if let Some(sample) = self.history.get(sequence) {
                state.advance(model, sample, self.settings.tick_s);
            }
        }
        self.rendered_at = Some(newest.sequence);
        state.force_n(model, newest)
    }

    /// Replays a slice. `Ok(Some(n))` when the incoming model has caught up after n samples in all.
    fn catch_up(&mut self, newest: u64) -> Result<Option<u64>, LocalModelError> {
        let Some((mut next, mut replayed)) = self.replay else {
            return Ok(None);
        };
        let ModelInstance { model, state } = &mut self.incoming;
        let budget = (self.settings.replay_per_tick as u64).saturating_add(self.fresh);
        if !model.has_state() {
            return Ok(Some(0));
        }
        let mut work: usize = 0;
        for i in 0..budget {
            // Where a tick is dear, or contacts are hard to solve, a slice is shorter; but one more than came, or it would never
            // catch up.
            let is_enough = work > MAX_REPLAY_WORK && i > self.fresh;
            if next > newest || is_enough {
                break;
            }
            let Some(sample) = self.history.get(next) else {
                let oldest = self.history.oldest_sequence().unwrap_or(0);
                return Err(LocalModelError::TooOld { model: model.id.sequence, oldest });
            };
            state.advance(model, sample, self.settings.tick_s);
            work = work.saturating_add(state.work(model));
            next = next.saturating_add(1);
            replayed += 1;
        }
        self.replay = Some((next, replayed));
        Ok((next > newest).then_some(replayed))
    }
}

#[cfg(test)]
mod tests;
