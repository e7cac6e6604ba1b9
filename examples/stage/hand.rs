//! Hands of scenes: scripts that go on where they were when their loop starts again.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// How far a scene's hand has come in its script: one millisecond for every reading since the scene was set up. A loop that starts
/// anew goes on from there, because time goes slowly now for instance; only a scene that begins again begins it again. So what
/// depends on what the hand does asks the hand for its time, and no other clock.
#[derive(Clone, Debug, Default)]
pub struct HandTime(Arc<AtomicU64>);

/// The times of a scene's hands, by the names of their devices.
#[derive(Resource, Default)]
pub(crate) struct HandTimes(HashMap<String, HandTime>);

impl HandTime {
    /// The time of the next reading, s.
    #[must_use]
    pub fn s(&self) -> f64 {
        self.0.load(Ordering::Relaxed) as f64 * 1e-3
    }

    /// The time of the reading that is asked for now, s.
    fn go_on(&self) -> f64 {
        self.0.fetch_add(1, Ordering::Relaxed) as f64 * 1e-3
    }
}

impl HandTimes {
    /// All hands are at their beginning. No loop may be running.
    pub(crate) fn begin_again(&self) {
        self.0.values().for_each(|time| time.0.store(0, Ordering::Relaxed));
    }
}

/// Registers the device `name`, whose hand does what `script` says of every time (s); in the place of one of the same name.
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
        Ok(ScriptedDevice::new(move |_, _| Ok(script(time.go_on()))))
    });
    time
}
