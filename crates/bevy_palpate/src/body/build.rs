//! Builds new and changed bodies from their components: blocks at once, meshes in a background task.

use super::construct::{BuildError, BuildInput, checked_pose};
use super::element_family::ElementFamily;
use super::install::{FinishedBuild, clear_build, install};
use super::mesh_assets::Meshes;
use super::mesh_source::Source;
use super::pending::{BodyBuild, BodyBuilds, PendingBuild};
use super::shape::{DeformableBody, FixedRegion, Slit};
use super::simulated::{SimulatedBody, SourceMesh};
use super::state::BodyState;
use super::tissue::{Inclusions, Tissue};
use crate::fault::{FaultWriter, HapticFaultKind, MeshFault};
use crate::model_time::LoopMode;
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::tasks::AsyncComputeTaskPool;
use bevy::tasks::futures::check_ready;
use glam::{DQuat, DVec3};

/// The components that describe a body, with its simulated body and its pending build.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct BodyQuery {
    entity: Entity,
    shape: Ref<'static, DeformableBody>,
    tissue: Ref<'static, Tissue>,
    family: Ref<'static, ElementFamily>,
    fixed: Ref<'static, FixedRegion>,
    slit: Option<Ref<'static, Slit>>,
    inclusions: Option<Ref<'static, Inclusions>>,
    simulated: Option<&'static mut SimulatedBody>,
    build: Option<&'static mut BodyBuild>,
}

/// Reason why a body cannot be built now.
enum NotReady {
    /// The mesh asset is being loaded.
    MeshLoading,
    Rejected(HapticFaultKind),
}

impl BodyQueryItem<'_, '_> {
    fn is_changed(&self) -> bool {
        self.shape.is_changed()
            || self.tissue.is_changed()
            || self.family.is_changed()
            || self.fixed.is_changed()
            || self.slit.as_ref().is_some_and(DetectChanges::is_changed)
            || self.inclusions.as_ref().is_some_and(DetectChanges::is_changed)
    }

    /// Whether the condition that prevented the build may have changed.
    fn is_due(&self, transforms: &TransformHelper) -> bool {
        match self.build.as_deref() {
            None | Some(BodyBuild::Running(_)) => false,
            Some(BodyBuild::TransformRejected(rejected)) => self.pose(transforms) != *rejected,
            Some(BodyBuild::MeshLoading | BodyBuild::MeshFailed | BodyBuild::Outdated) => true,
        }
    }

    /// The pose of the build: that of the simulated body, or of the entity.
    fn pose(&self, transforms: &TransformHelper) -> GlobalTransform {
        let old = self.simulated.as_ref().map(|old| old.pose);
        // The only error is a missing transform, which the body requires.
        old.unwrap_or_else(|| transforms.compute_global_transform(self.entity).unwrap_or_default())
    }

    /// The mesh to build from, and its comparison with the current asset. Reuses the closed mesh of the simulated body if the asset has
    /// not changed or was rejected.
    fn source(&self, meshes: &Meshes) -> Result<(Option<Source>, SourceMesh), NotReady> {
        let shape = match &*self.shape {
            DeformableBody::Block { .. } => return Ok((None, SourceMesh::Same)),
            DeformableBody::Tetrahedra(shape) => {
                let read = meshes.volume(shape);
                let read = read.map_err(|error| NotReady::Rejected(HapticFaultKind::Mesh(error)))?;
                return read.map(|read| (Some(read), SourceMesh::Same)).ok_or(NotReady::MeshLoading);
            }
            DeformableBody::Mesh(shape) => shape,
        };
        let has_source =
            |old: &&Mut<SimulatedBody>| old.source != SourceMesh::Changed && old.built_shape == *self.shape;
        if let Some(old) = self.simulated.as_ref().filter(has_source)
            && let Some(closed) = old.closed.clone()
        {
            return Ok((Some(Source::Closed(closed)), old.source));
        }
        let read = meshes.source(shape).map_err(|error| NotReady::Rejected(HapticFaultKind::Mesh(error)))?;
        read.map(|read| (Some(read), SourceMesh::Same)).ok_or(NotReady::MeshLoading)
    }

    fn input(&self, (rotation, translation_m): (DQuat, DVec3)) -> BuildInput {
        BuildInput {
            shape: (*self.shape).clone(),
            tissue: *self.tissue,
            family: *self.family,
            fixed: (*self.fixed).clone(),
            slit: self.slit.as_ref().map(|slit| **slit),
            inclusions: self.inclusions.as_ref().map(|inclusions| inclusions.0.clone()).unwrap_or_default(),
            rotation,
            translation_m,
        }
    }

    fn set_source(&mut self, source: SourceMesh) {
        if let Some(old) = &mut self.simulated {
            old.bypass_change_detection().source = source;
        }
    }
}

/// Components whose removal changes a body.
#[derive(SystemParam)]
pub(super) struct RemovedParts<'w, 's> {
    slits: RemovedComponents<'w, 's, Slit>,
    inclusions: RemovedComponents<'w, 's, Inclusions>,
}

impl RemovedParts<'_, '_> {
    /// The entities that have lost a component since the last call.
    fn take(&mut self) -> Vec<Entity> {
        self.slits.read().chain(self.inclusions.read()).collect()
    }
}

/// Number and mode of the builds.
#[derive(SystemParam)]
pub(super) struct BuildMode<'w> {
    builds: ResMut<'w, BodyBuilds>,
    mode: Option<Res<'w, LoopMode>>,
}

/// Builds new and changed bodies.
pub(super) fn build_bodies(
    mut commands: Commands,
    mut bodies: Query<BodyQuery>,
    mut removed: RemovedParts,
    mut meshes: Meshes,
    transforms: TransformHelper,
    BuildMode { mut builds, mode }: BuildMode,
    mut faults: FaultWriter,
) {
    meshes.update(|id| bodies.iter().any(|body| body.shape.is_made_of(id)));
    let removed = removed.take();
    for mut body in &mut bodies {
        let entity = body.entity;
        let is_new_mesh = meshes.has_changed(&body.shape);
        if is_new_mesh {
            body.set_source(SourceMesh::Changed);
        }
        let is_changed = is_new_mesh || body.is_changed() || removed.contains(&entity);
        if !(is_changed || body.is_due(&transforms)) {
            continue;
        }
        if let Some(BodyBuild::Running(build)) = body.build.as_deref_mut()
            && body.shape.has_source()
        {
            build.is_outdated = true;
            if is_new_mesh {
                build.source = SourceMesh::Changed;
            }
            continue;
        }
        let at = body.pose(&transforms);
        // The pose is checked first: if it is rejected the mesh need not be read.
        let pose = match checked_pose(&at) {
            Ok(pose) => pose,
            Err(kind) => {
                // Reported once, even if the entity moves to other rejected poses.
                if is_changed || !matches!(body.build.as_deref(), Some(BodyBuild::TransformRejected(_))) {
                    reject(&mut commands, &mut faults, entity, kind);
                }
                commands.entity(entity).try_insert(BodyBuild::TransformRejected(at));
                continue;
            }
        };
        let (source, compared) = match body.source(&meshes) {
            Ok(source) => source,
            Err(NotReady::MeshLoading) => {
                if !matches!(body.build.as_deref(), Some(BodyBuild::MeshLoading)) {
                    commands.entity(entity).try_insert((BodyBuild::MeshLoading, BodyState::Loading));
                }
                continue;
            }
            Err(NotReady::Rejected(
                kind @ HapticFaultKind::Mesh(MeshFault::NotLoaded(_) | MeshFault::NoLoader(_)),
            )) => {
                if !matches!(body.build.as_deref(), Some(BodyBuild::MeshFailed)) {
                    reject(&mut commands, &mut faults, entity, kind);
                    commands.entity(entity).try_insert(BodyBuild::MeshFailed);
                }
                continue;
            }
            Err(NotReady::Rejected(kind)) => {
                reject(&mut commands, &mut faults, entity, kind);
                clear_build(&mut commands, entity);
                body.set_source(SourceMesh::Rejected);
                continue;
            }
        };
        let input = body.input(pose);
        // In lock step no result may depend on the time at which another thread finishes.
        let is_background = source.is_some() && mode.as_deref() != Some(&LoopMode::Lockstep);
        if let Some(pool) = AsyncComputeTaskPool::try_get().filter(|_| is_background) {
            let task = pool.spawn(async move {
                let output = input.build(source);
                (input, output)
            });
            let build = PendingBuild { task, is_outdated: false, source: compared };
            commands.entity(entity).try_insert((BodyBuild::Running(build), BodyState::Building));
            continue;
        }
        clear_build(&mut commands, entity);
        match input.build(source) {
            Ok(output) => {
                let build = FinishedBuild { input, output, source: compared };
                let old = body.simulated.as_deref_mut();
                install(&mut commands, &mut faults, (entity, old), (build, at), builds.next());
            }
            Err(BuildError { kind, is_mesh_error }) => {
                reject(&mut commands, &mut faults, entity, kind);
                if is_mesh_error {
                    body.set_source(SourceMesh::Rejected);
                }
            }
        }
    }
}

/// Installs the bodies that background tasks have built.
pub(super) fn poll_builds(
    mut commands: Commands,
    mut bodies: Query<(Entity, &mut BodyBuild, Option<&mut SimulatedBody>)>,
    transforms: TransformHelper,
    mut builds: ResMut<BodyBuilds>,
    mut faults: FaultWriter,
) {
    for (entity, mut build, mut simulated) in &mut bodies {
        let BodyBuild::Running(PendingBuild { task, is_outdated, source }) = &mut *build else { continue };
        let Some((input, output)) = check_ready(task) else { continue };
        let (is_outdated, source) = (*is_outdated, *source);
        if is_outdated {
            *build = BodyBuild::Outdated;
        } else {
            clear_build(&mut commands, entity);
        }
        match output {
            Ok(output) => {
                let old = simulated.as_ref().map(|old| old.pose);
                let at =
                    old.unwrap_or_else(|| transforms.compute_global_transform(entity).unwrap_or_default());
                let build = FinishedBuild { input, output, source };
                let old = simulated.as_deref_mut();
                install(&mut commands, &mut faults, (entity, old), (build, at), builds.next());
            }
            Err(BuildError { kind, is_mesh_error }) => {
                reject(&mut commands, &mut faults, entity, kind);
                // A mesh that has changed since the start of the build, or has another size, has not been rejected.
                if is_mesh_error
                    && source != SourceMesh::Changed
                    && let Some(old) = simulated.filter(|old| old.built_shape == input.shape)
                {
                    old.into_inner().source = SourceMesh::Rejected;
                }
            }
        }
    }
}

/// Sets the state of the body of `entity` to rejected, and reports the fault.
fn reject(commands: &mut Commands, faults: &mut FaultWriter, entity: Entity, kind: HapticFaultKind) {
    commands.entity(entity).try_insert(BodyState::Rejected(kind.report()));
    faults.write(entity, kind);
}

#[cfg(test)]
mod tests;
