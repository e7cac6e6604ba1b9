//! Bodies at places of the world: the closest surface point, depth, force, strain and stress.

use crate::body::{SimulatedBody, SurfaceTrees};
use crate::layers::TouchLayers;
use crate::model_time::ModelStepCount;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{Deformation, StressState};

/// Reads bodies at places of the world: the closest point of a surface, the depth below it, the force there, and strain and stress of the tissue.
///
/// Results are those of the last model step; the drawn meshes lag by up to one step. A system in [`ModelSchedule`](crate::ModelSchedule)
/// belongs into [`HapticSystems::Last`](crate::HapticSystems::Last).
///
/// ```
/// # use bevy::prelude::*;
/// use bevy_palpate::{BodyQuery, TouchLayers, prelude::*};
///
/// fn needle(mut bodies: BodyQuery, tools: Query<&ToolForce>) {
///     for tool in &tools {
///         let Some(point) = bodies.closest(tool.device_position_m, 0.05, TouchLayers::ALL) else { continue };
///         if point.depth_m() > 0.0 {
///             let strain = bodies.deformation(point.body, tool.device_position_m).map(|at| at.strain());
///             info!("{:.1} mm deep, {strain:?}", 1e3 * point.depth_m());
///         }
///     }
/// }
/// # bevy::ecs::system::assert_is_system(needle);
/// ```
#[derive(SystemParam)]
pub struct BodyQuery<'w, 's> {
    bodies: Query<'w, 's, (Entity, &'static SimulatedBody, Option<&'static TouchLayers>)>,
    steps: Option<Res<'w, ModelStepCount>>,
    trees: Local<'s, SurfaceTrees>,
}

/// A point of a body's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySurfacePoint {
    /// The body.
    pub body: Entity,
    /// Position, m, world frame.
    pub point_m: DVec3,
    /// Outward unit normal of the surface, world frame.
    pub normal: DVec3,
    /// Distance of the given place from the surface, m; negative inside the body.
    pub distance_m: f64,
    /// Force of the tissue on the point, N, world frame. At rest it balances the external force there: zero where nothing touches, loads or
    /// holds the body.
    pub force_n: DVec3,
}

impl BodySurfacePoint {
    /// Returns the depth of the given place below the surface, m; negative outside the body.
    #[must_use]
    pub fn depth_m(&self) -> f64 {
        -self.distance_m
    }
}

impl BodyQuery<'_, '_> {
    /// Returns the point nearest to `place_m`, m, within `within_m` of the surfaces of all bodies that share one of `layers`. Of equally near
    /// bodies it is the one with the lowest entity.
    pub fn closest(
        &mut self,
        place_m: DVec3,
        within_m: f64,
        layers: TouchLayers,
    ) -> Option<BodySurfacePoint> {
        let touchable = |of_body| TouchLayers::are_shared(Some(&layers), of_body);
        let bodies: Vec<Entity> =
            self.bodies.iter().filter(|(.., of_body)| touchable(*of_body)).map(|(body, ..)| body).collect();
        let points = bodies.into_iter().filter_map(|body| self.closest_within(body, place_m, within_m));
        points.min_by(|a, b| a.distance_m.abs().total_cmp(&b.distance_m.abs()).then(a.body.cmp(&b.body)))
    }

    /// Returns the point of the surface of `body` nearest to `place_m`, m; `None` without a simulated body.
    pub fn closest_on(&mut self, body: Entity, place_m: DVec3) -> Option<BodySurfacePoint> {
        self.closest_within(body, place_m, f64::INFINITY)
    }

    /// Returns the deformation of the tissue of `body` at `place_m`, m, in the present shape: its gradient, strain and volume ratio; `None`
    /// outside the cells of the body. The axes of the strain are those of the world at the pose of the body's build.
    #[must_use]
    pub fn deformation(&self, body: Entity, place_m: DVec3) -> Option<Deformation> {
        let (_, simulated, _) = self.bodies.get(body).ok()?;
        simulated.body().deformation_at(place_m)
    }

    /// Returns stress and strain of the tissue of `body` at `place_m`, m, in the present shape: von Mises stress, pressure, principal stresses and strains;
    /// `None` outside the cells of the body. It computes the stress of the whole body, with about the cost of a substep; for many places use
    /// [`palpate_body::Body::node_stresses`].
    #[must_use]
    pub fn stress(&self, body: Entity, place_m: DVec3) -> Option<StressState> {
        let (_, simulated, _) = self.bodies.get(body).ok()?;
        let point = simulated.body().point_within(place_m)?;
        Some(simulated.body().stress_of(&point))
    }

    fn closest_within(&mut self, entity: Entity, place_m: DVec3, within_m: f64) -> Option<BodySurfacePoint> {
        let (_, simulated, _) = self.bodies.get(entity).ok()?;
        let bodies = &self.bodies;
        self.trees.retain(|body| bodies.contains(body));
        let step = self.steps.as_ref().map_or(0, |steps| steps.0);
        let closest = self.trees.of(entity, simulated, step).closest(place_m, within_m)?;
        let point = closest.body_point(simulated.body().surface());
        Some(BodySurfacePoint {
            body: entity,
            point_m: closest.point_m,
            normal: closest.normal,
            distance_m: closest.distance_m,
            force_n: point.internal_force_n(simulated.body()),
        })
    }
}
