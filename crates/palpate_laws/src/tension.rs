//! The value of a force law.

/// Value of a force law at one extension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tension {
    /// Tension φ(e), N; positive when stretched.
    pub force_n: f64,
    /// Stiffness φ'(e), N/m.
    pub stiffness_n_per_m: f64,
}
