//! How long model steps take, by part.

use crate::cost::{FrameCost, now};
use bevy::prelude::*;
use std::time::{Duration, Instant};

/// Durations of the newest model step.
#[derive(Resource, Clone, Debug, Default)]
pub(crate) struct StepTimes {
    /// The whole step.
    pub(crate) last: Duration,
    /// Whether the newest step has not been checked yet.
    is_new: bool,
    /// The steps since the last [`Self::take_steps`]: when each ended, and how long it took.
    steps: Vec<(Instant, Duration)>,
    /// Time in the steps of the bodies.
    pub(crate) bodies: FrameCost,
    /// Time in building local models.
    pub(crate) local_models: FrameCost,
}

impl StepTimes {
    /// The durations of `app`, which has some from now on.
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

    /// Whether a step has been recorded since the last call.
    pub(crate) fn take_is_new(&mut self) -> bool {
        std::mem::take(&mut self.is_new)
    }

    /// The steps recorded since the last call: when each ended, and how long it took.
    pub(crate) fn take_steps(&mut self) -> Vec<(Instant, Duration)> {
        std::mem::take(&mut self.steps)
    }
}

/// Maximum number of steps that are kept for the diagnostics; without them they are not read.
const MAX_STEPS: usize = 256;
