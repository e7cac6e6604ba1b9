//! How long systems take.

use bevy::ecs::system::{Adapt, IntoAdapterSystem, RunSystemError, System, SystemIn, SystemInput};
use bevy::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Time that has been spent in the systems of palpate since it was last asked for.
#[derive(Resource, Clone, Debug, Default)]
pub(crate) struct FrameCost(Arc<AtomicU64>);

impl FrameCost {
    /// The sum of `app`, which has one from now on.
    pub(crate) fn of(app: &mut App) -> Self {
        app.world_mut().get_resource_or_init::<Self>().clone()
    }

    /// `system`, its time counted.
    pub(crate) fn timed<M, S>(&self, system: S) -> IntoAdapterSystem<Timed, S>
    where
        S: IntoSystem<(), (), M>,
    {
        IntoAdapterSystem::new(Timed(self.0.clone()), system)
    }

    /// The time since the last call, ms.
    pub(crate) fn take_ms(&self) -> f64 {
        self.0.swap(0, Ordering::Relaxed) as f64 * 1e-6
    }
}

/// Runs a system and adds the time to a sum, ns.
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

/// What `run` gives, and how long it takes.
pub(crate) fn timed<T>(run: impl FnOnce() -> T) -> (T, Duration) {
    let began = now();
    let out = run();
    (out, now() - began)
}

/// The time of a measurement.
#[expect(clippy::disallowed_methods, reason = "what a system costs is reported, and decides nothing")]
pub(crate) fn now() -> Instant {
    Instant::now()
}
