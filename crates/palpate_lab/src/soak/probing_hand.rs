//! A simulated device: a hand that probes the block and checks every force that it receives.

use super::limits::{Limits, MAX_GROWTH_TICKS};
use glam::DVec3;
use palpate_haptics::{DeviceDescription, DeviceError, HapticDevice, Reading};
use std::f64::consts::TAU;
use std::time::{Duration, Instant};

/// ProbingHand that moves with wall-clock time: after missed deadlines it is elsewhere, as a person's hand is. It allocates only in
/// `describe`.
#[derive(Debug)]
pub(super) struct ProbingHand {
    /// Position at which the tool just touches the block, m.
    start_m: DVec3,
    limits: Limits,
    opened: Option<Instant>,
    last_n: DVec3,
    /// Forces received.
    pub(super) felt: ReceivedForces,
}

/// Forces that a device received.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ReceivedForces {
    /// Number of forces.
    pub(super) forces: u64,
    /// Number of nonzero forces.
    pub(super) not_zero: u64,
    /// Number of forces that were not finite, too large, or grew by more than four ticks allow. The device cannot count the ticks that
    /// have passed; the records can, and are checked more strictly.
    pub(super) out_of_limits: u64,
    /// Maximum force, N.
    pub(super) peak_n: f64,
}

impl ProbingHand {
    pub(super) fn new(start_m: DVec3, limits: Limits) -> Self {
        Self { start_m, limits, opened: None, last_n: DVec3::ZERO, felt: ReceivedForces::default() }
    }
}

impl HapticDevice for ProbingHand {
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: "probing hand".into(),
            workspace_m: [DVec3::splat(-0.2), DVec3::splat(0.2)],
            max_force_n: self.limits.magnitude_n,
            rate_hz: 1000.0,
        }
    }

    #[expect(clippy::disallowed_methods, reason = "a hand moves whether it is read or not")]
    fn open(&mut self) -> Result<(), DeviceError> {
        self.opened = Some(Instant::now());
        Ok(())
    }

    fn read(&mut self, _within: Duration) -> Result<Reading, DeviceError> {
        let opened = self.opened.ok_or(DeviceError::NotOpen)?;
        Ok(Reading::at(self.start_m + offset_m(opened.elapsed().as_secs_f64())))
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        self.felt.forces += 1;
        self.felt.not_zero += u64::from(force_n != DVec3::ZERO);
        self.felt.out_of_limits += u64::from(!self.limits.allow(self.last_n, force_n, MAX_GROWTH_TICKS));
        self.felt.peak_n = self.felt.peak_n.max(force_n.length());
        self.last_n = force_n;
        Ok(())
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        self.opened = None;
        Ok(())
    }
}

/// Offset of the hand from the touching position at `t`, m: from 4 mm above the block to 8 mm deep and back in 1.25 s, with some
/// shearing and a tremor.
fn offset_m(t: f64) -> DVec3 {
    let pressed = 0.012 * (1.0 - (TAU * 0.8 * t).cos()) / 2.0;
    DVec3::new(0.003 * (TAU * 0.37 * t).sin(), 0.002 * (TAU * 0.23 * t).sin(), 0.004 - pressed)
        + 0.0003 * (TAU * 9.0 * t).sin() * DVec3::Z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_forces_out_of_limits() {
        let mut hand = ProbingHand::new(DVec3::ZERO, Limits { magnitude_n: 20.0, growth_n: 0.5 });
        for (newtons, counted) in [(1.0, 0), (2.5, 0), (30.0, 1), (20.0, 1), (f64::NAN, 2), (0.0, 2)] {
            hand.write(DVec3::X * newtons).unwrap();
            assert_eq!(hand.felt.out_of_limits, counted, "{newtons} N");
        }
        assert_eq!((hand.felt.forces, hand.felt.not_zero, hand.felt.peak_n), (6, 5, 30.0));
    }

    #[test]
    fn movement_enters_and_leaves_contact_without_jumps() {
        let heights: Vec<f64> = (0..2500).map(|i| offset_m(f64::from(i) * 1e-3).z).collect();
        assert!(heights.iter().any(|z| *z > 0.003) && heights.iter().any(|z| *z < -0.007));
        assert!(heights.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 1e-4));
    }
}
