//! Bases for the projection of second-order systems: rational Krylov bases and modes.

use crate::{ReduceError, SecondOrderSystem};
use faer::{Mat, MatRef, Side};

/// Relative length below which the independent part of a column is rounding.
const RANK_TOLERANCE: f64 = 1e-10;

impl SecondOrderSystem {
    /// An orthonormal rational Krylov basis of second order, unknowns × p (Z. Bai and Y. Su, SIAM J. Sci. Comput. 26 (2005) 1692;
    /// C. Beattie and S. Gugercin, Syst. Control Lett. 58 (2009) 225).
    ///
    /// It spans the static response K⁻¹K_rc, the high-frequency end M⁻¹K_rc and M⁻¹B_rc, and (σ²M + σB + K)⁻¹(K_rc + σB_rc) at each
    /// real σ of `shifts_per_s`, 1/s. The projection onto it has exactly the G(0), G(σ), D and E of this system. Columns that depend
    /// on those before them to 1e-10 are dropped. With B proportional to K and equal masses, inputs × (shifts + 2) are left.
    ///
    /// # Errors
    /// [`ReduceError::Option`] for a shift that is not above zero, or whose square times a mass is not finite;
    /// [`ReduceError::Singular`] when K is not positive definite.
    pub fn krylov_basis(&self, shifts_per_s: &[f64]) -> Result<Mat<f64>, ReduceError> {
        let max_mass = self.mass.iter().copied().fold(0.0, f64::max);
        let is_valid = |s: f64| s > 0.0 && (s * s * max_mass).is_finite();
        if let Some(&value) = shifts_per_s.iter().find(|s| !is_valid(**s)) {
            let (what, allowed) = ("shift, 1/s", "above 0, and its square times the largest mass finite");
            return Err(ReduceError::Option { what, value, allowed });
        }
        let mut dynamic = self.dynamic_stiffness();
        let (k, b) = (&self.stiffness_rc, &self.damping_rc);
        let over_mass =
            |rc: &Mat<f64>| Mat::from_fn(rc.nrows(), rc.ncols(), |i, j| rc[(i, j)] / self.mass[i]);
        let mut blocks = vec![dynamic.solve_real(0.0, k.as_ref())?, over_mass(k), over_mass(b)];
        for &sigma in shifts_per_s {
            let rhs = Mat::from_fn(k.nrows(), k.ncols(), |i, j| k[(i, j)] + sigma * b[(i, j)]);
            blocks.push(dynamic.solve_real(sigma, rhs.as_ref())?);
        }
        Ok(orthonormal(self.unknowns(), &blocks))
    }

    /// The `modes` undamped modes of lowest frequency, K x = ω² M x with xᵀMx = 1, as columns: the basis of modal truncation.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when `modes` is zero or above the number of unknowns; [`ReduceError::Eigenvalues`] when
    /// the eigenvalue iteration does not converge.
    pub fn modal_basis(&self, modes: usize) -> Result<Mat<f64>, ReduceError> {
        let n = self.unknowns();
        if !(1..=n).contains(&modes) {
            let (what, allowed) = ("number of modes", "at least 1 and at most the number of unknowns");
            return Err(ReduceError::Option { what, value: modes as f64, allowed });
        }
        let eigen = self.weighted().self_adjoint_eigen(Side::Lower);
        let eigen = eigen.map_err(|_| ReduceError::Eigenvalues { order: n })?;
        let u = eigen.U();
        Ok(Mat::from_fn(n, modes, |i, j| u[(i, j)] / self.mass[i].sqrt()))
    }

    /// The natural frequencies ω of the undamped modes, K x = ω² M x, rad/s, ascending.
    ///
    /// # Errors
    /// [`ReduceError::Eigenvalues`] when the eigenvalue iteration does not converge.
    pub fn natural_frequencies_rad_per_s(&self) -> Result<Vec<f64>, ReduceError> {
        let squares = self.weighted().self_adjoint_eigenvalues(Side::Lower);
        let squares = squares.map_err(|_| ReduceError::Eigenvalues { order: self.unknowns() })?;
        Ok(squares.into_iter().map(|square| square.max(0.0).sqrt()).collect())
    }

    /// M^(−1/2) K M^(−1/2).
    fn weighted(&self) -> Mat<f64> {
        let mut weighted = Mat::zeros(self.unknowns(), self.unknowns());
        for t in self.stiffness.triplet_iter() {
            weighted[(t.row, t.col)] = t.val / (self.mass[t.row] * self.mass[t.col]).sqrt();
        }
        weighted
    }
}

/// An orthonormal basis of all columns of `blocks`, in order, by Gram-Schmidt with reorthogonalisation.
fn orthonormal(rows: usize, blocks: &[Mat<f64>]) -> Mat<f64> {
    let count: usize = blocks.iter().map(Mat::ncols).sum();
    let mut basis = Mat::zeros(rows, count.min(rows));
    let mut rank = 0;
    for column in blocks.iter().flat_map(|block| (0..block.ncols()).map(|j| block.as_ref().subcols(j, 1))) {
        let size = column.norm_l2();
        if size == 0.0 || rank == basis.ncols() {
            continue;
        }
        let mut rest = column * faer::Scale(1.0 / size);
        for _ in 0..2 {
            let columns: MatRef<'_, f64> = basis.as_ref().subcols(0, rank);
            rest -= columns * (columns.transpose() * &rest);
        }
        let norm = rest.norm_l2();
        if norm > RANK_TOLERANCE {
            (0..rows).for_each(|i| basis[(i, rank)] = rest[(i, 0)] / norm);
            rank += 1;
        }
    }
    basis.subcols(0, rank).to_owned()
}
