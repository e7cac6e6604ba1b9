//! Why a local model could not be built or judged.

use palpate_body::BodyError;
use palpate_local::LocalModelError;
use thiserror::Error;

/// What went wrong on the way from a body to a local model.
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
    /// Neither the exact nor the clamped tangent is positive definite: a part of the body hangs on nothing.
    #[error("the tangent is singular at pivot {pivot} even when clamped; is every part of the body held?")]
    Singular {
        /// The pivot that failed.
        pivot: usize,
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
