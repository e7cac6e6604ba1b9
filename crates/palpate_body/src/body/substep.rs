//! Data of a substep and its tools.

use super::tool_patches::ToolPatch;
use crate::obstacle_step::ObstacleStep;
use crate::tool::Hold;
use crate::{Integrator, Network, ToolContact};
use glam::DVec3;
use palpate_laws::ToolMove;

/// A substep whose velocities are to be constrained.
pub(super) struct Substep<'a> {
    /// Length of the step, s.
    pub(super) h: f64,
    /// Fractions of the advance before and after the step.
    pub(super) along: (f64, f64),
    pub(super) integrator: &'a Integrator,
    /// The driven node and its displacement in this step, m.
    pub(super) drive: Option<(usize, DVec3)>,
    /// Displacements of all nodes whose motion in this step is given, m, in ascending order of the nodes: the driven
    /// node and moved fixed nodes. They are already at their positions of the end of the step.
    pub(super) given: Vec<(usize, DVec3)>,
    pub(super) tools: Vec<ToolStep<'a>>,
    /// Motion of every obstacle.
    pub(super) obstacles: Vec<ObstacleStep>,
    /// Whether the velocities may be constrained at all.
    pub(super) constrained: bool,
}

/// A tool on a body in a substep.
pub(super) struct ToolStep<'a> {
    /// Index of the tool in the joint step.
    pub(super) index: usize,
    pub(super) contact: &'a mut ToolContact,
    /// Motion of the tool.
    pub(super) way: ToolMove,
    /// Velocity of a node that the tool drives, m/s.
    pub(super) velocity_m_per_s: DVec3,
    /// Candidate contact patches.
    pub(super) patches: &'a mut [ToolPatch],
}

impl Substep<'_> {
    /// The nodes that move freely: those that are neither fixed nor driven.
    pub(super) fn moving<'n>(&self, network: &'n Network) -> impl Iterator<Item = usize> + use<'n> {
        let driven = self.drive.map(|(node, _)| node);
        network.free().iter().copied().filter(move |&node| driven != Some(node))
    }

    /// Displacement of the weighted sum of `nodes` by the nodes whose motion is given, m.
    pub(super) fn given_m(&self, nodes: &[(usize, f64)]) -> DVec3 {
        let of = |node: usize| self.given.binary_search_by_key(&node, |(given, _)| *given).ok();
        nodes.iter().filter_map(|&(node, w)| Some(w * self.given[of(node)?].1)).sum()
    }

    /// Whether a tool may give an impulse.
    pub(super) fn constrains(&self) -> bool {
        self.tools.iter().any(|tool| match tool.contact.hold {
            Hold::Node { .. } => false,
            Hold::Point { .. } => true,
            Hold::Nothing { .. } => !tool.patches.is_empty(),
        })
    }
}
