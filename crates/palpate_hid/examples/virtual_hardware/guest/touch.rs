//! A haptic loop with a device on its own thread, and models for it.

use super::check::wait_until;
use glam::{DMat3, DVec3};
use palpate_haptics::{
    DeviceError, HapticDevice, HapticHandle, LoopConfig, LoopEventKind, LoopSettings, LoopThread,
    RealTimeRequest, SafetySettings, StopOutcome, haptic_loop,
};
use palpate_hid::HidDevice;
use palpate_local::{Capacity, Contact, HandOverSettings, Scheme};
use std::error::Error;

/// A running loop.
pub struct Touch {
    handle: HapticHandle,
    thread: LoopThread,
    force_n: DVec3,
    /// Relevant events of the loop, oldest first.
    pub events: Vec<LoopEventKind>,
}

/// Settings of the loop: those of any device, without a limit on the first force, and without real-time priority, as the guest has
/// only one processor.
pub fn settings(device: &dyn HapticDevice) -> (LoopConfig, LoopSettings) {
    let description = device.describe();
    let hand_over = HandOverSettings { capacity: Capacity::of_order(0), ..HandOverSettings::default() };
    let config = LoopConfig {
        device: description.limits(),
        real_time: RealTimeRequest::NONE,
        hand_over,
        ..LoopConfig::default()
    };
    let safety =
        SafetySettings { arm_below_n: f64::MAX, ramp_s: 0.02, ..description.safety(config.hand_over.tick_s) };
    (config, LoopSettings { safety, ..LoopSettings::default() })
}

/// Publishes a model with the constant force `force_n`, N.
pub fn press(handle: &mut HapticHandle, force_n: DVec3) {
    let sequence = handle.samples().newest().map_or(0, |sample| sample.sequence);
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, force_n);
    model.id.sequence = sequence;
    handle.publish_model();
}

/// Publishes a model of a spring to `to_m` with the stiffness `stiffness_n_per_m`, N/m.
pub fn attach_spring(handle: &mut HapticHandle, to_m: DVec3, stiffness_n_per_m: f64) {
    let sequence = handle.samples().newest().map_or(0, |sample| sample.sequence);
    let model = handle.model_slot();
    (model.scheme, model.contact) = (Scheme::Tangent, Contact::Held);
    (model.force_n, model.position_m) = (DVec3::ZERO, to_m);
    model.stiffness_n_per_m = DMat3::from_diagonal(DVec3::splat(stiffness_n_per_m));
    model.id.sequence = sequence;
    handle.publish_model();
}

impl Touch {
    /// Starts a loop with `device` and the constant force `force_n`, N.
    pub fn begin(device: HidDevice, force_n: DVec3) -> Result<Self, Box<dyn Error>> {
        let (config, settings) = settings(&device);
        let (handle, haptic_loop) = haptic_loop(config, settings)?;
        let thread = haptic_loop.spawn(Box::new(device))?;
        Ok(Self { handle, thread, force_n, events: Vec::new() })
    }

    /// Publishes the force until `holds`.
    pub fn until(
        &mut self,
        what: &str,
        mut holds: impl FnMut(&mut Self) -> bool,
    ) -> Result<(), Box<dyn Error>> {
        let waited = wait_until(what, || {
            press(&mut self.handle, self.force_n);
            let new = std::iter::from_fn(|| self.handle.next_event()).map(|event| event.kind);
            // Models are adopted and deadlines missed all the time.
            self.events.extend(new.filter(|kind| {
                !matches!(kind, LoopEventKind::ModelAdopted(_) | LoopEventKind::DeadlinesMissed(_))
            }));
            holds(self)
        });
        let first = self.events.len().saturating_sub(6);
        waited.map_err(|why| {
            let tick = self.handle.latest_tick().map(|tick| (tick.reading, tick.written));
            format!("{why}; the last events were {:?}, the last tick {tick:?}", &self.events[first..]).into()
        })
    }

    /// Position of the hand at the latest tick, m.
    pub fn position_m(&mut self) -> Option<DVec3> {
        self.handle.samples().newest().map(|sample| sample.position_m)
    }

    /// Buttons pressed at the latest tick.
    pub fn buttons(&mut self) -> u32 {
        self.handle.samples().newest().map_or(0, |sample| sample.buttons)
    }

    /// Force written at the latest tick, N.
    pub fn force_n(&mut self) -> DVec3 {
        self.handle.latest_tick().map_or(DVec3::ZERO, |tick| tick.force_n)
    }

    /// Number of ticks, to the last 64.
    pub fn ticks(&mut self) -> u64 {
        self.handle.report().ticks
    }

    /// Whether the device was reported as disconnected and has not returned.
    pub fn is_disconnected(&mut self) -> bool {
        let was_reported = self.events.contains(&LoopEventKind::DeviceFailed(DeviceError::Disconnected));
        was_reported && self.handle.latest_tick().is_some_and(|tick| tick.reading.is_err())
    }

    /// Stops the loop: zero force, device closed.
    pub fn end(mut self) -> Result<(), Box<dyn Error>> {
        match self.thread.stop() {
            StopOutcome::Joined => Ok(()),
            stop => Err(format!("the loop did not stop properly: {stop:?}").into()),
        }
    }
}
