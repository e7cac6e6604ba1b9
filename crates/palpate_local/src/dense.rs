//! A small dense Cholesky factorisation in place, for systems of a few dozen unknowns inside a tick.

use crate::LocalModelError;
use glam::DVec2;

/// A = L Lᵀ of a symmetric positive definite matrix, row by row in a buffer that is made once.
#[derive(Clone, Debug, PartialEq)]
pub struct Cholesky {
    n: usize,
    /// Row i of L at `i * n`, its diagonal entry inverted.
    l: Vec<f64>,
}

impl Cholesky {
    /// Room for up to `capacity` unknowns.
    #[must_use]
    pub fn with_capacity(capacity: usize) -> Self {
        Self { n: 0, l: zeros(capacity * capacity) }
    }

    /// Factorises the symmetric matrix `a` (n × n, row by row; its lower triangle is read).
    ///
    /// # Errors
    /// [`LocalModelError::Pivot`] when `a` is not positive definite, [`LocalModelError::Size`] when `a` or the
    /// room for the factor is too small. There is no factor then, as if of order zero.
    pub fn factorise(&mut self, n: usize, a: &[f64]) -> Result<(), LocalModelError> {
        self.n = 0;
        let needed = n * n;
        for (what, found) in [("matrix to factorise", a.len()), ("room for a factor", self.l.len())] {
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

    /// Room, in unknowns.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.l.len().isqrt()
    }

    /// Becomes `other`, without allocating when there is room.
    ///
    /// # Errors
    /// [`LocalModelError::Order`] when there is no room; `self` is unchanged then.
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
    /// Unknowns beyond the shorter of the factor and `b` are left alone.
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

/// Σ a_i b_i in eight running sums, two to a register, so that no sum waits for the one before.
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

/// Rows of a product that are summed at once.
const ROWS: usize = 16;

/// y += factor · Σ_j a_j x_j over the columns a_j of A, which lie one after the other: as a symmetric matrix's rows do. Faster
/// than by rows, for no sums are left at the end of each; some rows at a time, so that y is written once.
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

/// y −= A x for a row-by-row matrix A.
pub(crate) fn subtract_product(y: &mut [f64], a: &[f64], x: &[f64]) {
    for (y, row) in y.iter_mut().zip(a.chunks_exact(x.len().max(1))) {
        *y -= dot(row, x);
    }
}

/// So many zeros in memory that has been written to: the operating system finds pages for what is only promised to be zero when
/// it is first used, which would be within a tick.
pub(crate) fn zeros(n: usize) -> Vec<f64> {
    let mut zeros = std::hint::black_box(vec![1.0; n]);
    zeros.fill(0.0);
    zeros
}

/// Room for so many like `one`, in memory that has been written to.
pub(crate) fn room<T: Clone>(n: usize, one: T) -> Vec<T> {
    let mut room = std::hint::black_box(vec![one; n]);
    room.clear();
    room
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A random-looking symmetric positive definite matrix.
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
    fn the_solution_satisfies_the_system() {
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
    fn columns_are_added_as_rows_are() {
        for (m, n) in [(1, 1), (3, 4), (7, 5), (12, 11), (90, 29)] {
            let a: Vec<f64> = (0..m * n).map(|i| (i as f64 * 0.7).sin()).collect();
            let x: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let mut y = vec![1.0; m];
            // What lies behind is not looked at.
            add_columns(&mut y, &[a.clone(), vec![f64::NAN; 5 * m]].concat(), &x, -2.0);
            for (i, y) in y.iter().enumerate() {
                let sum: f64 = (0..n).map(|j| a[j * m + i] * x[j]).sum();
                assert!((y - (1.0 - 2.0 * sum)).abs() < 1e-12, "{m} x {n}");
            }
        }
        add_columns(&mut [], &[1.0], &[1.0], 1.0);
    }

    #[test]
    fn an_indefinite_matrix_is_refused_with_its_pivot() {
        let mut factor = Cholesky::with_capacity(2);
        let refused = factor.factorise(2, &[1.0, 2.0, 2.0, 1.0]).unwrap_err();
        assert_eq!(refused, LocalModelError::Pivot { index: 1, pivot: -3.0 });
        assert_eq!(factor.order(), 0);
        assert!(matches!(factor.factorise(3, &spd(3)), Err(LocalModelError::Size { .. })));
        assert!(matches!(factor.factorise(2, &[1.0]), Err(LocalModelError::Size { .. })));
    }

    #[test]
    fn a_copy_needs_room() {
        let mut large = Cholesky::with_capacity(4);
        large.factorise(4, &spd(4)).unwrap();
        let mut small = Cholesky::with_capacity(3);
        assert_eq!(small.copy_from(&large), Err(LocalModelError::Order { order: 4, capacity: 3 }));
        let mut same = Cholesky::with_capacity(5);
        same.copy_from(&large).unwrap();
        assert_eq!(same.order(), 4);
    }
}
