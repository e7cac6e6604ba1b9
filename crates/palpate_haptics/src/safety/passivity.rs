//! Passivity observer and controller: damping while the loop has given the hand more energy than it received.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use glam::DVec3;

/// Passivity observer and controller (B. Hannaford, J.-H. Ryu, IEEE Trans. Robot. Autom. 18 (2002) 1–10) for forces that are held
/// constant between ticks. The energy exchanged in a tick is then exactly the force times the displacement.
///
/// The energy counts from the beginning of a touch, and is reset after 0.1 s without force.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PassivityObserver {
    /// Energy received from the hand minus energy given to it since the touch began, J.
    observed_j: f64,
    /// Consecutive ticks without force.
    idle: u64,
}

/// Number of ticks without force that ends a touch.
const IDLE_TICKS: u64 = 100;

impl PassivityObserver {
    /// Adds the displacement `moved_m` of the hand under the constant force `written_n` during `elapsed` ticks.
    pub(super) fn record(&mut self, written_n: DVec3, moved_m: DVec3, elapsed: u64) {
        let given_j = written_n.dot(moved_m);
        if given_j.is_finite() {
            self.observed_j -= given_j;
        }
        self.idle = if written_n == DVec3::ZERO { self.idle.saturating_add(elapsed) } else { 0 };
        if self.idle >= IDLE_TICKS {
            self.observed_j = 0.0;
        }
    }

    /// Energy received from the hand minus energy given to it since the touch began, J.
    pub(super) fn observed_energy_j(&self) -> f64 {
        self.observed_j
    }

    /// Damping, N s/m, that dissipates the given energy beyond `tolerance_j` within a tick of `tick_s`, s, at this speed; at most
    /// `max_damping`.
    pub(super) fn damping(&self, m_per_s: f64, tick_s: f64, tolerance_j: f64, max_damping: f64) -> f64 {
        let excess_j = -self.observed_j - tolerance_j;
        let speed2 = m_per_s * m_per_s;
        if excess_j > 0.0 && speed2 > 0.0 { (excess_j / (speed2 * tick_s)).min(max_damping) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passive_spring_gets_no_damping() {
        let mut observer = PassivityObserver::default();
        let depth = |i: i32| 5e-3 * (f64::from(i) * 0.01).sin().max(0.0);
        for i in 0..1000 {
            // The mean force over the displacement: this spring is lossless; a delayed one would generate energy.
            let held = 0.5 * (depth(i) + depth(i + 1));
            observer.record(DVec3::Z * 300.0 * held, -DVec3::Z * (depth(i + 1) - depth(i)), 1);
            assert!(observer.observed_energy_j() > -1e-12);
            assert_eq!(observer.damping(0.1, 1e-3, 1e-9, 5.0), 0.0);
        }
        assert!(observer.observed_energy_j().abs() < 1e-12);
    }

    #[test]
    fn given_energy_is_dissipated_within_limits() {
        let mut observer = PassivityObserver::default();
        // The loop pushes the hand with 1 N over 2 mm.
        observer.record(DVec3::X, DVec3::X * 2e-3, 1);
        assert!((observer.observed_energy_j() + 2e-3).abs() < 1e-15);
        // P = b v², so 1.5 mJ in a tick at 1 m/s take 1.5 N s/m.
        assert!((observer.damping(1.0, 1e-3, 5e-4, 5.0) - 1.5).abs() < 1e-12);
        assert_eq!(observer.damping(-0.1, 1e-3, 5e-4, 5.0), 5.0);
        assert_eq!(observer.damping(0.0, 1e-3, 5e-4, 5.0), 0.0);
        // A displacement that is NaN is ignored.
        observer.record(DVec3::X, DVec3::NAN, 1);
        assert!((observer.observed_energy_j() + 2e-3).abs() < 1e-15);
        // The end of a touch resets the energy.
        observer.record(DVec3::ZERO, DVec3::X, 99);
        assert!(observer.observed_energy_j() < 0.0);
        observer.record(DVec3::ZERO, DVec3::X, 1);
        assert_eq!(observer.observed_energy_j(), 0.0);
    }
}
