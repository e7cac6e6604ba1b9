//! Scripted devices of scenes, which continue their motion when their loop restarts.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use palpate_haptics::{Reading, ScriptedDevice};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Time of a scripted device: one millisecond per reading since the start of the scene. It continues when the loop restarts, for example
/// for slow motion, and is reset by a restart of the scene. Systems that depend on the device's motion use this time.
#[derive(Clone, Debug, Default)]
pub struct HandTime(Arc<AtomicU64>);

/// Times of a scene's devices, by name.
#[derive(Resource, Default)]
pub(crate) struct HandTimes(HashMap<String, HandTime>);

impl HandTime {
    /// Returns the time of the next reading, s.
    #[must_use]
    pub fn s(&self) -> f64 {
        self.0.load(Ordering::Relaxed) as f64 * 1e-3
    }

    /// Returns the time of the present reading, s, and advances by a millisecond.
    fn advance(&self) -> f64 {
        self.0.fetch_add(1, Ordering::Relaxed) as f64 * 1e-3
    }
}

impl HandTimes {
    /// Resets the times. No loop may be running.
    pub(crate) fn restart(&self) {
        self.0.values().for_each(|time| time.0.store(0, Ordering::Relaxed));
    }
}

/// Registers the device `name` with the reading `script(t)` at time t, s; replaces a device of the same name.
pub fn register_hand(
    world: &mut World,
    name: &str,
    script: impl Fn(f64) -> Reading + Clone + Send + Sync + 'static,
) -> HandTime {
    let time = HandTime::default();
    world.get_resource_or_init::<HandTimes>().0.insert(name.to_owned(), time.clone());
    let of_device = time.clone();
    world.get_resource_or_init::<HapticDevices>().register(name, move || {
        let (time, script) = (of_device.clone(), script.clone());
        Ok(ScriptedDevice::new(move |_, _| Ok(script(time.advance()))))
    });
    time
}
