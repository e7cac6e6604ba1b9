//! A constraint on the nodes of a body in a substep.

use crate::weights::Weights;
use glam::DVec3;
use palpate_laws::ConstraintLaw;

/// A constraint row on nodes, with its origin.
#[derive(Clone)]
pub(super) struct Constraint {
    pub(super) source: ConstraintSource,
    pub(super) nodes: Weights,
    pub(super) law: ConstraintLaw,
    pub(super) gap: DVec3,
    /// Part of the gap that existed before the step. The position update closes it, and it leaves no velocity behind.
    pub(super) overdue: DVec3,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum ConstraintSource {
    /// Index of a tie.
    Tie(usize),
    /// Index of a tool that holds a point.
    Grip(usize),
    /// A node and an obstacle, with their distance.
    Obstacle { node: usize, obstacle: usize, apart_m: f64, normal: DVec3 },
    /// A row of a contact patch: indices of the tool, of its patch and of the row. `apart_m` is the distance at the
    /// end of the step if the surface stands still; `gap_m` is the part of it that this step may close.
    Touch { tool: usize, patch: (usize, usize), apart_m: f64, gap_m: f64, push: DVec3 },
}

impl ConstraintSource {
    /// Whether it is the contact of that node with that obstacle.
    pub(super) fn is_contact(self, node: usize, obstacle: usize) -> bool {
        matches!(self, Self::Obstacle { node: n, obstacle: o, .. } if (n, o) == (node, obstacle))
    }

    /// Index of the tool to which the row belongs.
    pub(super) fn tool(self) -> Option<usize> {
        match self {
            Self::Grip(tool) | Self::Touch { tool, .. } => Some(tool),
            Self::Tie(_) | Self::Obstacle { .. } => None,
        }
    }
}
