//! Report of an advance.

use crate::integrator::SolvedBy;

/// Statistics of an advance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Number of ticks.
    pub ticks: usize,
    /// Maximum number of substeps per tick; 1 when a step spans several ticks, 0 of a body that is asleep.
    pub substeps: usize,
    /// Solver of the steps.
    pub solved_by: SolvedBy,
    /// Number of steps with a clamped tangent.
    pub clamped: usize,
    /// Whether the body is settled and was not stepped: its state is unchanged, except that its velocities are zero.
    pub is_asleep: bool,
    /// Maximum number of points in contact with obstacles.
    pub contacts: usize,
    /// Maximum number of active rows of contact patches of a tool: one or nine for each patch.
    pub touched: usize,
    /// Maximum number of contact patches that a tool lacked, because it has at most four.
    pub left_out: usize,
    /// Maximum number of iterations of the constraint solver.
    pub iterations: usize,
    /// Number of solutions that did not converge: the constraints are contradictory or redundant, or convergence is
    /// too slow.
    pub unconverged: usize,
    /// Number of ties that tore.
    pub torn: usize,
    /// Number of inverted cells and tetrahedra at the end of the advance; see [`crate::Body::inverted_cells`] and
    /// [`crate::Body::inverted_tetrahedra`].
    pub inverted_cells: usize,
}
