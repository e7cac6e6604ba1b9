//! A constant-force effect of the device.

use super::effect_duration::RESTART_PERIOD;
use super::layout::{Layout, Pool};
use super::report_encoding::{UsageValue, put};
use crate::clock;
use crate::link::Link;
use palpate_haptics::DeviceError;
use std::time::Duration;

/// Time after which an unchanged magnitude is sent again, in case a report was lost.
const REFRESH: Duration = Duration::from_millis(25);
/// Time within which the device must report the status of a new effect.
const STATUS_TIMEOUT: Duration = Duration::from_millis(200);
/// Time between two reads of the status.
const STATUS_PERIOD: Duration = Duration::from_millis(1);
/// Maximum number of reads of the status, each after a period.
const MAX_STATUS_READS: u32 = 200;

/// A constant-force effect, with its reports.
#[derive(Clone, Debug)]
pub(super) struct Effect {
    /// Index of the effect in the device.
    index: i64,
    /// Set Effect report. This and the following reports contain the index of the effect.
    set: Vec<u8>,
    magnitude: Vec<u8>,
    zero: Vec<u8>,
    start: Vec<u8>,
    stop: Vec<u8>,
    free: Option<Vec<u8>>,
    /// Magnitude to be sent.
    pub(super) target: i64,
    /// Magnitude in the device, if known.
    displayed: Option<i64>,
    /// Time of the last write.
    at: Duration,
    /// Time of the last start.
    started_at: Duration,
}

impl Effect {
    /// Creates an effect in the device, for the axis with index `axis`, in addition to `others`.
    pub(super) fn create(
        link: &mut Link,
        layout: &Layout,
        axis: usize,
        others: &[Self],
    ) -> Result<Self, DeviceError> {
        link.set_feature(&layout.create)?;
        let index = wait_for_index(link, layout, others)?;
        let [x, y] = &layout.set_effect;
        let set = if axis == 0 { x } else { y };
        let zero = layout.constant_force.for_effect(index);
        Ok(Self {
            index,
            set: set.for_effect(index),
            magnitude: zero.clone(),
            zero,
            start: layout.start.for_effect(index),
            stop: layout.stop.for_effect(index),
            free: layout.free.as_ref().map(|free| free.for_effect(index)),
            target: 0,
            displayed: None,
            at: Duration::ZERO,
            started_at: Duration::ZERO,
        })
    }

    /// Sets the parameters.
    pub(super) fn set(&self, link: &mut Link) -> Result<(), DeviceError> {
        link.write(&self.set)
    }

    /// Starts the effect for its duration. An effect that is playing restarts with its magnitude.
    pub(super) fn start(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        link.write(&self.start)?;
        self.started_at = link.clock.now();
        Ok(())
    }

    /// Whether the effect has or will have a force and its last start is too long ago.
    fn has_to_start(&self, layout: &Layout, now: Duration) -> bool {
        let has_force = self.target != 0 || self.displayed != Some(0);
        layout.has_finite_effects && has_force && now.saturating_sub(self.started_at) >= RESTART_PERIOD
    }

    /// Stops the effect.
    pub(super) fn stop(&self, link: &mut Link) -> Result<(), DeviceError> {
        link.write(&self.stop)
    }

    /// Frees the effect in the device.
    pub(super) fn free(&self, link: &mut Link) -> Result<(), DeviceError> {
        self.free.as_ref().map_or(Ok(()), |free| link.write(free))
    }

    /// Sets the magnitude to zero.
    pub(super) fn zero(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let zeroed = link.write(&self.zero);
        self.displayed = zeroed.is_ok().then_some(0);
        self.at = link.clock.now();
        zeroed
    }

    /// Increase of the absolute magnitude; the minimum if the magnitude in the device is unknown.
    pub(super) fn growth(&self) -> i64 {
        self.displayed.map_or(i64::MIN, |displayed| self.target.saturating_abs() - displayed.saturating_abs())
    }

    /// Sends the target magnitude if it has changed or was sent too long ago, and returns whether it was sent. After an error the caller
    /// must zero the effect, as the device may have received a report. A finite effect is started again in time, before its magnitude is
    /// sent: an effect that has ended at zero then starts at zero.
    pub(super) fn send(
        &mut self,
        link: &mut Link,
        layout: &Layout,
        now: Duration,
    ) -> Result<bool, DeviceError> {
        if self.has_to_start(layout, now) {
            self.start(link)?;
        }
        if self.displayed == Some(self.target) && now.saturating_sub(self.at) < REFRESH {
            return Ok(false);
        }
        put(&mut self.magnitude, &layout.magnitude, self.target);
        link.write(&self.magnitude)?;
        (self.displayed, self.at) = (Some(self.target), now);
        Ok(true)
    }

    /// Report that sets the magnitude to zero.
    pub(super) fn zero_report(&self) -> Vec<u8> {
        self.zero.clone()
    }
}

/// Waits for the index of the newly created effect, for at most 200 ms. A device may need some milliseconds. Until then it reports no
/// status, the status of the effect before, or nothing at all.
fn wait_for_index(link: &mut Link, layout: &Layout, others: &[Effect]) -> Result<i64, DeviceError> {
    let (mut report, start) = (layout.block_load.blank.clone(), link.clock.now());
    let mut last = DeviceError::Protocol(NO_STATUS);
    for read in 0..MAX_STATUS_READS {
        if read > 0 {
            clock::wait(STATUS_PERIOD);
        }
        match read_status(link, layout, &mut report) {
            // Index 0 means none. In an array that is numbered from 0, an empty report has the number of success.
            Ok(Status::Created(0)) => last = DeviceError::Protocol(INDEX_OUT_OF_RANGE),
            Ok(Status::Created(index)) if others.iter().any(|other| other.index == index) => {
                last =
                    DeviceError::Protocol("the device reports the index of an earlier effect for a new one");
            }
            Ok(Status::Created(index)) => {
                let index = Some(index).filter(|&index| layout.has_index(index));
                return index.ok_or(DeviceError::Protocol(INDEX_OUT_OF_RANGE));
            }
            Ok(Status::Failed(reason)) => return Err(DeviceError::Protocol(reason)),
            Ok(Status::Pending) => last = DeviceError::Protocol(NO_STATUS),
            Err(DeviceError::Disconnected) => return Err(DeviceError::Disconnected),
            Err(error) => last = error,
        }
        if link.clock.now().saturating_sub(start) >= STATUS_TIMEOUT {
            break;
        }
    }
    Err(last)
}

/// Error text for an index that does not fit into the reports.
const INDEX_OUT_OF_RANGE: &str = "the index of a new effect is outside the range in the report descriptor";
/// Error text for a device that never reports a status.
const NO_STATUS: &str = "the device reports no status for a new effect within 200 ms";

/// Status of the effect that was created last.
enum Status {
    /// The effect exists, and has this index.
    Created(i64),
    /// The effect was not created, for this reason.
    Failed(&'static str),
    /// The device has not reported the effect.
    Pending,
}

fn read_status(link: &mut Link, layout: &Layout, report: &mut [u8]) -> Result<Status, DeviceError> {
    let load = &layout.block_load;
    report.copy_from_slice(&load.blank);
    let length = link.feature(report)?;
    let data = match report.split_first() {
        Some((id, data)) if length == load.blank.len() && load.blank.first() == Some(id) => data,
        _ => {
            return Err(DeviceError::Protocol(
                "the status report of a new effect does not match the report descriptor",
            ));
        }
    };
    let is_set = |value: &Option<UsageValue>| value.as_ref().is_some_and(|value| value.is_set(data));
    Ok(match load.index.get(data) {
        Some(index) if load.success.is_set(data) => Status::Created(index),
        _ if is_set(&load.full) => Status::Failed("the device has no memory for another effect"),
        _ if is_set(&load.error) => Status::Failed("the device failed to create a constant-force effect"),
        _ => Status::Pending,
    })
}

/// Checks the capacity for `effects` effects. A device that rejects the pool report may have it; some clear their memory when it is
/// read.
pub(super) fn check_capacity(link: &mut Link, pool: &Pool, effects: i64) -> Result<(), DeviceError> {
    let mut report = pool.blank.clone();
    let length = match link.feature(&mut report) {
        Ok(length) => length,
        Err(DeviceError::Disconnected) => return Err(DeviceError::Disconnected),
        Err(_) => return Ok(()),
    };
    let data = report.get(1..length).unwrap_or_default();
    let value = |field: &Option<crate::Field>| field.as_ref().and_then(|field| field.get(data));
    if value(&pool.is_managed) == Some(0) {
        return Err(DeviceError::Protocol(
            "the device requires driver-managed effect memory, which is not supported",
        ));
    }
    // Some devices report 0 without a meaning.
    if value(&pool.max_effects).is_some_and(|max| (1..effects).contains(&max)) {
        return Err(DeviceError::Protocol("the device plays fewer simultaneous effects than it has axes"));
    }
    Ok(())
}
