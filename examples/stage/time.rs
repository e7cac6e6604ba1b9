//! The clocks of a scene.
//!
//! With a window the loops run on threads, in real time. Slow motion cannot: a thread has the device's own time. So it
//! changes to the lock-step clock at a tenth of the speed, with a model step every 5 ms instead of every 50 ms, so that there are
//! as many pictures as before: what it shows is the same body and hand, with a local model that is renewed ten times as often.
//! Going into slow motion and out of it starts the loops again: a scripted hand begins anew, and force as at every start
//! once it is small.
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

/// Time goes on by one model step at every update, however long that takes.
pub(crate) fn step_by_step(app: &mut App) {
    app.insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
}

/// Goes into slow motion or out of it.
pub fn set_slow(world: &mut World, slow: bool) {
    world.insert_resource(if slow { HapticClock::Lockstep } else { HapticClock::Thread });
    let rate = if slow { ModelRate::every_ticks(SLOW_TICKS) } else { Ok(ModelRate::default()) };
    world.insert_resource(rate.unwrap_or_default());
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

/// Whether time goes slowly.
#[must_use]
pub fn is_slow(time: &Time<Virtual>) -> bool {
    time.relative_speed_f64() < 1.0
}
