//! Rigid obstacles and the force of the bodies on them.

use bevy::prelude::*;
use glam::DVec3;

/// A rigid obstacle at the entity's transform: bodies cannot enter it, and slide on it with friction.
///
/// The transform may move: between two model steps the obstacle moves to its new place at constant velocity, and carries and pushes what it
/// touches. A move faster than 25 m/s counts as a jump, after which the obstacle pushes out what it covers at 1 m/s. A body and an obstacle
/// meet if they share one of their [`TouchLayers`](crate::TouchLayers). Tools pass through obstacles.
///
/// Points of a body's surface, about one in each cell, touch an obstacle. Edges and features of an obstacle that are smaller than a cell of
/// the body may pass between them.
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{Gravity, Obstacle, prelude::*};
///
/// fn setup(mut commands: Commands) {
///     commands.insert_resource(Gravity::EARTH);
///     // A table at y = 0, and a body that falls onto it.
///     commands.spawn(Obstacle::half_space());
///     commands.spawn((DeformableBody::block([6; 3], 0.1), Transform::from_xyz(0.0, 0.06, 0.0)));
/// }
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[require(ObstacleForce, Transform)]
#[reflect(Component, Debug, PartialEq, Clone)]
pub struct Obstacle {
    /// Shape, in the frame of the entity and scaled with it.
    pub shape: ObstacleShape,
    /// Coefficient of friction between the obstacle and bodies.
    pub friction: f64,
}

/// Shape of an [`Obstacle`], in the frame of its entity.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub enum ObstacleShape {
    /// The points with y below 0.
    HalfSpace,
    /// A ball around the origin.
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// A box around the origin.
    Cuboid {
        /// Half of the sides, m.
        half_m: DVec3,
    },
    /// The points within a radius of a segment of the y axis around the origin.
    Capsule {
        /// Half of the length of the segment, m.
        half_length_m: f64,
        /// Radius, m.
        radius_m: f64,
    },
    /// The convex hull of the vertices of a mesh, in metres.
    ConvexHull(Handle<Mesh>),
    /// The triangles of a mesh, in metres, counter-clockwise as seen from outside. A closed mesh is solid; an open one is a shell behind its
    /// triangles with a thickness of a twentieth of its size.
    TriangleMesh(Handle<Mesh>),
}

impl Obstacle {
    /// Coefficient of friction of a new obstacle.
    pub const FRICTION: f64 = 0.5;

    /// Returns an obstacle of a shape.
    #[must_use]
    pub fn new(shape: ObstacleShape) -> Self {
        Self { shape, friction: Self::FRICTION }
    }

    /// Returns a half-space below the entity's xz plane: a table or a floor.
    #[must_use]
    pub fn half_space() -> Self {
        Self::new(ObstacleShape::HalfSpace)
    }

    /// Returns a ball of radius `radius_m`, m.
    #[must_use]
    pub fn sphere(radius_m: f64) -> Self {
        Self::new(ObstacleShape::Sphere { radius_m })
    }

    /// Returns a box of size `size_m`, m.
    #[must_use]
    pub fn cuboid(size_m: DVec3) -> Self {
        Self::new(ObstacleShape::Cuboid { half_m: 0.5 * size_m })
    }

    /// Returns a capsule along y with radius `radius_m`, m, and `length_m`, m, between the centres of its ends, as
    /// [`Capsule3d`].
    #[must_use]
    pub fn capsule(radius_m: f64, length_m: f64) -> Self {
        Self::new(ObstacleShape::Capsule { half_length_m: 0.5 * length_m, radius_m })
    }

    /// Returns the convex hull of a mesh.
    #[must_use]
    pub fn convex_hull(mesh: Handle<Mesh>) -> Self {
        Self::new(ObstacleShape::ConvexHull(mesh))
    }

    /// Returns the triangles of a mesh.
    #[must_use]
    pub fn triangle_mesh(mesh: Handle<Mesh>) -> Self {
        Self::new(ObstacleShape::TriangleMesh(mesh))
    }

    /// Returns the obstacle with another coefficient of friction.
    #[must_use]
    pub fn with_friction(self, friction: f64) -> Self {
        Self { friction, ..self }
    }

    /// The mesh of a hull or of triangles.
    pub(super) fn mesh(&self) -> Option<&Handle<Mesh>> {
        match &self.shape {
            ObstacleShape::ConvexHull(mesh) | ObstacleShape::TriangleMesh(mesh) => Some(mesh),
            _ => None,
        }
    }
}

/// Mean force of all bodies on an obstacle over the last model step.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ObstacleForce {
    /// Force, N, world frame.
    pub force_n: DVec3,
    /// Torque about the entity's position, N m, world frame.
    pub torque_nm: DVec3,
}
