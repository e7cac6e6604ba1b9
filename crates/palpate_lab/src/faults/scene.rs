//! A hand that presses a surface, with what may break.

use crate::error::LabError;
use glam::{DMat3, DVec3};
use palpate_haptics::{
    DeviceError, DeviceLimits, HapticHandle, LoopConfig, LoopEventKind, LoopSettings, Reading,
    RealTimeRequest, haptic_loop,
};
use palpate_local::{Contact, LocalModel, ModelId, Scheme};

/// Ticks of a scene, unless it needs more, and the one at which something breaks.
pub(crate) const TICKS: u64 = 4000;
pub(crate) const BREAKS_AT: u64 = 1500;
/// The device's limits: 10 N, and 0.5 N a tick.
pub(crate) const LIMITS: DeviceLimits = DeviceLimits { force_n: 10.0, slew_n_per_s: 500.0 };
/// Ticks between two model steps.
pub(crate) const PERIOD: u64 = 50;
/// Of the surface, N/m.
const STIFFNESS: f64 = 300.0;
/// The body that is touched.
pub(crate) const BODY: u64 = 1;

/// What the hand does: nothing for 0.7 s, a touch of 6 to 7 mm until 2.5 s, and another from 2.9 s on.
pub(crate) fn hand(tick: u64) -> DVec3 {
    let t = tick as f64 * 1e-3;
    let ease = |from: f64, to: f64| {
        let share = ((t - from) / (to - from)).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    };
    let down = ease(0.7, 1.0) - ease(2.4, 2.6) + ease(2.9, 3.2);
    DVec3::Z * (0.004 - (0.0105 + 0.0005 * (8.0 * t).sin()) * down)
}

/// Writes the local model of the surface for a tool at `at`.
pub(crate) fn write_model(model: &mut LocalModel, at: DVec3, sequence: u64) {
    model.id = ModelId { body: BODY, epoch: 0, sequence };
    (model.scheme, model.position_m, model.velocity_m_per_s) = (Scheme::Tangent, at, DVec3::ZERO);
    (model.reduced.order, model.clamped) = (0, false);
    let is_in = at.z < 0.0;
    model.contact = if is_in { Contact::Touching { normal: DVec3::Z } } else { Contact::Apart };
    model.force_n = if is_in { DVec3::Z * (-STIFFNESS * at.z) } else { DVec3::ZERO };
    let k = if is_in { STIFFNESS } else { 0.0 };
    model.stiffness_n_per_m = DMat3::from_diagonal(DVec3::new(0.0, 0.0, k));
    model.damping_ns_per_m = DMat3::ZERO;
}

pub(crate) fn config() -> LoopConfig {
    LoopConfig { device: LIMITS, real_time: RealTimeRequest::NONE, ..LoopConfig::default() }
}

pub(crate) fn settings() -> LoopSettings {
    LoopSettings { body: Some(BODY), ..LoopSettings::default() }
}

/// What a scene does beside pressing: each is asked at every tick.
pub(crate) struct Scene {
    /// How many ticks it lasts.
    pub(crate) ticks: u64,
    /// How many periods pass from the tick before to this one.
    pub(crate) elapsed: Box<dyn FnMut(u64) -> u64>,
    /// What the device gives instead of a reading.
    pub(crate) read: Box<dyn FnMut(u64, Reading) -> Result<Reading, DeviceError>>,
    /// What writing a force gives.
    pub(crate) write: Box<dyn FnMut(u64) -> Result<(), DeviceError>>,
    /// What the model side does with a local model before it is published; `false` publishes nothing.
    pub(crate) model: Box<dyn FnMut(u64, &mut LocalModel) -> bool>,
    /// What the app does beside.
    pub(crate) app: Box<dyn FnMut(u64, &mut HapticHandle)>,
}

impl Default for Scene {
    /// Nothing breaks.
    fn default() -> Self {
        Self {
            ticks: TICKS,
            elapsed: Box::new(|_| 1),
            read: Box::new(|_, reading| Ok(reading)),
            write: Box::new(|_| Ok(())),
            model: Box::new(|_, _| true),
            app: Box::new(|_, _| ()),
        }
    }
}

/// What came of a scene.
#[derive(Debug, Default)]
pub(crate) struct Turned {
    /// Tick and force written, N.
    pub(crate) forces: Vec<(u64, DVec3)>,
    /// What the app was told that went wrong, with its causes.
    pub(crate) told: Vec<String>,
    /// How many ticks it should have lasted.
    pub(crate) ticks: u64,
}

impl Scene {
    /// Turns the loop in lock step, from the first tick to the last.
    pub(crate) fn turn(mut self) -> Result<Turned, LabError> {
        let (mut handle, mut haptic_loop) = haptic_loop(config(), settings())?;
        let mut turned = Turned { ticks: self.ticks, ..Turned::default() };
        for tick in 1..=self.ticks {
            (self.app)(tick, &mut handle);
            let whole = Reading { sequence: Some(tick), ..Reading::at(hand(tick)) };
            let reading = (self.read)(tick, whole);
            let ticked = haptic_loop.tick((self.elapsed)(tick), reading);
            let written = (self.write)(tick);
            // What is not written is not felt: the device goes on with what it had.
            let held = turned.forces.last().map_or(DVec3::ZERO, |(_, force)| *force);
            let felt = if written.is_ok() { ticked.device_force_n } else { held };
            haptic_loop.finish_tick(ticked, None, written);
            turned.forces.push((tick, felt));
            if tick % PERIOD == 0 {
                // The model side knows the hand by the loop's samples alone.
                let newest = handle.samples().newest().copied();
                let model = handle.model_slot();
                if let Some(sample) = newest {
                    write_model(model, sample.position_m, sample.sequence);
                    if (self.model)(tick, model) {
                        handle.publish_model();
                    }
                }
            }
            turned.listen(&mut handle);
        }
        Ok(turned)
    }
}

impl Turned {
    /// Takes what the loop has told.
    pub(crate) fn listen(&mut self, handle: &mut HapticHandle) {
        while let Some(event) = handle.next_event() {
            if event.kind.is_fault() {
                self.tell(&event.kind);
            }
        }
    }

    /// Notes what was told, with its causes.
    pub(crate) fn tell(&mut self, kind: &LoopEventKind) {
        self.told.push(chain(kind));
    }
}

/// The force that the surface gives at that tick if nothing is broken, N.
pub(crate) fn sound_n(tick: u64) -> f64 {
    (-STIFFNESS * hand(tick).z).max(0.0)
}

/// An event's message and those of its causes.
fn chain(kind: &LoopEventKind) -> String {
    let mut text = kind.to_string();
    let mut cause = std::error::Error::source(kind);
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}
