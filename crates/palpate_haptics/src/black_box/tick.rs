//! Record of one tick in the black box.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::safety_actions::{SafetyActions, actions_of};
use crate::{DeviceError, StageForces, TickRecord, TickTiming};
use glam::DVec3;
use palpate_local::{ModelId, Sample};
use std::fmt::{Display, Formatter};

/// Record of one tick. Forces act on the hand, in the scene's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlackBoxTick {
    /// Periods since the loop's start.
    pub sequence: u64,
    /// Time since the loop's start, s: `sequence` times the period.
    pub time_s: f64,
    /// Periods since the previous tick: 1 plus the number of missed deadlines.
    pub elapsed: u64,
    /// Newest sample; `None` before the first reading.
    pub sample: Option<Sample>,
    /// Active local model; `None` before the first.
    pub model: Option<ModelId>,
    /// Force before the safety chain, N; may be infinite or NaN.
    pub before_n: DVec3,
    /// Force after each stage of the safety chain, N; the last stage gives `written_n`.
    pub after: StageForces,
    /// Written force, N.
    pub written_n: DVec3,
    /// Product of the gains, 0 to 1.
    pub gain: f64,
    /// Actions of the safety chain.
    pub acted: SafetyActions,
    /// Times of the tick; zero in lock step.
    pub timing: TickTiming,
    /// Error of the device's read, or reason for which the reading was rejected.
    pub read_failed: Option<RecordedDeviceError>,
    /// Error of the device's write.
    pub write_failed: Option<RecordedDeviceError>,
}

impl BlackBoxTick {
    /// Converts `record` of a loop with ticks of `tick_s`, s.
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

/// A [`DeviceError`] as stored in a file, without the texts of [`DeviceError::Protocol`] and [`DeviceError::Unavailable`].
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
    /// All variants but [`RecordedDeviceError::Os`], with their names.
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

    /// Parses a name.
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
