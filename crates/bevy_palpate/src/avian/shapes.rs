//! Converts avian's shapes to those of obstacles.

use super::math::double;
use avian3d::math::Vector;
use avian3d::parry::shape::{SharedShape, TypedShape};
use glam::{DQuat, DVec3};
use palpate_body::{BodyError, Obstacle};
use thiserror::Error;

/// A shape that is no obstacle.
#[derive(Clone, Debug, Error)]
pub(super) enum ShapeError {
    /// The kind of shape has no volume, or is unknown.
    #[error("a {0}")]
    Unsupported(&'static str),
    #[error(transparent)]
    Rejected(#[from] BodyError),
}

/// Segments around the axis of a cylinder or a cone.
const SEGMENTS: u32 = 32;

/// Appends the convex parts or meshes of `shape` to `parts`, each in its pose.
pub(super) fn convert(
    shape: &SharedShape,
    (position_m, rotation): (DVec3, DQuat),
    friction: f64,
    parts: &mut Vec<Obstacle>,
) -> Result<(), ShapeError> {
    let place = |obstacle: Obstacle| obstacle.with_pose(position_m, rotation);
    let hull = |points: &[Vector]| {
        let points: Vec<DVec3> = points.iter().copied().map(double).collect();
        Obstacle::convex_hull(&points, friction)
    };
    let rounded = |inner: Result<Obstacle, BodyError>, radius: f64| place(inner?.with_margin(radius)?);
    let part = match shape.as_typed_shape() {
        TypedShape::Ball(ball) => place(Obstacle::sphere(DVec3::ZERO, f64::from(ball.radius), friction)?)?,
        TypedShape::Cuboid(cuboid) => place(Obstacle::cuboid(double(cuboid.half_extents), friction)?)?,
        TypedShape::Capsule(capsule) => {
            let [a, b] = [capsule.segment.a, capsule.segment.b].map(double);
            let along = (b - a).try_normalize().unwrap_or(DVec3::Y);
            // The ends are equal: the smaller rotation.
            let along = if along.y < 0.0 { -along } else { along };
            let turn = DQuat::from_rotation_arc(DVec3::Y, along);
            let obstacle = Obstacle::capsule(0.5 * a.distance(b), f64::from(capsule.radius), friction)?;
            obstacle.with_pose(position_m + rotation * (0.5 * (a + b)), rotation * turn)?
        }
        TypedShape::HalfSpace(half_space) => {
            place(Obstacle::plane(DVec3::ZERO, double(half_space.normal).normalize(), friction)?)?
        }
        TypedShape::ConvexPolyhedron(polyhedron) => place(hull(polyhedron.points())?)?,
        TypedShape::Cylinder(cylinder) => place(hull(&cylinder.to_trimesh(SEGMENTS).0)?)?,
        TypedShape::Cone(cone) => place(hull(&cone.to_trimesh(SEGMENTS).0)?)?,
        TypedShape::RoundCuboid(round) => rounded(
            Obstacle::cuboid(double(round.inner_shape.half_extents), friction),
            f64::from(round.border_radius),
        )?,
        TypedShape::RoundCylinder(round) => {
            rounded(hull(&round.inner_shape.to_trimesh(SEGMENTS).0), f64::from(round.border_radius))?
        }
        TypedShape::RoundCone(round) => {
            rounded(hull(&round.inner_shape.to_trimesh(SEGMENTS).0), f64::from(round.border_radius))?
        }
        TypedShape::RoundConvexPolyhedron(round) => {
            rounded(hull(round.inner_shape.points()), f64::from(round.border_radius))?
        }
        TypedShape::TriMesh(mesh) => place(triangles(mesh.vertices(), mesh.indices(), friction)?)?,
        TypedShape::HeightField(field) => {
            let (vertices, indices) = field.to_trimesh();
            place(triangles(&vertices, &indices, friction)?)?
        }
        TypedShape::Voxels(voxels) => {
            let (vertices, indices) = voxels.to_trimesh();
            place(triangles(&vertices, &indices, friction)?)?
        }
        TypedShape::Triangle(triangle) => {
            place(triangles(&[triangle.a, triangle.b, triangle.c], &[[0, 1, 2]], friction)?)?
        }
        TypedShape::Compound(compound) => {
            for (pose, shape) in compound.shapes() {
                let at_m = position_m + rotation * double(pose.translation);
                let turn = rotation * super::math::double_rotation(pose.rotation);
                convert(shape, (at_m, turn), friction, parts)?;
            }
            return Ok(());
        }
        TypedShape::Segment(_) => return Err(ShapeError::Unsupported("segment")),
        TypedShape::Polyline(_) => return Err(ShapeError::Unsupported("polyline")),
        TypedShape::RoundTriangle(_) => return Err(ShapeError::Unsupported("rounded triangle")),
        TypedShape::Custom(_) => return Err(ShapeError::Unsupported("shape of your own")),
    };
    parts.push(part);
    Ok(())
}

fn triangles(vertices: &[Vector], indices: &[[u32; 3]], friction: f64) -> Result<Obstacle, BodyError> {
    let vertices: Vec<DVec3> = vertices.iter().copied().map(double).collect();
    let triangles: Vec<[usize; 3]> = indices.iter().map(|t| t.map(|index| index as usize)).collect();
    Obstacle::triangle_mesh(&vertices, &triangles, friction)
}
