//! Transfer functions in pole-residue form, for evaluation at many frequencies.

use crate::{ReduceError, StateSpace};
use faer::linalg::solvers::Solve;
use faer::{Mat, c64};

/// The strictly proper part of a transfer function in pole-residue form, C (s − A)⁻¹ B = Σ_i c_i b_iᵀ / (s − λ_i).
///
/// With the eigendecomposition A = V Λ V⁻¹, c_i is column i of C V and b_iᵀ is row i of V⁻¹B. It is computed once; an evaluation
/// then takes a few operations for each pole. Where A is nearly defective, as with a critically damped mode, the eigenvectors are
/// ill-conditioned. [`PoleResidue::check`] measures the loss of accuracy against a dense factorisation.
#[derive(Clone, Debug)]
pub struct PoleResidue {
    poles: Vec<c64>,
    /// C V, m × n.
    output: Mat<c64>,
    /// V⁻¹ B, n × m.
    input: Mat<c64>,
}

impl PoleResidue {
    /// Computes the poles and residues of the strictly proper part of `system`.
    ///
    /// # Errors
    /// [`ReduceError::Eigenvalues`] when the eigenvalue iteration does not converge, or its residual is too large.
    pub fn new(system: &StateSpace) -> Result<Self, ReduceError> {
        let order = system.order();
        let complex = |m: &Mat<f64>| Mat::from_fn(m.nrows(), m.ncols(), |i, j| c64::new(m[(i, j)], 0.0));
        // A is passed as a complex matrix: for real ones with repeated pairs, as in symmetric lattices, faer 0.24 returns vectors that are
        // not eigenvectors.
        let a = complex(&system.a);
        let eigen = a.eigen().map_err(|_| ReduceError::Eigenvalues { order })?;
        let v = eigen.U().to_owned();
        let scaled = Mat::from_fn(order, order, |i, j| v[(i, j)] * eigen.S().column_vector()[j]);
        let residual = (&a * &v - scaled).norm_l2() / (system.a.norm_l2() * v.norm_l2());
        if residual.is_nan() || residual > 1e-10 {
            return Err(ReduceError::Eigenvalues { order });
        }
        let input = v.partial_piv_lu().solve(complex(&system.b));
        let poles = eigen.S().column_vector().iter().copied().collect();
        Ok(Self { poles, output: complex(&system.c) * v, input })
    }

    /// The poles, 1/s, in no particular order.
    #[must_use]
    pub fn poles(&self) -> &[c64] {
        &self.poles
    }

    /// The strictly proper part at the complex frequency `s`, 1/s.
    #[must_use]
    pub fn at(&self, s: c64) -> Mat<c64> {
        let m = self.input.ncols();
        let mut sum = Mat::zeros(m, m);
        for (i, &pole) in self.poles.iter().enumerate() {
            let weight = c64::new(1.0, 0.0) / (s - pole);
            for column in 0..m {
                let driven = weight * self.input[(i, column)];
                for row in 0..m {
                    sum[(row, column)] += self.output[(row, i)] * driven;
                }
            }
        }
        sum
    }

    /// Sum of the norms of the terms of [`PoleResidue::at`]: the scale of rounding errors where the terms cancel.
    pub(crate) fn sum_of_norms(&self, s: c64) -> f64 {
        let term = |(i, &pole): (usize, &c64)| {
            let (output, input) = (self.output.as_ref().subcols(i, 1), self.input.as_ref().subrows(i, 1));
            output.norm_l2() * input.norm_l2() / (s - pole).norm()
        };
        self.poles.iter().enumerate().map(term).sum()
    }

    /// Relative difference between [`PoleResidue::at`] and a dense factorisation of `system` at `s`.
    #[must_use]
    pub fn check(&self, system: &StateSpace, s: c64) -> f64 {
        let exact = &system.proper_response(&[s])[0];
        (exact - self.at(s)).norm_l2() / exact.norm_l2()
    }
}
