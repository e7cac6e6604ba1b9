//! Hand-over: replaces the active local model by a newer one, after replay of the samples that the newer one has missed.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{
    Capacity, Contact, LocalModel, LocalModelError, LocalState, LowPass, MAX_BODIES, ModelId, Sample,
    SampleHistory, Scheme,
};
use glam::DVec3;
use palpate_laws::unilateral_force;

/// Work after which replay stops for a tick, in multiplications: about a quarter of a millisecond.
const MAX_REPLAY_WORK: usize = 1_500_000;

/// Sizes and rates of a hand-over, fixed at construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandOverSettings {
    /// Length of a tick, s.
    pub tick_s: f64,
    /// Maximum sizes of a local model.
    pub capacity: Capacity,
    /// Number of samples kept for replay.
    pub history: usize,
    /// Maximum number of missed samples that are replayed in one tick. Replay stops earlier after about a quarter of a millisecond of
    /// computation. The samples of the tick itself are replayed in addition, which guarantees that a model catches up.
    pub replay_per_tick: usize,
    /// Cut-off frequency of the low-pass filter of [`Scheme::LowPass`], Hz.
    pub cutoff_hz: f64,
}

impl Default for HandOverSettings {
    /// Ticks of 1 ms, the default capacity, 512 samples, 8 of them replayed a tick, 10 Hz.
    fn default() -> Self {
        let capacity = Capacity::default();
        Self { tick_s: 1e-3, capacity, history: 512, replay_per_tick: 8, cutoff_hz: 10.0 }
    }
}

impl HandOverSettings {
    /// Checks the ranges of all settings.
    ///
    /// # Errors
    /// [`LocalModelError::Setting`] for a tick outside 10 µs to 0.1 s, a cut-off that is not finite and above zero, a size above 4096, a
    /// replay outside 1 to 10000 samples a tick, or a history outside 1 to 1000000 samples.
    pub fn validate(&self) -> Result<(), LocalModelError> {
        let Self { tick_s, capacity, history, replay_per_tick, cutoff_hz } = *self;
        let near = [capacity.near, capacity.second]
            .map(|near| [near.nodes, near.order, near.ring, near.springs, near.points, near.triangles]);
        let max_size = near.into_iter().flatten().chain([capacity.order]).max().unwrap_or(0);
        for (what, value, ok, allowed) in [
            ("tick, s", tick_s, (1e-5..=0.1).contains(&tick_s), "1e-5 to 0.1"),
            ("maximum size of a local model", max_size as f64, max_size <= 4096, "at most 4096"),
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

/// A local model with its state.
#[derive(Clone, Debug)]
struct ModelInstance {
    model: LocalModel,
    state: LocalState,
}

/// Progress of the replay into the candidate model.
#[derive(Clone, Copy, Debug)]
struct Replay {
    /// Sequence number of the next sample.
    next: u64,
    /// Number of samples replayed.
    replayed: u64,
}

/// Renders force from the active local model, and replaces it by newer ones.
///
/// Every tick has three calls: [`HandOver::push`] with the sample, [`HandOver::submit`] if a model has arrived and
/// [`HandOver::is_ready`], then [`HandOver::render`].
///
/// * **Submit.** A submitted model is validated and copied. It becomes the candidate, and the active model stays.
/// * **Replay.** A model built at sample N and submitted at sample n has missed n − N samples. [`HandOver::render`] advances the candidate
///   over them, at most [`HandOverSettings::replay_per_tick`] a tick, while the active model renders the force. A model that took
///   40 ms to compute is thus not 40 ms late. A model without a state has nothing to replay.
/// * **Swap.** In the tick in which the candidate reaches the newest sample, it becomes the active model. [`ModelSwap`] reports the jumps
///   of force and energy. The candidate is dropped if the samples it needs are no longer in the history.
/// * **Render.** The active model advances by one tick and displays its force. After missed ticks it also advances over the
///   samples that bridge them, the last `replay_per_tick` at most, and skips older ones.
#[derive(Clone, Debug)]
pub struct HandOver {
    settings: HandOverSettings,
    history: SampleHistory,
    active: ModelInstance,
    /// Sample at which `active` last rendered a force; `None` before the first model.
    rendered_at: Option<u64>,
    candidate: ModelInstance,
    /// Progress of the replay; `None` when there is no candidate.
    replay: Option<Replay>,
    /// Number of samples pushed since the last force was rendered.
    pushed: u64,
    low_pass: LowPass,
}

/// The result of submitting a local model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SubmitResult {
    /// The model has been copied. It becomes active when the missed samples have been replayed into it.
    Accepted,
    /// Another model is being replayed, or there is no sample yet. Submit the model again in a later tick.
    Busy,
    /// The model cannot be used; the active one stays.
    Rejected(LocalModelError),
}

/// The force of a tick, and what happened to the local models in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderedForce {
    /// Force on the hand, N, scene frame, before the safety chain.
    pub force_n: DVec3,
    /// The active model; `None` before the first.
    pub model: Option<ModelId>,
    /// The swap of models in this tick; `None` in a tick without one.
    pub swap: Option<ModelSwap>,
    /// Whether the contact solver of the active model failed to converge: see [`LocalState::is_unconverged`].
    pub unconverged: bool,
    /// Why the candidate model was dropped in this tick; `None` if none was.
    pub abandoned: Option<LocalModelError>,
}

/// A swap of the active local model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelSwap {
    /// The model that is active from this tick on.
    pub to: ModelId,
    /// Number of samples that were replayed into it.
    pub replayed_samples: u64,
    /// Force of the new model minus the force of the old one at this tick, N, both before the filter of [`Scheme::LowPass`].
    pub force_jump_n: DVec3,
    /// Energy of the bodies in the new model minus its energy in the old one, J. Positive: the swap adds energy. `None` where
    /// one of the models has no energy, or belongs to other bodies or epochs.
    pub energy_jump_j: Option<f64>,
}

impl HandOver {
    /// A hand-over without a model; it renders zero force.
    ///
    /// # Errors
    /// As [`HandOverSettings::validate`].
    pub fn new(settings: HandOverSettings) -> Result<Self, LocalModelError> {
        settings.validate()?;
        let empty = ModelInstance {
            model: LocalModel::empty(settings.capacity),
            state: LocalState::with_capacity(settings.capacity),
        };
        Ok(Self {
            settings,
            history: SampleHistory::with_capacity(settings.history)?,
            active: empty.clone(),
            rendered_at: None,
            candidate: empty,
            replay: None,
            pushed: 0,
            low_pass: LowPass::new(settings.cutoff_hz, settings.tick_s)?,
        })
    }

    /// The samples pushed so far, as many as the history holds.
    #[must_use]
    pub fn history(&self) -> &SampleHistory {
        &self.history
    }

    /// Adds the newest sample.
    pub fn push(&mut self, sample: Sample) {
        self.history.push(sample);
        self.pushed = self.pushed.saturating_add(1);
    }

    /// Whether missed samples are being replayed into a candidate model.
    #[must_use]
    pub fn is_catching_up(&self) -> bool {
        self.replay.is_some()
    }

    /// Whether a model can be submitted: there is a sample, and no candidate model.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        !self.is_catching_up() && !self.history.is_empty()
    }

    /// Drops the models of all bodies but `bodies`. Without an active model the force is zero. Of a model of two bodies it drops the one
    /// that is not among `bodies`, and keeps the other.
    pub fn retain_bodies(&mut self, bodies: &[u64]) {
        if self.rendered_at.is_some() && !self.active.model.retain_bodies(bodies) {
            self.rendered_at = None;
        }
        if self.replay.is_some() && !self.candidate.model.retain_bodies(bodies) {
            self.replay = None;
        }
    }

    /// The active model; `None` before the first.
    #[must_use]
    pub fn active(&self) -> Option<&LocalModel> {
        self.rendered_at.map(|_| &self.active.model)
    }

    /// The force of the tool on each body of the active model in the last tick, N, with the identity of the body: see
    /// [`LocalState::forces_on_bodies_n`].
    #[must_use]
    pub fn forces_on_bodies_n(&self) -> [(u64, DVec3); MAX_BODIES] {
        match self.rendered_at {
            Some(_) => self.active.state.forces_on_bodies_n(&self.active.model),
            None => [(ModelId::NO_BODY, DVec3::ZERO); MAX_BODIES],
        }
    }

    /// Submits a new model: validates it and copies it as the candidate.
    pub fn submit(&mut self, model: &LocalModel) -> SubmitResult {
        if !self.is_ready() {
            return SubmitResult::Busy;
        }
        match self.accept(model) {
            Ok(()) => SubmitResult::Accepted,
            Err(error) => SubmitResult::Rejected(error),
        }
    }

    /// Makes `model` the candidate.
    fn accept(&mut self, model: &LocalModel) -> Result<(), LocalModelError> {
        model.validate()?;
        let sequence = model.id.sequence;
        let newest = self.history.newest().map_or(0, |s| s.sequence);
        if sequence > newest {
            return Err(LocalModelError::FromTheFuture { model: sequence, newest });
        }
        if self.rendered_at.is_some() {
            let epoch_of = |body: u64| {
                let mut bodies = self.active.model.bodies().into_iter().flatten();
                bodies.find(|(active, _)| *active == body).map(|(_, epoch)| epoch)
            };
            for (body, epoch) in model.bodies().into_iter().flatten() {
                if let Some(active) = epoch_of(body).filter(|active| epoch < *active) {
                    return Err(LocalModelError::OldEpoch { model: epoch, active });
                }
            }
            let active = self.active.model.id;
            let same_body = active.body == model.id.body;
            // A model of no body may be repeated for the same sample.
            let newer =
                sequence > active.sequence || sequence == active.sequence && active.body == ModelId::NO_BODY;
            if same_body && model.id.epoch == active.epoch && !newer {
                return Err(LocalModelError::NotNewer { model: sequence, active: active.sequence });
            }
        }
        // Without a state there is nothing to replay: the next sample to replay is the one after the newest.
        let mut next = newest.saturating_add(1);
        if model.has_state() {
            let (found, needed) = (model.step_s(), self.settings.tick_s);
            if (found / needed - 1.0).abs() > 1e-9 {
                return Err(LocalModelError::Step { found, needed });
            }
            next = sequence.saturating_add(1);
            let oldest = self.history.oldest_sequence().unwrap_or(0);
            if next < oldest {
                return Err(LocalModelError::TooOld { model: sequence, oldest });
            }
        }
        self.candidate.model.copy_from(model)?;
        self.candidate.state.start(&self.candidate.model);
        self.replay = Some(Replay { next, replayed: 0 });
        Ok(())
    }

    /// Renders the force at the newest sample: advances the active model, replays samples into the candidate, and swaps the two when
    /// the candidate has caught up.
    pub fn render(&mut self) -> RenderedForce {
        let Some(&newest) = self.history.newest() else {
            return RenderedForce::default();
        };
        let mut force_n = self.advance_active(&newest);
        let (mut swap, mut abandoned) = (None, None);
        match self.advance_candidate(newest.sequence) {
            Ok(None) => {}
            Ok(Some(replayed)) => {
                let (new_force_n, model_swap) = self.swap_models(&newest, force_n, replayed);
                (force_n, swap) = (new_force_n, Some(model_swap));
            }
            Err(error) => {
                self.replay = None;
                abandoned = Some(error);
            }
        }
        let pushed = std::mem::take(&mut self.pushed);
        let force_n = self.apply_low_pass(force_n, pushed);
        let model = self.rendered_at.map(|_| self.active.model.id);
        let unconverged = model.is_some() && self.active.state.is_unconverged(&self.active.model);
        RenderedForce { force_n, model, swap, unconverged, abandoned }
    }

    /// Makes the candidate the active model, after the old one has displayed `old_force_n`. Returns the force of the new one, N.
    fn swap_models(
        &mut self,
        newest: &Sample,
        old_force_n: DVec3,
        replayed_samples: u64,
    ) -> (DVec3, ModelSwap) {
        let energy_j = |instance: &ModelInstance| instance.state.energy_j(&instance.model);
        let to = self.candidate.model.id;
        let (mut from_bodies, mut to_bodies) = (self.active.model.bodies(), self.candidate.model.bodies());
        from_bodies.sort_unstable();
        to_bodies.sort_unstable();
        let is_same_body = self.rendered_at.is_some() && from_bodies == to_bodies;
        let old_energy_j = energy_j(&self.active).filter(|_| is_same_body);
        let energy_jump_j = energy_j(&self.candidate).zip(old_energy_j).map(|(new, old)| new - old);
        std::mem::swap(&mut self.active, &mut self.candidate);
        self.replay = None;
        self.rendered_at = Some(newest.sequence);
        let force_n = self.active.state.force_n(&self.active.model, newest);
        (force_n, ModelSwap { to, replayed_samples, force_jump_n: force_n - old_force_n, energy_jump_j })
    }

    /// Applies the low-pass filter of [`Scheme::LowPass`], with `pushed` samples since the last force. Without contact the force is zero at
    /// once, and the force of a surface never pulls, whatever the state of the filter.
    fn apply_low_pass(&mut self, force_n: DVec3, pushed: u64) -> DVec3 {
        let model = &self.active.model;
        let is_filtered = self.rendered_at.is_some() && model.scheme == Scheme::LowPass;
        match model.contact {
            Contact::Held if is_filtered => self.low_pass.advance(force_n, pushed),
            Contact::Touching { normal } if is_filtered => {
                unilateral_force(self.low_pass.advance(force_n, pushed), normal)
            }
            _ => {
                self.low_pass.reset(force_n);
                force_n
            }
        }
    }

    /// Advances the active model over the samples since it last rendered, at most `replay_per_tick` of them, and returns its force, N.
    fn advance_active(&mut self, newest: &Sample) -> DVec3 {
        let Some(rendered_at) = self.rendered_at else {
            return DVec3::ZERO;
        };
        let limit = self.settings.replay_per_tick as u64;
        let first =
            rendered_at.saturating_add(1).max(newest.sequence.saturating_add(1).saturating_sub(limit));
        let ModelInstance { model, state } = &mut self.active;
        for sequence in first..=newest.sequence {
            if let Some(sample) = self.history.get(sequence) {
                state.advance(model, sample, self.settings.tick_s);
            }
        }
        self.rendered_at = Some(newest.sequence);
        state.force_n(model, newest)
    }

    /// Replays one tick's share of the missed samples into the candidate. Returns the number of samples replayed in all if it has now
    /// caught up.
    fn advance_candidate(&mut self, newest: u64) -> Result<Option<u64>, LocalModelError> {
        let Some(Replay { mut next, mut replayed }) = self.replay else {
            return Ok(None);
        };
        let ModelInstance { model, state } = &mut self.candidate;
        let budget = (self.settings.replay_per_tick as u64).saturating_add(self.pushed);
        if !model.has_state() {
            return Ok(Some(0));
        }
        let mut work: usize = 0;
        for i in 0..budget {
            // Costly ticks end the replay early. At least one sample more than were pushed is replayed, or the candidate would never
            // catch up.
            let is_over_budget = work > MAX_REPLAY_WORK && i > self.pushed;
            if next > newest || is_over_budget {
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
        self.replay = Some(Replay { next, replayed });
        Ok((next > newest).then_some(replayed))
    }
}

#[cfg(test)]
mod tests;
