//! A constraint on the nodes of a body in a substep.

use crate::weights::Weights;
use glam::DVec3;
use palpate_laws::ConstraintLaw;

/// A row of nodes that has to obey, and where it comes from.
#[derive(Clone)]
pub(super) struct Constraint {
    pub(super) source: ConstraintSource,
    pub(super) nodes: Weights,
    pub(super) law: ConstraintLaw,
    pub(super) gap: DVec3,
    /// The part of the gap that was there before: positions close it, velocities keep nothing of that.
    pub(super) overdue: DVec3,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum ConstraintSource {
    /// The tie of this index.
    Tie(usize),
    /// The point that the tool of this index holds.
    Grip(usize),
    /// A node and an obstacle, and how far apart they are.
    Obstacle { node: usize, obstacle: usize, apart_m: f64, normal: DVec3 },
    /// The surface and the tool of this index: with which row of which of its patches, how far apart at the end of the step if the surface stood still, and that as far as
    /// it is to be closed in this step.
    Touch { tool: usize, patch: (usize, usize), apart_m: f64, gap_m: f64, push: DVec3 },
}

impl ConstraintSource {
    /// The tool whose row it is.
    pub(super) fn tool(self) -> Option<usize> {
        match self {
            Self::Grip(tool) | Self::Touch { tool, .. } => Some(tool),
            Self::Tie(_) | Self::Obstacle { .. } => None,
        }
    }
}
