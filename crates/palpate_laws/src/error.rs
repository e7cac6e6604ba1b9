//! Errors in the parameters of a law.

use thiserror::Error;

/// An invalid parameter of a law.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LawError {
    /// The stiffness is not finite or not above 0.
    #[error("spring stiffness is {0} N/m; it must be finite and above 0")]
    Stiffness(f64),
    /// The compliance of a skin law is not finite or not above 0.
    #[error("compliance of skin is {0} m/N; it must be finite and above 0")]
    Compliance(f64),
    /// The hardening of a skin law is not finite or not above 0. Use a linear law for no hardening.
    #[error("hardening of skin is {0} 1/N; it must be finite and above 0")]
    Hardening(f64),
    /// The rate of an exponential law is not finite or not above 0. Use a linear law for no stiffening.
    #[error("rate of stiffening is {0} 1/m; it must be finite and above 0")]
    Rate(f64),
    /// The coefficient of friction is negative or not finite.
    #[error("coefficient of friction is {0}; it must be finite and at least 0")]
    Friction(f64),
    /// A normal or an axis is not a unit vector.
    #[error("the length of a normal or an axis is {0}; it must be 1")]
    Normal(f64),
    /// The radius of a tool is not finite or not above 0.
    #[error("radius of a tool is {0} m; it must be finite and above 0")]
    Radius(f64),
    /// The maximum force of a virtual coupling is not finite or not above 0. Use no coupling for an unlimited force.
    #[error("largest force of a tool's coupling is {0} N; it must be finite and above 0")]
    CouplingForce(f64),
    /// The damping is negative or not finite. Use zero for a spring without a damper.
    #[error("damping is {0} N s/m; it must be finite and at least 0")]
    Damping(f64),
    /// The rest length of a spring is not finite or not above 0.
    #[error("spring rest length is {0} m; it must be finite and above 0")]
    RestLength(f64),
    /// Young's modulus is not finite or not above 0.
    #[error("Young's modulus is {0} Pa; it must be finite and above 0")]
    YoungsModulus(f64),
    /// A Prony series has too many terms.
    #[error("relaxation has {0} terms; it must have at most 3")]
    RelaxationTerms(usize),
    /// A share of a Prony series, or their sum, is out of range.
    #[error("share of the modulus that relaxes is {0}; each must be above 0 and their sum at most 0.99")]
    RelaxedShare(f64),
    /// A time of a Prony series is not finite or not above 0.
    #[error("relaxation time is {0} s; it must be finite and above 0")]
    RelaxationTime(f64),
    /// Poisson's ratio is not from 0 to 0.49.
    #[error("Poisson's ratio is {0}; it must be from 0 to 0.49")]
    PoissonsRatio(f64),
}
