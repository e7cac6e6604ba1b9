//! Builds of bodies that have not ended.

use super::construct::{BuildError, BuildInput, BuildOutput};
use super::simulated::SourceMesh;
use bevy::prelude::*;
use bevy::tasks::Task;

/// Pending build of a body that has no [`SimulatedBody`](super::SimulatedBody) yet, or one that differs from its components.
#[derive(Component)]
pub(crate) enum BodyBuild {
    /// The mesh asset is being loaded.
    MeshLoading,
    /// The mesh asset failed to load, which has been reported. It may still be loaded later.
    MeshFailed,
    /// The transform was rejected, which has been reported. It may still change.
    TransformRejected(GlobalTransform),
    /// A background task builds the body. Changes during the build are built afterwards: a task that restarts at every change would
    /// not end while a slider is dragged.
    Running(PendingBuild),
    /// The body has been built, but its components changed during the build.
    Outdated,
}

/// A running background build.
pub(crate) struct PendingBuild {
    pub(super) task: Task<(BuildInput, Result<BuildOutput, BuildError>)>,
    /// Whether components have changed since the start of the task.
    pub(super) is_outdated: bool,
    /// Comparison of the task's mesh with the current asset.
    pub(super) source: SourceMesh,
}

/// Number of builds and moves of bodies in an app.
#[derive(Resource, Default)]
pub(super) struct BodyBuilds(u64);

impl BodyBuilds {
    /// Number of the next build or move, greater than all previous ones.
    pub(super) fn next(&mut self) -> u64 {
        self.0 += 1;
        self.0
    }
}
