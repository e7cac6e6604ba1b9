//! First-order low-pass filter on the force.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::LocalModelError;
use glam::DVec3;

/// First-order low-pass filter, y ← y + a (u − y) with a = 1 − e^(−2π f_c h): exact for inputs that are constant over the step h.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPass {
    a: f64,
    y: DVec3,
}

impl LowPass {
    /// A filter with cut-off frequency `cutoff_hz` (f_c) and step `step_s` (h), at y = 0.
    ///
    /// # Errors
    /// [`LocalModelError::Setting`] when either is not finite and above zero.
    pub fn new(cutoff_hz: f64, step_s: f64) -> Result<Self, LocalModelError> {
        for (what, value) in [("low-pass cut-off, Hz", cutoff_hz), ("tick, s", step_s)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(LocalModelError::Setting { what, value, allowed: "finite and above 0" });
            }
        }
        Ok(Self { a: -(-std::f64::consts::TAU * cutoff_hz * step_s).exp_m1(), y: DVec3::ZERO })
    }

    /// Advances by `steps` steps with input `u` and returns y. A non-finite input counts as zero.
    pub fn advance(&mut self, u: DVec3, steps: u64) -> DVec3 {
        let u = if u.is_finite() { u } else { DVec3::ZERO };
        let left = (1.0 - self.a).powi(i32::try_from(steps).unwrap_or(i32::MAX));
        self.y = u + left * (self.y - u);
        self.y
    }

    /// Sets y; a non-finite `y` counts as zero.
    pub fn reset(&mut self, y: DVec3) {
        self.y = if y.is_finite() { y } else { DVec3::ZERO };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_response_is_exponential() {
        let mut filter = LowPass::new(10.0, 1e-3).unwrap();
        let y = (0..100).map(|_| filter.advance(DVec3::X, 1)).last().unwrap();
        let expected = 1.0 - (-std::f64::consts::TAU * 10.0 * 0.1).exp();
        assert!((y.x - expected).abs() < 1e-13);
        let mut at_once = LowPass::new(10.0, 1e-3).unwrap();
        assert!((at_once.advance(DVec3::X, 100).x - expected).abs() < 1e-13);
    }

    #[test]
    fn non_finite_input_counts_as_zero() {
        let mut filter = LowPass::new(10.0, 1e-3).unwrap();
        filter.reset(DVec3::INFINITY);
        assert_eq!(filter.advance(DVec3::NAN, 1), DVec3::ZERO);
        assert!(filter.advance(DVec3::X, 1).x > 0.0);
    }

    #[test]
    fn rejects_non_positive_or_non_finite_settings() {
        for (cutoff, step) in [(0.0, 1e-3), (f64::NAN, 1e-3), (10.0, -1.0), (10.0, f64::INFINITY)] {
            assert!(LowPass::new(cutoff, step).is_err());
        }
    }
}
