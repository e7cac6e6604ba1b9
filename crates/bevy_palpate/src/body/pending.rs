//! The build of a body that has not ended.

use super::construct::{BuildError, BuildInput, BuildOutput};
use super::simulated::SourceMesh;
use bevy::prelude::*;
use bevy::tasks::Task;

/// The build of a body whose components differ from those of its [`SimulatedBody`](super::SimulatedBody), or that has none yet.
#[derive(Component)]
pub(crate) enum BodyBuild {
    /// Its mesh asset is being loaded.
    MeshLoading,
    /// Its mesh asset could not be loaded, which has been reported; the asset may still be loaded later.
    MeshFailed,
    /// Its transform was rejected, which has been reported; it may be moved.
    TransformRejected(GlobalTransform),
    /// A background task is building it. Changes in the meantime are built afterwards: a task that was restarted at every change would
    /// not end while a slider is dragged.
    Running(PendingBuild),
    /// It has been built, and its components had changed before that.
    Outdated,
}

/// A running background build.
pub(crate) struct PendingBuild {
    pub(super) task: Task<(BuildInput, Result<BuildOutput, BuildError>)>,
    /// Whether components have changed since it was started.
    pub(super) is_outdated: bool,
    /// How its mesh compares with the asset as it is now.
    pub(super) source: SourceMesh,
}

/// Counts the builds and moves of bodies in an app.
#[derive(Resource, Default)]
pub(super) struct BodyBuilds(u64);

impl BodyBuilds {
    /// The number of the next build or move, greater than all before.
    pub(super) fn next(&mut self) -> u64 {
        self.0 += 1;
        self.0
    }
}
