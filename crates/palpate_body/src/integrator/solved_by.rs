//! The solver that a step used.

/// What solved for the steps of a model step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SolvedBy {
    /// Nothing had to be solved: semi-implicit Euler.
    #[default]
    Nothing,
    /// A sparse Cholesky factorisation at each step.
    Cholesky,
    /// Preconditioned conjugate gradients.
    ConjugateGradients {
        /// The most iterations that a step took.
        iterations: usize,
    },
}
