//! Time of a scene, and slow motion.
//!
//! With a window the loops run on threads, in real time, which slow motion cannot do. Slow motion therefore switches to lock step at a
//! tenth of the speed, with a model step every 5 ms instead of 50 ms, which keeps the frame rate. It shows the same body and tool, with
//! local models ten times as often.
//!
//! Each switch restarts the loops. The scene continues: devices of [`register_hand`](crate::register_hand) continue their motion, and a
//! held point is held again after a model step. Other devices start as when they are opened. The force starts, as always, once it is small.
//!
//! Without a window, and for pictures, a scene runs in lock step as fast as possible, unless it demonstrates threads.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::prelude::*;
use bevy_palpate::{LoopMode, ModelRate};
use std::time::Duration;

/// Relative speed of slow motion.
pub const SLOW: f64 = 0.1;

/// Ticks between two model steps in slow motion.
const SLOW_TICKS: u32 = 5;

/// Settings before slow motion.
#[derive(Resource, Clone, Copy)]
struct AtFullSpeed {
    mode: LoopMode,
    rate: ModelRate,
    timestep: Duration,
}

/// Settings after the next model step, which is still a short one: it restores the grasp.
#[derive(Resource)]
pub(crate) struct Returning(AtFullSpeed);

/// Makes every update one model step.
pub(crate) fn step_by_step(app: &mut App) {
    app.insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
}

/// Starts or ends slow motion. The end restores mode and rate; a rate that was set during slow motion stays.
pub fn set_slow(world: &mut World, slow: bool) {
    if slow == is_slow(world.resource::<Time<Virtual>>()) {
        return;
    }
    let slow_rate = ModelRate::every_ticks(SLOW_TICKS).unwrap_or_default();
    if slow {
        let before = world.remove_resource::<Returning>().map_or_else(
            || AtFullSpeed {
                mode: *world.resource::<LoopMode>(),
                rate: *world.resource::<ModelRate>(),
                timestep: world.resource::<Time<Fixed>>().timestep(),
            },
            |Returning(before)| before,
        );
        world.insert_resource(before);
        world.insert_resource(LoopMode::Lockstep);
        world.insert_resource(slow_rate);
        // Otherwise several model steps would fall into one tick of the fixed main loop.
        world.resource_mut::<Time<Fixed>>().set_timestep(Duration::from_millis(SLOW_TICKS.into()));
    } else if let Some(before) = world.remove_resource::<AtFullSpeed>() {
        world.insert_resource(before.mode);
        let present = *world.resource::<ModelRate>();
        let rate = if present == slow_rate { before.rate } else { present };
        world.insert_resource(Returning(AtFullSpeed { rate, ..before }));
    }
    world.resource_mut::<Time<Virtual>>().set_relative_speed_f64(if slow { SLOW } else { 1.0 });
    let mut tools = world.query::<(Entity, &mut HapticTool)>();
    let tools: Vec<Entity> = tools
        .iter_mut(world)
        .map(|(entity, mut tool)| {
            // A changed tool without a loop starts another one.
            tool.set_changed();
            entity
        })
        .collect();
    for tool in tools {
        world.entity_mut(tool).remove::<bevy_palpate::ToolLoop>();
    }
}

/// Restores rate and timestep after the first model step at full speed.
pub(crate) fn return_to_full_speed(
    mut commands: Commands,
    returning: Res<Returning>,
    mut rate: ResMut<ModelRate>,
    mut fixed: ResMut<Time<Fixed>>,
) {
    *rate = returning.0.rate;
    fixed.set_timestep(returning.0.timestep);
    commands.remove_resource::<Returning>();
}

/// Whether slow motion is on.
#[must_use]
pub fn is_slow(time: &Time<Virtual>) -> bool {
    time.relative_speed_f64() < 1.0
}
