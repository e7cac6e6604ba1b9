//! Gramians in factored form, by the squared Smith method.

use crate::{ReduceError, StateSpace};
use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef};

/// Factors of both Gramians of a stable system: P = Z_c Z_cᵀ and Q = Z_o Z_oᵀ with
///
/// ```text
/// A P + P Aᵀ + B Bᵀ = 0,    Aᵀ Q + Q A + Cᵀ C = 0
/// ```
///
/// # Method
///
/// With a shift p > 0 the Cayley transform S = (A − p)⁻¹(A + p) turns the first into P = S P Sᵀ + 2p R Rᵀ,
/// R = (A − p)⁻¹B, whose solution Σ Sⁱ (2p R Rᵀ) Sᵀⁱ is summed by doubling: Z ← [Z, S Z], S ← S² (R. A. Smith,
/// SIAM J. Appl. Math. 16 (1968) 198; T. Penzl, SIAM J. Sci. Comput. 21 (1999) 1401). Each doubling squares what
/// is left, so a few suffice. The factor has few columns because the system has few inputs; after each doubling
/// it is cut back to its numerical rank. Both Gramians share the powers of S.
#[derive(Clone, Debug)]
pub struct Gramians {
    /// Z_c, n × k.
    pub controllability: Mat<f64>,
    /// Z_o, n × k.
    pub observability: Mat<f64>,
    /// ‖A P + P Aᵀ + B Bᵀ‖ / ‖B Bᵀ‖, Frobenius. Of lightly damped systems, whose P is large, it is more than rounding
    /// even where P is right to the last bit.
    pub controllability_residual: f64,
    /// ‖Aᵀ Q + Q A + Cᵀ C‖ / ‖Cᵀ C‖, Frobenius.
    pub observability_residual: f64,
    /// Doublings taken.
    pub doublings: usize,
}

/// Columns below this share of the largest singular value of a factor are dropped: P keeps its square.
const RANK_TOLERANCE: f64 = 1e-15;
/// More doublings than that mean a pole on the imaginary axis, to within rounding.
const MOST_DOUBLINGS: usize = 48;
/// The residual that is promised, relative to the terms of the equation.
const RESIDUAL: f64 = 1e-10;

impl Gramians {
    /// The Gramians of `system`.
    ///
    /// # Errors
    /// [`ReduceError::Unstable`] when a pole is not in the open left half-plane, as far as the iteration can see;
    /// [`ReduceError::Residual`] when the residual is not reached.
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
            let (more_c, more_o) = (&s * &z_c, s.transpose() * &z_o);
            let left = (more_c.norm_l2() / z_c.norm_l2()).max(more_o.norm_l2() / z_o.norm_l2());
            if !left.is_finite() || doublings == MOST_DOUBLINGS {
                return Err(ReduceError::Unstable);
            }
            z_c = compress(beside(&z_c, &more_c))?;
            z_o = compress(beside(&z_o, &more_o))?;
            doublings += 1;
            if left < 1e-16 {
                break;
            }
            s = &s * &s;
        }
        let (controllability_residual, relative_c) =
            residual(system.a.as_ref(), system.b.as_ref(), z_c.as_ref());
        let (observability_residual, relative_o) =
            residual(system.a.transpose(), system.c.transpose(), z_o.as_ref());
        let worst = relative_c.max(relative_o);
        if worst.is_nan() || worst > RESIDUAL {
            return Err(ReduceError::Residual { found: worst, allowed: RESIDUAL });
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

/// The geometric mean of bounds of the fastest and the slowest pole: √(‖A‖ / ‖A⁻¹‖), Frobenius.
fn shift(a: MatRef<'_, f64>) -> f64 {
    let inverse = a.partial_piv_lu().solve(Mat::<f64>::identity(a.nrows(), a.ncols()));
    (a.norm_l2() / inverse.norm_l2()).sqrt()
}

fn beside(left: &Mat<f64>, right: &Mat<f64>) -> Mat<f64> {
    let split = left.ncols();
    Mat::from_fn(left.nrows(), split + right.ncols(), |i, j| {
        if j < split { left[(i, j)] } else { right[(i, j - split)] }
    })
}

/// The same Z Zᵀ with as few columns as its numerical rank.
fn compress(z: Mat<f64>) -> Result<Mat<f64>, ReduceError> {
    // Doubling what grows soon leaves the finite numbers.
    if !z.norm_l2().is_finite() {
        return Err(ReduceError::Unstable);
    }
    let svd = z.thin_svd().map_err(|_| ReduceError::Eigenvalues { order: z.ncols() })?;
    let (u, sigma) = (svd.U(), svd.S().column_vector());
    let rank = (0..sigma.nrows()).take_while(|&i| sigma[i] > RANK_TOLERANCE * sigma[0]).count();
    Ok(Mat::from_fn(z.nrows(), rank.max(1), |i, j| u[(i, j)] * sigma[j]))
}

/// ‖A Z Zᵀ + Z Zᵀ Aᵀ + B Bᵀ‖ divided by ‖B Bᵀ‖, and by the size of all its terms, 2 ‖A‖ ‖Z Zᵀ‖ + ‖B Bᵀ‖.
fn residual(a: MatRef<'_, f64>, b: MatRef<'_, f64>, z: MatRef<'_, f64>) -> (f64, f64) {
    let half = (a * z) * z.transpose();
    let driven = b * b.transpose();
    let n = a.nrows();
    let left = Mat::from_fn(n, n, |i, j| half[(i, j)] + half[(j, i)] + driven[(i, j)]).norm_l2();
    // ‖Z Zᵀ‖ = ‖Zᵀ Z‖, which is smaller.
    let terms = 2.0 * a.norm_l2() * (z.transpose() * z).norm_l2() + driven.norm_l2();
    (left / driven.norm_l2(), left / terms)
}
