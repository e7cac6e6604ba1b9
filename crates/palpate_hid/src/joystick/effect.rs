//! A constant-force effect of the device.

use super::effect_duration::RESTART_PERIOD;
use super::layout::{Layout, Pool};
use super::report_encoding::{UsageValue, put};
use crate::link::Link;
use palpate_haptics::DeviceError;
use std::time::Duration;

/// Time after which an unchanged magnitude is sent again, in case a report was lost.
const REFRESH: Duration = Duration::from_millis(25);
/// Maximum number of reads of the status of a new effect.
const MAX_STATUS_READS: usize = 16;

/// A constant-force effect, with its reports.
#[derive(Clone, Debug)]
pub(super) struct Effect {
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
    /// Creates an effect in the device, for the axis with index `axis`.
    pub(super) fn create(link: &mut Link, layout: &Layout, axis: usize) -> Result<Self, DeviceError> {
        link.set_feature(&layout.create)?;
        let index = read_new_effect_index(link, layout)?;
        let [x, y] = &layout.set_effect;
        let set = if axis == 0 { x } else { y };
        let zero = layout.constant_force.for_effect(index);
        Ok(Self {
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

/// Reads the index of the newly created effect.
fn read_new_effect_index(link: &mut Link, layout: &Layout) -> Result<i64, DeviceError> {
    let load = &layout.block_load;
    let mut report = load.blank.clone();
    for _ in 0..MAX_STATUS_READS {
        report.copy_from_slice(&load.blank);
        let length = link.feature(&mut report)?;
        let data = match report.split_first() {
            Some((id, data)) if length == report.len() && load.blank.first() == Some(id) => data,
            _ => {
                return Err(DeviceError::Protocol(
                    "the status report of a new effect does not match the report descriptor",
                ));
            }
        };
        let is_set = |value: &Option<UsageValue>| value.as_ref().is_some_and(|value| value.is_set(data));
        if load.success.is_set(data) {
            let index = load.index.get(data).filter(|&index| layout.has_index(index));
            return index.ok_or(DeviceError::Protocol(
                "the index of a new effect is outside the range in the report descriptor",
            ));
        }
        if is_set(&load.full) {
            return Err(DeviceError::Protocol("the device has no memory for another effect"));
        }
        if is_set(&load.error) {
            return Err(DeviceError::Protocol("the device failed to create a constant-force effect"));
        }
    }
    Err(DeviceError::Protocol("the device reports no status for a new effect"))
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
