//! Position and derivatives of a linkage's tip.

use glam::DVec2;

/// Tip of a linkage in the plane of B and C: x is ρ, the distance from A's axis, and y the height, m.
pub(super) struct Reach {
    pub(super) tip: DVec2,
    /// Derivatives of the tip with respect to θ_B and θ_C, m/rad.
    pub(super) by_b: DVec2,
    pub(super) by_c: DVec2,
    /// Distance from singularity, 0 (singular) to 1.
    pub(super) leverage: f64,
    /// Whether the bars can be closed.
    pub(super) is_closed: bool,
}
