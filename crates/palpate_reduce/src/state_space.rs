//! State-space systems with a separate improper part.

use crate::ReduceError;
use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, c64};

/// A linear system with transfer function G(s) = E s + D + C (s − A)⁻¹ B from displacement, m, to force, N.
///
/// Dampers at the driven node make G improper: E is their damping. Reductions approximate the strictly proper part
/// C (s − A)⁻¹ B and keep D and E. E s + D is the high-frequency asymptote of G.
#[derive(Clone, Debug)]
pub struct StateSpace {
    /// A, n × n.
    pub a: Mat<f64>,
    /// B, n × m.
    pub b: Mat<f64>,
    /// C, m × n.
    pub c: Mat<f64>,
    /// D, m × m, N/m.
    pub d: Mat<f64>,
    /// E, m × m, N s/m.
    pub e: Mat<f64>,
}

impl StateSpace {
    /// Number n of states.
    #[must_use]
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// The strictly proper part C (s − A)⁻¹ B at each of the complex frequencies `s`, 1/s, by a dense factorisation each. Not finite at
    /// a pole.
    #[must_use]
    pub fn proper_response(&self, s: &[c64]) -> Vec<Mat<c64>> {
        let complex = |matrix: &Mat<f64>| {
            Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| c64::new(matrix[(i, j)], 0.0))
        };
        let (b, c) = (complex(&self.b), complex(&self.c));
        s.iter()
            .map(|&s| {
                let shifted = Mat::from_fn(self.order(), self.order(), |i, j| {
                    c64::new(-self.a[(i, j)], 0.0) + if i == j { s } else { c64::new(0.0, 0.0) }
                });
                &c * shifted.partial_piv_lu().solve(&b)
            })
            .collect()
    }

    /// G at each of the complex frequencies `s`, 1/s. Not finite at a pole.
    #[must_use]
    pub fn response(&self, s: &[c64]) -> Vec<Mat<c64>> {
        let improper = s.iter().map(|&s| dynamic_block(self.d.as_ref(), self.e.as_ref(), s));
        self.proper_response(s)
            .into_iter()
            .zip(improper)
            .map(|(proper, improper)| proper + improper)
            .collect()
    }

    /// The static gain G(0), N/m.
    ///
    /// # Errors
    /// [`ReduceError::Pole`] when zero is a pole.
    pub fn dc_gain(&self) -> Result<Mat<f64>, ReduceError> {
        let gain = &self.d - &self.c * self.a.partial_piv_lu().solve(&self.b);
        let finite = (0..gain.nrows()).all(|i| (0..gain.ncols()).all(|j| gain[(i, j)].is_finite()));
        if finite { Ok(gain) } else { Err(ReduceError::Pole { re: 0.0, im: 0.0 }) }
    }

    /// The poles (eigenvalues of A), 1/s, in ascending order of absolute value.
    ///
    /// # Errors
    /// [`ReduceError::Eigenvalues`] when the eigenvalue iteration does not converge.
    pub fn poles(&self) -> Result<Vec<c64>, ReduceError> {
        let mut poles = self.a.eigenvalues().map_err(|_| ReduceError::Eigenvalues { order: self.order() })?;
        poles.sort_by(|a, b| a.norm().total_cmp(&b.norm()).then(a.im.total_cmp(&b.im)));
        Ok(poles)
    }
}

/// K + s B at the complex frequency `s`.
pub(crate) fn dynamic_block(k: MatRef<'_, f64>, b: MatRef<'_, f64>, s: c64) -> Mat<c64> {
    Mat::from_fn(k.nrows(), k.ncols(), |i, j| c64::new(k[(i, j)], 0.0) + s * b[(i, j)])
}
