//! Friction and coupling that a tool of an app has by default, and the limit of its force.

use palpate_body::VirtualCoupling;

/// Coefficient of friction.
pub(crate) const FRICTION: f64 = 0.3;
/// Virtual coupling.
pub(crate) const COUPLING: VirtualCoupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 10.0 };

/// Rounding allowed to a force at the limit, relative.
const ROUNDING: f64 = 1e-6;

/// A sentence about a force of `peak_n` that has reached the limit of `coupling`; `None` below the limit.
pub(crate) fn limit_reached(coupling: VirtualCoupling, peak_n: f64) -> Option<String> {
    let limit_n = coupling.max_force_n;
    let is_reached = peak_n >= (1.0 - ROUNDING) * limit_n;
    is_reached.then(|| format!("the force reached {limit_n} N, the limit of the virtual coupling"))
}
