//! One constant force in the device: made, changed, started, stopped.

use super::effect_duration::RESTART_PERIOD;
use super::layout::{Layout, Pool};
use super::report_encoding::{Word, put};
use crate::link::Link;
use palpate_haptics::DeviceError;
use std::time::Duration;

/// A magnitude that has not changed is sent again after this time, so that a report that was lost does not stay.
const REFRESH: Duration = Duration::from_millis(25);
/// So often the device is asked what has become of a new effect.
const ASKED: usize = 16;

/// A constant force that the device has.
#[derive(Clone, Debug)]
pub(super) struct Effect {
    /// Its reports, with its index.
    set: Vec<u8>,
    magnitude: Vec<u8>,
    zero: Vec<u8>,
    start: Vec<u8>,
    stop: Vec<u8>,
    free: Option<Vec<u8>>,
    /// The magnitude that is wanted, and the one that the device has, if that is known.
    pub(super) wanted: i64,
    shown: Option<i64>,
    /// When it was last written.
    at: Duration,
    /// When it was last started.
    started_at: Duration,
}

impl Effect {
    /// Has the device make one, for the axis `axis`.
    pub(super) fn create(link: &mut Link, layout: &Layout, axis: usize) -> Result<Self, DeviceError> {
        link.set_feature(&layout.create)?;
        let index = created(link, layout)?;
        let [x, y] = &layout.set_effect;
        let set = if axis == 0 { x } else { y };
        let zero = layout.constant_force.about(index);
        Ok(Self {
            set: set.about(index),
            magnitude: zero.clone(),
            zero,
            start: layout.start.about(index),
            stop: layout.stop.about(index),
            free: layout.free.as_ref().map(|free| free.about(index)),
            wanted: 0,
            shown: None,
            at: Duration::ZERO,
            started_at: Duration::ZERO,
        })
    }

    /// Says what it is.
    pub(super) fn set(&self, link: &mut Link) -> Result<(), DeviceError> {
        link.write(&self.set)
    }

    /// Lets it act, from now on for as long as it lasts. One that acts already goes on with its magnitude.
    pub(super) fn start(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        link.write(&self.start)?;
        self.started_at = link.clock.now();
        Ok(())
    }

    /// Whether it has or shall have a force and was started so long ago that it has to be started again, or has ended.
    fn has_to_start(&self, layout: &Layout, now: Duration) -> bool {
        let has_force = self.wanted != 0 || self.shown != Some(0);
        layout.ends && has_force && now.saturating_sub(self.started_at) >= RESTART_PERIOD
    }

    /// Ends it.
    pub(super) fn stop(&self, link: &mut Link) -> Result<(), DeviceError> {
        link.write(&self.stop)
    }

    /// Gives its room back.
    pub(super) fn free(&self, link: &mut Link) -> Result<(), DeviceError> {
        self.free.as_ref().map_or(Ok(()), |free| link.write(free))
    }

    /// Makes it zero.
    pub(super) fn zero(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let zeroed = link.write(&self.zero);
        self.shown = zeroed.is_ok().then_some(0);
        self.at = link.clock.now();
        zeroed
    }

    /// How much more than it has is wanted; least where it is unknown what it has.
    pub(super) fn growth(&self) -> i64 {
        self.shown.map_or(i64::MIN, |shown| self.wanted.saturating_abs() - shown.saturating_abs())
    }

    /// Makes it what is wanted, if it is not or that was said long ago: whether a magnitude was written. If that fails it is to be made zero: what was on its way may
    /// have arrived. Where effects end it is started again in time: first, so that one that had ended at zero begins at zero.
    pub(super) fn send(
        &mut self,
        link: &mut Link,
        layout: &Layout,
        now: Duration,
    ) -> Result<bool, DeviceError> {
        if self.has_to_start(layout, now) {
            self.start(link)?;
        }
        if self.shown == Some(self.wanted) && now.saturating_sub(self.at) < REFRESH {
            return Ok(false);
        }
        put(&mut self.magnitude, &layout.magnitude, self.wanted);
        link.write(&self.magnitude)?;
        (self.shown, self.at) = (Some(self.wanted), now);
        Ok(true)
    }

    /// The report that makes it zero.
    pub(super) fn zero_report(&self) -> Vec<u8> {
        self.zero.clone()
    }
}

/// What the device says of the effect that it was asked to make last: its index.
fn created(link: &mut Link, layout: &Layout) -> Result<i64, DeviceError> {
    let load = &layout.block_load;
    let mut report = load.blank.clone();
    for _ in 0..ASKED {
        report.copy_from_slice(&load.blank);
        let length = link.feature(&mut report)?;
        let data = match report.split_first() {
            Some((id, data)) if length == report.len() && load.blank.first() == Some(id) => data,
            _ => {
                return Err(DeviceError::Protocol(
                    "its word on a new effect is not what its descriptor says",
                ));
            }
        };
        let says = |word: &Option<Word>| word.as_ref().is_some_and(|word| word.is_said(data));
        if load.success.is_said(data) {
            let index = load.index.get(data).filter(|&index| layout.has_index(index));
            return index.ok_or(DeviceError::Protocol(
                "it gave an effect an index that its descriptor does not have",
            ));
        }
        if says(&load.full) {
            return Err(DeviceError::Protocol("it has no room for another effect"));
        }
        if says(&load.error) {
            return Err(DeviceError::Protocol("it could not make a constant force"));
        }
    }
    Err(DeviceError::Protocol("it does not say whether it has made an effect"))
}

/// Whether there is room for `effects` in the device. One that does not answer may have it; some empty their memory when asked.
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
            "it leaves the room for effects to the driver, which is not supported",
        ));
    }
    // Some say 0 and mean nothing by it.
    if value(&pool.most).is_some_and(|most| (1..effects).contains(&most)) {
        return Err(DeviceError::Protocol("it plays fewer effects at once than it has axes"));
    }
    Ok(())
}
