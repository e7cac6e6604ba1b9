//! State space, with the improper part kept apart.

use crate::{ReduceError, SecondOrderSystem};
use faer::linalg::solvers::Solve;
use faer::{Mat, c64};

/// G(s) = E s + D + C (s − A)⁻¹ B.
///
/// Dampers at the driven node make the transfer function improper: E is their damping. What is reduced is the
/// strictly proper part C (s − A)⁻¹ B; D and E are kept.
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
    /// The exact state space of `system`: q' = M⁻¹(y − B_rr q − B_rc u), y' = −K_rr q − K_rc u, so that
    ///
    /// ```text
    /// A = [−M⁻¹B_rr  M⁻¹; −K_rr  0],  B = [−M⁻¹B_rc; −K_rc],  C = [K_cr − B_cr M⁻¹ B_rr,  B_cr M⁻¹],
    /// D = K_cc − B_cr M⁻¹ B_rc,  E = B_cc
    /// ```
    ///
    /// with the second half of the state divided by a typical momentum per metre, so that both halves are of like
    /// size.
    #[must_use]
    pub fn exact(system: &SecondOrderSystem) -> Self {
        let (n, m) = (system.unknowns(), system.inputs());
        let scale = momentum_scale(system);
        let mut a = Mat::zeros(2 * n, 2 * n);
        for t in system.damping.triplet_iter() {
            a[(t.row, t.col)] = -t.val / system.mass[t.row];
        }
        for t in system.stiffness.triplet_iter() {
            a[(n + t.row, t.col)] = -t.val / scale;
        }
        for (i, mass) in system.mass.iter().enumerate() {
            a[(i, n + i)] = scale / mass;
        }
        let (k, b) = (&system.stiffness_rc, &system.damping_rc);
        let over_mass = Mat::from_fn(n, m, |i, j| b[(i, j)] / system.mass[i]);
        let mut input = Mat::zeros(2 * n, m);
        let mut output = Mat::zeros(m, 2 * n);
        // B_cr M⁻¹ B_rr, transposed: B_rr is symmetric.
        let damped = system.damping.as_ref() * &over_mass;
        for i in 0..n {
            for j in 0..m {
                input[(i, j)] = -over_mass[(i, j)];
                input[(n + i, j)] = -k[(i, j)] / scale;
                output[(j, i)] = k[(i, j)] - damped[(i, j)];
                output[(j, n + i)] = over_mass[(i, j)] * scale;
            }
        }
        let d = &system.stiffness_cc - b.transpose() * &over_mass;
        Self { a, b: input, c: output, d, e: system.damping_cc.clone() }
    }

    /// n.
    #[must_use]
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// The strictly proper part C (s − A)⁻¹ B at each of `s` (1/s), by a dense factorisation at each.
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

    /// G at each of `s` (1/s).
    #[must_use]
    pub fn response(&self, s: &[c64]) -> Vec<Mat<c64>> {
        let improper = s.iter().map(|&s| crate::system::combine(self.d.as_ref(), self.e.as_ref(), s));
        self.proper_response(s)
            .into_iter()
            .zip(improper)
            .map(|(proper, improper)| proper + improper)
            .collect()
    }

    /// G(0).
    ///
    /// # Errors
    /// [`ReduceError::Pole`] when zero is a pole.
    pub fn dc_gain(&self) -> Result<Mat<f64>, ReduceError> {
        let gain = &self.d - &self.c * self.a.partial_piv_lu().solve(&self.b);
        let finite = (0..gain.nrows()).all(|i| (0..gain.ncols()).all(|j| gain[(i, j)].is_finite()));
        if finite { Ok(gain) } else { Err(ReduceError::Pole { re: 0.0, im: 0.0 }) }
    }

    /// The poles, the eigenvalues of A, 1/s, by ascending absolute value.
    ///
    /// # Errors
    /// [`ReduceError::Eigenvalues`] when they are not found.
    pub fn poles(&self) -> Result<Vec<c64>, ReduceError> {
        let mut poles = self.a.eigenvalues().map_err(|_| ReduceError::Eigenvalues { order: self.order() })?;
        poles.sort_by(|a, b| a.norm().total_cmp(&b.norm()).then(a.im.total_cmp(&b.im)));
        Ok(poles)
    }
}

/// √(k̄ m̄) of the mean diagonal stiffness and mass, kg/s.
fn momentum_scale(system: &SecondOrderSystem) -> f64 {
    let n = system.unknowns() as f64;
    let k: f64 = (0..system.unknowns()).filter_map(|i| system.stiffness.as_ref().get(i, i)).sum();
    let m: f64 = system.mass.iter().sum();
    ((k / n) * (m / n)).sqrt()
}
