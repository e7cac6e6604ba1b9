//! Linearly implicit Euler and its linear solvers.

use super::{Columns, SolvedBy};
use crate::conjugate_gradients::{ConjugateGradients, SolveError};
use crate::error::{check, check_positive};
use crate::network::NetworkState;
use crate::{BodyError, Network, Tangent, TangentPattern};
use faer::linalg::solvers::Solve;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::{Mat, Side};
use glam::{DMat3, DVec3};

/// One Newton step of implicit Euler. With F, K and B at the beginning of a step of length h:
///
/// ```text
/// (M + h B + h² K) Δv = h (F − h K v),    v ← v + Δv,    x ← x + h v
/// ```
///
/// The step is stable at any h for a body that is not about to buckle (D. Baraff and A. Witkin, SIGGRAPH 98, pp.
/// 43-54). Stiff tissue needs no more steps than soft tissue. The method is of first order and damps motion that is
/// fast compared with h.
///
/// K is the exact tangent with its geometric stiffness. If the matrix is not positive definite, as for a buckling
/// body, the clamped part of K replaces it in that step, and [`crate::StepReport::clamped`] counts the step. The
/// contribution of volume barriers is always clamped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearlyImplicitEuler {
    /// Length of a tick, s.
    pub tick_s: f64,
    /// Number of steps per tick; 1 if a step spans several ticks.
    pub substeps: usize,
    /// Number of ticks that a step spans; 1 if a tick has several steps. The tool moves on a straight line during a
    /// step.
    pub ticks_per_step: usize,
    /// Solver of the linear system.
    pub solver: LinearSolver,
    /// Residual relative to the right-hand side at which conjugate gradients stop.
    pub tolerance: f64,
}

/// Solver of the linear system of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinearSolver {
    /// Cholesky for bodies of up to 2,000 free nodes, conjugate gradients for larger ones.
    #[default]
    Auto,
    /// Sparse Cholesky factorisation. Its pattern is analysed once per body.
    Cholesky,
    /// Conjugate gradients with the 3 × 3 diagonal blocks as preconditioner, starting from the previous solution.
    ConjugateGradients,
}

/// Maximum number of free nodes for which `Auto` factorises.
const CHOLESKY_NODES: usize = 2_000;

impl Default for LinearlyImplicitEuler {
    /// One step per tick of 1 ms, the solver chosen by size, a tolerance of 1e-8.
    fn default() -> Self {
        Self { tick_s: 1e-3, substeps: 1, ticks_per_step: 1, solver: LinearSolver::Auto, tolerance: 1e-8 }
    }
}

impl LinearlyImplicitEuler {
    pub(crate) fn validate(&self) -> Result<(), BodyError> {
        check_positive("tick, s", self.tick_s)?;
        let (substeps, ticks) = (self.substeps, self.ticks_per_step);
        check("steps in a tick", substeps as f64, (1..=1000).contains(&substeps), "1 to 1000")?;
        let allowed = "1 to 1000, and 1 when a tick has several steps";
        let ok = (1..=1000).contains(&ticks) && (ticks == 1 || substeps == 1);
        check("ticks that a step spans", ticks as f64, ok, allowed)?;
        let tolerance = self.tolerance;
        check(
            "tolerance of conjugate gradients",
            tolerance,
            (1e-14..=1e-2).contains(&tolerance),
            "1e-14 to 0.01",
        )?;
        Ok(())
    }

    fn factorises(&self, nodes: usize) -> bool {
        match self.solver {
            LinearSolver::Auto => nodes <= CHOLESKY_NODES,
            LinearSolver::Cholesky => true,
            LinearSolver::ConjugateGradients => false,
        }
    }
}

/// The linear system of a body's steps.
#[derive(Clone, Debug)]
pub(crate) struct Workspace {
    pattern: TangentPattern,
    tangent: Tangent,
    /// Entries of M + h B + h² K.
    matrix: Vec<f64>,
    symbolic: Option<SymbolicLlt<usize>>,
    /// Factor of the matrix; `None` with conjugate gradients.
    factor: Option<Llt<usize, f64>>,
    rhs: Mat<f64>,
    /// Δv of the previous step, the start of conjugate gradients.
    last: Vec<f64>,
}

impl Workspace {
    pub(crate) fn new(network: &Network) -> Self {
        let pattern = TangentPattern::of_network(network);
        let dofs = pattern.symbolic().ncols();
        Self {
            tangent: pattern.zero(),
            matrix: vec![0.0; pattern.symbolic().row_idx().len()],
            symbolic: None,
            factor: None,
            rhs: Mat::zeros(dofs, 1),
            last: vec![0.0; dofs],
            pattern,
        }
    }

    /// Clears the previous step, so that the next one depends on the state alone.
    pub(crate) fn forget(&mut self) {
        self.last.fill(0.0);
    }

    /// Solves for Δv of every free node over a step of length `h`, in the order of `network.free()`. Δv of the node
    /// `driven` is zero.
    ///
    /// `force` is the total force on every node. With `constrained`, [`Workspace::add_columns`] may follow. Returns
    /// the solver, and whether K was clamped.
    pub(crate) fn solve(
        &mut self,
        state: NetworkState<'_>,
        driven: Option<usize>,
        force: &[DVec3],
        h: f64,
        settings: &LinearlyImplicitEuler,
        constrained: bool,
    ) -> Result<(SolvedBy, bool), BodyError> {
        let driven = driven.and_then(|node| state.network.free_index(node));
        // Conjugate gradients may not detect an indefinite matrix, and contacts need the same matrix.
        let cautious = constrained && !settings.factorises(state.network.free().len());
        for clamped in if cautious { [true, true] } else { [false, true] } {
            self.factor = None;
            self.assemble(state, driven, force, h, clamped);
            if settings.factorises(state.network.free().len()) {
                if self.factorise()? {
                    (0..self.last.len()).for_each(|i| self.last[i] = self.rhs[(i, 0)]);
                    return Ok((SolvedBy::Cholesky, clamped));
                }
            } else {
                let rhs: Vec<f64> = (0..self.last.len()).map(|i| self.rhs[(i, 0)]).collect();
                let start = self.last.clone();
                if let Some((solution, iterations)) =
                    self.conjugate_gradients(&rhs, start, settings.tolerance)?
                {
                    self.last = solution;
                    return Ok((SolvedBy::ConjugateGradients { iterations }, clamped));
                }
            }
        }
        Err(BodyError::Indefinite)
    }

    /// Δv of the free node at `index` of `network.free()`, m/s.
    pub(crate) fn change(&self, index: usize) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|axis| self.last[3 * index + axis]))
    }

    fn assemble(
        &mut self,
        state: NetworkState<'_>,
        driven: Option<usize>,
        force: &[DVec3],
        h: f64,
        clamped: bool,
    ) {
        let NetworkState { network, v, .. } = state;
        // With the exact tangent of a barrier, steps would become long along its negative curvature.
        self.pattern.fill_at(state, (clamped, true), &mut self.tangent);
        let symbolic = self.pattern.symbolic();
        let (k, b) = (self.tangent.stiffness(), self.tangent.damping());
        let is_driven = |dof: usize| Some(dof / 3) == driven;
        for column in 0..symbolic.ncols() {
            let free = network.free()[column / 3];
            let range = symbolic.col_range(column);
            let mut k_v = 0.0;
            for (place, &row) in range.clone().zip(&symbolic.row_idx()[range]) {
                let (stiffness, damping) = (k.val()[place], b.val()[place]);
                let eliminated = is_driven(row) || is_driven(column);
                // K is symmetric, so a column is a row.
                if !eliminated {
                    k_v += stiffness * v[network.free()[row / 3]][row % 3];
                }
                self.matrix[place] = match (row == column, eliminated) {
                    (true, true) => 1.0,
                    (false, true) => 0.0,
                    (diagonal, false) => {
                        let mass = if diagonal { network.mass_kg()[free] } else { 0.0 };
                        mass + h * damping + h * h * stiffness
                    }
                };
            }
            let pushed = h * (force[free][column % 3] - h * k_v);
            self.rhs[(column, 0)] = if is_driven(column) { 0.0 } else { pushed };
        }
    }

    /// Solves in place for the right-hand side. Returns false if the matrix is not positive definite.
    fn factorise(&mut self) -> Result<bool, BodyError> {
        let matrix = SparseColMatRef::new(self.pattern.symbolic(), &self.matrix);
        let too_large = |_| BodyError::TooLarge { nodes: matrix.ncols() / 3 };
        if self.symbolic.is_none() {
            self.symbolic = Some(SymbolicLlt::try_new(matrix.symbolic(), Side::Lower).map_err(too_large)?);
        }
        let Some(symbolic) = &self.symbolic else { return Ok(false) };
        match Llt::try_new_with_symbolic(symbolic.clone(), matrix, Side::Lower) {
            Ok(factor) => {
                factor.solve_in_place(&mut self.rhs);
                self.factor = Some(factor);
                Ok(true)
            }
            Err(LltError::Numeric(_)) => Ok(false),
            Err(LltError::Generic(error)) => Err(too_large(error)),
        }
    }

    /// Adds the columns of A⁻¹Hᵀ of the `rows` that have none in `columns`, for the matrix of the last
    /// [`Workspace::solve`]. Each row holds the weights of its nodes.
    pub(crate) fn add_columns<'r>(
        &self,
        network: &Network,
        rows: impl Iterator<Item = &'r [(usize, f64)]>,
        settings: &LinearlyImplicitEuler,
        columns: &mut Columns,
    ) -> Result<(), BodyError> {
        let (added, dofs): (Vec<_>, _) = (rows.skip(columns.row_count()).collect(), self.last.len());
        if added.is_empty() {
            return Ok(());
        }
        let mut rhs = Mat::zeros(dofs, 3 * added.len());
        for (row, nodes) in added.into_iter().enumerate() {
            for &(node, w) in nodes {
                if let Some(index) = network.free_index(node) {
                    (0..3).for_each(|axis| rhs[(3 * index + axis, 3 * row + axis)] += w);
                }
            }
        }
        match &self.factor {
            Some(factor) => factor.solve_in_place(&mut rhs),
            None => {
                for column in 0..rhs.ncols() {
                    let unit: Vec<f64> = (0..dofs).map(|i| rhs[(i, column)]).collect();
                    let solved = self.conjugate_gradients(&unit, vec![0.0; dofs], settings.tolerance)?;
                    let (solution, _) = solved.ok_or(BodyError::Indefinite)?;
                    (0..dofs).for_each(|i| rhs[(i, column)] = solution[i]);
                }
            }
        }
        columns.add(rhs);
        Ok(())
    }

    /// Solves for `rhs` by conjugate gradients, starting from `x`. Returns the solution and the number of iterations;
    /// `None` if the matrix is not positive definite.
    fn conjugate_gradients(
        &self,
        rhs: &[f64],
        mut x: Vec<f64>,
        tolerance: f64,
    ) -> Result<Option<(Vec<f64>, usize)>, BodyError> {
        let n = self.last.len();
        let blocks: Vec<DMat3> = (0..n / 3).map(|node| self.diagonal_block(node)).collect();
        let Some(inverses) = blocks.iter().map(positive_inverse).collect::<Option<Vec<_>>>() else {
            return Ok(None);
        };
        let precondition = |r: &[f64], z: &mut [f64]| {
            for (node, inverse) in inverses.iter().enumerate() {
                let at = 3 * node..3 * node + 3;
                let solved = *inverse * DVec3::from_slice(&r[at.clone()]);
                z[at].copy_from_slice(&solved.to_array());
            }
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut product = vec![0.0; n];
        self.multiply(&x, &mut product);
        let mut residual: Vec<f64> = (0..n).map(|i| rhs[i] - product[i]).collect();
        let goal = tolerance * dot(rhs, rhs).sqrt();
        let max_iterations = 20 * n + 100;
        let method = ConjugateGradients {
            multiply: |x: &[f64], product: &mut [f64]| self.multiply(x, product),
            precondition,
            dot,
            is_converged: |residual: &[f64], _| dot(residual, residual).sqrt() <= goal,
            max_iterations,
        };
        match method.solve(&mut x, &mut residual) {
            Ok(iterations) => Ok(Some((x, iterations))),
            Err(SolveError::Indefinite) => Ok(None),
            Err(SolveError::NotConverged) => {
                Err(BodyError::NotConverged { iterations: max_iterations, tolerance })
            }
        }
    }

    /// Multiplies the symmetric matrix by `x`.
    fn multiply(&self, x: &[f64], product: &mut [f64]) {
        let symbolic = self.pattern.symbolic();
        for (column, sum) in product.iter_mut().enumerate() {
            let range = symbolic.col_range(column);
            let rows = &symbolic.row_idx()[range.clone()];
            *sum = rows.iter().zip(&self.matrix[range]).map(|(&row, value)| value * x[row]).sum();
        }
    }

    fn diagonal_block(&self, node: usize) -> DMat3 {
        let symbolic = self.pattern.symbolic();
        DMat3::from_cols_array_2d(&[0, 1, 2].map(|axis| {
            let range = symbolic.col_range(3 * node + axis);
            let first = symbolic.row_idx()[range.clone()].partition_point(|&row| row < 3 * node);
            [0, 1, 2].map(|row| self.matrix[range.start + first + row])
        }))
    }
}

/// Inverse of a symmetric block; `None` unless it is positive definite.
fn positive_inverse(block: &DMat3) -> Option<DMat3> {
    let minor = block.x_axis.x * block.y_axis.y - block.x_axis.y * block.y_axis.x;
    (block.x_axis.x > 0.0 && minor > 0.0 && block.determinant() > 0.0).then(|| block.inverse())
}
