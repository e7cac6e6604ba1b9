//! Gramians in factored form, by the squared Smith method.

use crate::{ReduceError, StateSpace};
use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef};

/// Factors of the controllability and observability Gramians of a stable system, P = Z_c Z_cᵀ and Q = Z_o Z_oᵀ, with
///
/// ```text
/// A P + P Aᵀ + B Bᵀ = 0,    Aᵀ Q + Q A + Cᵀ C = 0
/// ```
///
/// # Method
///
/// With a shift p > 0 the Cayley transform S = (A − p)⁻¹(A + p) turns the first into P = S P Sᵀ + 2p R Rᵀ,
/// R = (A − p)⁻¹B, whose solution Σ Sⁱ (2p R Rᵀ) Sᵀⁱ is summed by doubling: Z ← [Z, S Z], S ← S² (R. A. Smith,
/// SIAM J. Appl. Math. 16 (1968) 198; T. Penzl, SIAM J. Sci. Comput. 21 (1999) 1401). Each doubling squares the
/// remainder, so convergence is quadratic. The factor has few columns because the system has few inputs; each doubling
/// truncates it to its numerical rank. Both Gramians share the powers of S.
#[derive(Clone, Debug)]
pub struct Gramians {
    /// Factor Z_c of the controllability Gramian, n × k.
    pub controllability: Mat<f64>,
    /// Factor Z_o of the observability Gramian, n × k.
    pub observability: Mat<f64>,
    /// Residual ‖A P + P Aᵀ + B Bᵀ‖ / ‖B Bᵀ‖, Frobenius norm. For lightly damped systems P is large, and the residual exceeds rounding even
    /// if P is exact to the last bit.
    pub controllability_residual: f64,
    /// Residual ‖Aᵀ Q + Q A + Cᵀ C‖ / ‖Cᵀ C‖, Frobenius norm.
    pub observability_residual: f64,
    /// Number of doublings.
    pub doublings: usize,
}

/// Relative singular value below which a column of a factor is dropped; its square is the relative error of P.
const RANK_TOLERANCE: f64 = 1e-15;
/// Maximum number of doublings. Beyond it, a pole is on the imaginary axis to within rounding.
const MAX_DOUBLINGS: usize = 48;
/// Maximum residual relative to the terms of the equation.
const MAX_RESIDUAL: f64 = 1e-10;

impl Gramians {
    /// Computes the Gramians of `system`.
    ///
    /// # Errors
    /// [`ReduceError::Unstable`] when a pole is not in the open left half-plane, and the iteration therefore does not converge;
    /// [`ReduceError::Residual`] when the residual is too large.
    pub fn new(system: &StateSpace) -> Result<Self, ReduceError> {
        let n = system.order();
        let p = shift(system.a.as_ref());
        let shifted =
            |sign: f64| Mat::from_fn(n, n, |i, j| system.a[(i, j)] + if i == j { sign * p } else { 0.0 });
        let lu = shifted(-1.0).partial_piv_lu();
        let mut s = lu.solve(shifted(1.0));
        let root = (2.0 * p).sqrt();
        let mut z_c = compress(lu.solve(&system.b) * faer::Scale(root))?;
        let mut z_o = compress(lu.solve_transpose(system.c.transpose()) * faer::Scale(root))?;
        let mut doublings = 0;
        loop {
            let (next_c, next_o) = (&s * &z_c, s.transpose() * &z_o);
            let remainder = (next_c.norm_l2() / z_c.norm_l2()).max(next_o.norm_l2() / z_o.norm_l2());
            if !remainder.is_finite() || doublings == MAX_DOUBLINGS {
                return Err(ReduceError::Unstable);
            }
            z_c = compress(concatenate(&z_c, &next_c))?;
            z_o = compress(concatenate(&z_o, &next_o))?;
            doublings += 1;
            if remainder < 1e-16 {
                break;
            }
            s = &s * &s;
        }
        let (controllability_residual, relative_c) =
            residual(system.a.as_ref(), system.b.as_ref(), z_c.as_ref());
        let (observability_residual, relative_o) =
            residual(system.a.transpose(), system.c.transpose(), z_o.as_ref());
        let worst = relative_c.max(relative_o);
        if worst.is_nan() || worst > MAX_RESIDUAL {
            return Err(ReduceError::Residual { found: worst, allowed: MAX_RESIDUAL });
        }
        Ok(Self {
            controllability: z_c,
            observability: z_o,
            controllability_residual,
            observability_residual,
            doublings,
        })
    }
}

/// The Smith shift √(‖A‖ / ‖A⁻¹‖), Frobenius norm: the geometric mean of bounds of the fastest and the slowest pole.
fn shift(a: MatRef<'_, f64>) -> f64 {
    let inverse = a.partial_piv_lu().solve(Mat::<f64>::identity(a.nrows(), a.ncols()));
    (a.norm_l2() / inverse.norm_l2()).sqrt()
}

/// The columns of `left`, then those of `right`.
fn concatenate(left: &Mat<f64>, right: &Mat<f64>) -> Mat<f64> {
    let split = left.ncols();
    Mat::from_fn(left.nrows(), split + right.ncols(), |i, j| {
        if j < split { left[(i, j)] } else { right[(i, j - split)] }
    })
}

/// A factor of the same product Z Zᵀ with as few columns as its numerical rank.
fn compress(z: Mat<f64>) -> Result<Mat<f64>, ReduceError> {
    // The factor of an unstable system overflows after a few doublings.
    if !z.norm_l2().is_finite() {
        return Err(ReduceError::Unstable);
    }
    let svd = z.thin_svd().map_err(|_| ReduceError::Eigenvalues { order: z.ncols() })?;
    let (u, sigma) = (svd.U(), svd.S().column_vector());
    let rank = (0..sigma.nrows()).take_while(|&i| sigma[i] > RANK_TOLERANCE * sigma[0]).count();
    Ok(Mat::from_fn(z.nrows(), rank.max(1), |i, j| u[(i, j)] * sigma[j]))
}

/// The residual ‖A Z Zᵀ + Z Zᵀ Aᵀ + B Bᵀ‖ relative to ‖B Bᵀ‖, and relative to the sum of its terms, 2 ‖A‖ ‖Z Zᵀ‖ + ‖B Bᵀ‖.
fn residual(a: MatRef<'_, f64>, b: MatRef<'_, f64>, z: MatRef<'_, f64>) -> (f64, f64) {
    let half = (a * z) * z.transpose();
    let driven = b * b.transpose();
    let n = a.nrows();
    let residual = Mat::from_fn(n, n, |i, j| half[(i, j)] + half[(j, i)] + driven[(i, j)]).norm_l2();
    // ‖Z Zᵀ‖ = ‖Zᵀ Z‖; the latter matrix is smaller.
    let terms = 2.0 * a.norm_l2() * (z.transpose() * z).norm_l2() + driven.norm_l2();
    (residual / driven.norm_l2(), residual / terms)
}
