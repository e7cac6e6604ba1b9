//! A constraint on the nodes of a body in a substep.

use crate::Network;
use crate::impulse_response::RigidPoint;
use crate::weights::Weights;
use glam::DVec3;
use palpate_laws::ConstraintLaw;

/// A constraint row on nodes, with its origin.
#[derive(Clone)]
pub(super) struct Constraint {
    pub(super) source: ConstraintSource,
    pub(super) nodes: Weights,
    /// Point of a rigid body whose velocity is subtracted.
    pub(super) rigid: Option<RigidPoint>,
    pub(super) law: ConstraintLaw,
    pub(super) gap: DVec3,
    /// Part of the gap that existed before the step. The position update closes it, and it leaves no velocity behind.
    pub(super) initial_violation: DVec3,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum ConstraintSource {
    /// Index of a tie.
    Tie(usize),
    /// Index of a tool that holds a point.
    Grip(usize),
    /// A point at `at_m` and an obstacle, with their distance if the point stood still during the step.
    Obstacle { point: usize, obstacle: usize, apart_m: f64, normal: DVec3, at_m: DVec3 },
    /// A row of a contact patch: indices of the tool, of its patch and of the row. `apart_m` is the distance at the
    /// end of the step if the surface stands still; `gap_m` is the part of it that this step may close.
    Touch { tool: usize, patch: (usize, usize), apart_m: f64, gap_m: f64, push: DVec3 },
}

impl ConstraintSource {
    /// Index of the tool to which the row belongs.
    pub(super) fn tool(self) -> Option<usize> {
        match self {
            Self::Grip(tool) | Self::Touch { tool, .. } => Some(tool),
            Self::Tie(_) | Self::Obstacle { .. } => None,
        }
    }
}

/// Whether the motion of `node` in the step is given: it is fixed or driven, and is already at its position of the end of
/// the step. It does not respond to impulses.
pub(super) fn is_prescribed(network: &Network, drive: Option<(usize, DVec3)>, node: usize) -> bool {
    network.is_fixed(node) || drive.is_some_and(|(driven, _)| driven == node)
}
