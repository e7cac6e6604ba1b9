//! One tick in the black box.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::stages::{SafetyActions, actions_of};
use crate::{DeviceError, StageForces, TickRecord, TickTiming};
use glam::DVec3;
use palpate_local::{ModelId, Sample};
use std::fmt::{Display, Formatter};

/// What went through one tick. Forces are in the scene's frame, on the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlackBoxTick {
    /// Periods since the loop's start.
    pub sequence: u64,
    /// Time since the loop's start, s: `sequence` times the period.
    pub time_s: f64,
    /// Periods since the tick before: 1, and one more for every missed deadline.
    pub elapsed: u64,
    /// The sample of this tick; `None` before the first reading.
    pub sample: Option<Sample>,
    /// The local model that spoke; `None` before the first.
    pub model: Option<ModelId>,
    /// Force before the safety chain, N. It need not be finite.
    pub before_n: DVec3,
    /// Force after each stage of the safety chain, N; after the last, the limit of growth, it is `written_n`.
    pub after: StageForces,
    /// The force that was written, N.
    pub written_n: DVec3,
    /// The product of the gains, 0 to 1.
    pub gain: f64,
    /// What acted in the safety chain.
    pub acted: SafetyActions,
    /// When it began and how long it took; zero in lock step.
    pub timing: TickTiming,
    /// Why the device gave no usable reading.
    pub read_failed: Option<RecordedDeviceError>,
    /// Why the device did not take the force.
    pub write_failed: Option<RecordedDeviceError>,
}

impl BlackBoxTick {
    /// That of `record`, in a loop with ticks of `tick_s`, s.
    #[must_use]
    pub fn of(record: &TickRecord, tick_s: f64) -> Self {
        Self {
            sequence: record.sequence,
            time_s: record.sequence as f64 * tick_s,
            elapsed: record.elapsed,
            sample: record.sample,
            model: record.rendered.model,
            before_n: record.rendered.force_n,
            after: record.safety.after,
            written_n: record.force_n,
            gain: record.safety.gain,
            acted: actions_of(&record.safety),
            timing: record.timing,
            read_failed: record.reading.err().map(RecordedDeviceError::from),
            write_failed: record.written.err().map(RecordedDeviceError::from),
        }
    }
}

/// A [`DeviceError`] as a file tells it: without the text that goes with a broken protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum RecordedDeviceError {
    /// [`DeviceError::NotOpen`], `not_open`.
    NotOpen,
    /// [`DeviceError::AlreadyOpen`], `already_open`.
    AlreadyOpen,
    /// [`DeviceError::TimedOut`], `timed_out`.
    TimedOut,
    /// [`DeviceError::Disconnected`], `disconnected`.
    Disconnected,
    /// [`DeviceError::Os`] with its number, `os:` and the number.
    Os(i32),
    /// [`DeviceError::Protocol`] or [`DeviceError::Unavailable`], `protocol`.
    Protocol,
    /// [`DeviceError::Unusable`], `unusable`.
    Unusable,
    /// [`DeviceError::Jumped`], `jumped`.
    Jumped,
    /// [`DeviceError::Repeated`], `repeated`.
    Repeated,
    /// [`DeviceError::Reordered`], `reordered`.
    Reordered,
}

impl RecordedDeviceError {
    /// All but [`DeviceFault::Os`], with their names.
    const NAMED: [(Self, &'static str); 9] = [
        (Self::Jumped, "jumped"),
        (Self::Repeated, "repeated"),
        (Self::Reordered, "reordered"),
        (Self::NotOpen, "not_open"),
        (Self::AlreadyOpen, "already_open"),
        (Self::TimedOut, "timed_out"),
        (Self::Disconnected, "disconnected"),
        (Self::Protocol, "protocol"),
        (Self::Unusable, "unusable"),
    ];

    /// The fault of that name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        match name.strip_prefix("os:") {
            Some(number) => number.parse().ok().map(Self::Os),
            None => Self::NAMED.into_iter().find(|(_, text)| *text == name).map(|(fault, _)| fault),
        }
    }
}

impl Display for RecordedDeviceError {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match (self, Self::NAMED.iter().find(|(fault, _)| fault == self)) {
            (Self::Os(number), _) => write!(f, "os:{number}"),
            (_, Some((_, name))) => f.write_str(name),
            (_, None) => Ok(()),
        }
    }
}

impl From<DeviceError> for RecordedDeviceError {
    fn from(error: DeviceError) -> Self {
        match error {
            DeviceError::NotOpen => Self::NotOpen,
            DeviceError::AlreadyOpen => Self::AlreadyOpen,
            DeviceError::TimedOut => Self::TimedOut,
            DeviceError::Disconnected => Self::Disconnected,
            DeviceError::Os(number) => Self::Os(number),
            DeviceError::Protocol(_) | DeviceError::Unavailable(_) => Self::Protocol,
            DeviceError::Unusable => Self::Unusable,
            DeviceError::Jumped => Self::Jumped,
            DeviceError::Repeated => Self::Repeated,
            DeviceError::Reordered => Self::Reordered,
        }
    }
}
