//! Converts avian's colliders to obstacles when they are new or have changed.

use super::coupling::Coupling;
use super::math::{double, double_rotation};
use super::not_an_obstacle::NotAnObstacle;
use super::shapes::{ShapeError, convert};
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::surroundings::{CoupledObstacle, Obstacle, ObstacleForce, PreparedObstacle};
use avian3d::collision::collider::ColliderDisabled;
use avian3d::parry::shape::SharedShape;
use avian3d::prelude::{
    Collider, ColliderOf, ColliderTransform, DefaultFriction, Friction, RigidBody, RigidBodyColliders,
    RigidBodyDisabled, Sensor,
};
use bevy::prelude::*;
use glam::{DQuat, DVec3};
use palpate_body::CoupledMotion;
use std::sync::Arc;

/// The shape of a collider as it was converted. It holds the shape, so that another one cannot be at its address.
#[derive(Clone)]
struct Converted {
    collider: Entity,
    shape: SharedShape,
    /// Pose in the rigid body.
    place: (DVec3, DQuat),
    friction: f64,
}

impl PartialEq for Converted {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shape.0, &other.shape.0)
            && (self.collider, self.place) == (other.collider, other.place)
            && self.friction.to_bits() == other.friction.to_bits()
    }
}

/// The obstacle of a collider of a static rigid body, or of all colliders of another one, as it was converted.
#[derive(Component)]
pub(super) struct ConvertedColliders {
    from: Vec<Converted>,
    is_static: bool,
}

/// The first version of an obstacle from colliders; the others are greater. Those of obstacles of their own begin at 1.
const FIRST_VERSION: u64 = 1 << 32;

#[derive(bevy::ecs::query::QueryData)]
pub(super) struct BodyColliders {
    entity: Entity,
    kind: &'static RigidBody,
    colliders: &'static RigidBodyColliders,
    friction: Option<&'static Friction>,
    is_disabled: Has<RigidBodyDisabled>,
    is_excluded: Has<NotAnObstacle>,
}

#[derive(bevy::ecs::query::QueryData)]
pub(super) struct ColliderParts {
    entity: Entity,
    collider: &'static Collider,
    place: Option<&'static ColliderTransform>,
    friction: Option<&'static Friction>,
}

type Usable =
    (With<ColliderOf>, Without<Sensor>, Without<ColliderDisabled>, Without<NotAnObstacle>, Without<Obstacle>);

/// Prepares the obstacles of new and changed colliders, and removes those of colliders that are none any more.
pub(super) fn prepare_colliders(
    mut commands: Commands,
    bodies: Query<BodyColliders>,
    colliders: Query<ColliderParts, Usable>,
    converted: Query<(Entity, &ConvertedColliders, Has<Obstacle>)>,
    default_friction: Option<Res<DefaultFriction>>,
    mut versions: Local<u64>,
    mut faults: FaultWriter,
) {
    let default_friction = default_friction.map_or_else(Friction::default, |friction| friction.0);
    let mut live = bevy::ecs::entity::EntityHashSet::default();
    for body in &bodies {
        if body.is_disabled || body.is_excluded {
            continue;
        }
        let is_static = body.kind.is_static();
        let mut from: Vec<Converted> = colliders
            .iter_many(body.colliders.iter())
            .map(|parts| {
                let friction = parts.friction.or(body.friction).unwrap_or(&default_friction);
                let place = parts.place.filter(|_| !is_static);
                Converted {
                    collider: parts.entity,
                    shape: parts.collider.shape_scaled().clone(),
                    place: place.map_or((DVec3::ZERO, DQuat::IDENTITY), |place| {
                        (double(place.translation), double_rotation(place.rotation.0))
                    }),
                    friction: f64::from(friction.dynamic_coefficient),
                }
            })
            .collect();
        from.sort_unstable_by_key(|of| of.collider);
        let groups: Vec<(Entity, Vec<Converted>)> = if is_static {
            from.into_iter().map(|of| (of.collider, vec![of])).collect()
        } else {
            vec![(body.entity, from)]
        };
        for (entity, from) in groups.into_iter().filter(|(_, from)| !from.is_empty()) {
            live.insert(entity);
            let known = converted.get(entity).ok().map(|(_, known, _)| known);
            if known.is_some_and(|known| known.is_static == is_static && known.from == from) {
                continue;
            }
            let obstacle = obstacle(&from, |error| {
                let kind = match error {
                    ShapeError::Unsupported(shape) => HapticFaultKind::UnsupportedCollider { shape },
                    ShapeError::Rejected(error) => HapticFaultKind::Obstacle(error),
                };
                faults.write(entity, kind);
            });
            *versions += 1;
            let version = FIRST_VERSION + *versions;
            let mut commands = commands.entity(entity);
            commands.try_insert(ConvertedColliders { from, is_static });
            match obstacle {
                Some(obstacle) if is_static => {
                    commands
                        .try_insert(PreparedObstacle { obstacle, version, scale: Vec3::ONE })
                        .try_insert_if_new(ObstacleForce::default())
                        .try_remove::<(CoupledObstacle, Coupling)>();
                }
                Some(obstacle) => {
                    commands
                        .try_insert(CoupledObstacle::standing(obstacle, version))
                        .try_insert_if_new((ObstacleForce::default(), Coupling::default()))
                        .try_remove::<PreparedObstacle>();
                }
                None => {
                    commands.try_remove::<(PreparedObstacle, CoupledObstacle, Coupling)>();
                }
            }
        }
    }
    for (entity, _, has_obstacle) in converted.iter().filter(|(entity, ..)| !live.contains(entity)) {
        let mut commands = commands.entity(entity);
        commands.try_remove::<(ConvertedColliders, CoupledObstacle, Coupling)>();
        if !has_obstacle {
            commands.try_remove::<(PreparedObstacle, ObstacleForce)>();
        }
    }
}

/// The obstacle of colliders; `None` if none of them can be one.
fn obstacle(from: &[Converted], mut report: impl FnMut(ShapeError)) -> Option<palpate_body::Obstacle> {
    let mut parts = Vec::new();
    for of in from {
        if let Err(error) = convert(&of.shape, of.place, of.friction, &mut parts) {
            report(error);
        }
    }
    let is_at_origin = |part: &palpate_body::Obstacle| {
        (part.position_m(), part.rotation()) == (DVec3::ZERO, DQuat::IDENTITY)
    };
    match &parts[..] {
        [] => None,
        [part] if is_at_origin(part) => Some(part.clone()),
        // Cannot fail: there is a part.
        _ => palpate_body::Obstacle::compound(&parts).ok(),
    }
}

impl CoupledObstacle {
    /// The obstacle before its first model step.
    fn standing(obstacle: palpate_body::Obstacle, version: u64) -> Self {
        // Without a finite place it is left out.
        let start = (DVec3::NAN, DQuat::IDENTITY);
        let motion = CoupledMotion::prescribed(start.0, start.1);
        Self { obstacle, version, start, has_jumped: true, motion, expected: Vec::new() }
    }
}
