//! The report of an advance.

use crate::integrator::SolvedBy;

/// What a model step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Ticks stepped.
    pub ticks: usize,
    /// Substeps in each of them, at most; 1 when a step spans several ticks.
    pub substeps: usize,
    /// What solved for the steps.
    pub solved_by: SolvedBy,
    /// Steps for which the tangent had to be clamped.
    pub clamped: usize,
    /// Nodes in contact with obstacles, at most.
    pub contacts: usize,
    /// Rows of contact patches with which a tool pushed at once, at most: one or nine for each patch.
    pub touched: usize,
    /// Contact patches that it should have had but did not, at most: it has no more than four at once.
    pub left_out: usize,
    /// Sweeps that the impulses of obstacles, ties and the tool took, at most.
    pub sweeps: usize,
    /// How often those impulses were not found in all sweeps that are made: what is asked for cannot be, or is not
    /// determined, or converges too slowly.
    pub unconverged: usize,
    /// Ties that tore.
    pub torn: usize,
    /// Cells that are inverted at the end of the advance: those for which the volume ratio of at least one of their ten tetrahedra
    /// is zero or negative. See [`Body::inverted_cells`].
    pub inverted_cells: usize,
}
