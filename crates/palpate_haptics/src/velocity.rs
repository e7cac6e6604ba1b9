//! Velocity estimation from positions.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::HapticsError;
use crate::error::check;
use glam::DVec3;

/// Estimator of a sample's velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VelocityEstimator {
    /// Backward difference (xₙ − xₙ₋₁)/h: accurate for a smooth path, noisy for a quantised one. A step of 0.3 mm gives 0.3 m/s.
    BackwardDifference,
    /// The backward difference through two equal first-order low-passes in series, at `cutoff_hz` each, by backward Euler:
    /// a = ω h/(1 + ω h), ω = 2π f. Each delays by 1/ω, as in continuous time.
    TwoPole {
        /// Cut-off frequency of each pole, Hz.
        cutoff_hz: f64,
    },
    /// Velocity measured by the device; the backward difference if the device measures none.
    Device,
}

impl Default for VelocityEstimator {
    /// Two poles at 80 Hz.
    fn default() -> Self {
        Self::TwoPole { cutoff_hz: 80.0 }
    }
}

impl VelocityEstimator {
    /// Rejects a cut-off frequency that is not finite or not positive.
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

/// State of a [`VelocityEstimator`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VelocityState {
    last_m: Option<DVec3>,
    poles: [DVec3; 2],
}

impl VelocityState {
    /// Velocity, m/s, at a new position, `tick_s` after the last one; zero at the first. `measured_m_per_s` is the device's own velocity.
    pub fn step(
        &mut self,
        estimator: VelocityEstimator,
        position_m: DVec3,
        measured_m_per_s: Option<DVec3>,
        tick_s: f64,
    ) -> DVec3 {
        let difference = self.last_m.map_or(DVec3::ZERO, |last| (position_m - last) / tick_s);
        self.last_m = Some(position_m);
        match estimator {
            VelocityEstimator::BackwardDifference => difference,
            VelocityEstimator::Device => measured_m_per_s.unwrap_or(difference),
            VelocityEstimator::TwoPole { cutoff_hz } => {
                let angle = std::f64::consts::TAU * cutoff_hz * tick_s;
                let a = angle / (1.0 + angle);
                let mut input = difference;
                for pole in &mut self.poles {
                    *pole += a * (input - *pole);
                    input = *pole;
                }
                input
            }
        }
    }

    /// Resets to the state before the first position.
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
    fn constant_velocity_is_exact() {
        for estimator in [VelocityEstimator::BackwardDifference, VelocityEstimator::default()] {
            assert!((run(estimator, |t| 0.2 * t, 100) - 0.2).abs() < 1e-12);
        }
    }

    #[test]
    fn two_poles_delay_by_their_group_delay() {
        // The velocity of x = t^2/2 is t. The backward difference delays by half a tick, each pole by 1/ω.
        let delay = 0.5e-3 + 2.0 / (std::f64::consts::TAU * 80.0);
        let v = run(VelocityEstimator::default(), |t| t * t / 2.0, 500);
        assert!((v - (0.5 - delay)).abs() < 1e-12, "{v}");
    }

    #[test]
    fn two_poles_reduce_quantisation_noise() {
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
        let (unfiltered, filtered) =
            (noise(VelocityEstimator::BackwardDifference), noise(VelocityEstimator::default()));
        assert!(filtered < 0.35 * unfiltered, "{filtered} m/s of {unfiltered} m/s");
    }

    #[test]
    fn device_estimator_prefers_measured_velocity() {
        let mut state = VelocityState::default();
        let measured = Some(DVec3::Y);
        assert_eq!(state.step(VelocityEstimator::Device, DVec3::ZERO, measured, 1e-3), DVec3::Y);
        assert_eq!(state.step(VelocityEstimator::Device, DVec3::X * 1e-3, None, 1e-3), DVec3::X);
    }

    #[test]
    fn rejects_invalid_cutoff() {
        for cutoff_hz in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(VelocityEstimator::TwoPole { cutoff_hz }.validate().is_err());
        }
    }
}
