//! Second-order systems with full matrices, in particular the projections of a body.

use crate::ReduceError;
use crate::state_space::{StateSpace, dynamic_block};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side, c64};

/// A second-order system with full matrices M, B and K, in generalised coordinates. The equations are those of
/// [`SecondOrderSystem`](crate::SecondOrderSystem).
#[derive(Clone, Debug)]
pub struct DenseSystem {
    /// M, kg.
    pub mass: Mat<f64>,
    /// B, N s/m.
    pub damping: Mat<f64>,
    /// K, N/m.
    pub stiffness: Mat<f64>,
    /// B_rc, N s/m.
    pub damping_rc: Mat<f64>,
    /// K_rc, N/m.
    pub stiffness_rc: Mat<f64>,
    /// B_cc, N s/m.
    pub damping_cc: Mat<f64>,
    /// K_cc, N/m.
    pub stiffness_cc: Mat<f64>,
}

impl DenseSystem {
    /// Number of second-order unknowns, half the order in state space.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.mass.nrows()
    }

    /// The equivalent state-space system, with q' = M⁻¹(y − B q − B_rc u), y' = −K q − K_rc u:
    ///
    /// ```text
    /// A = [−M⁻¹B  M⁻¹; −K  0],  B = [−M⁻¹B_rc; −K_rc],  C = [K_cr − B_cr M⁻¹ B,  B_cr M⁻¹],
    /// D = K_cc − B_cr M⁻¹ B_rc,  E = B_cc
    /// ```
    ///
    /// The second half of the state is divided by a typical momentum per metre, which balances the two halves.
    ///
    /// # Errors
    /// [`ReduceError::Mass`] when M is not positive definite; [`ReduceError::Option`] when there are no unknowns.
    pub fn state_space(&self) -> Result<StateSpace, ReduceError> {
        let (n, m) = (self.unknowns(), self.stiffness_cc.nrows());
        if n == 0 {
            return Err(ReduceError::Option {
                what: "number of unknowns",
                value: 0.0,
                allowed: "at least 1",
            });
        }
        let mass = self.mass.llt(Side::Lower).map_err(|error| {
            let faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index } = error;
            ReduceError::Mass { pivot: index }
        })?;
        let scale = self.momentum_scale();
        let inverse = mass.solve(Mat::<f64>::identity(n, n));
        let rates = &inverse * &self.damping;
        let driven = &inverse * &self.damping_rc;
        let (k, b) = (&self.stiffness_rc, &self.damping_rc);
        // B_cr M⁻¹ B; M and B are symmetric.
        let damped = b.transpose() * &rates;
        let a = Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, true) => -rates[(i, j)],
            (true, false) => scale * inverse[(i, j - n)],
            (false, true) => -self.stiffness[(i - n, j)] / scale,
            (false, false) => 0.0,
        });
        let input =
            Mat::from_fn(2 * n, m, |i, j| if i < n { -driven[(i, j)] } else { -k[(i - n, j)] / scale });
        let output = Mat::from_fn(m, 2 * n, |j, i| {
            if i < n { k[(i, j)] - damped[(j, i)] } else { scale * driven[(i - n, j)] }
        });
        let d = &self.stiffness_cc - b.transpose() * &driven;
        Ok(StateSpace { a, b: input, c: output, d, e: self.damping_cc.clone() })
    }

    /// The poles, 1/s, in ascending order of absolute value: the eigenvalues λ of λ²M + λB + K.
    ///
    /// Fast poles are computed as eigenvalues of A of [`DenseSystem::state_space`], slow ones from those of A⁻¹. Both then have full
    /// relative accuracy even if they are far apart, as in an overdamped body.
    ///
    /// # Errors
    /// As [`DenseSystem::state_space`]; [`ReduceError::Eigenvalues`] when the eigenvalue iteration does not converge.
    pub fn poles(&self) -> Result<Vec<c64>, ReduceError> {
        let mut poles = self.state_space()?.poles()?;
        // The widest gap separates slow poles from fast ones.
        let gap = |i: &usize| poles[i + 1].norm() / poles[*i].norm();
        let widest = (0..poles.len() - 1).max_by(|a, b| gap(a).total_cmp(&gap(b)));
        if let Some(last) = widest.filter(|last| gap(last) > 10.0) {
            let mut slow = self.inverse_of_a().eigenvalues();
            let slow = slow.as_mut().map_err(|_| ReduceError::Eigenvalues { order: poles.len() })?;
            slow.iter_mut().for_each(|value| *value = c64::new(1.0, 0.0) / *value);
            slow.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
            poles[..=last].copy_from_slice(&slow[..=last]);
        }
        poles.sort_by(|a, b| a.norm().total_cmp(&b.norm()).then(a.im.total_cmp(&b.im)));
        Ok(poles)
    }

    /// A⁻¹ = [0  −K⁻¹; M  −BK⁻¹], scaled like A. Computed from K⁻¹, whose accuracy does not depend on the fast poles.
    fn inverse_of_a(&self) -> Mat<f64> {
        let (n, scale) = (self.unknowns(), self.momentum_scale());
        let compliance = self.stiffness.partial_piv_lu().solve(Mat::<f64>::identity(n, n));
        let damped = &self.damping * &compliance;
        Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, true) => 0.0,
            (true, false) => -scale * compliance[(i, j - n)],
            (false, true) => self.mass[(i - n, j)] / scale,
            (false, false) => -damped[(i - n, j - n)],
        })
    }

    /// G at each of the complex frequencies `s`, 1/s, by a dense factorisation each. Not finite at a pole.
    #[must_use]
    pub fn response(&self, s: &[c64]) -> Vec<Mat<c64>> {
        let n = self.unknowns();
        s.iter()
            .map(|&s| {
                let dynamic = Mat::from_fn(n, n, |i, j| {
                    s * s * self.mass[(i, j)] + s * self.damping[(i, j)] + self.stiffness[(i, j)]
                });
                let coupling = dynamic_block(self.stiffness_rc.as_ref(), self.damping_rc.as_ref(), s);
                let direct = dynamic_block(self.stiffness_cc.as_ref(), self.damping_cc.as_ref(), s);
                direct - coupling.transpose() * dynamic.partial_piv_lu().solve(&coupling)
            })
            .collect()
    }

    /// √(k̄ m̄) of the mean diagonal stiffness and mass, kg/s.
    fn momentum_scale(&self) -> f64 {
        let n = self.unknowns();
        let mean = |matrix: &Mat<f64>| (0..n).map(|i| matrix[(i, i)]).sum::<f64>() / n as f64;
        (mean(&self.stiffness) * mean(&self.mass)).sqrt()
    }
}
