//! The 1 kHz side of palpate: haptic devices, the haptic loop on its own thread, the lock-free exchange with the model side, the
//! safety chain, and timing measurements. The crate depends on no body simulation and no game engine.
//!
//! Use it to render forces at 1 kHz from models that another thread computes at a lower rate, for example at 20 Hz. The model side
//! publishes *local models*: plain data from which the loop computes a force for each position of the tool until the next model
//! arrives (`palpate_local`).
//!
//! # Getting started
//!
//! ```
//! use glam::DVec3;
//! use palpate_haptics::{Lockstep, LoopConfig, LoopSettings, Reading, ScriptedDevice, haptic_loop};
//! use palpate_local::Contact;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A hand at rest, and a loop in lock step. On a thread: `haptic_loop.spawn(device)`.
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
//! # Main types
//!
//! * Devices: [`HapticDevice`] with [`Reading`] and [`EmergencyStop`]; simulated by [`ScriptedDevice`], [`ReplayDevice`] (replays a
//!   [`Trajectory`], for example of [`Probe`]) and [`FollowerDevice`]; in another process with a vendor's library
//!   [`bridge::BridgeDevice`].
//! * The loop: [`haptic_loop()`] returns a [`HapticHandle`] for the app and a [`HapticLoop`] for the thread.
//! * Execution: [`LoopThread`] on its own thread, [`Lockstep`] for tests and replay.
//! * Settings: [`LoopConfig`], [`LoopSettings`], [`DeviceFrame`], [`VelocityEstimator`], [`SafetySettings`].
//! * Measurements: [`LoopReport`], [`RealTimeReport`], [`LoopEvent`], [`TickRecord`].
//! * Recordings: [`BlackBox`] of the newest ticks, [`BlackBoxWriter`] for its files, [`Recorder`] for whole runs, [`Recording`] to
//!   read both.
//! * Errors: [`HapticsError`], [`DeviceError`], [`CsvError`]; [`report`] formats an error with its causes.
//!
//! # Threads
//!
//! | thread | runs | waits for |
//! | --- | --- | --- |
//! | the app's | model side, [`HapticHandle`], [`LoopThread::stop`] | the loop's thread, at most 200 ms, in `stop` |
//! | `haptic-loop` | device, [`HapticLoop::tick`] | its deadlines, and the device |
//! | `haptic-watchdog` | [`EmergencyStop`], if the device offers one | its own deadlines |
//!
//! The app never blocks the loop: newest values cross in triple buffers, events and records in bounded queues whose overflow is
//! counted. A tick reads no clock and does not allocate, lock, log or panic.
//!
//! # Safety
//!
//! Every force passes the [`SafetyChain`] before the device, whatever the local model renders. The chain guarantees that
//!
//! * a force is finite, and its length is at most the smaller of the user's and the device's limit;
//! * a force grows by at most a set rate, and starts only once the rendered force is small;
//! * a force fades to zero when its local model is stale, the device is silent or the app is paused;
//! * no force accelerates a hand that moves at twice the speed limit;
//! * damping is added while the loop has given the hand more energy than it received: a passivity observer and controller
//!   (B. Hannaford, J.-H. Ryu, IEEE Trans. Robot. Autom. 18 (2002) 1–10). The damping is limited, and the passivity of a sampled wall
//!   also depends on the device's own damping (J. E. Colgate, G. G. Schenkel, J. Robotic Systems 14 (1997) 37–47): this stage
//!   reduces energy, it does not prove stability.
//!
//! Stopping, dropping and unwinding write zero force before the device is closed.
//!
//! # Units, frames, signs
//!
//! SI units and `f64`; histograms are in µs. Readings and written forces are in the device's frame, everything else in the scene's
//! ([`DeviceFrame`]). A force acts on the hand.
//!
//! # Limits
//!
//! * The thread requests real-time priority and locked memory ([`RealTimeRequest`]) and reports the results. Without them a busy
//!   machine wakes the thread late; [`LoopReport::lateness`] measures this.
//! * A deadline counts as missed if its tick has not started before the next deadline. A tick that overruns its period appears as
//!   lateness of the next one.
//! * A device that blocks forever in `read` blocks the loop with the last force applied. If the device offers an
//!   [`EmergencyStop`], the watchdog stops it within 60 ms; otherwise only the device's own firmware can.

#![forbid(unsafe_code)]

mod baseline_thread;
mod black_box;
pub mod bridge;
mod clock;
mod csv_error;
mod device;
mod displayed_forces;
mod error;
mod event;
mod exchange;
mod force_board;
mod frame;
mod frozen_position;
mod haptic_loop;
mod lockstep;
mod loop_report;
mod plausibility;
mod real_time;
mod recorder;
mod runner;
mod safety;
mod sampling;
mod settings;
mod tick_record;
mod timing;
mod trajectory;
mod velocity;
mod watchdog;

#[doc(hidden)]
pub use baseline_thread::{BaselineReport, BaselineThread};
pub use black_box::{
    BlackBox, BlackBoxError, BlackBoxTick, BlackBoxWriter, RecordedDeviceError, Recording, SafetyAction,
    SafetyActions,
};
pub use csv_error::CsvError;
pub use device::{
    DeviceDescription, DeviceError, DeviceLimits, EmergencyStop, FollowerDevice, FollowerSettings,
    FollowerTarget, HapticDevice, Reading, ReplayDevice, ReplayEnd, ScriptedDevice,
};
pub use displayed_forces::DisplayedForces;
pub use error::{HapticsError, report};
pub use event::{LoopEvent, LoopEventKind};
pub use exchange::HapticHandle;
pub use force_board::{FollowedTool, ForceBoard};
pub use frame::DeviceFrame;
pub use haptic_loop::{HapticLoop, haptic_loop};
pub use lockstep::Lockstep;
pub use loop_report::LoopReport;
pub use real_time::{DenialReason, Outcome, RealTimeReport, RealTimeRequest};
pub use recorder::Recorder;
#[doc(hidden)]
pub use runner::run_with_baseline;
pub use runner::{LoopThread, StopOutcome, StoppedLoop, run};
pub use safety::{SafetyChain, SafetyInput, SafetyReport, SafetySettings, StageForces};
pub use sampling::MAX_BRIDGED_TICKS;
pub use settings::{LoopConfig, LoopSettings};
pub use tick_record::{TickOutput, TickRecord};
pub use timing::{SuccessRate, TickTiming, TimeHistogram};
pub use trajectory::{Probe, Trajectory, TrajectoryError};
pub use velocity::{VelocityEstimator, VelocityState};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
