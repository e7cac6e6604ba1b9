//! Why a local model could not be built or judged, or a linear system not analysed.

use palpate_body::BodyError;
use palpate_local::LocalModelError;
use thiserror::Error;

/// What went wrong on the way from a body to a local model, or in the analysis of its small motions.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ReduceError {
    /// The body could not be built or stepped.
    #[error("the full body failed")]
    Body(#[from] BodyError),
    /// The local model does not fit or cannot be stepped.
    #[error("the local model failed")]
    LocalModel(#[from] LocalModelError),
    /// The pattern of the tangent could not be factorised: too large for memory.
    #[error("the symbolic factorisation of {unknowns} unknowns failed")]
    Symbolic {
        /// Number of unknowns.
        unknowns: usize,
    },
    /// K, and where a local model is built its clamped form too, is not positive definite: a part of the body hangs on
    /// nothing.
    #[error("the stiffness is not positive definite at pivot {pivot}; is every part of the body held?")]
    Singular {
        /// The pivot that failed.
        pivot: usize,
    },
    /// M is not positive definite: a reduced system's basis is not of full rank.
    #[error("the mass matrix is not positive definite at pivot {pivot}; is the basis of full rank?")]
    Mass {
        /// The pivot that failed.
        pivot: usize,
    },
    /// A frequency at which the response is asked for is a pole.
    #[error("{re} + {im}i 1/s is a pole of the system; ask for the response elsewhere")]
    Pole {
        /// Real part, 1/s.
        re: f64,
        /// Imaginary part, 1/s.
        im: f64,
    },
    /// An eigenvalue or singular value iteration did not converge.
    #[error("the eigenvalue iteration of order {order} did not converge; are all numbers finite?")]
    Eigenvalues {
        /// Order of the matrix.
        order: usize,
    },
    /// Gramians exist for stable systems only.
    #[error(
        "the system is not stable: it has a pole right of the imaginary axis, on it, or so near that rounding cannot \
         tell; give it more damping, and hold it"
    )]
    Unstable,
    /// A Lyapunov equation could not be solved as exactly as is promised.
    #[error(
        "the residual of a Lyapunov equation is {found:.1e}, and at most {allowed:.0e} is promised; give the system more damping"
    )]
    Residual {
        /// The relative residual found.
        found: f64,
        /// The one promised.
        allowed: f64,
    },
    /// An option is outside what is allowed.
    #[error("{what} is {value}; it must be {allowed}")]
    Option {
        /// The option with its unit.
        what: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The samples to be compared do not follow one another.
    #[error("sample {index} has sequence number {found}, not {expected}")]
    Samples {
        /// Index in the list.
        index: usize,
        /// Its sequence number.
        found: u64,
        /// The one that follows its predecessor's.
        expected: u64,
    },
}
