//! Hand-over: a new local model is brought up to now before it speaks.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::{LocalModel, LocalModelError, LocalState, LowPass, ModelId, Sample, SampleHistory, Scheme};
use glam::DVec3;

/// Sizes and rates of a hand-over, fixed at construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandOverSettings {
    /// Length of a tick, s.
    pub tick_s: f64,
    /// Largest reduced order of a model.
    pub order_capacity: usize,
    /// Samples kept for replay.
    pub history: usize,
    /// Samples replayed into a new model in one tick, at most.
    pub replay_per_tick: usize,
    /// Cut-off of the low-pass of [`Scheme::LowPass`], Hz.
    pub cutoff_hz: f64,
}

impl Default for HandOverSettings {
    /// 1 ms, order 96, 512 samples, 8 a tick, 10 Hz.
    fn default() -> Self {
        Self { tick_s: 1e-3, order_capacity: 96, history: 512, replay_per_tick: 8, cutoff_hz: 10.0 }
    }
}

/// A model with its state.
#[derive(Clone, Debug)]
struct Speaker {
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
#[derive(Clone, Debug)]
pub struct HandOver {
    settings: HandOverSettings,
    history: SampleHistory,
    speaking: Speaker,
    /// Sample at which `speaking` spoke last; `None` before the first model.
    spoken: Option<u64>,
    incoming: Speaker,
    /// Next sample to be replayed into `incoming`, and how many have been; `None` when it holds no model.
    replay: Option<(u64, u64)>,
    low_pass: LowPass,
}

/// What came of an offered model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Offer {
    /// It has been copied and will speak when it has caught up.
    Taken,
    /// Another one is catching up; offer again when it has.
    Busy,
    /// It is refused, and the one in use goes on speaking.
    Refused(LocalModelError),
}

/// What the hand-over has to say at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spoken {
    /// Force on the hand, N, scene frame, before the safety chain.
    pub force_n: DVec3,
    /// The model that spoke; `None` before the first.
    pub model: Option<ModelId>,
    /// The change of model at this tick, if there was one.
    pub swap: Option<Swap>,
    /// Why a model that was catching up had to be given up at this tick.
    pub abandoned: Option<LocalModelError>,
}

/// A change of model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swap {
    /// The model that speaks from this tick on.
    pub to: ModelId,
    /// Samples that were replayed into it.
    pub replayed: u64,
    /// Its force minus what the old model would have displayed at this tick, N.
    pub force_step_n: DVec3,
}

impl HandOver {
    /// A silent hand-over.
    ///
    /// # Errors
    /// [`LocalModelError::Setting`] for a tick or cut-off that is not finite and above zero, and for a history
    /// or replay of zero samples.
    pub fn new(settings: HandOverSettings) -> Result<Self, LocalModelError> {
        if settings.replay_per_tick == 0 {
            let (what, allowed) = ("samples replayed in a tick", "at least 1");
            return Err(LocalModelError::Setting { what, value: 0.0, allowed });
        }
        let speaker = Speaker {
            model: LocalModel::silent(settings.order_capacity),
            state: LocalState::with_capacity(settings.order_capacity),
        };
        Ok(Self {
            settings,
            history: SampleHistory::with_capacity(settings.history)?,
            speaking: speaker.clone(),
            spoken: None,
            incoming: speaker,
            replay: None,
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
    }

    /// Whether a model is being brought up to now.
    #[must_use]
    pub fn is_catching_up(&self) -> bool {
        self.replay.is_some()
    }

    /// The model that speaks; `None` before the first.
    #[must_use]
    pub fn speaking(&self) -> Option<&LocalModel> {
        self.spoken.map(|_| &self.speaking.model)
    }

    /// Offers a new model, which is checked and copied.
    pub fn offer(&mut self, model: &LocalModel) -> Offer {
        if self.is_catching_up() {
            return Offer::Busy;
        }
        match self.take(model) {
            Ok(()) => Offer::Taken,
            Err(error) => Offer::Refused(error),
        }
    }

    fn take(&mut self, model: &LocalModel) -> Result<(), LocalModelError> {
        model.validate()?;
        let sequence = model.id.sequence;
        let newest = self.history.newest().map_or(0, |s| s.sequence);
        if sequence > newest {
            return Err(LocalModelError::FromTheFuture { model: sequence, newest });
        }
        if self.spoken.is_some() {
            let active = self.speaking.model.id;
            let same_body = (active.body, active.epoch) == (model.id.body, model.id.epoch);
            if same_body && sequence <= active.sequence {
                return Err(LocalModelError::NotNewer { model: sequence, active: active.sequence });
            }
        }
        let first = if model.has_state() { sequence + 1 } else { newest + 1 };
        let oldest = self.history.oldest_sequence().unwrap_or(0);
        if first < oldest {
            return Err(LocalModelError::TooOld { model: sequence, oldest });
        }
        self.incoming.model.copy_from(model)?;
        self.incoming.state.start(&self.incoming.model);
        self.replay = Some((first, 0));
        Ok(())
    }

    /// The force at the newest sample: steps the speaking model, catches up the incoming one, and changes
    /// over when it has caught up.
    pub fn speak(&mut self) -> Spoken {
        let Some(&newest) = self.history.newest() else {
            return Spoken::default();
        };
        let mut force = self.step_speaking(&newest);
        let mut out = Spoken::default();
        match self.catch_up(newest.sequence) {
            Ok(None) => {}
            Ok(Some(replayed)) => {
                std::mem::swap(&mut self.speaking, &mut self.incoming);
                self.replay = None;
                self.spoken = Some(newest.sequence);
                let new = self.speaking.state.force_n(&self.speaking.model, &newest);
                out.swap = Some(Swap { to: self.speaking.model.id, replayed, force_step_n: new - force });
                force = new;
            }
            Err(error) => {
                self.replay = None;
                out.abandoned = Some(error);
            }
        }
        if self.speaking.model.scheme == Scheme::LowPass && self.spoken.is_some() {
            force = self.low_pass.step(force);
        } else {
            self.low_pass.reset(force);
        }
        out.force_n = force;
        out.model = self.spoken.map(|_| self.speaking.model.id);
        out
    }

    /// Steps the speaking model over the samples since it spoke last: one, or a few where ticks were missed,
    /// and never more than a slice.
    fn step_speaking(&mut self, newest: &Sample) -> DVec3 {
        let Some(spoken) = self.spoken else {
            return DVec3::ZERO;
        };
        let slice = self.settings.replay_per_tick as u64;
        let first = (spoken + 1).max((newest.sequence + 1).saturating_sub(slice));
        let Speaker { model, state } = &mut self.speaking;
        for sequence in first..=newest.sequence {
            if let Some(sample) = self.history.get(sequence) {
                state.advance(model, sample, self.settings.tick_s);
            }
        }
        self.spoken = Some(newest.sequence);
        state.force_n(model, newest)
    }

    /// Replays a slice. `Ok(Some(n))` when the incoming model has caught up after n samples in all.
    fn catch_up(&mut self, newest: u64) -> Result<Option<u64>, LocalModelError> {
        let Some((mut next, mut replayed)) = self.replay else {
            return Ok(None);
        };
        let Speaker { model, state } = &mut self.incoming;
        for _ in 0..self.settings.replay_per_tick {
            if next > newest {
                break;
            }
            let Some(sample) = self.history.get(next) else {
                let oldest = self.history.oldest_sequence().unwrap_or(0);
                return Err(LocalModelError::TooOld { model: model.id.sequence, oldest });
            };
            state.advance(model, sample, self.settings.tick_s);
            next += 1;
            replayed += 1;
        }
        self.replay = Some((next, replayed));
        Ok((next > newest).then_some(replayed))
    }
}

#[cfg(test)]
mod tests;
