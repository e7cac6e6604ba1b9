//! Converts obstacles to those of the bodies when they are new or have changed.

use super::obstacle::{Obstacle, ObstacleForce, ObstacleShape};
use crate::fault::{FaultWriter, HapticFaultKind};
use bevy::ecs::message::MessageCursor;
use bevy::ecs::system::SystemParam;
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use glam::{DQuat, DVec3};
use palpate_body::BodyError;

/// An obstacle that is ready to be placed.
#[derive(Component, Debug)]
pub(crate) struct PreparedObstacle {
    pub(crate) obstacle: palpate_body::Obstacle,
    /// Greater than the versions of all obstacles before.
    pub(crate) version: u64,
    /// Scale of the entity for which it was prepared.
    pub(crate) scale: Vec3,
}

/// Marks an obstacle whose present components were rejected and reported.
#[derive(Component, Debug)]
pub(crate) struct RejectedObstacle {
    scale: Vec3,
}

/// Position and rotation of an obstacle, m.
pub(crate) fn pose(transform: &GlobalTransform) -> (Vec3, DVec3, DQuat) {
    let (scale, rotation, translation) = transform.to_scale_rotation_translation();
    (scale, translation.as_dvec3(), rotation.as_dquat().normalize())
}

/// Minimum relative change of a scale for which an obstacle is prepared again.
const SCALE_TOLERANCE: f32 = 1e-5;

/// Mesh assets and their changes.
#[derive(SystemParam)]
pub(super) struct ObstacleMeshes<'w, 's> {
    assets: Option<Res<'w, Assets<Mesh>>>,
    events: Option<Res<'w, Messages<AssetEvent<Mesh>>>>,
    cursor: Local<'s, MessageCursor<AssetEvent<Mesh>>>,
}

impl ObstacleMeshes<'_, '_> {
    /// The meshes for which `is_source` is true and that have changed since the last call. Drawn meshes of bodies change in every frame.
    fn take_modified(&mut self, is_source: impl Fn(AssetId<Mesh>) -> bool) -> Vec<AssetId<Mesh>> {
        let Some(events) = &self.events else { return Vec::new() };
        let of = |event: &AssetEvent<Mesh>| match event {
            AssetEvent::Modified { id } => Some(*id),
            _ => None,
        };
        self.cursor.read(events).filter_map(of).filter(|id| is_source(*id)).collect()
    }
}

/// Prepares new and changed obstacles, those whose mesh is loaded or changed, and those whose scale has changed.
pub(super) fn prepare_obstacles(
    mut commands: Commands,
    obstacles: Query<(Entity, Ref<Obstacle>, Option<&PreparedObstacle>, Option<&RejectedObstacle>)>,
    transforms: TransformHelper,
    mut meshes: ObstacleMeshes,
    mut versions: Local<u64>,
    mut faults: FaultWriter,
) {
    let modified = meshes.take_modified(|id| {
        obstacles.iter().any(|(_, obstacle, ..)| obstacle.mesh().is_some_and(|mesh| mesh.id() == id))
    });
    for (entity, obstacle, prepared, rejected) in &obstacles {
        let Ok(transform) = transforms.compute_global_transform(entity) else { continue };
        let (scale, ..) = pose(&transform);
        let is_same_scale =
            |of: Vec3| (of - scale).abs().max_element() <= SCALE_TOLERANCE * scale.abs().max_element();
        let is_done = prepared.is_some_and(|it| is_same_scale(it.scale))
            || rejected.is_some_and(|it| is_same_scale(it.scale));
        let is_modified = obstacle.mesh().is_some_and(|mesh| modified.contains(&mesh.id()));
        if is_done && !obstacle.is_changed() && !is_modified {
            continue;
        }
        let mesh = match obstacle.mesh() {
            Some(handle) => match meshes.assets.as_ref().and_then(|assets| assets.get(handle)) {
                Some(mesh) => Some(mesh),
                // The asset is being loaded.
                None => continue,
            },
            None => None,
        };
        let mut entity_commands = commands.entity(entity);
        match convert(&obstacle, mesh, scale.as_dvec3()) {
            Ok(converted) => {
                *versions += 1;
                let prepared = PreparedObstacle { obstacle: converted, version: *versions, scale };
                entity_commands.try_insert(prepared).try_remove::<RejectedObstacle>();
            }
            Err(error) => {
                entity_commands.try_insert(RejectedObstacle { scale }).try_remove::<PreparedObstacle>();
                faults.write(entity, HapticFaultKind::Obstacle(error));
            }
        }
    }
}

/// Removes the prepared obstacle together with [`Obstacle`].
pub(super) fn remove_obstacle(removed: On<Remove, Obstacle>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<(PreparedObstacle, RejectedObstacle, ObstacleForce)>();
}

/// The obstacle in its own frame, scaled by `scale`.
fn convert(
    obstacle: &Obstacle,
    mesh: Option<&Mesh>,
    scale: DVec3,
) -> Result<palpate_body::Obstacle, BodyError> {
    let invalid = |what, value, allowed| BodyError::Parameter { what, value, allowed };
    if !(scale.is_finite() && scale.min_element() > 0.0) {
        let allowed = "above 0 along every axis: change the Transform of the entity or of a parent";
        return Err(invalid("scale of an obstacle", scale.min_element(), allowed));
    }
    let uniform = || {
        let (low, high) = (scale.min_element(), scale.max_element());
        let allowed = "equal along all axes for a sphere or a capsule";
        if high - low <= 1e-4 * high {
            Ok(high)
        } else {
            Err(invalid("scale of an obstacle", high / low, allowed))
        }
    };
    let friction = obstacle.friction;
    let vertices = |mesh: &Mesh| match mesh.try_attribute(Mesh::ATTRIBUTE_POSITION) {
        Ok(VertexAttributeValues::Float32x3(positions)) => {
            Ok(positions.iter().map(|x| scale * DVec3::from_array(x.map(f64::from))).collect::<Vec<_>>())
        }
        _ => Err(invalid("vertices of an obstacle's mesh", 0.0, "at least 4, kept in the main world")),
    };
    match (&obstacle.shape, mesh) {
        (ObstacleShape::HalfSpace, _) => palpate_body::Obstacle::plane(DVec3::ZERO, DVec3::Y, friction),
        (ObstacleShape::Sphere { radius_m }, _) => {
            palpate_body::Obstacle::sphere(DVec3::ZERO, radius_m * uniform()?, friction)
        }
        (ObstacleShape::Cuboid { half_m }, _) => palpate_body::Obstacle::cuboid(*half_m * scale, friction),
        (ObstacleShape::Capsule { half_length_m, radius_m }, _) => {
            let scale = uniform()?;
            palpate_body::Obstacle::capsule(half_length_m * scale, radius_m * scale, friction)
        }
        (ObstacleShape::ConvexHull(_), Some(mesh)) => {
            palpate_body::Obstacle::convex_hull(&vertices(mesh)?, friction)
        }
        (ObstacleShape::TriangleMesh(_), Some(mesh)) => {
            let vertices = vertices(mesh)?;
            let corners: Vec<usize> = match mesh.try_indices() {
                Ok(indices) => indices.iter().collect(),
                Err(_) => (0..vertices.len()).collect(),
            };
            let triangles: Vec<[usize; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
            palpate_body::Obstacle::triangle_mesh(&vertices, &triangles, friction)
        }
        // The mesh of these shapes is always given.
        (ObstacleShape::ConvexHull(_) | ObstacleShape::TriangleMesh(_), None) => {
            Err(invalid("vertices of an obstacle's mesh", 0.0, "at least 4"))
        }
    }
}
