//! A substep and its tools.

use super::tool_patches::ToolPatch;
use crate::tool::Hold;
use crate::{Integrator, ToolContact};
use glam::DVec3;
use palpate_laws::ToolMove;

/// What is known of a step when its velocities are to be constrained.
pub(super) struct Substep<'a> {
    /// Its length, s.
    pub(super) h: f64,
    /// The shares of the advance that are over before and after it.
    pub(super) along: (f64, f64),
    pub(super) integrator: &'a Integrator,
    /// The node that is driven, and how far it has been moved.
    pub(super) drive: Option<(usize, DVec3)>,
    pub(super) tools: Vec<ToolStep<'a>>,
}

/// A tool in a step.
pub(super) struct ToolStep<'a> {
    pub(super) contact: &'a mut ToolContact,
    /// From where to where it goes.
    pub(super) way: ToolMove,
    /// Velocity that a node which it drives takes over, m/s.
    pub(super) velocity_m_per_s: DVec3,
    /// The patches that it may touch.
    pub(super) patches: &'a mut [ToolPatch],
}

impl<'a> ToolStep<'a> {
    /// The step of a tool whose device goes from one place to another, with a velocity in the end.
    pub(super) fn new(
        contact: &'a mut ToolContact,
        (device_m, velocity_m_per_s): ((DVec3, DVec3), DVec3),
        patches: &'a mut [ToolPatch],
    ) -> Self {
        let radius_m = contact.shape().map(|(shape, _)| shape.radius_m());
        let way = ToolMove::new(contact.coupling, device_m, contact.proxy_m(device_m.0), radius_m);
        Self { contact, way, velocity_m_per_s, patches }
    }
}

impl Substep<'_> {
    /// Whether a tool may push or pull.
    pub(super) fn constrains(&self) -> bool {
        self.tools.iter().any(|tool| match tool.contact.hold {
            Hold::Node { .. } => false,
            Hold::Point { .. } => true,
            Hold::Nothing { .. } => !tool.patches.is_empty(),
        })
    }
}
