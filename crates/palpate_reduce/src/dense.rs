//! A second-order system with full matrices: what a projection makes of a body.

use crate::system::combine;
use crate::{ReduceError, SecondOrderSystem, StateSpace};
use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, Side, c64};

/// [`SecondOrderSystem`] with full matrices, M among them, in coordinates that may be no single node's.
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

impl SecondOrderSystem {
    /// The projection by congruence on the columns of `v` (unknowns × p): q = V q̃, M̃ = VᵀMV, B̃ = VᵀBV, K̃ = VᵀKV,
    /// B̃_rc = VᵀB_rc, K̃_rc = VᵀK_rc. Whatever V of full rank, M̃, B̃ and K̃ are symmetric and as definite as M, B and
    /// K: what is passive stays passive.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when `v` has another number of rows than this system unknowns, or no columns.
    pub fn project(&self, v: MatRef<'_, f64>) -> Result<DenseSystem, ReduceError> {
        for (what, value, ok, allowed) in [
            ("rows of the basis", v.nrows(), v.nrows() == self.unknowns(), "the number of unknowns"),
            ("columns of the basis", v.ncols(), v.ncols() > 0, "at least 1"),
        ] {
            if !ok {
                return Err(ReduceError::Option { what, value: value as f64, allowed });
            }
        }
        let p = v.ncols();
        let weighted = Mat::from_fn(v.nrows(), p, |i, j| self.mass[i] * v[(i, j)]);
        // Exactly symmetric, whatever the rounding.
        let symmetric = |m: Mat<f64>| Mat::from_fn(p, p, |i, j| 0.5 * (m[(i, j)] + m[(j, i)]));
        Ok(DenseSystem {
            mass: symmetric(v.transpose() * weighted),
            damping: symmetric(v.transpose() * (self.damping.as_ref() * v)),
            stiffness: symmetric(v.transpose() * (self.stiffness.as_ref() * v)),
            damping_rc: v.transpose() * &self.damping_rc,
            stiffness_rc: v.transpose() * &self.stiffness_rc,
            damping_cc: self.damping_cc.clone(),
            stiffness_cc: self.stiffness_cc.clone(),
        })
    }
}

impl DenseSystem {
    /// Number of second-order unknowns; the order of the system in state space is twice that.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.mass.nrows()
    }

    /// The exact state space: q' = M⁻¹(y − B q − B_rc u), y' = −K q − K_rc u, so that
    ///
    /// ```text
    /// A = [−M⁻¹B  M⁻¹; −K  0],  B = [−M⁻¹B_rc; −K_rc],  C = [K_cr − B_cr M⁻¹ B,  B_cr M⁻¹],
    /// D = K_cc − B_cr M⁻¹ B_rc,  E = B_cc
    /// ```
    ///
    /// with the second half of the state divided by a typical momentum per metre, so that both halves are of like
    /// size.
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

    /// The poles, 1/s, by ascending absolute value: the eigenvalues λ of λ²M + λB + K.
    ///
    /// Fast ones are the large eigenvalues of A of [`DenseSystem::state_space`], slow ones those of its inverse, so that
    /// both have full relative accuracy when they are far apart, as in an overdamped body.
    ///
    /// # Errors
    /// As [`DenseSystem::state_space`]; [`ReduceError::Eigenvalues`] when they are not found.
    pub fn poles(&self) -> Result<Vec<c64>, ReduceError> {
        let mut poles = self.state_space()?.poles()?;
        // The widest gap is where slow ends and fast begins.
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

    /// A⁻¹ = [0  −K⁻¹; M  −BK⁻¹], its halves scaled like those of A; from K⁻¹, which knows nothing of fast poles.
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

    /// G at each of the complex frequencies `s` (1/s), by a dense factorisation at each; not finite at a pole.
    #[must_use]
    pub fn response(&self, s: &[c64]) -> Vec<Mat<c64>> {
        let n = self.unknowns();
        s.iter()
            .map(|&s| {
                let dynamic = Mat::from_fn(n, n, |i, j| {
                    s * s * self.mass[(i, j)] + s * self.damping[(i, j)] + self.stiffness[(i, j)]
                });
                let coupling = combine(self.stiffness_rc.as_ref(), self.damping_rc.as_ref(), s);
                let direct = combine(self.stiffness_cc.as_ref(), self.damping_cc.as_ref(), s);
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
