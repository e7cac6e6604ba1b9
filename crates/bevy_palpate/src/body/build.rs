//! Bodies are built of what is asked for, and anew when that changes: blocks at once, meshes beside the app.

use super::make::{Made, Plan, place};
use super::source::Source;
use super::{
    DeformableBody, Drawn, FixedRegion, Inclusions, MeshShape, MeshSourceError, SimulatedBody, Slit, Tissue,
};
use crate::fault::{HapticFault, HapticFaultKind};
use crate::schedule::HapticClock;
use bevy::asset::LoadState;
use bevy::ecs::message::MessageCursor;
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use palpate_body::StepReport;

/// A body of a mesh that is not there yet.
#[derive(Component)]
pub(super) enum BodyBuild {
    /// Its mesh is being loaded.
    AwaitsMesh,
    /// Its mesh could not be loaded, which has been said; it may still come.
    MissesMesh,
    /// It is being made.
    Making(Task<Result<Build, HapticFaultKind>>),
}

/// What was made of what.
pub(super) struct Build {
    plan: Plan,
    made: Made,
    /// Whether the mesh is another one than before.
    is_new_mesh: bool,
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
    transform: Ref<'static, Transform>,
    simulated: Option<&'static mut SimulatedBody>,
    build: Option<&'static BodyBuild>,
}

/// The meshes of the app, and which of them have changed.
#[derive(SystemParam)]
pub(super) struct Meshes<'w, 's> {
    assets: Option<Res<'w, Assets<Mesh>>>,
    server: Option<Res<'w, AssetServer>>,
    events: Option<Res<'w, Messages<AssetEvent<Mesh>>>>,
    cursor: Local<'s, MessageCursor<AssetEvent<Mesh>>>,
}

impl Meshes<'_, '_> {
    /// Those that changed since the last call. What is new is waited for where it is wanted.
    fn changed(&mut self) -> Vec<AssetId<Mesh>> {
        let Some(events) = &self.events else { return Vec::new() };
        let id = |event: &AssetEvent<Mesh>| match event {
            AssetEvent::Modified { id } => Some(*id),
            _ => None,
        };
        self.cursor.read(events).filter_map(id).collect()
    }

    /// What is to be filled; `None` while it is being loaded.
    fn source(&self, shape: &MeshShape) -> Result<Option<Source>, MeshSourceError> {
        let assets = self.assets.as_ref().ok_or(MeshSourceError::NoMeshes)?;
        if let Some(mesh) = assets.get(&shape.mesh) {
            return Source::read(mesh, shape).map(Some);
        }
        match self.server.as_ref().and_then(|server| server.get_load_state(&shape.mesh)) {
            Some(LoadState::Failed(error)) => Err(MeshSourceError::NotLoaded(error.to_string())),
            _ => Ok(None),
        }
    }
}

/// Builds what is new or changed.
pub(super) fn build_bodies(
    mut commands: Commands,
    mut bodies: Query<Asked>,
    mut meshes: Meshes,
    transforms: TransformHelper,
    clock: Option<Res<HapticClock>>,
    mut builds: ResMut<BodyBuilds>,
    mut faults: MessageWriter<HapticFault>,
) {
    let changed_meshes = meshes.changed();
    for mut asked in &mut bodies {
        let entity = asked.entity;
        let is_new_mesh =
            matches!(&*asked.shape, DeformableBody::Mesh(shape) if changed_meshes.contains(&shape.mesh.id()));
        let changed = asked.shape.is_changed()
            || asked.tissue.is_changed()
            || asked.fixed.is_changed()
            || asked.slit.as_ref().is_some_and(DetectChanges::is_changed)
            || asked.inclusions.as_ref().is_some_and(DetectChanges::is_changed)
            || is_new_mesh
            || matches!(asked.build, Some(BodyBuild::AwaitsMesh | BodyBuild::MissesMesh));
        // What could not be built where it was may be built where it is now.
        let is_nowhere = asked.simulated.is_none() && asked.build.is_none();
        if !(changed || is_nowhere && asked.transform.is_changed()) {
            continue;
        }
        let old_place = asked.simulated.as_ref().map(|old| old.place);
        // The only error is a missing transform, which the body requires.
        let at = old_place.unwrap_or_else(|| transforms.compute_global_transform(entity).unwrap_or_default());
        let mut refuse = |kind| {
            commands.entity(entity).try_remove::<BodyBuild>();
            faults.write(HapticFault { entity: Some(entity), kind });
        };
        let (rotation, translation_m) = match place(&at) {
            Ok(place) => place,
            Err(kind) => {
                refuse(kind);
                continue;
            }
        };
        let plan = Plan {
            shape: (*asked.shape).clone(),
            tissue: *asked.tissue,
            fixed: (*asked.fixed).clone(),
            slit: asked.slit.as_ref().map(|slit| **slit),
            inclusions: asked.inclusions.as_ref().map(|inclusions| inclusions.0.clone()).unwrap_or_default(),
            rotation,
            translation_m,
        };
        let source = match &plan.shape {
            DeformableBody::Block { .. } => None,
            DeformableBody::Mesh(shape) => {
                let known =
                    asked.simulated.as_ref().filter(|old| !is_new_mesh && old.shape_asked == plan.shape);
                let source = match known.and_then(|old| old.closed.clone()) {
                    Some(closed) => Ok(Some(Source::Closed(closed))),
                    None => meshes.source(shape),
                };
                match source {
                    Ok(Some(source)) => Some(source),
                    Ok(None) => {
                        commands.entity(entity).try_insert(BodyBuild::AwaitsMesh);
                        continue;
                    }
                    Err(MeshSourceError::NotLoaded(_))
                        if matches!(asked.build, Some(BodyBuild::MissesMesh)) =>
                    {
                        continue;
                    }
                    Err(error) => {
                        let is_missing = matches!(error, MeshSourceError::NotLoaded(_));
                        refuse(HapticFaultKind::Mesh(error));
                        if is_missing {
                            commands.entity(entity).try_insert(BodyBuild::MissesMesh);
                        }
                        continue;
                    }
                }
            }
        };
        // In lock step nothing may depend on when another thread is ready.
        let is_beside = source.is_some() && clock.as_deref() != Some(&HapticClock::Lockstep);
        if let Some(pool) = AsyncComputeTaskPool::try_get().filter(|_| is_beside) {
            let task =
                pool.spawn(async move { plan.make(source).map(|made| Build { plan, made, is_new_mesh }) });
            commands.entity(entity).try_insert(BodyBuild::Making(task));
            continue;
        }
        match plan.make(source) {
            Ok(made) => {
                let build = Build { plan, made, is_new_mesh };
                put(&mut commands, (entity, asked.simulated.as_deref_mut()), (build, at), builds.next());
            }
            Err(kind) => refuse(kind),
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
        let BodyBuild::Making(task) = &mut *build else { continue };
        let Some(built) = check_ready(task) else { continue };
        match built {
            Ok(built) => {
                let old = simulated.as_ref().map(|old| old.place);
                let at =
                    old.unwrap_or_else(|| transforms.compute_global_transform(entity).unwrap_or_default());
                put(&mut commands, (entity, simulated.as_deref_mut()), (built, at), builds.next());
            }
            Err(kind) => {
                commands.entity(entity).try_remove::<BodyBuild>();
                faults.write(HapticFault { entity: Some(entity), kind });
            }
        }
    }
}

/// Puts a new body in its place: with shape and motion of the old one if it has the same nodes, at rest if not. It was planned
/// where the entity was then and is put where it is `at` now.
fn put(
    commands: &mut Commands,
    (entity, old): (Entity, Option<&mut SimulatedBody>),
    (build, at): (Build, GlobalTransform),
    epoch: u64,
) {
    let Build { plan, made, is_new_mesh } = build;
    let planned = GlobalTransform::from(
        Transform::from_translation(plan.translation_m.as_vec3()).with_rotation(plan.rotation.as_quat()),
    );
    let mut new = SimulatedBody {
        body: made.body,
        builder: made.builder,
        epoch,
        last_step: StepReport::default(),
        shape: epoch,
        carried: 0,
        failed: None,
        place: planned,
        is_refused_place: false,
        shape_asked: plan.shape,
        fixed_asked: plan.fixed,
        slit_asked: plan.slit,
        skin: made.skin,
        closed: made.closed,
        drawn: Drawn::default(),
        sutures: Vec::new(),
    };
    commands.entity(entity).try_remove::<BodyBuild>();
    let Some(old) = old else {
        new.carry_to(at);
        commands.entity(entity).try_insert(new);
        return;
    };
    let is_same = !is_new_mesh
        && (&old.shape_asked, &old.fixed_asked, old.slit_asked)
            == (&new.shape_asked, &new.fixed_asked, new.slit_asked)
        && old.body.positions_m().len() == new.body.positions_m().len();
    if is_same {
        // It fits, since the nodes are the same.
        let _ = new.body.set_state(old.body.positions_m(), old.body.velocities_m_per_s());
        (new.shape, new.carried, new.place) = (old.shape, old.carried, old.place);
        new.drawn = std::mem::take(&mut old.drawn);
    } else {
        new.drawn = std::mem::take(&mut old.drawn).of_another_shape();
        new.carry_to(at);
    }
    new.is_refused_place = old.is_refused_place;
    *old = new;
}
