//! Does the loop give the hand more energy than it got? If so, it takes it back by damping.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use glam::DVec3;

/// A passivity observer and controller (B. Hannaford, J.-H. Ryu, IEEE Trans. Robot. Autom. 18 (2002) 1) for forces that are held
/// between ticks: what the hand did against a force is force times way, exactly.
///
/// It counts from touch to touch: after a tenth of a second without force the account is closed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PassivityObserver {
    /// What the hand has given since the touch began, minus what it got, J.
    given_j: f64,
    /// Ticks in a row without force.
    idle: u64,
}

/// Ticks without force after which a touch is over.
const IDLE_TICKS: u64 = 100;

impl PassivityObserver {
    /// Books the way `moved_m` of the hand against the force `written_n` that was held meanwhile, over `elapsed` ticks.
    pub(super) fn record(&mut self, written_n: DVec3, moved_m: DVec3, elapsed: u64) {
        let got_j = written_n.dot(moved_m);
        if got_j.is_finite() {
            self.given_j -= got_j;
        }
        self.idle = if written_n == DVec3::ZERO { self.idle.saturating_add(elapsed) } else { 0 };
        if self.idle >= IDLE_TICKS {
            self.given_j = 0.0;
        }
    }

    /// What the hand has given since the touch began, minus what it got, J.
    pub(super) fn observed_energy_j(&self) -> f64 {
        self.given_j
    }

    /// The damping, N s/m, up to `most`, with which the debt beyond `tolerance_j` is taken back within a tick of `tick_s` at
    /// this speed.
    pub(super) fn damping(&self, m_per_s: f64, tick_s: f64, tolerance_j: f64, most: f64) -> f64 {
        let debt_j = -self.given_j - tolerance_j;
        let speed2 = m_per_s * m_per_s;
        if debt_j > 0.0 && speed2 > 0.0 { (debt_j / (speed2 * tick_s)).min(most) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spring_gives_back_what_it_got_and_no_damping_comes_of_it() {
        let mut account = PassivityObserver::default();
        let depth = |i: i32| 5e-3 * (f64::from(i) * 0.01).sin().max(0.0);
        for i in 0..1000 {
            // The force of the tick before was held while the hand went on: a spring in time loses nothing, a late one gains.
            let held = 0.5 * (depth(i) + depth(i + 1));
            account.record(DVec3::Z * 300.0 * held, -DVec3::Z * (depth(i + 1) - depth(i)), 1);
            assert!(account.observed_energy_j() > -1e-12);
            assert_eq!(account.damping(0.1, 1e-3, 1e-9, 5.0), 0.0);
        }
        assert!(account.observed_energy_j().abs() < 1e-12);
    }

    #[test]
    fn a_debt_is_taken_back_in_a_tick_or_as_fast_as_allowed() {
        let mut account = PassivityObserver::default();
        // The hand is pushed along by 1 N over 2 mm.
        account.record(DVec3::X, DVec3::X * 2e-3, 1);
        assert!((account.observed_energy_j() + 2e-3).abs() < 1e-15);
        // P = b v², so 1.5 mJ in a tick at 1 m/s take 1.5 N s/m.
        assert!((account.damping(1.0, 1e-3, 5e-4, 5.0) - 1.5).abs() < 1e-12);
        assert_eq!(account.damping(-0.1, 1e-3, 5e-4, 5.0), 5.0);
        assert_eq!(account.damping(0.0, 1e-3, 5e-4, 5.0), 0.0);
        // Nothing is known of a way that is no number.
        account.record(DVec3::X, DVec3::NAN, 1);
        assert!((account.observed_energy_j() + 2e-3).abs() < 1e-15);
        // A touch that is over is forgotten.
        account.record(DVec3::ZERO, DVec3::X, 99);
        assert!(account.observed_energy_j() < 0.0);
        account.record(DVec3::ZERO, DVec3::X, 1);
        assert_eq!(account.observed_energy_j(), 0.0);
    }
}
