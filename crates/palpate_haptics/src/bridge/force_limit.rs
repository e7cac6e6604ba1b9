//! Force limit of a bridged device.

use glam::DVec3;

/// Whether `force_n` is finite and within the device's limit, with a tolerance for the rounding of rotations.
pub(super) fn is_within(force_n: DVec3, max_force_n: f64) -> bool {
    // The comparison is false for NaN.
    force_n.length() <= max_force_n * (1.0 + 1e-9)
}
