//! Samples of the tool from readings of the device, one for each period.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::velocity::VelocityState;
use crate::{DeviceError, Reading, VelocityEstimator};
use glam::{DQuat, DVec3};
use palpate_local::{HandOver, OtherToolForce, Sample, SampleOrigin};

/// Missed deadlines in a row that are bridged by interpolated samples; after more, the sample history restarts.
pub const MAX_BRIDGED_TICKS: u64 = 200;

/// Appends samples to the history of a [`HandOver`].
#[derive(Clone, Debug)]
pub(crate) struct Sampler {
    tick_s: f64,
    velocity: VelocityState,
    /// Force of another tool in the samples of this tick.
    other: Option<OtherToolForce>,
}

/// Periods that end with a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Periods {
    /// Sequence number of the tick.
    pub(crate) sequence: u64,
    /// Periods since the previous tick.
    pub(crate) elapsed: u64,
}

impl Sampler {
    pub(crate) fn new(tick_s: f64) -> Self {
        Self { tick_s, velocity: VelocityState::default(), other: None }
    }

    /// Appends the sample of this tick, and samples for the missed deadlines before it. `reading` is in the scene's frame; all samples
    /// get the force `other` of another tool. After a jump (`has_jumped`) there is no interpolation and no velocity, because the motion in
    /// between was not observed.
    pub(crate) fn take_sample(
        &mut self,
        hand_over: &mut HandOver,
        estimator: VelocityEstimator,
        periods: Periods,
        (reading, other): (&Result<Reading, DeviceError>, Option<OtherToolForce>),
        has_jumped: bool,
    ) {
        self.other = other;
        let Periods { sequence: newest, elapsed } = periods;
        let last = hand_over.history().newest().copied();
        let first_missed = newest.saturating_sub(elapsed - 1);
        if let Some(last) = last.filter(|_| elapsed <= MAX_BRIDGED_TICKS + 1) {
            for (i, sequence) in (1..elapsed).zip(first_missed..) {
                match reading {
                    Ok(now) if !has_jumped => {
                        let fraction = i as f64 / elapsed as f64;
                        let between = Reading {
                            position_m: last.position_m + (now.position_m - last.position_m) * fraction,
                            orientation: slerp(last.orientation, now.orientation, fraction),
                            ..*now
                        };
                        let origin = SampleOrigin::Interpolated;
                        self.push_sample(hand_over, estimator, sequence, &between, origin);
                    }
                    _ => self.repeat_sample(hand_over, estimator, sequence, &last),
                }
            }
        } else {
            self.velocity.reset();
        }
        match (reading, last) {
            (Ok(now), _) => {
                if has_jumped {
                    self.velocity.reset();
                }
                self.push_sample(hand_over, estimator, newest, now, SampleOrigin::Measured);
            }
            (Err(_), Some(last)) => self.repeat_sample(hand_over, estimator, newest, &last),
            (Err(_), None) => {}
        }
    }

    /// Appends the last sample again, with zero velocity.
    fn repeat_sample(
        &mut self,
        hand_over: &mut HandOver,
        estimator: VelocityEstimator,
        sequence: u64,
        last: &Sample,
    ) {
        let at_rest =
            Reading { orientation: last.orientation, buttons: last.buttons, ..Reading::at(last.position_m) };
        self.velocity.reset();
        self.push_sample(hand_over, estimator, sequence, &at_rest, SampleOrigin::Repeated);
    }

    fn push_sample(
        &mut self,
        hand_over: &mut HandOver,
        estimator: VelocityEstimator,
        sequence: u64,
        reading: &Reading,
        origin: SampleOrigin,
    ) {
        let measured = reading.velocity_m_per_s;
        let velocity_m_per_s = self.velocity.step(estimator, reading.position_m, measured, self.tick_s);
        hand_over.push(Sample {
            sequence,
            time_s: sequence as f64 * self.tick_s,
            position_m: reading.position_m,
            velocity_m_per_s,
            orientation: reading.orientation,
            buttons: reading.buttons,
            origin,
            other: self.other,
        });
    }
}

/// Displacement and velocity of the hand between two ticks, in the hand's own scale.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HandMotion {
    /// Position at the previous tick, m, divided by the frame's scale.
    last_m: Option<DVec3>,
}

impl HandMotion {
    /// Displacement since the previous tick, m, and velocity, m/s, along the scene's axes, in the hand's own scale; zero displacement
    /// after a jump.
    pub(crate) fn advance(
        &mut self,
        sample: Option<&Sample>,
        scale: f64,
        has_jumped: bool,
    ) -> (DVec3, DVec3) {
        let Some(sample) = sample else { return (DVec3::ZERO, DVec3::ZERO) };
        let position_m = sample.position_m / scale;
        let last = self.last_m.replace(position_m).filter(|_| !has_jumped);
        (last.map_or(DVec3::ZERO, |last| position_m - last), sample.velocity_m_per_s / scale)
    }
}

/// Spherical interpolation; returns `to` for opposite orientations, between which no path is the shortest.
fn slerp(from: DQuat, to: DQuat, fraction: f64) -> DQuat {
    let between = from.slerp(to, fraction);
    if between.is_finite() { between } else { to }
}
