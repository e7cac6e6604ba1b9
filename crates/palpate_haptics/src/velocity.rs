//! Velocity from positions.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::HapticsError;
use crate::error::check;
use glam::DVec3;

/// Where a sample's velocity comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VelocityEstimator {
    /// (xₙ − xₙ₋₁)/h. Exact for a smooth path, rough for a quantised one: a step of 0.3 mm is 0.3 m/s.
    BackwardDifference,
    /// The backward difference through two equal first-order low-passes in series, at `cutoff_hz` each, by backward Euler:
    /// a = ω h/(1 + ω h), ω = 2π f, with which each is late by 1/ω, as in continuous time.
    TwoPole {
        /// Cut-off of each pole, Hz.
        cutoff_hz: f64,
    },
    /// What the device says; the backward difference where it says nothing.
    Device,
}

impl Default for VelocityEstimator {
    /// Two poles at 80 Hz.
    fn default() -> Self {
        Self::TwoPole { cutoff_hz: 80.0 }
    }
}

impl VelocityEstimator {
    /// Refuses a cut-off that is none.
    ///
    /// # Errors
    /// [`HapticsError::Setting`].
    pub fn validate(&self) -> Result<(), HapticsError> {
        match *self {
            Self::TwoPole { cutoff_hz: f } => check(
                "cut-off of the velocity estimator, Hz",
                f,
                f.is_finite() && f > 0.0,
                "finite and above 0",
            ),
            Self::BackwardDifference | Self::Device => Ok(()),
        }
    }
}

/// The state of an estimator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityState {
    last_m: Option<DVec3>,
    poles: [DVec3; 2],
}

impl VelocityState {
    /// The velocity at a new position, m/s, `tick_s` after the last one; zero at the first. `told` is what the device says.
    pub fn step(
        &mut self,
        estimator: VelocityEstimator,
        position_m: DVec3,
        told: Option<DVec3>,
        tick_s: f64,
    ) -> DVec3 {
        let difference = self.last_m.map_or(DVec3::ZERO, |last| (position_m - last) / tick_s);
        self.last_m = Some(position_m);
        match estimator {
            VelocityEstimator::BackwardDifference => difference,
            VelocityEstimator::Device => told.unwrap_or(difference),
            VelocityEstimator::TwoPole { cutoff_hz } => {
                let turned = std::f64::consts::TAU * cutoff_hz * tick_s;
                let a = turned / (1.0 + turned);
                let mut input = difference;
                for pole in &mut self.poles {
                    *pole += a * (input - *pole);
                    input = *pole;
                }
                input
            }
        }
    }

    /// Forgets the past: the next position is a first one, at rest.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(estimator: VelocityEstimator, path: impl Fn(f64) -> f64, ticks: u32) -> f64 {
        let mut state = VelocityState::default();
        (0..=ticks)
            .map(|i| state.step(estimator, DVec3::X * path(f64::from(i) * 1e-3), None, 1e-3).x)
            .last()
            .unwrap()
    }

    #[test]
    fn a_steady_movement_is_found_exactly() {
        for estimator in [VelocityEstimator::BackwardDifference, VelocityEstimator::default()] {
            assert!((run(estimator, |t| 0.2 * t, 100) - 0.2).abs() < 1e-12);
        }
    }

    #[test]
    fn two_poles_delay_by_their_group_delay() {
        // The velocity of x = t^2/2 is t. Backward difference: half a tick late; each pole: 1/ω.
        let late = 0.5e-3 + 2.0 / (std::f64::consts::TAU * 80.0);
        let v = run(VelocityEstimator::default(), |t| t * t / 2.0, 500);
        assert!((v - (0.5 - late)).abs() < 1e-12, "{v}");
    }

    #[test]
    fn two_poles_calm_a_quantised_path() {
        let quantised = |t: f64| ((0.02 * (6.0 * t).sin()) / 3e-4).round() * 3e-4;
        let noise = |estimator| {
            let mut state = VelocityState::default();
            let errors = (0..1000).map(|i| {
                let t = f64::from(i) * 1e-3;
                let v = state.step(estimator, DVec3::X * quantised(t), None, 1e-3).x;
                if i < 50 { 0.0 } else { (v - 0.12 * (6.0 * t).cos()).powi(2) }
            });
            (errors.sum::<f64>() / 950.0).sqrt()
        };
        let (rough, calm) =
            (noise(VelocityEstimator::BackwardDifference), noise(VelocityEstimator::default()));
        assert!(calm < 0.35 * rough, "{calm} m/s of {rough} m/s");
    }

    #[test]
    fn the_device_s_word_counts_if_it_gives_one() {
        let mut state = VelocityState::default();
        let told = Some(DVec3::Y);
        assert_eq!(state.step(VelocityEstimator::Device, DVec3::ZERO, told, 1e-3), DVec3::Y);
        assert_eq!(state.step(VelocityEstimator::Device, DVec3::X * 1e-3, None, 1e-3), DVec3::X);
    }

    #[test]
    fn a_senseless_cutoff_is_refused() {
        for cutoff_hz in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(VelocityEstimator::TwoPole { cutoff_hz }.validate().is_err());
        }
    }
}
