//! The 1 kHz side of palpate: devices, the haptic loop on a thread of its own, the lock-free exchange with the
//! model side, the safety chain and the loop's account of itself. It knows no body and no game engine.
//!
//! # Getting started
//!
//! ```
//! use glam::DVec3;
//! use palpate_haptics::{Lockstep, LoopConfig, LoopSettings, Reading, ScriptedDevice, haptic_loop};
//! use palpate_local::Contact;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A hand that stands still, and a loop in lock step. On a thread: `haptic_loop.spawn(device)`.
//! let device = ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::ZERO)));
//! let (mut handle, haptic_loop) = haptic_loop(LoopConfig::default(), LoopSettings::default())?;
//! let mut lockstep = Lockstep::new(haptic_loop, Box::new(device))?;
//! lockstep.run(50);
//!
//! // The model side: read the samples, build a local model from them, publish it.
//! let newest = *handle.samples().newest().ok_or("no sample")?;
//! let model = handle.model_slot();
//! model.id.sequence = newest.sequence;
//! model.contact = Contact::Held;
//! model.force_n = DVec3::Y;
//! handle.publish_model();
//! lockstep.run(50);
//! assert_eq!(newest.sequence, 50);
//! # Ok(())
//! # }
//! ```
//!
//! # Contents
//!
//! * Devices: [`HapticDevice`], [`ScriptedDevice`], [`ReplayDevice`], [`FollowingDevice`], [`Trajectory`],
//!   [`Probe`]; with a vendor's own library in another process [`bridge::BridgeDevice`].
//! * The two halves: [`haptic_loop()`], [`HapticHandle`], [`HapticLoop`].
//! * Two clocks: [`LoopThread`] on a thread of its own, [`Lockstep`] for tests and replay.
//! * Settings: [`LoopConfig`], [`LoopSettings`], [`DeviceFrame`], [`VelocityEstimator`], [`SafetySettings`].
//! * The loop's account: [`LoopReport`], [`RealTimeReport`], [`LoopEvent`], [`TickRecord`].
//! * What went through it: [`BlackBox`], [`BlackBoxKeeper`], [`Recorder`] for whole runs, [`Recording`] to read them.
//! * What to compare its lateness with: [`BareThread`].
//!
//! # Units, frames, signs
//!
//! SI and `f64` (histograms: µs). Readings and written forces are in the device's frame, all else in the
//! scene's. Force is what the body does to the hand.
//!
//! # Limits
//!
//! * The thread asks for a real-time priority and for locked memory ([`RealTime`]) and says what it got; without them a busy
//!   machine wakes it late, and how late is measured ([`LoopReport::lateness`]).
//! * A deadline counts as missed when its tick has not begun before the next one is due. A tick that overruns
//!   its period shows as lateness of the next.
//! * A device that blocks for ever in `read` blocks the loop with the last force written. If it offers an [`EmergencyStop`] a
//!   watchdog stops it within 60 ms; if not its own firmware has to.

#![forbid(unsafe_code)]

mod bare;
mod black_box;
pub mod bridge;
mod clock;
mod device;
mod displayed;
mod error;
mod exchange;
mod frame;
mod haptic_loop;
mod lockstep;
mod plausibility;
mod real_time;
mod record;
mod recorder;
mod runner;
mod safety;
mod settings;
mod timing;
mod trajectory;
mod velocity;
mod watchdog;

pub use bare::{BaselineReport, BaselineThread};
pub use black_box::{
    BlackBox, BlackBoxError, BlackBoxTick, BlackBoxWriter, RecordedDeviceError, Recording, SafetyAction,
    SafetyActions,
};
pub use device::{
    DeviceDescription, DeviceError, DeviceLimits, FollowerDevice, FollowerSettings, FollowerTarget,
    HapticDevice, Reading, ReplayDevice, ReplayEnd, ScriptedDevice,
};
pub use displayed::DisplayedForces;
pub use error::{HapticsError, TrajectoryError};
pub use exchange::{HapticHandle, haptic_loop};
pub use frame::DeviceFrame;
pub use haptic_loop::{HapticLoop, MAX_BRIDGED_TICKS, TickOutput};
pub use lockstep::Lockstep;
pub use real_time::{DenialReason, Outcome, RealTimeReport, RealTimeRequest};
pub use record::{LoopEvent, LoopEventKind, TickRecord};
pub use recorder::Recorder;
pub use runner::{LoopThread, StopOutcome, StoppedLoop, run, run_with_baseline};
pub use safety::{SafetyChain, SafetyInput, SafetyReport, SafetySettings, StageForces};
pub use settings::{LoopConfig, LoopSettings};
pub use timing::{LoopReport, SuccessRate, TickTiming, TimeHistogram};
pub use trajectory::{Probe, Trajectory};
pub use velocity::{VelocityEstimator, VelocityState};
pub use watchdog::EmergencyStop;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
