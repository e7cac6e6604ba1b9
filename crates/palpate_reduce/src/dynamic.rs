//! The dynamic stiffness s²M + sB + K of a sparse system, whose pattern does not depend on s.

use crate::{ReduceError, SecondOrderSystem};
use faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, Lu, SymbolicLlt, SymbolicLu};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMat};
use faer::{Mat, MatRef, Side, c64};

/// Solves with s²M + sB + K; what depends on the pattern alone is done once.
pub(crate) struct DynamicStiffness<'a> {
    system: &'a SecondOrderSystem,
    pattern: SymbolicSparseColMat<usize>,
    /// Where each entry of K, of B and of M's diagonal stands in the pattern.
    stiffness: Vec<usize>,
    damping: Vec<usize>,
    mass: Vec<usize>,
    llt: Option<SymbolicLlt<usize>>,
    lu: Option<SymbolicLu<usize>>,
}

impl<'a> DynamicStiffness<'a> {
    pub(crate) fn new(system: &'a SecondOrderSystem) -> Self {
        let n = system.unknowns();
        let (k, b) = (system.stiffness.as_ref(), system.damping.as_ref());
        let (mut starts, mut rows) = (vec![0], Vec::new());
        let mut places = [Vec::new(), Vec::new(), Vec::new()];
        let mut union: Vec<usize> = Vec::new();
        for column in 0..n {
            union.clear();
            union.extend(k.row_idx_of_col(column).chain(b.row_idx_of_col(column)).chain([column]));
            union.sort_unstable();
            union.dedup();
            let place = |row: usize| rows.len() + union.binary_search(&row).unwrap_or(0);
            places[0].extend(k.row_idx_of_col(column).map(place));
            places[1].extend(b.row_idx_of_col(column).map(place));
            places[2].push(place(column));
            rows.extend(&union);
            starts.push(rows.len());
        }
        let [stiffness, damping, mass] = places;
        let pattern = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        Self { system, pattern, stiffness, damping, mass, llt: None, lu: None }
    }

    /// (σ²M + σB + K)⁻¹ `rhs` for real σ, 1/s.
    pub(crate) fn solve_real(&mut self, sigma: f64, rhs: MatRef<'_, f64>) -> Result<Mat<f64>, ReduceError> {
        let matrix = self.at(sigma, 1.0);
        let unknowns = self.system.unknowns();
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
        let unknowns = self.system.unknowns();
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
        let mut add = |places: &[usize], factor: S, entries: &mut dyn Iterator<Item = f64>| {
            places.iter().zip(entries).for_each(|(&place, entry)| values[place] += factor * entry);
        };
        let entries = |matrix: SparseColMatRef<'a, usize, f64>| {
            (0..matrix.ncols()).flat_map(move |column| matrix.val_of_col(column).iter().copied())
        };
        add(&self.stiffness, one, &mut entries(self.system.stiffness.as_ref()));
        add(&self.damping, s, &mut entries(self.system.damping.as_ref()));
        add(&self.mass, s * s, &mut self.system.mass.iter().copied());
        SparseColMat::new(self.pattern.clone(), values)
    }
}
