//! Eigenvalues of small symmetric matrices.

/// Maximum number of Jacobi sweeps; a matrix of order nine takes about six.
const MAX_SWEEPS: usize = 20;

/// The positive semidefinite part Σ max(λ, 0) v vᵀ of a symmetric matrix.
pub(crate) fn positive_part<const N: usize>(a: [[f64; N]; N]) -> [[f64; N]; N] {
    let (values, v) = eigenvectors(a);
    let entry = |r: usize, c: usize| (0..N).map(|i| values[i].max(0.0) * v[r][i] * v[c][i]).sum::<f64>();
    std::array::from_fn(|r| std::array::from_fn(|c| entry(r, c)))
}

/// Eigenvalues, and eigenvectors as columns, of a symmetric matrix, by the cyclic Jacobi method.
pub(crate) fn eigenvectors<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut v: [[f64; N]; N] = std::array::from_fn(|r| std::array::from_fn(|c| f64::from(u8::from(r == c))));
    let total: f64 = a.iter().flatten().map(|x| x * x).sum();
    for _ in 0..MAX_SWEEPS {
        let off: f64 = (0..N).flat_map(|p| (0..p).map(move |q| (p, q))).map(|(p, q)| a[p][q] * a[p][q]).sum();
        if off.is_nan() || off <= 1e-30 * total {
            break;
        }
        for p in 0..N - 1 {
            for q in p + 1..N {
                rotate(&mut a, &mut v, p, q);
            }
        }
    }
    (std::array::from_fn(|i| a[i][i]), v)
}

/// The Jacobi rotation that makes entry (p, q) of `a` zero.
fn rotate<const N: usize>(a: &mut [[f64; N]; N], v: &mut [[f64; N]; N], p: usize, q: usize) {
    if a[p][q] == 0.0 {
        return;
    }
    let (c, s) = rotation_angle(a[p][p], a[p][q], a[q][q]);
    for row in a.iter_mut().chain(v) {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
    let (row_p, row_q) = (a[p], a[q]);
    for (k, (x, y)) in row_p.into_iter().zip(row_q).enumerate() {
        (a[p][k], a[q][k]) = (c * x - s * y, s * x + c * y);
    }
}

/// Cosine and sine of the Jacobi rotation of the symmetric matrix (pp, pq; pq, qq), with pq not zero.
pub(crate) fn rotation_angle(pp: f64, pq: f64, qq: f64) -> (f64, f64) {
    let theta = (qq - pp) / (2.0 * pq);
    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let c = 1.0 / t.hypot(1.0);
    (c, t * c)
}
