//! Events of the loop.

use crate::{DeviceError, RealTimeReport};
use palpate_local::{LocalModelError, ModelId, ModelSwap};
use thiserror::Error;

/// An event of the loop, with the tick at which it occurred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopEvent {
    /// Sequence number of the tick.
    pub sequence: u64,
    /// Kind of the event, with its data.
    pub kind: LoopEventKind,
}

/// Kind of a [`LoopEvent`]. Its text describes the event and names a remedy for faults.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LoopEventKind {
    /// The device is open and the loop runs.
    #[error("the device is open, the loop runs")]
    Started,
    /// Result of the thread's real-time requests.
    #[error("{0}")]
    RealTime(RealTimeReport),
    /// The loop wrote zero force, closed the device and ended.
    #[error("the loop has stopped with zero force")]
    Stopped,
    /// A new local model became active.
    #[error("local model for sample {} became active after replaying {} samples", .0.to.sequence, .0.replayed_samples)]
    ModelAdopted(ModelSwap),
    /// A local model was rejected or abandoned; the previous one stays active.
    #[error("local model rejected; the previous one stays active and its force fades once stale")]
    ModelRejected(#[source] LocalModelError),
    /// A local model of another body was rejected.
    #[error(
        "local model of body {} rejected: the tool touches another body; publish models of LoopSettings::body",
        .0.body
    )]
    WrongBody(ModelId),
    /// The device failed or its reading was rejected; the last sample is repeated.
    #[error("the device failed")]
    DeviceFailed(#[source] DeviceError),
    /// The device gives readings again, after this number of ticks without.
    #[error("the device gives readings again after {0} ticks")]
    DeviceRecovered(u64),
    /// This number of deadlines passed without a tick.
    #[error("{0} deadlines were missed; raise the thread's priority or reduce the load of the machine")]
    DeadlinesMissed(u64),
    /// More deadlines were missed in a row than are bridged; the sample history restarts.
    #[error(
        "{0} deadlines were missed in a row: the sample history restarts, and force returns once it is small; unless the app \
         was suspended, raise the thread's priority or reduce the load of the machine"
    )]
    Gap(u64),
    /// The device offers no [`crate::EmergencyStop`]: if it blocks the loop, only its own firmware ends the force.
    #[error(
        "the device offers no emergency stop: if it blocks the loop, only its own firmware ends the force"
    )]
    NoEmergencyStop,
    /// A setting that the user should check for this device ([`crate::HapticDevice::notice`]).
    #[error("check a setting of the device: {0}")]
    DeviceNotice(&'static str),
    /// The watchdog stopped the device, because the loop was blocked in it or could not write to it for too long. The start stage
    /// of the safety chain is armed again.
    #[error(
        "the loop was blocked in its device or could not write to it, and the device was stopped; force returns once it is small; \
         check driver and cable"
    )]
    EmergencyStopped,
    /// The hand was accepted at a place this far from the last, m. The start stage of the safety chain is armed again.
    #[error(
        "the hand jumped by {0:.3} m; force returns once it is small; check the sensor if the hand did not move"
    )]
    HandJumped(f64),
    /// The position has been the same for this time, s, while the orientation changed.
    #[error(
        "the position has not changed for {0:.1} s while the orientation did; check the encoders of the arm and their cables, unless it \
         is held by its dock"
    )]
    PositionFrozen(f64),
    /// The device cannot be opened at the start of the loop. The loop tries twice a second, and emits this event once for each new reason.
    #[error("the device cannot be opened; the loop tries again twice a second")]
    OpenFailed(#[source] DeviceError),
    /// A disconnected device was opened again.
    #[error("the device is connected again")]
    Reconnected,
    /// A disconnected device is present but cannot be opened. The loop tries twice a second, and emits this event once for each
    /// new reason.
    #[error("the device was disconnected and cannot be opened again")]
    ReopenFailed(#[source] DeviceError),
    /// The active local model is this old, in model periods, and the force fades.
    #[error(
        "no new local model has come for {0:.1} model periods, and the force fades; the model side stands still or is too slow: \
         reduce its work"
    )]
    ModelStale(f64),
    /// The force of a local model is not finite and was replaced by zero.
    #[error(
        "the force of a local model is not finite and is replaced by zero; make the body softer or its steps shorter"
    )]
    ForceNotFinite,
    /// The driver or the loop panicked. This is the last event.
    #[error(
        "the driver panicked; zero force was written and the device closed: update the driver and restart the tool"
    )]
    Panicked,
    /// The settings with this number are in force.
    #[error("settings {0} are in force")]
    SettingsAdopted(u64),
}

impl LoopEventKind {
    /// Whether the event is a fault.
    #[must_use]
    pub fn is_fault(&self) -> bool {
        match self {
            Self::ModelRejected(_)
            | Self::WrongBody(_)
            | Self::DeviceFailed(_)
            | Self::OpenFailed(_)
            | Self::ReopenFailed(_)
            | Self::DeadlinesMissed(_)
            | Self::EmergencyStopped
            | Self::HandJumped(_)
            | Self::PositionFrozen(_)
            | Self::ModelStale(_)
            | Self::ForceNotFinite
            | Self::Panicked
            | Self::Gap(_) => true,
            Self::Started
            | Self::RealTime(_)
            | Self::NoEmergencyStop
            | Self::DeviceNotice(_)
            | Self::Reconnected
            | Self::Stopped
            | Self::ModelAdopted(_)
            | Self::DeviceRecovered(_)
            | Self::SettingsAdopted(_) => false,
        }
    }
}
