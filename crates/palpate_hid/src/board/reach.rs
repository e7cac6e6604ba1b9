//! Position and derivatives of a linkage's tip.

use glam::DVec2;

/// Where a linkage has the tip, in the plane of B and C: x is ρ, the distance from A's axis, and y the height, m.
pub(super) struct Reach {
    pub(super) tip: DVec2,
    /// How the tip moves with θ_B and θ_C, m/rad.
    pub(super) by_b: DVec2,
    pub(super) by_c: DVec2,
    /// 0 where it is singular, 1 at most.
    pub(super) leverage: f64,
    /// Whether its bars meet.
    pub(super) is_closed: bool,
}
