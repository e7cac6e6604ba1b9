//! Colliders of avian3d as obstacles, and the reaction on its rigid bodies.

mod colliders;
mod coupling;
mod math;
mod not_an_obstacle;
mod shapes;
mod step;
mod supports;
mod ticks;

pub use not_an_obstacle::NotAnObstacle;

use crate::body::CarryBodies;
use crate::cost::FrameCost;
use crate::fault::add_faults;
use crate::schedule::{HapticSystems, HapticUpdateSystems, ModelSchedule};
use crate::surroundings::ApplySurroundings;
use avian3d::dynamics::integrator::{IntegrationSystems, pre_process_velocity_increments};
use avian3d::prelude::{ForceSystems, PhysicsSchedule, PhysicsStepSystems, SubstepCount};
use bevy::prelude::*;

/// Couples the rigid bodies of avian3d with the soft bodies: their colliders are obstacles, and dynamic ones receive the reaction.
///
/// Part of [`PalpatePlugins`](crate::PalpatePlugins) with the feature `avian`. It needs avian's `PhysicsPlugins`, and does nothing
/// without them. [The guide](crate::guide::avian) describes the coupling and the order of the schedules.
#[derive(Clone, Copy, Debug, Default)]
pub struct AvianPlugin;

impl Plugin for AvianPlugin {
    fn build(&self, app: &mut App) {
        add_faults(app);
        let cost = FrameCost::of(app);
        app.register_type::<NotAnObstacle>()
            .add_systems(
                PreUpdate,
                cost.timed(colliders::prepare_colliders).in_set(HapticUpdateSystems::Bodies),
            )
            .add_systems(
                ModelSchedule,
                (
                    step::begin_step.after(CarryBodies).before(ApplySurroundings),
                    step::end_step.in_set(HapticSystems::Writeback),
                ),
            )
            // Avian reports an error for two systems in no order whose data overlap.
            .add_systems(
                PhysicsSchedule,
                (
                    ticks::apply_forces
                        .in_set(IntegrationSystems::UpdateVelocityIncrements)
                        .after(ForceSystems::ApplyConstantForces)
                        .before(pre_process_velocity_increments)
                        .ambiguous_with_all(),
                    ticks::record_ticks
                        .in_set(PhysicsStepSystems::Last)
                        .run_if(resource_exists::<SubstepCount>)
                        .ambiguous_with_all(),
                ),
            );
    }
}
