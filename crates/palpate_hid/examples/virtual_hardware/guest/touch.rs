//! A haptic loop with a device, on a thread of its own, that touches something.

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
    /// What it told that matters here, oldest first.
    pub told: Vec<LoopEventKind>,
}

/// How a loop is made here: as for any device, but that the first touch comes at once. No priority is asked for: the one processor
/// that there is must go round.
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

/// Publishes a model that presses with `force_n`, N, wherever the hand is.
pub fn press(handle: &mut HapticHandle, force_n: DVec3) {
    let sequence = handle.samples().newest().map_or(0, |sample| sample.sequence);
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, force_n);
    model.id.sequence = sequence;
    handle.publish_model();
}

/// Publishes a model that draws the hand to `to_m`, N/m.
pub fn draw(handle: &mut HapticHandle, to_m: DVec3, stiffness_n_per_m: f64) {
    let sequence = handle.samples().newest().map_or(0, |sample| sample.sequence);
    let model = handle.model_slot();
    (model.scheme, model.contact) = (Scheme::Tangent, Contact::Held);
    (model.force_n, model.position_m) = (DVec3::ZERO, to_m);
    model.stiffness_n_per_m = DMat3::from_diagonal(DVec3::splat(stiffness_n_per_m));
    model.id.sequence = sequence;
    handle.publish_model();
}

impl Touch {
    /// Begins a loop with `device` that is pressed with `force_n`, N.
    pub fn begin(device: HidDevice, force_n: DVec3) -> Result<Self, Box<dyn Error>> {
        let (config, settings) = settings(&device);
        let (handle, haptic_loop) = haptic_loop(config, settings)?;
        let thread = haptic_loop.spawn(Box::new(device))?;
        Ok(Self { handle, thread, force_n, told: Vec::new() })
    }

    /// Goes on pressing until `holds`.
    pub fn until(
        &mut self,
        what: &str,
        mut holds: impl FnMut(&mut Self) -> bool,
    ) -> Result<(), Box<dyn Error>> {
        let waited = wait_until(what, || {
            press(&mut self.handle, self.force_n);
            let told = std::iter::from_fn(|| self.handle.next_event()).map(|event| event.kind);
            // A model is adopted and a deadline missed all the time.
            self.told.extend(told.filter(|kind| {
                !matches!(kind, LoopEventKind::ModelAdopted(_) | LoopEventKind::DeadlinesMissed(_))
            }));
            holds(self)
        });
        let lasts = self.told.len().saturating_sub(6);
        waited.map_err(|why| {
            let tick = self.handle.latest_tick().map(|tick| (tick.reading, tick.written));
            format!("{why}; the loop's last words were {:?}, its last tick {tick:?}", &self.told[lasts..])
                .into()
        })
    }

    /// Where the hand was at the newest tick, m.
    pub fn position_m(&mut self) -> Option<DVec3> {
        self.handle.samples().newest().map(|sample| sample.position_m)
    }

    /// Which buttons were pressed then.
    pub fn buttons(&mut self) -> u32 {
        self.handle.samples().newest().map_or(0, |sample| sample.buttons)
    }

    /// The force that was written then, N.
    pub fn force_n(&mut self) -> DVec3 {
        self.handle.latest_tick().map_or(DVec3::ZERO, |tick| tick.force_n)
    }

    /// Ticks so far, to the last 64.
    pub fn ticks(&mut self) -> u64 {
        self.handle.report().ticks
    }

    /// Whether it has said that the device is disconnected, and the device is not back since.
    pub fn is_disconnected(&mut self) -> bool {
        let is_said = self.told.contains(&LoopEventKind::DeviceFailed(DeviceError::Disconnected));
        is_said && self.handle.latest_tick().is_some_and(|tick| tick.reading.is_err())
    }

    /// Ends it: zero force, the device closed.
    pub fn end(mut self) -> Result<(), Box<dyn Error>> {
        match self.thread.stop() {
            StopOutcome::Joined => Ok(()),
            stop => Err(format!("the loop did not stop as it should: {stop:?}").into()),
        }
    }
}
