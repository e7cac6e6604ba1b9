//! What acts on bodies beside tools: gravity, obstacles and external forces.

mod apply;
mod coupled;
mod external_force;
mod gravity;
mod obstacle;
mod prepare;

#[cfg(feature = "avian")]
pub(crate) use coupled::CoupledObstacle;
pub use external_force::{ExternalForce, Load};
pub use gravity::{Gravity, GravityScale};
pub use obstacle::{Obstacle, ObstacleForce, ObstacleShape};

#[cfg(feature = "avian")]
pub(crate) use prepare::PreparedObstacle;

use crate::body::CarryBodies;
use crate::cost::FrameCost;
use crate::fault::add_faults;
use crate::schedule::{HapticSystems, HapticUpdateSystems, ModelSchedule};
use bevy::prelude::*;

/// The systems that give the bodies their surroundings before a step.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct ApplySurroundings;

/// Applies [`Gravity`], [`Obstacle`] and [`ExternalForce`] to the bodies at every model step, and writes [`ObstacleForce`].
#[derive(Clone, Copy, Debug, Default)]
pub struct SurroundingsPlugin;

impl Plugin for SurroundingsPlugin {
    fn build(&self, app: &mut App) {
        add_faults(app);
        let cost = FrameCost::of(app);
        app.init_resource::<Gravity>()
            .register_type::<Gravity>()
            .register_type::<GravityScale>()
            .register_type::<Obstacle>()
            .register_type::<ObstacleForce>()
            .register_type::<ExternalForce>()
            .add_systems(
                PreUpdate,
                cost.timed(prepare::prepare_obstacles).in_set(HapticUpdateSystems::Bodies),
            )
            .add_observer(prepare::remove_obstacle)
            .add_systems(
                ModelSchedule,
                (
                    (apply::apply_gravity, apply::apply_loads, apply::place_obstacles)
                        .chain()
                        .in_set(ApplySurroundings)
                        .after(HapticSystems::ReceiveSamples)
                        .after(CarryBodies)
                        .before(HapticSystems::StepBodies),
                    apply::write_forces.in_set(HapticSystems::Writeback),
                ),
            );
    }
}
