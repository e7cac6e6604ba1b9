//! The solver used in a step.

/// Solver used in the steps of an advance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SolvedBy {
    /// None: semi-implicit Euler.
    #[default]
    Nothing,
    /// Sparse Cholesky factorisation in each step.
    Cholesky,
    /// Preconditioned conjugate gradients.
    ConjugateGradients {
        /// Maximum number of iterations in a step.
        iterations: usize,
    },
}
