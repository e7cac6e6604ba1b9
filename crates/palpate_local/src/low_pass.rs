//! A first-order low-pass filter on the force.

use crate::LocalModelError;
use glam::DVec3;

/// y ← y + a (u − y) with a = 1 − e^(−2π f_c h): first order, exact for inputs held over the step h.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPass {
    a: f64,
    y: DVec3,
}

impl LowPass {
    /// A filter of cut-off `cutoff_hz` (f_c) stepped every `step_s` (h), at zero.
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

    /// One step with input `u`; returns y.
    pub fn step(&mut self, u: DVec3) -> DVec3 {
        self.y += self.a * (u - self.y);
        self.y
    }

    /// Sets y.
    pub fn reset(&mut self, y: DVec3) {
        self.y = y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_followed_exponentially() {
        let mut filter = LowPass::new(10.0, 1e-3).unwrap();
        let y = (0..100).map(|_| filter.step(DVec3::X)).last().unwrap();
        let expected = 1.0 - (-std::f64::consts::TAU * 10.0 * 0.1).exp();
        assert!((y.x - expected).abs() < 1e-13);
    }

    #[test]
    fn a_senseless_filter_is_refused() {
        for (cutoff, step) in [(0.0, 1e-3), (f64::NAN, 1e-3), (10.0, -1.0), (10.0, f64::INFINITY)] {
            assert!(LowPass::new(cutoff, step).is_err());
        }
    }
}
