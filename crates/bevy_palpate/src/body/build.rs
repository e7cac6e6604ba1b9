//! Bodies are built of what is asked for, and anew when that changes: blocks at once, meshes beside the app.

use super::make::{BuildError, BuildInput, BuildOutput, place};
use super::meshes::Meshes;
use super::put::{Build, put, settle};
use super::source::Source;
use super::{DeformableBody, FixedRegion, Inclusions, MeshFault, SimulatedBody, Slit, SourceMesh, Tissue};
use crate::fault::{HapticFault, HapticFaultKind};
use crate::schedule::LoopMode;
use bevy::ecs::query::QueryData;
use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};

/// A body that is not there yet, or not as it is asked for now.
#[derive(Component)]
pub(crate) enum BodyBuild {
    /// Its mesh is being loaded.
    AwaitsMesh,
    /// Its mesh could not be loaded, which has been said; it may still come.
    MissesMesh,
    /// It was asked for where no body can be, which has been said; it may be moved.
    AwaitsPlace(GlobalTransform),
    /// It is being made. What changes meanwhile is made afterwards: a task that was begun anew at every change would never end
    /// while a slider is dragged.
    Making(Making),
    /// It has been made, and something had changed meanwhile.
    Outdated,
}

/// A body that is being made beside the app.
pub(crate) struct Making {
    task: Task<(BuildInput, Result<BuildOutput, BuildError>)>,
    /// Whether something has changed since.
    is_outdated: bool,
    /// How its mesh compares with the one that there is now.
    source: SourceMesh,
}

/// How often bodies have been built in this app.
#[derive(Resource, Default)]
pub(super) struct BodyBuilds(u64);

impl BodyBuilds {
    /// The number of the next build, or of the next place: greater than all before.
    pub(super) fn next(&mut self) -> u64 {
        self.0 += 1;
        self.0
    }
}

#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct Asked {
    entity: Entity,
    shape: Ref<'static, DeformableBody>,
    tissue: Ref<'static, Tissue>,
    fixed: Ref<'static, FixedRegion>,
    slit: Option<Ref<'static, Slit>>,
    inclusions: Option<Ref<'static, Inclusions>>,
    simulated: Option<&'static mut SimulatedBody>,
    build: Option<&'static mut BodyBuild>,
}

/// Why a body is not built now.
enum NotNow {
    /// Its mesh is not there yet.
    Awaits,
    Refused(HapticFaultKind),
}

impl AskedItem<'_, '_> {
    fn is_changed(&self) -> bool {
        self.shape.is_changed()
            || self.tissue.is_changed()
            || self.fixed.is_changed()
            || self.slit.as_ref().is_some_and(DetectChanges::is_changed)
            || self.inclusions.as_ref().is_some_and(DetectChanges::is_changed)
    }

    /// Whether what kept it from being built may be over.
    fn is_due(&self, transforms: &TransformHelper) -> bool {
        match self.build.as_deref() {
            None | Some(BodyBuild::Making(_)) => false,
            Some(BodyBuild::AwaitsPlace(refused)) => self.place(transforms) != *refused,
            Some(BodyBuild::AwaitsMesh | BodyBuild::MissesMesh | BodyBuild::Outdated) => true,
        }
    }

    /// Where it is to be built: where it is, or where its entity is now.
    fn place(&self, transforms: &TransformHelper) -> GlobalTransform {
        let old = self.simulated.as_ref().map(|old| old.place);
        // The only error is a missing transform, which the body requires.
        old.unwrap_or_else(|| transforms.compute_global_transform(self.entity).unwrap_or_default())
    }

    /// What it is to be made of, and how that compares with the mesh that there is now: as it was closed before, if that is still
    /// the mesh or the new one was refused.
    fn source(&self, meshes: &Meshes) -> Result<(Option<Source>, SourceMesh), NotNow> {
        let Some(shape) = self.shape.mesh() else { return Ok((None, SourceMesh::Same)) };
        let is_known =
            |old: &&Mut<SimulatedBody>| old.source != SourceMesh::Changed && old.shape_asked == *self.shape;
        if let Some(old) = self.simulated.as_ref().filter(is_known)
            && let Some(closed) = old.closed.clone()
        {
            return Ok((Some(Source::Closed(closed)), old.source));
        }
        let read = meshes.source(shape).map_err(|error| NotNow::Refused(HapticFaultKind::Mesh(error)))?;
        read.map(|read| (Some(read), SourceMesh::Same)).ok_or(NotNow::Awaits)
    }

    /// All that makes it, at `at`.
    fn plan(&self, at: &GlobalTransform) -> Result<BuildInput, HapticFaultKind> {
        let (rotation, translation_m) = place(at)?;
        Ok(BuildInput {
            shape: (*self.shape).clone(),
            tissue: *self.tissue,
            fixed: (*self.fixed).clone(),
            slit: self.slit.as_ref().map(|slit| **slit),
            inclusions: self.inclusions.as_ref().map(|inclusions| inclusions.0.clone()).unwrap_or_default(),
            rotation,
            translation_m,
        })
    }

    fn note_source(&mut self, source: SourceMesh) {
        if let Some(old) = &mut self.simulated {
            old.bypass_change_detection().source = source;
        }
    }
}

/// Builds what is new or changed.
pub(super) fn build_bodies(
    mut commands: Commands,
    mut bodies: Query<Asked>,
    mut meshes: Meshes,
    transforms: TransformHelper,
    clock: Option<Res<LoopMode>>,
    mut builds: ResMut<BodyBuilds>,
    mut faults: MessageWriter<HapticFault>,
) {
    meshes
        .look(|id| bodies.iter().any(|asked| asked.shape.mesh().is_some_and(|shape| shape.mesh.id() == id)));
    for mut asked in &mut bodies {
        let entity = asked.entity;
        let is_new_mesh = meshes.has_changed(&asked.shape);
        if is_new_mesh {
            asked.note_source(SourceMesh::Changed);
        }
        let is_asked_anew = is_new_mesh || asked.is_changed();
        if !(is_asked_anew || asked.is_due(&transforms)) {
            continue;
        }
        if let Some(BodyBuild::Making(making)) = asked.build.as_deref_mut()
            && asked.shape.mesh().is_some()
        {
            making.is_outdated = true;
            if is_new_mesh {
                making.source = SourceMesh::Changed;
            }
            continue;
        }
        let at = asked.place(&transforms);
        let mut refuse = |kind| {
            faults.write(HapticFault { entity: Some(entity), kind });
        };
        // The place first: what is refused there need not be read.
        if let Err(kind) = place(&at) {
            // Said once, however it moves on.
            if is_asked_anew || !matches!(asked.build.as_deref(), Some(BodyBuild::AwaitsPlace(_))) {
                refuse(kind);
            }
            commands.entity(entity).try_insert(BodyBuild::AwaitsPlace(at));
            continue;
        }
        let (source, compared) = match asked.source(&meshes) {
            Ok(source) => source,
            Err(NotNow::Awaits) => {
                commands.entity(entity).try_insert(BodyBuild::AwaitsMesh);
                continue;
            }
            Err(NotNow::Refused(HapticFaultKind::Mesh(MeshFault::NotLoaded(why)))) => {
                if !matches!(asked.build.as_deref(), Some(BodyBuild::MissesMesh)) {
                    refuse(HapticFaultKind::Mesh(MeshFault::NotLoaded(why)));
                    commands.entity(entity).try_insert(BodyBuild::MissesMesh);
                }
                continue;
            }
            Err(NotNow::Refused(kind)) => {
                refuse(kind);
                settle(&mut commands, entity);
                asked.note_source(SourceMesh::Refused);
                continue;
            }
        };
        let plan = match asked.plan(&at) {
            Ok(plan) => plan,
            Err(kind) => {
                refuse(kind);
                continue;
            }
        };
        // In lock step nothing may depend on when another thread is ready.
        let is_beside = source.is_some() && clock.as_deref() != Some(&LoopMode::Lockstep);
        if let Some(pool) = AsyncComputeTaskPool::try_get().filter(|_| is_beside) {
            let task = pool.spawn(async move {
                let made = plan.make(source);
                (plan, made)
            });
            let making = Making { task, is_outdated: false, source: compared };
            commands.entity(entity).try_insert(BodyBuild::Making(making));
            continue;
        }
        settle(&mut commands, entity);
        match plan.make(source) {
            Ok(made) => {
                let build = Build { plan, made, source: compared };
                let old = asked.simulated.as_deref_mut();
                put(&mut commands, &mut faults, (entity, old), (build, at), builds.next());
            }
            Err(refusal) => {
                refuse(refusal.kind);
                if refusal.is_of_mesh {
                    asked.note_source(SourceMesh::Refused);
                }
            }
        }
    }
}

/// Takes what was made beside the app.
pub(super) fn take_built(
    mut commands: Commands,
    mut bodies: Query<(Entity, &mut BodyBuild, Option<&mut SimulatedBody>)>,
    transforms: TransformHelper,
    mut builds: ResMut<BodyBuilds>,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, mut build, mut simulated) in &mut bodies {
        let BodyBuild::Making(Making { task, is_outdated, source }) = &mut *build else { continue };
        let Some((plan, made)) = check_ready(task) else { continue };
        let (is_outdated, source) = (*is_outdated, *source);
        if is_outdated {
            *build = BodyBuild::Outdated;
        } else {
            settle(&mut commands, entity);
        }
        match made {
            Ok(made) => {
                let old = simulated.as_ref().map(|old| old.place);
                let at =
                    old.unwrap_or_else(|| transforms.compute_global_transform(entity).unwrap_or_default());
                let build = Build { plan, made, source };
                let old = simulated.as_deref_mut();
                put(&mut commands, &mut faults, (entity, old), (build, at), builds.next());
            }
            Err(BuildError { kind, is_of_mesh }) => {
                faults.write(HapticFault { entity: Some(entity), kind });
                // Another mesh than the one refused, or in another size, has not been refused.
                if is_of_mesh
                    && source != SourceMesh::Changed
                    && let Some(old) = simulated.filter(|old| old.shape_asked == plan.shape)
                {
                    old.into_inner().source = SourceMesh::Refused;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
