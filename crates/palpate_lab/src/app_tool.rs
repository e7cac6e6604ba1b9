//! Friction and coupling that a tool of an app has by default.

use palpate_body::VirtualCoupling;

/// Coefficient of friction.
pub(crate) const FRICTION: f64 = 0.3;
/// Virtual coupling.
pub(crate) const COUPLING: VirtualCoupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 10.0 };
