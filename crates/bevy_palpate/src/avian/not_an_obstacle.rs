//! Marks colliders that are no obstacles.

use bevy::prelude::*;

/// Excludes a collider of avian, or all colliders of a rigid body, from the obstacles: soft bodies pass through it.
///
/// ```
/// # use bevy::prelude::*;
/// use avian3d::prelude::{Collider, RigidBody};
/// use bevy_palpate::NotAnObstacle;
///
/// fn setup(mut commands: Commands) {
///     commands.spawn((RigidBody::Static, Collider::cuboid(1.0, 0.1, 1.0), NotAnObstacle));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct NotAnObstacle;
