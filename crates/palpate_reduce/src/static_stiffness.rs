//! The static stiffness that a body shows at one node: K condensed on it.

use crate::ReduceError;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::{Mat, Side};
use glam::{DMat3, DVec3};
use palpate_body::{Body, Tangent, TangentPattern};

/// D = K_cc − K_cr K_rr⁻¹ K_rc with one symbolic factorisation for all nodes c.
///
/// With K̂ = K + P on the three degrees of freedom of c, (K̂⁻¹)_cc = (D + P)⁻¹. So one factorisation of K̂,
/// whose pattern does not depend on c, and three solutions give D; and K̂ is positive definite whenever K_rr
/// and D + P are, so a body that only the tool keeps from buckling is no obstacle.
#[derive(Debug)]
pub(crate) struct StaticStiffness {
    symbolic: SymbolicLlt<usize>,
    /// σ₀² m of every degree of freedom, N/m.
    regularisation: Vec<f64>,
    shift: Vec<f64>,
    solution: Mat<f64>,
}

/// P as a multiple of the stiffness of the springs at the node: large enough to hold it against a
/// buckling body, small enough to lose no more than two digits when it is taken away again.
const HOLD: f64 = 4.0;

impl StaticStiffness {
    pub(crate) fn new(pattern: &TangentPattern, body: &Body, sigma_per_s: f64) -> Result<Self, ReduceError> {
        let unknowns = pattern.symbolic().ncols();
        let symbolic = SymbolicLlt::try_new(pattern.symbolic(), Side::Lower)
            .map_err(|_| ReduceError::Symbolic { unknowns })?;
        let network = body.network();
        let regularisation = network
            .free()
            .iter()
            .flat_map(|&node| [sigma_per_s * sigma_per_s * network.mass_kg()[node]; 3])
            .collect();
        Ok(Self { symbolic, regularisation, shift: vec![0.0; unknowns], solution: Mat::zeros(unknowns, 3) })
    }

    /// D at `node`, N/m. Adds the regularisation and P to `tangent`'s K.
    pub(crate) fn at(
        &mut self,
        tangent: &mut Tangent,
        body: &Body,
        node: usize,
    ) -> Result<DMat3, ReduceError> {
        let c = 3 * body.network().free_index(node).expect("a driven node is free");
        let hold = HOLD * (0..3).map(|axis| diagonal(tangent, c + axis)).fold(0.0, f64::max);
        self.shift.copy_from_slice(&self.regularisation);
        self.shift[c..c + 3].iter_mut().for_each(|shift| *shift += hold);
        tangent.add_to_stiffness_diagonal(&self.shift);
        let factor = Llt::try_new_with_symbolic(self.symbolic.clone(), tangent.stiffness(), Side::Lower)
            .map_err(|error| match error {
                LltError::Numeric(faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot {
                    index,
                }) => ReduceError::Singular { pivot: index },
                LltError::Generic(_) => ReduceError::Symbolic { unknowns: self.shift.len() },
            })?;
        self.solution.fill(0.0);
        (0..3).for_each(|axis| self.solution[(c + axis, axis)] = 1.0);
        factor.solve_in_place(&mut self.solution);
        let column = |axis: usize| DVec3::from_array([0, 1, 2].map(|row| self.solution[(c + row, axis)]));
        let compliance = DMat3::from_cols(column(0), column(1), column(2));
        Ok(compliance.inverse() - DMat3::from_diagonal(DVec3::splat(hold)))
    }
}

fn diagonal(tangent: &Tangent, dof: usize) -> f64 {
    tangent.stiffness().get(dof, dof).copied().unwrap_or(0.0).abs()
}
