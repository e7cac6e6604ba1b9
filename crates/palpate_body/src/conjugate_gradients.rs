//! Preconditioned conjugate gradients for symmetric positive definite systems (M. R. Hestenes and E. Stiefel, J. Res. Natl.
//! Bur. Stand. 49 (1952) 409).

use std::ops::{Add, AddAssign, Mul, SubAssign};

/// The operators and limits of a solution. Vectors have elements `T`: numbers, or one vector for each node.
pub(crate) struct ConjugateGradients<M, P, D, C> {
    /// Writes the matrix times a vector.
    pub(crate) multiply: M,
    /// Writes the preconditioner times a residual.
    pub(crate) precondition: P,
    /// The scalar product of two vectors.
    pub(crate) dot: D,
    /// Whether a residual r is small enough; its second argument is r · P r.
    pub(crate) is_converged: C,
    pub(crate) max_iterations: usize,
}

/// Why no solution was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SolveError {
    /// The matrix is not positive definite.
    Indefinite,
    /// The iterations are used up.
    NotConverged,
}

impl<M, P, D, C> ConjugateGradients<M, P, D, C> {
    /// Improves `x`, whose residual is `r`, until it is a solution. Returns the number of iterations.
    ///
    /// # Errors
    /// [`SolveError`]; `x` is then the last approximation.
    pub(crate) fn solve<T>(&self, x: &mut [T], r: &mut [T]) -> Result<usize, SolveError>
    where
        T: Copy + Default + Add<Output = T> + Mul<f64, Output = T> + AddAssign + SubAssign,
        M: Fn(&[T], &mut [T]),
        P: Fn(&[T], &mut [T]),
        D: Fn(&[T], &[T]) -> f64,
        C: Fn(&[T], f64) -> bool,
    {
        let n = x.len();
        let (mut z, mut product) = (vec![T::default(); n], vec![T::default(); n]);
        (self.precondition)(r, &mut z);
        let (mut p, mut rz) = (z.clone(), (self.dot)(r, &z));
        for iterations in 0..self.max_iterations {
            if (self.is_converged)(r, rz) {
                return Ok(iterations);
            }
            (self.multiply)(&p, &mut product);
            let curvature = (self.dot)(&p, &product);
            if curvature.is_nan() || curvature <= 0.0 {
                return Err(SolveError::Indefinite);
            }
            let alpha = rz / curvature;
            for i in 0..n {
                x[i] += p[i] * alpha;
                r[i] -= product[i] * alpha;
            }
            (self.precondition)(r, &mut z);
            let next = (self.dot)(r, &z);
            let beta = next / rz;
            rz = next;
            for i in 0..n {
                p[i] = z[i] + p[i] * beta;
            }
        }
        Err(SolveError::NotConverged)
    }
}
