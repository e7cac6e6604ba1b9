//! Small dense linear algebra inside a tick: in-place Cholesky factorisation, products, and vectors in flat lists.

use crate::LocalModelError;
use glam::{DVec2, DVec3};

/// Cholesky factorisation A = L Lᵀ of a symmetric positive definite matrix, stored by rows in a buffer allocated at construction.
#[derive(Clone, Debug, PartialEq)]
pub struct Cholesky {
    n: usize,
    /// Row i of L begins at `i * n`; its diagonal entry is inverted.
    l: Vec<f64>,
}

impl Cholesky {
    /// An empty factor with capacity for `capacity` unknowns.
    #[must_use]
    pub fn with_capacity(capacity: usize) -> Self {
        Self { n: 0, l: zeros(capacity * capacity) }
    }

    /// Factorises the symmetric matrix `a`, n × n by rows. Only the lower triangle is read.
    ///
    /// # Errors
    /// [`LocalModelError::Pivot`] when `a` is not positive definite, [`LocalModelError::Size`] when `a` or the capacity of the factor
    /// is too small. The factor then has order zero.
    pub fn factorise(&mut self, n: usize, a: &[f64]) -> Result<(), LocalModelError> {
        self.n = 0;
        let needed = n * n;
        for (what, found) in [("matrix to factorise", a.len()), ("capacity of the factor", self.l.len())] {
            if found < needed {
                return Err(LocalModelError::Size { what, found, needed, order: n });
            }
        }
        for i in 0..n {
            let (above, row) = self.l.split_at_mut(i * n);
            for (j, other) in above.chunks_exact(n).enumerate() {
                row[j] = (a[i * n + j] - dot(&row[..j], &other[..j])) * other[j];
            }
            let pivot = a[i * n + i] - dot(&row[..i], &row[..i]);
            if !(pivot.is_finite() && pivot > 0.0) {
                return Err(LocalModelError::Pivot { index: i, pivot });
            }
            row[i] = 1.0 / pivot.sqrt();
        }
        self.n = n;
        Ok(())
    }

    /// Number of unknowns.
    #[must_use]
    pub fn order(&self) -> usize {
        self.n
    }

    /// Whether every entry of the factor is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.l.iter().take(self.n * self.n).all(|v| v.is_finite())
    }

    /// Maximum number of unknowns.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.l.len().isqrt()
    }

    /// Copies `other` without allocation.
    ///
    /// # Errors
    /// [`LocalModelError::Order`] when the order of `other` exceeds the capacity; `self` is then unchanged.
    pub fn copy_from(&mut self, other: &Self) -> Result<(), LocalModelError> {
        let used = other.n * other.n;
        let (Some(to), Some(from)) = (self.l.get_mut(..used), other.l.get(..used)) else {
            return Err(LocalModelError::Order { order: other.n, capacity: self.capacity() });
        };
        to.copy_from_slice(from);
        self.n = other.n;
        Ok(())
    }

    /// Solves A x = b in place.
    ///
    /// Solves for the first n unknowns, n the smaller of the order of the factor and the length of `b`; the rest of `b` is unchanged.
    pub fn solve_in_place(&self, b: &mut [f64]) {
        let n = self.n.min(b.len());
        for (i, row) in self.l.chunks_exact(self.n.max(1)).take(n).enumerate() {
            b[i] = (b[i] - dot(&row[..i], &b[..i])) * row[i];
        }
        for (i, row) in self.l.chunks_exact(self.n.max(1)).take(n).enumerate().rev() {
            let x = b[i] * row[i];
            b[i] = x;
            for (b, l) in b[..i].iter_mut().zip(&row[..i]) {
                *b -= l * x;
            }
        }
    }
}

/// Σ a_i b_i in eight independent partial sums, two to a register, to hide the latency of additions.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let ((a8, a_rest), (b8, b_rest)) = (a[..n].as_chunks::<8>(), b[..n].as_chunks::<8>());
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    let mut sums = [DVec2::ZERO; 4];
    for (a, b) in a8.iter().zip(b8) {
        for ((sum, a), b) in sums.iter_mut().zip(a.as_chunks::<2>().0).zip(b.as_chunks::<2>().0) {
            *sum += DVec2::from_array(*a) * DVec2::from_array(*b);
        }
    }
    let [a, b, c, d] = sums;
    ((a + b) + (c + d)).element_sum() + rest
}

/// Rows of a product that are summed in one pass.
const ROWS: usize = 16;

/// y += factor · A x for a matrix stored by columns, or a symmetric one stored by rows.
///
/// It is faster than dot products by rows, which end in a horizontal sum each. Blocks of [`ROWS`] rows write y once.
pub(crate) fn add_columns(y: &mut [f64], a: &[f64], x: &[f64], factor: f64) {
    let m = y.len();
    let columns = || a.chunks_exact(m.max(1)).zip(x);
    let (blocks, rest) = y.as_chunks_mut::<ROWS>();
    let whole = blocks.len() * ROWS;
    for (index, y) in blocks.iter_mut().enumerate() {
        let mut sums = [0.0; ROWS];
        for (column, x) in columns() {
            let Some(part) = column.get(index * ROWS..).and_then(|part| part.first_chunk::<ROWS>()) else {
                continue;
            };
            sums.iter_mut().zip(part).for_each(|(sum, a)| *sum += a * x);
        }
        y.iter_mut().zip(sums).for_each(|(y, sum)| *y += factor * sum);
    }
    let mut sums = [0.0; ROWS];
    for (column, x) in columns() {
        let part = column.get(whole..).unwrap_or_default();
        sums.iter_mut().zip(part).for_each(|(sum, a)| *sum += a * x);
    }
    rest.iter_mut().zip(sums).for_each(|(y, sum)| *y += factor * sum);
}

/// y −= A x for a matrix A stored by rows.
pub(crate) fn subtract_product(y: &mut [f64], a: &[f64], x: &[f64]) {
    for (y, row) in y.iter_mut().zip(a.chunks_exact(x.len().max(1))) {
        *y -= dot(row, x);
    }
}

/// `n` zeros in memory that has been written to.
///
/// Zeroed memory from the allocator has no pages until its first use, which would be inside a tick.
pub(crate) fn zeros(n: usize) -> Vec<f64> {
    let mut zeros = std::hint::black_box(vec![1.0; n]);
    zeros.fill(0.0);
    zeros
}

/// An empty vector with capacity for `n` elements, in memory that has been written to: see [`zeros`].
pub(crate) fn touched_capacity<T: Clone>(n: usize, fill: T) -> Vec<T> {
    let mut list = std::hint::black_box(vec![fill; n]);
    list.clear();
    list
}

/// The `i`-th vector of a list of three numbers each; zero beyond its end.
pub(crate) fn vec3_at(list: &[f64], i: usize) -> DVec3 {
    match list.get(3 * i..3 * i + 3) {
        Some(&[x, y, z]) => DVec3::new(x, y, z),
        _ => DVec3::ZERO,
    }
}

/// Sets the `i`-th vector of a list of three numbers each.
pub(crate) fn set_vec3(list: &mut [f64], i: usize, value: DVec3) {
    if let Some(to) = list.get_mut(3 * i..3 * i + 3) {
        to.copy_from_slice(&value.to_array());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pseudo-random symmetric positive definite matrix.
    fn spd(n: usize) -> Vec<f64> {
        let g: Vec<f64> = (0..n * n).map(|i| ((i * i + 3 * i) as f64 * 0.7).sin()).collect();
        (0..n * n)
            .map(|ij| {
                let (i, j) = (ij / n, ij % n);
                (0..n).map(|k| g[i * n + k] * g[j * n + k]).sum::<f64>() + if i == j { 1.0 } else { 0.0 }
            })
            .collect()
    }

    #[test]
    fn cholesky_solves_the_system() {
        for n in [1, 2, 5, 8, 51] {
            let a = spd(n);
            let mut factor = Cholesky::with_capacity(51);
            factor.factorise(n, &a).unwrap();
            let x: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let mut b: Vec<f64> = (0..n).map(|i| dot(&a[i * n..(i + 1) * n], &x)).collect();
            factor.solve_in_place(&mut b);
            let error = b.iter().zip(&x).map(|(b, x)| (b - x).abs()).fold(0.0, f64::max);
            assert!(error < 1e-10, "n = {n}: {error}");
        }
    }

    #[test]
    fn add_columns_equals_product_by_rows() {
        for (m, n) in [(1, 1), (3, 4), (7, 5), (12, 11), (90, 29)] {
            let a: Vec<f64> = (0..m * n).map(|i| (i as f64 * 0.7).sin()).collect();
            let x: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let mut y = vec![1.0; m];
            // Entries beyond the last column are not read.
            add_columns(&mut y, &[a.clone(), vec![f64::NAN; 5 * m]].concat(), &x, -2.0);
            for (i, y) in y.iter().enumerate() {
                let sum: f64 = (0..n).map(|j| a[j * m + i] * x[j]).sum();
                assert!((y - (1.0 - 2.0 * sum)).abs() < 1e-12, "{m} x {n}");
            }
        }
        add_columns(&mut [], &[1.0], &[1.0], 1.0);
    }

    #[test]
    fn factorise_rejects_indefinite_matrix_with_its_pivot() {
        let mut factor = Cholesky::with_capacity(2);
        let error = factor.factorise(2, &[1.0, 2.0, 2.0, 1.0]).unwrap_err();
        assert_eq!(error, LocalModelError::Pivot { index: 1, pivot: -3.0 });
        assert_eq!(factor.order(), 0);
        assert!(matches!(factor.factorise(3, &spd(3)), Err(LocalModelError::Size { .. })));
        assert!(matches!(factor.factorise(2, &[1.0]), Err(LocalModelError::Size { .. })));
    }

    #[test]
    fn copy_rejects_order_above_capacity() {
        let mut large = Cholesky::with_capacity(4);
        large.factorise(4, &spd(4)).unwrap();
        let mut small = Cholesky::with_capacity(3);
        assert_eq!(small.copy_from(&large), Err(LocalModelError::Order { order: 4, capacity: 3 }));
        let mut same = Cholesky::with_capacity(5);
        same.copy_from(&large).unwrap();
        assert_eq!(same.order(), 4);
    }
}
