//! The clocks of a scene.
//!
//! With a window the loops run on threads, in real time. Slow motion cannot: a thread has the device's own time. So it
//! changes to the lock-step clock at a tenth of the speed, with a model step every 5 ms instead of every 50 ms, so that there are
//! as many pictures as before: what it shows is the same body and hand, with a local model that is renewed ten times as often.
//! Going into slow motion and out of it starts the loops again. The scene goes on where it is: its hands do
//! ([`register_hand`](crate::register_hand)), and what was held is held again after a model step; a device of another kind begins as
//! it does when it is opened. The force begins as at every start, once it is small.
//!
//! Without a window, and for pictures, a scene runs in lock step and as fast as it can, unless it is about the thread.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::prelude::*;
use std::time::Duration;

/// The speed of slow motion.
pub const SLOW: f64 = 0.1;

/// Model steps in slow motion come every so many ticks.
const SLOW_TICKS: u32 = 5;

/// What there was before slow motion.
#[derive(Resource, Clone, Copy)]
struct AtFullSpeed {
    mode: LoopMode,
    rate: ModelRate,
    timestep: Duration,
}

/// What there will be after the next model step, which is still a short one: nothing is held until it is over.
#[derive(Resource)]
pub(crate) struct Returning(AtFullSpeed);

/// Time goes on by one model step at every update, however long that takes.
pub(crate) fn step_by_step(app: &mut App) {
    app.insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
}

/// Goes into slow motion or out of it, back to the clock and the rate that there were before; a rate that was set meanwhile stays.
pub fn set_slow(world: &mut World, slow: bool) {
    if slow == is_slow(world.resource::<Time<Virtual>>()) {
        return;
    }
    let slowly = ModelRate::every_ticks(SLOW_TICKS).unwrap_or_default();
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
        world.insert_resource(slowly);
        // Or several model steps would wait for each other, and be seen as one.
        world.resource_mut::<Time<Fixed>>().set_timestep(Duration::from_millis(SLOW_TICKS.into()));
    } else if let Some(before) = world.remove_resource::<AtFullSpeed>() {
        world.insert_resource(before.mode);
        let set_meanwhile = *world.resource::<ModelRate>();
        let rate = if set_meanwhile == slowly { before.rate } else { set_meanwhile };
        world.insert_resource(Returning(AtFullSpeed { rate, ..before }));
    }
    world.resource_mut::<Time<Virtual>>().set_relative_speed_f64(if slow { SLOW } else { 1.0 });
    let mut tools = world.query::<(Entity, &mut HapticTool)>();
    let tools: Vec<Entity> = tools
        .iter_mut(world)
        .map(|(entity, mut tool)| {
            // A tool that has changed and has no loop gets one.
            tool.set_changed();
            entity
        })
        .collect();
    for tool in tools {
        world.entity_mut(tool).remove::<bevy_palpate::ToolLoop>();
    }
}

/// After the first model step at full speed.
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

/// Whether time goes slowly.
#[must_use]
pub fn is_slow(time: &Time<Virtual>) -> bool {
    time.relative_speed_f64() < 1.0
}
