//! The dynamic stiffness s²M + sB + K of a sparse system.

use crate::ReduceError;
use faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, Lu, SymbolicLlt, SymbolicLu};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMat};
use faer::{Mat, MatRef, Side, c64};

/// Solves linear systems with s²M + sB + K. The sparsity pattern does not depend on s: its symbolic factorisations are computed once.
pub(crate) struct DynamicStiffness<'a> {
    mass: &'a [f64],
    damping: SparseColMatRef<'a, usize, f64>,
    stiffness: SparseColMatRef<'a, usize, f64>,
    pattern: SymbolicSparseColMat<usize>,
    /// Positions in the pattern of the entries of K, of B, and of the diagonal of M.
    stiffness_entries: Vec<usize>,
    damping_entries: Vec<usize>,
    mass_entries: Vec<usize>,
    llt: Option<SymbolicLlt<usize>>,
    lu: Option<SymbolicLu<usize>>,
}

impl<'a> DynamicStiffness<'a> {
    /// Prepares the matrices: `mass` is the diagonal of M.
    pub(crate) fn new(
        mass: &'a [f64],
        damping: SparseColMatRef<'a, usize, f64>,
        stiffness: SparseColMatRef<'a, usize, f64>,
    ) -> Self {
        let n = mass.len();
        let (k, b) = (stiffness, damping);
        let (mut starts, mut rows) = (vec![0], Vec::new());
        let mut entries = [Vec::new(), Vec::new(), Vec::new()];
        let mut union: Vec<usize> = Vec::new();
        for column in 0..n {
            union.clear();
            union.extend(k.row_idx_of_col(column).chain(b.row_idx_of_col(column)).chain([column]));
            union.sort_unstable();
            union.dedup();
            let entry = |row: usize| rows.len() + union.binary_search(&row).unwrap_or(0);
            entries[0].extend(k.row_idx_of_col(column).map(entry));
            entries[1].extend(b.row_idx_of_col(column).map(entry));
            entries[2].push(entry(column));
            rows.extend(&union);
            starts.push(rows.len());
        }
        let [stiffness_entries, damping_entries, mass_entries] = entries;
        let pattern = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        Self {
            mass,
            damping,
            stiffness,
            pattern,
            stiffness_entries,
            damping_entries,
            mass_entries,
            llt: None,
            lu: None,
        }
    }

    /// (σ²M + σB + K)⁻¹ `rhs` for real σ, 1/s.
    pub(crate) fn solve_real(&mut self, sigma: f64, rhs: MatRef<'_, f64>) -> Result<Mat<f64>, ReduceError> {
        let matrix = self.at(sigma, 1.0);
        let unknowns = self.mass.len();
        let symbolic = match &mut self.llt {
            Some(symbolic) => symbolic,
            none => none.insert(
                SymbolicLlt::try_new(matrix.symbolic(), Side::Lower)
                    .map_err(|_| ReduceError::Symbolic { unknowns })?,
            ),
        };
        let factor = Llt::try_new_with_symbolic(symbolic.clone(), matrix.as_ref(), Side::Lower);
        let factor = factor.map_err(|error| match error {
            LltError::Numeric(NonPositivePivot { index }) => ReduceError::Singular { pivot: index },
            LltError::Generic(_) => ReduceError::Symbolic { unknowns },
        })?;
        Ok(factor.solve(rhs))
    }

    /// (s²M + sB + K)⁻¹ `rhs` for complex s, 1/s.
    pub(crate) fn solve_complex(&mut self, s: c64, rhs: MatRef<'_, c64>) -> Result<Mat<c64>, ReduceError> {
        let matrix = self.at(s, c64::new(1.0, 0.0));
        let unknowns = self.mass.len();
        let symbolic = match &mut self.lu {
            Some(symbolic) => symbolic,
            none => none.insert(
                SymbolicLu::try_new(matrix.symbolic()).map_err(|_| ReduceError::Symbolic { unknowns })?,
            ),
        };
        let factor = Lu::try_new_with_symbolic(symbolic.clone(), matrix.as_ref());
        Ok(factor.map_err(|_| ReduceError::Pole { re: s.re, im: s.im })?.solve(rhs))
    }

    fn at<S>(&self, s: S, one: S) -> SparseColMat<usize, S>
    where
        S: Copy + std::ops::Mul<Output = S> + std::ops::Mul<f64, Output = S> + std::ops::AddAssign,
    {
        let mut values = vec![one * 0.0; self.pattern.row_idx().len()];
        let mut add = |entries: &[usize], factor: S, of_matrix: &mut dyn Iterator<Item = f64>| {
            entries.iter().zip(of_matrix).for_each(|(&entry, value)| values[entry] += factor * value);
        };
        let values_of = |matrix: SparseColMatRef<'a, usize, f64>| {
            (0..matrix.ncols()).flat_map(move |column| matrix.val_of_col(column).iter().copied())
        };
        add(&self.stiffness_entries, one, &mut values_of(self.stiffness));
        add(&self.damping_entries, s, &mut values_of(self.damping));
        add(&self.mass_entries, s * s, &mut self.mass.iter().copied());
        SparseColMat::new(self.pattern.clone(), values)
    }
}
