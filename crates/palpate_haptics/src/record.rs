//! What leaves the loop by queues: events, and a record of every tick.

use crate::{DeviceError, LoopSettings, Reading, RealTimeReport, SafetyReport, TickTiming};
use glam::DVec3;
use palpate_local::{LocalModelError, ModelId, ModelSwap, RenderedForce, Sample};
use thiserror::Error;

/// Something that happened in the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopEvent {
    /// Sequence number of the tick.
    pub sequence: u64,
    /// What happened.
    pub kind: LoopEventKind,
}

/// What happened.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LoopEventKind {
    /// The device is open and the loop has begun.
    #[error("the device is open, the loop runs")]
    Started,
    /// What the loop's thread got of what it asked the operating system for.
    #[error("{0}")]
    RealTime(RealTimeReport),
    /// The loop has written zero force, closed the device and ended.
    #[error("the loop has stopped with zero force")]
    Stopped,
    /// A new local model speaks.
    #[error("the local model of sample {} speaks, after {} replayed samples", .0.to.sequence, .0.replayed_samples)]
    ModelAdopted(ModelSwap),
    /// A local model was refused or given up; the one before goes on speaking.
    #[error(
        "a local model was refused; the force goes on with the one before and fades when that is old; whatever built it is at fault"
    )]
    ModelRefused(#[source] LocalModelError),
    /// A local model of another body was refused.
    #[error("a local model of body {} was refused: the tool touches another; publish models of the body that is set", .0.body)]
    WrongBody(ModelId),
    /// The device failed or its reading could not be used; the last sample is repeated.
    #[error("the device failed")]
    DeviceFailed(#[source] DeviceError),
    /// The device gives readings again, after this many ticks without.
    #[error("the device answers again after {0} ticks")]
    DeviceRecovered(u64),
    /// This many deadlines passed without a tick.
    #[error("{0} deadlines were missed; give the thread priority and the machine less to do")]
    DeadlinesMissed(u64),
    /// So many deadlines were missed that the samples begin anew.
    #[error(
        "{0} deadlines were missed in a row: the samples begin anew, and force comes back when it is small; unless the app was stopped, give the thread priority and the machine less to do"
    )]
    Gap(u64),
    /// The device offers no [`crate::EmergencyStop`]: if it hangs only its own firmware ends the force.
    #[error("the device offers no emergency stop: if it hangs only its own firmware ends the force")]
    NoEmergencyStop,
    /// For too long the loop had hung in the device, or the device had taken no force: the watchdog stopped it. The start begins
    /// anew.
    #[error(
        "the loop hung in its device or could not write to it: the device was stopped; force comes back when it is small; check driver and cable"
    )]
    EmergencyStopped,
    /// The hand is believed to be elsewhere, that far away, m; the start begins anew.
    #[error(
        "the hand jumped by {0:.3} m; force comes back when it is small; check the sensor if nobody moved it"
    )]
    HandJumped(f64),
    /// The device was opened again after it had been disconnected.
    #[error("the device is connected again")]
    Reconnected,
    /// A device that was disconnected is there and cannot be opened. It is tried again twice a second; this is told when the reason is
    /// another than the last one told.
    #[error("the device was disconnected and cannot be opened again")]
    ReopenFailed(#[source] DeviceError),
    /// No new local model has come for so long that the force fades.
    #[error(
        "no new local model has come for {0:.1} model periods, and the force fades; the model side stands still or is too slow: give it less to do"
    )]
    ModelStale(f64),
    /// The force of a local model is not finite, and zero takes its place.
    #[error(
        "the force of a local model is not finite, and zero takes its place until it is; make the body softer or its steps shorter"
    )]
    ForceNotFinite,
    /// The driver or the loop panicked. It is the last word.
    #[error(
        "the driver panicked; zero force was written and the device closed: update the driver and start the tool anew"
    )]
    Panicked,
    /// Settings of this number are in force.
    #[error("settings {0} are in force")]
    SettingsAdopted(u64),
}

impl LoopEventKind {
    /// Whether it tells of something that went wrong.
    #[must_use]
    pub fn is_fault(&self) -> bool {
        match self {
            Self::ModelRefused(_)
            | Self::WrongBody(_)
            | Self::DeviceFailed(_)
            | Self::ReopenFailed(_)
            | Self::DeadlinesMissed(_)
            | Self::EmergencyStopped
            | Self::HandJumped(_)
            | Self::ModelStale(_)
            | Self::ForceNotFinite
            | Self::Panicked
            | Self::Gap(_) => true,
            Self::Started
            | Self::RealTime(_)
            | Self::NoEmergencyStop
            | Self::Reconnected
            | Self::Stopped
            | Self::ModelAdopted(_)
            | Self::DeviceRecovered(_)
            | Self::SettingsAdopted(_) => false,
        }
    }
}

/// Everything that went into one tick and came out of it. With the local models of the sequence numbers in
/// `taken` and the `settings` where they changed, feeding `elapsed` and `reading` to another loop gives the same
/// forces to the bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickRecord {
    /// Periods since the loop's start.
    pub sequence: u64,
    /// Periods since the last tick.
    pub elapsed: u64,
    /// What the device gave.
    pub reading: Result<Reading, DeviceError>,
    /// The sample made of it; `None` before the first reading.
    pub sample: Option<Sample>,
    /// The settings that were adopted at this tick, and their number.
    pub settings: Option<(u64, LoopSettings)>,
    /// The local model that was taken out of the exchange at this tick, to be caught up.
    pub taken: Option<ModelId>,
    /// The force before the safety chain, and the model it came from.
    pub rendered: RenderedForce,
    /// What the safety chain did.
    pub safety: SafetyReport,
    /// The force that was written, N, scene frame.
    pub force_n: DVec3,
    /// What writing it gave; `Ok` before it is written.
    pub written: Result<(), DeviceError>,
    /// When it began and how long it took; zero in lock step.
    pub timing: TickTiming,
}
