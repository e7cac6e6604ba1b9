//! Rigid obstacles: their shapes, poses and masses.

mod contact;
mod coupled;
mod hull;
mod pose;
mod rigid_body;
mod shape;
mod triangle_mesh;

pub use contact::{ObstacleContact, ObstacleReaction};
pub(crate) use coupled::Coupled;
pub use coupled::{CoupledMotion, RigidResponse};
pub(crate) use pose::Pose;
pub use rigid_body::{RigidMass, RigidMotion};

use crate::BodyError;
use crate::error::{check, check_positive};
use glam::{DQuat, DVec3};
use palpate_laws::Coulomb;
use shape::{Part, Shape};
use std::sync::Arc;
use triangle_mesh::TriangleMesh;

/// A rigid obstacle. Points of a body cannot enter it, and slide on it with friction.
///
/// A shape is given in the frame of the obstacle, and [`Obstacle::with_pose`] places it. An obstacle stands still, is
/// moved by [`crate::Body::move_obstacle`], moves as a rigid body if it has a mass ([`Obstacle::with_mass`]), or follows the
/// motion of a rigid body of another solver ([`crate::Body::couple_obstacle`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    shape: Shape,
    friction: f64,
    pub(crate) pose: Pose,
    /// Pose at the end of the next advance, if it moves.
    pub(crate) target: Option<Pose>,
    pub(crate) rigid: Option<(RigidMass, RigidMotion)>,
    /// Motion and response in the next advance, if another solver moves it.
    pub(crate) coupled: Option<Coupled>,
}

impl Obstacle {
    /// Creates a half-space bounded by the plane through `point_m` (m) with outward unit normal `normal`, with
    /// coefficient of friction `friction`. Its position is `point_m`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the normal is not a unit vector, the point is not finite or the friction is
    /// negative.
    pub fn plane(point_m: DVec3, normal: DVec3, friction: f64) -> Result<Self, BodyError> {
        let length = normal.length();
        check("length of the normal of a plane", length, (length - 1.0).abs() < 1e-9, "1 within 1e-9")?;
        check("point of a plane, m", point_m.abs().max_element(), point_m.is_finite(), "finite")?;
        Self { pose: Pose::at(point_m), ..Self::new(Shape::HalfSpace { normal }, friction)? }.checked()
    }

    /// Creates a ball of radius `radius_m` (m) around `center_m` (m), with coefficient of friction `friction`. Its
    /// position is `center_m`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the radius is not above zero, the centre is not finite or the friction is
    /// negative.
    pub fn sphere(center_m: DVec3, radius_m: f64, friction: f64) -> Result<Self, BodyError> {
        check("centre of a sphere, m", center_m.abs().max_element(), center_m.is_finite(), "finite")?;
        check_positive("radius of a sphere, m", radius_m)?;
        Self { pose: Pose::at(center_m), ..Self::new(Shape::Sphere { radius_m }, friction)? }.checked()
    }

    /// Creates a box around the origin with half the sides `half_m` (m), with coefficient of friction `friction`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if a side is not above zero or the friction is negative.
    pub fn cuboid(half_m: DVec3, friction: f64) -> Result<Self, BodyError> {
        half_m
            .to_array()
            .into_iter()
            .try_for_each(|half| check_positive("half side of a box, m", half).map(drop))?;
        Self::new(Shape::Cuboid { half_m }, friction)
    }

    /// Creates a capsule: the points within `radius_m` of the segment from −`half_length_m` to +`half_length_m` (m)
    /// on the y axis, with coefficient of friction `friction`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the radius is not above zero, the length or the friction is negative.
    pub fn capsule(half_length_m: f64, radius_m: f64, friction: f64) -> Result<Self, BodyError> {
        let is_length = half_length_m.is_finite() && half_length_m >= 0.0;
        check("half length of a capsule, m", half_length_m, is_length, "finite and at least 0")?;
        check_positive("radius of a capsule, m", radius_m)?;
        Self::new(Shape::Capsule { half_length_m, radius_m }, friction)
    }

    /// Creates the convex hull of `points_m` (m), with coefficient of friction `friction`. Coincident points and points
    /// inside are allowed. The effort grows with the number of points times that of the faces.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if a coordinate is not finite, the points have no volume or the friction is negative.
    pub fn convex_hull(points_m: &[DVec3], friction: f64) -> Result<Self, BodyError> {
        check_points("point of a convex hull, m", points_m)?;
        let what = "thickness of a convex hull relative to its size";
        let flat = |value| BodyError::Parameter { what, value, allowed: "above 1e-9; use a triangle mesh" };
        let triangles = hull::convex_hull(points_m).map_err(flat)?;
        let mesh = TriangleMesh::new(points_m, &triangles, true).ok_or_else(|| flat(0.0))?;
        Self::new(Shape::Mesh(Arc::new(mesh)), friction)
    }

    /// Creates an obstacle of triangles, given as indices of `vertices_m` (m), counter-clockwise as seen from outside,
    /// with coefficient of friction `friction`.
    ///
    /// A closed mesh is solid; if it encloses a negative volume, its triangles are turned. It is closed if every edge
    /// has two triangles of consistent winding. Any other mesh is a shell behind its triangles, with a thickness of
    /// a twentieth of its size ([`Obstacle::with_thickness`]): points in the shell are pushed out through the front.
    /// Coincident vertices are merged, and degenerate triangles omitted.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if a coordinate is not finite, an index is not that of a vertex, no triangle has an
    /// area or the friction is negative.
    pub fn triangle_mesh(
        vertices_m: &[DVec3],
        triangles: &[[usize; 3]],
        friction: f64,
    ) -> Result<Self, BodyError> {
        check_points("vertex of a triangle mesh, m", vertices_m)?;
        let what = "index of a vertex in a triangle mesh";
        for &index in triangles.iter().flatten() {
            check(what, index as f64, index < vertices_m.len(), "below the number of vertices")?;
        }
        let mesh = TriangleMesh::new(vertices_m, triangles, false).ok_or(BodyError::Parameter {
            what: "triangles of an obstacle with an area",
            value: 0.0,
            allowed: "at least 1",
        })?;
        Self::new(Shape::Mesh(Arc::new(mesh)), friction)
    }

    fn new(shape: Shape, friction: f64) -> Result<Self, BodyError> {
        Self { shape, friction, pose: Pose::at(DVec3::ZERO), target: None, rigid: None, coupled: None }
            .checked()
    }

    fn checked(self) -> Result<Self, BodyError> {
        let ok = self.friction.is_finite() && self.friction >= 0.0;
        check("coefficient of friction", self.friction, ok, "finite and at least 0")?;
        Ok(self)
    }

    /// Places the obstacle: its frame is rotated by `rotation` and then translated to `position_m`, m.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the position is not finite or the rotation is not a unit quaternion within 0.001.
    pub fn with_pose(self, position_m: DVec3, rotation: DQuat) -> Result<Self, BodyError> {
        Ok(Self { pose: Pose::new(position_m, rotation)?, target: None, coupled: None, ..self })
    }

    /// Sets the thickness of the shell behind an open triangle mesh, m. A point that jumps deeper than that behind the
    /// triangles is behind the shell.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the thickness is not above zero, or the obstacle is not an open triangle mesh.
    pub fn with_thickness(self, thickness_m: f64) -> Result<Self, BodyError> {
        let what = "thickness of an open triangle mesh, m";
        check_positive(what, thickness_m)?;
        match &self.shape {
            Shape::Mesh(mesh) if !mesh.is_closed() => {
                Ok(Self { shape: Shape::Mesh(Arc::new(mesh.with_thickness(thickness_m))), ..self })
            }
            _ => Err(BodyError::Parameter {
                what,
                value: thickness_m,
                allowed: "that of an open triangle mesh",
            }),
        }
    }

    /// Creates the union of `parts`, each in its pose in the frame of the union and with its own friction. Masses and motions
    /// of the parts have no effect. The effort grows with their number.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if there is no part.
    pub fn compound(parts: &[Self]) -> Result<Self, BodyError> {
        let friction = parts.first().map(|part| part.friction).ok_or(BodyError::Parameter {
            what: "parts of an obstacle",
            value: 0.0,
            allowed: "at least 1",
        })?;
        let of = |part: &Self| Part { shape: part.shape.clone(), pose: part.pose, friction: part.friction };
        Self::new(Shape::Compound(parts.iter().map(of).collect()), friction)
    }

    /// Returns the obstacle with all points within `margin_m` (m) of it: with rounded edges and corners.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the margin is negative or not finite.
    pub fn with_margin(self, margin_m: f64) -> Result<Self, BodyError> {
        let is_margin = margin_m.is_finite() && margin_m >= 0.0;
        check("margin of an obstacle, m", margin_m, is_margin, "finite and at least 0")?;
        Ok(Self { shape: Shape::Rounded { shape: Arc::new(self.shape), margin_m }, ..self })
    }

    /// Gives the obstacle a mass: it moves freely with `motion` and under the contacts of the body. It does not
    /// collide with other obstacles.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if the motion is not finite.
    pub fn with_mass(self, mass: RigidMass, motion: RigidMotion) -> Result<Self, BodyError> {
        motion.validate()?;
        Ok(Self { rigid: Some((mass, motion)), ..self })
    }

    /// Rejects an obstacle with a mass, which cannot be moved.
    pub(crate) fn check_massless(&self) -> Result<(), BodyError> {
        let mass_kg = self.rigid_mass().map_or(0.0, RigidMass::mass_kg);
        check("mass of a moved obstacle, kg", mass_kg, self.rigid.is_none(), "none").map(drop)
    }

    /// Coefficient of friction μ.
    #[must_use]
    pub fn friction(&self) -> f64 {
        self.friction
    }

    /// Position of the obstacle's frame, m.
    #[must_use]
    pub fn position_m(&self) -> DVec3 {
        self.pose.position_m
    }

    /// Rotation of the obstacle's frame.
    #[must_use]
    pub fn rotation(&self) -> DQuat {
        self.pose.rotation
    }

    /// Mass, if the obstacle moves as a rigid body.
    #[must_use]
    pub fn rigid_mass(&self) -> Option<&RigidMass> {
        self.rigid.as_ref().map(|(mass, _)| mass)
    }

    /// Motion, if the obstacle moves as a rigid body.
    #[must_use]
    pub fn rigid_motion(&self) -> Option<&RigidMotion> {
        self.rigid.as_ref().map(|(_, motion)| motion)
    }

    /// Thickness of the shell, m, if the obstacle is an open triangle mesh.
    #[must_use]
    pub fn thickness_m(&self) -> Option<f64> {
        match &self.shape {
            Shape::Mesh(mesh) if !mesh.is_closed() => Some(mesh.thickness_m()),
            _ => None,
        }
    }

    /// Distance of `x_m` from the obstacle, m, negative inside, and the unit normal there.
    ///
    /// On an edge or a corner the normal is the mean of the adjacent faces. Where several surface points are equally
    /// near, the normal is that of one of them: in the centre of a sphere and on the axis of a capsule the obstacle's z.
    #[must_use]
    pub fn gap_m(&self, x_m: DVec3) -> (f64, DVec3) {
        // Only a place that is not finite has no distance.
        self.gap_at(&self.pose, x_m, f64::INFINITY).unwrap_or((f64::INFINITY, DVec3::Z))
    }

    /// [`Obstacle::gap_m`] in another pose; `None` if the distance exceeds `within_m`, which not every shape checks.
    pub(crate) fn gap_at(&self, pose: &Pose, x_m: DVec3, within_m: f64) -> Option<(f64, DVec3)> {
        let (gap_m, normal) = self.shape.gap_m(pose.local_m(x_m), within_m)?;
        Some((gap_m, pose.rotation * normal))
    }

    /// Lower bound of the distance of the box of half sides `half_m` around `center_m` in a pose, m.
    pub(crate) fn box_gap_m(&self, pose: &Pose, center_m: DVec3, half_m: DVec3) -> f64 {
        let Some((gap_m, normal)) = self.gap_at(pose, center_m, f64::INFINITY) else { return f64::NAN };
        match self.shape {
            Shape::HalfSpace { .. } => gap_m - normal.abs().dot(half_m),
            _ => gap_m - half_m.length(),
        }
    }

    /// Distance of the farthest point from the centre of mass, m; 1 m for a half-space.
    pub(crate) fn reach_m(&self) -> f64 {
        let of_coupled = self.coupled.as_ref().map(|coupled| coupled.motion.center_m);
        self.shape.reach_m(of_coupled.or(self.rigid_mass().map(RigidMass::center_m)).unwrap_or_default())
    }

    /// Upper bound of the speed of its points, m/s; 0 if it neither has a mass nor is coupled.
    pub(crate) fn speed_m_per_s(&self) -> f64 {
        if let Some(coupled) = &self.coupled {
            let to = self.target.as_ref().unwrap_or(&self.pose);
            return coupled.speed_m_per_s(&self.pose, to, self.reach_m());
        }
        self.rigid_motion().map_or(0.0, |motion| {
            motion.velocity_m_per_s.length() + motion.angular_velocity_rad_per_s.length() * self.reach_m()
        })
    }

    /// The contact law at `at_m` with a normal, in a pose.
    pub(crate) fn law(&self, pose: &Pose, at_m: DVec3, normal: DVec3) -> Option<Coulomb> {
        let of_part = self.shape.friction(pose.local_m(at_m));
        Coulomb::new(normal, of_part.unwrap_or(self.friction)).ok()
    }
}

fn check_points(what: &'static str, points_m: &[DVec3]) -> Result<(), BodyError> {
    let invalid = points_m.iter().find(|x| !x.is_finite());
    check(what, invalid.map_or(0.0, |x| x.abs().max_element()), invalid.is_none(), "finite").map(drop)
}
