//! Measures the durations of systems.

use bevy::ecs::system::{Adapt, IntoAdapterSystem, RunSystemError, System, SystemIn, SystemInput};
use bevy::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Sum of the durations of wrapped systems since the last call of [`Self::take_ms`].
#[derive(Resource, Clone, Debug, Default)]
pub(crate) struct FrameCost(Arc<AtomicU64>);

impl FrameCost {
    /// Returns the sum of `app`; adds the resource if it is missing.
    pub(crate) fn of(app: &mut App) -> Self {
        app.world_mut().get_resource_or_init::<Self>().clone()
    }

    /// Wraps `system` to add its duration to the sum.
    pub(crate) fn timed<M, S>(&self, system: S) -> IntoAdapterSystem<Timed, S>
    where
        S: IntoSystem<(), (), M>,
    {
        IntoAdapterSystem::new(Timed(self.0.clone()), system)
    }

    /// Returns the sum since the last call, ms, and resets it.
    pub(crate) fn take_ms(&self) -> f64 {
        self.0.swap(0, Ordering::Relaxed) as f64 * 1e-6
    }
}

/// Adapter that runs a system and adds its duration to a sum, ns.
pub(crate) struct Timed(Arc<AtomicU64>);

impl<S: System> Adapt<S> for Timed {
    type In = S::In;
    type Out = S::Out;

    fn adapt(
        &mut self,
        input: <S::In as SystemInput>::Inner<'_>,
        run_system: impl FnOnce(SystemIn<'_, S>) -> Result<S::Out, RunSystemError>,
    ) -> Result<S::Out, RunSystemError> {
        let (out, time) = timed(|| run_system(input));
        self.0.fetch_add(time.as_nanos() as u64, Ordering::Relaxed);
        out
    }
}

/// Runs `run`; returns its result and its duration.
pub(crate) fn timed<T>(run: impl FnOnce() -> T) -> (T, Duration) {
    let start = now();
    let out = run();
    (out, now() - start)
}

/// The present time, for measurements.
#[expect(clippy::disallowed_methods, reason = "durations of systems are reported and influence no result")]
pub(crate) fn now() -> Instant {
    Instant::now()
}
