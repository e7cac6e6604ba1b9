//! The value of a force law.

/// The value of a force law at one extension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tension {
    /// φ(e), N; positive when stretched.
    pub force_n: f64,
    /// φ'(e), N/m.
    pub stiffness_n_per_m: f64,
}
