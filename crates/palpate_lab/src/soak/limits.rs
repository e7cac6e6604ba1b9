//! Limits of the force, implemented independently of the safety chain that enforces them.

use glam::DVec3;

/// Maximum number of ticks whose growth a force may make up after missed deadlines.
pub(super) const MAX_GROWTH_TICKS: u64 = 4;

/// Rounding allowed, N.
const ROUNDING_N: f64 = 1e-9;

/// Limits of the force at a device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Maximum magnitude, N.
    pub(super) magnitude_n: f64,
    /// Maximum growth in a tick, N.
    pub(super) growth_n: f64,
}

impl Limits {
    /// Whether `force_n` may follow `last_n` after `ticks` ticks.
    pub(super) fn allow(&self, last_n: DVec3, force_n: DVec3, ticks: u64) -> bool {
        let length = force_n.length();
        // Only the part of the last force along the new one counts.
        let along = if length > 0.0 { (last_n.dot(force_n) / length).clamp(0.0, length) } else { 0.0 };
        let max_n = along + self.growth_n * ticks.clamp(1, MAX_GROWTH_TICKS) as f64;
        force_n.is_finite() && length <= self.magnitude_n.min(max_n) + ROUNDING_N
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_large_fast_growing_and_non_finite_forces() {
        let limits = Limits { magnitude_n: 20.0, growth_n: 0.5 };
        let y = |newtons: f64| DVec3::Y * newtons;
        for (last, force, ticks, allowed) in [
            (0.0, 0.5, 1, true),
            (0.0, 0.6, 1, false),
            (0.0, 0.6, 2, true),
            (0.0, 2.0, 4, true),
            (0.0, 2.1, 100, false),
            (19.8, 20.0, 1, true),
            (19.8, 20.1, 1, false),
            (20.0, 0.0, 1, true),
            // A reversed force grows from zero.
            (1.0, -0.6, 1, false),
            (1.0, -0.5, 1, true),
            (0.0, f64::NAN, 1, false),
            (0.0, f64::INFINITY, 1, false),
        ] {
            assert_eq!(limits.allow(y(last), y(force), ticks), allowed, "{last} to {force} in {ticks}");
        }
    }
}
