//! Durations of model steps and their parts.

use crate::cost::{FrameCost, now};
use bevy::prelude::*;
use std::time::{Duration, Instant};

/// Durations of the newest model step.
#[derive(Resource, Clone, Debug, Default)]
pub(crate) struct StepTimes {
    /// Duration of the whole step.
    pub(crate) last: Duration,
    /// Whether the newest step has not been read by [`Self::take_is_new`].
    is_new: bool,
    /// End and duration of the steps since the last [`Self::take_steps`].
    steps: Vec<(Instant, Duration)>,
    /// Time spent in stepping bodies.
    pub(crate) bodies: FrameCost,
    /// Time spent in building local models.
    pub(crate) local_models: FrameCost,
}

impl StepTimes {
    /// Returns the durations of `app`; adds the resource if it is missing.
    pub(crate) fn of(app: &mut App) -> Self {
        app.world_mut().get_resource_or_init::<Self>().clone()
    }

    /// Records a model step that took `last`.
    pub(crate) fn record(&mut self, last: Duration) {
        (self.last, self.is_new) = (last, true);
        if self.steps.len() < MAX_STEPS {
            self.steps.push((now(), last));
        }
    }

    /// Returns whether a step has been recorded since the last call.
    pub(crate) fn take_is_new(&mut self) -> bool {
        std::mem::take(&mut self.is_new)
    }

    /// Returns end and duration of the steps recorded since the last call.
    pub(crate) fn take_steps(&mut self) -> Vec<(Instant, Duration)> {
        std::mem::take(&mut self.steps)
    }
}

/// Maximum number of recorded steps, for apps without the diagnostics that read them.
const MAX_STEPS: usize = 256;
