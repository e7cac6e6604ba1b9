//! What can be wrong with a law's parameters.

use thiserror::Error;

/// A parameter of a force law that makes no sense.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LawError {
    /// The stiffness of a spring is negative, zero or not finite. Give a finite number above zero.
    #[error("spring stiffness is {0} N/m; it must be finite and above 0")]
    Stiffness(f64),
    /// The compliance of a law of skin is negative, zero or not finite.
    #[error("compliance of skin is {0} m/N; it must be finite and above 0")]
    Compliance(f64),
    /// The hardening of a law of skin is negative, zero or not finite. A law without is linear.
    #[error("hardening of skin is {0} 1/N; it must be finite and above 0")]
    Hardening(f64),
    /// The rate of an exponential law is negative, zero or not finite. A law without is linear.
    #[error("rate of stiffening is {0} 1/m; it must be finite and above 0")]
    Rate(f64),
    /// A coefficient of friction is negative or not finite.
    #[error("coefficient of friction is {0}; it must be finite and at least 0")]
    Friction(f64),
    /// A normal or an axis is not of unit length.
    #[error("the length of a normal or an axis is {0}; it must be 1")]
    Normal(f64),
    /// The radius of a tool is negative, zero or not finite.
    #[error("radius of a tool is {0} m; it must be finite and above 0")]
    Radius(f64),
    /// The largest force of a tool's coupling is negative, zero or not finite. A tool that is to give way never has none.
    #[error("largest force of a tool's coupling is {0} N; it must be finite and above 0")]
    CouplingForce(f64),
    /// The damping of a damper is negative or not finite. Give zero for a spring without a damper.
    #[error("damping is {0} N s/m; it must be finite and at least 0")]
    Damping(f64),
    /// The rest length of a spring is negative, zero or not finite. Its two nodes must be apart.
    #[error("spring rest length is {0} m; it must be finite and above 0")]
    RestLength(f64),
}
