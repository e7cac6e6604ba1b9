//! What can be wrong with a law's parameters.

use thiserror::Error;

/// A parameter of a force law that makes no sense.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LawError {
    /// The stiffness of a spring is negative, zero or not finite. Give a finite number above zero.
    #[error("spring stiffness is {0} N/m; it must be finite and above 0")]
    Stiffness(f64),
    /// The damping of a damper is negative or not finite. Give zero for a spring without a damper.
    #[error("damping is {0} N s/m; it must be finite and at least 0")]
    Damping(f64),
    /// The rest length of a spring is negative, zero or not finite. Its two nodes must be apart.
    #[error("spring rest length is {0} m; it must be finite and above 0")]
    RestLength(f64),
}
