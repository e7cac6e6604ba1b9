//! Scene of a fault: a hand that presses an elastic surface.

use crate::error::LabError;
use glam::{DMat3, DVec3};
use palpate_haptics::{
    DeviceError, DeviceLimits, HapticHandle, LoopConfig, LoopEventKind, LoopSettings, Reading,
    RealTimeRequest, haptic_loop,
};
use palpate_local::{Contact, LocalModel, ModelId, Scheme};

/// Default number of ticks of a scene.
pub(crate) const TICKS: u64 = 4000;
/// Tick of the fault.
pub(crate) const FAULT_TICK: u64 = 1500;
/// Limits of the device: 10 N, and 0.5 N per tick.
pub(crate) const LIMITS: DeviceLimits = DeviceLimits { force_n: 10.0, slew_n_per_s: 500.0 };
/// Ticks between two model steps.
pub(crate) const PERIOD: u64 = 50;
/// Stiffness of the surface, N/m.
const STIFFNESS: f64 = 300.0;
/// Id of the touched body.
pub(crate) const BODY: u64 = 1;

/// Position of the hand, m: above the surface for 0.7 s, a touch of 6 to 7 mm until 2.5 s, and another from 2.9 s on.
pub(crate) fn hand_m(tick: u64) -> DVec3 {
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
    let is_touching = at.z < 0.0;
    model.contact = if is_touching { Contact::Touching { normal: DVec3::Z } } else { Contact::Apart };
    model.force_n = if is_touching { DVec3::Z * (-STIFFNESS * at.z) } else { DVec3::ZERO };
    let k = if is_touching { STIFFNESS } else { 0.0 };
    model.stiffness_n_per_m = DMat3::from_diagonal(DVec3::new(0.0, 0.0, k));
    model.damping_ns_per_m = DMat3::ZERO;
}

pub(crate) fn config() -> LoopConfig {
    LoopConfig { device: LIMITS, real_time: RealTimeRequest::NONE, ..LoopConfig::default() }
}

pub(crate) fn settings() -> LoopSettings {
    LoopSettings { body: Some(BODY), ..LoopSettings::default() }
}

/// A scene with its faults; each function is called at every tick.
pub(crate) struct Scene {
    /// Number of ticks.
    pub(crate) ticks: u64,
    /// Number of periods since the tick before.
    pub(crate) elapsed: Box<dyn FnMut(u64) -> u64>,
    /// Result of reading the device, from the intact reading.
    pub(crate) read: Box<dyn FnMut(u64, Reading) -> Result<Reading, DeviceError>>,
    /// Result of writing a force.
    pub(crate) write: Box<dyn FnMut(u64) -> Result<(), DeviceError>>,
    /// Change of a local model before it is published; `false` publishes nothing.
    pub(crate) model: Box<dyn FnMut(u64, &mut LocalModel) -> bool>,
    /// Action of the app.
    pub(crate) app: Box<dyn FnMut(u64, &mut HapticHandle)>,
}

impl Default for Scene {
    /// A scene without a fault.
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

/// Forces and events of a scene.
#[derive(Debug, Default)]
pub(crate) struct SceneRun {
    /// Tick and force on the device, N.
    pub(crate) forces: Vec<(u64, DVec3)>,
    /// Events that report a fault.
    pub(crate) events: Vec<LoopEventKind>,
    /// Planned number of ticks.
    pub(crate) ticks: u64,
}

impl Scene {
    /// Runs all ticks in lock step.
    pub(crate) fn run(mut self) -> Result<SceneRun, LabError> {
        let (mut handle, mut haptic_loop) = haptic_loop(config(), settings())?;
        let mut run = SceneRun { ticks: self.ticks, ..SceneRun::default() };
        for tick in 1..=self.ticks {
            (self.app)(tick, &mut handle);
            let intact = Reading { sequence: Some(tick), ..Reading::at(hand_m(tick)) };
            let reading = (self.read)(tick, intact);
            let output = haptic_loop.tick((self.elapsed)(tick), reading);
            let written = (self.write)(tick);
            // Without a write the device keeps its last force.
            let kept = run.forces.last().map_or(DVec3::ZERO, |(_, force)| *force);
            let shown = if written.is_ok() { output.device_force_n } else { kept };
            haptic_loop.finish_tick(output, None, written);
            run.forces.push((tick, shown));
            if tick % PERIOD == 0 {
                // The model side receives only the loop's samples.
                let newest = handle.samples().newest().copied();
                let model = handle.model_slot();
                if let Some(sample) = newest {
                    write_model(model, sample.position_m, sample.sequence);
                    if (self.model)(tick, model) {
                        handle.publish_model();
                    }
                }
            }
            run.read_events(&mut handle);
        }
        Ok(run)
    }
}

impl SceneRun {
    /// Reads the queued events and keeps those that report a fault.
    pub(crate) fn read_events(&mut self, handle: &mut HapticHandle) {
        while let Some(event) = handle.next_event() {
            if event.kind.is_fault() {
                self.events.push(event.kind);
            }
        }
    }
}

/// Force of the surface at `tick` without a fault, N.
pub(crate) fn intact_force_n(tick: u64) -> f64 {
    (-STIFFNESS * hand_m(tick).z).max(0.0)
}
