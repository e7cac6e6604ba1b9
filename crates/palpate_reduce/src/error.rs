//! Errors of building and comparing local models, and of the analysis of linear systems.

use palpate_body::BodyError;
use palpate_local::LocalModelError;
use thiserror::Error;

/// Error of building or comparing local models, or of the analysis of a linear system.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ReduceError {
    /// Error of the body.
    #[error("the full body failed")]
    Body(#[from] BodyError),
    /// Error of the local model.
    #[error("the local model failed")]
    LocalModel(#[from] LocalModelError),
    /// The symbolic factorisation of the tangent failed: it is too large for memory.
    #[error("the symbolic factorisation of {unknowns} unknowns failed; use a body of fewer nodes")]
    Symbolic {
        /// Number of unknowns.
        unknowns: usize,
    },
    /// The stiffness K is not positive definite: a part of the body is not attached to a fixed node. For local models, this holds for the
    /// clamped K too.
    #[error(
        "the stiffness is not positive definite at pivot {pivot}; attach every part of the body to fixed nodes"
    )]
    Singular {
        /// Index of the pivot that failed.
        pivot: usize,
    },
    /// M is not positive definite: the basis of the reduced system does not have full rank.
    #[error("the mass matrix is not positive definite at pivot {pivot}; use a basis of full rank")]
    Mass {
        /// Index of the pivot that failed.
        pivot: usize,
    },
    /// A complex frequency is a pole of the system.
    #[error("the frequency {re} + {im}i 1/s is a pole of the system; use another frequency")]
    Pole {
        /// Real part, 1/s.
        re: f64,
        /// Imaginary part, 1/s.
        im: f64,
    },
    /// An eigenvalue or singular value iteration did not converge.
    #[error("the eigenvalue iteration of order {order} did not converge; check that all numbers are finite")]
    Eigenvalues {
        /// Order of the matrix.
        order: usize,
    },
    /// The system is unstable, to within rounding: it has no Gramians and no H∞ norm.
    #[error(
        "the system has a pole on or right of the imaginary axis, to within rounding; \
         add damping, and attach every part to fixed nodes"
    )]
    Unstable,
    /// The residual of a Lyapunov equation is above its tolerance.
    #[error(
        "the residual of a Lyapunov equation is {found:.1e}; it must be at most {allowed:.0e}; add damping"
    )]
    Residual {
        /// Relative residual.
        found: f64,
        /// Maximum relative residual.
        allowed: f64,
    },
    /// An option is outside its allowed range.
    #[error("{what} is {value}; it must be {allowed}")]
    Option {
        /// Name of the option with its unit.
        what: &'static str,
        /// Value of the option.
        value: f64,
        /// Allowed range.
        allowed: &'static str,
    },
    /// The sequence numbers of samples are not consecutive.
    #[error("the sequence number of sample {index} is {found}; it must be {expected}")]
    Samples {
        /// Index of the sample in the list.
        index: usize,
        /// Sequence number of the sample.
        found: u64,
        /// The number that follows that of the previous sample.
        expected: u64,
    },
}
