//! Tools of a body: they hold a point or touch the surface.

mod touched_point;

pub use touched_point::TouchedPoint;

use crate::weights::add_weight;
use crate::{Body, BodyError, BodyPoint};
use glam::DVec3;
use palpate_laws::{Coulomb, ToolShape, VirtualCoupling};

/// A point of a tool's path in the frame of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolPoint {
    /// Position of the tool's centre, m.
    pub position_m: DVec3,
    /// Velocity, m/s. It may be a smoothed estimate instead of the derivative of the positions. Only a held node
    /// takes it over; all other contact depends on the positions.
    pub velocity_m_per_s: DVec3,
}

impl ToolPoint {
    /// A tool at rest at `position_m`, m.
    #[must_use]
    pub fn at_rest(position_m: DVec3) -> Self {
        Self { position_m, velocity_m_per_s: DVec3::ZERO }
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.position_m.is_finite() && self.velocity_m_per_s.is_finite()
    }
}

/// Contact of a tool with a body.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolContact {
    pub(crate) hold: Hold,
    /// Rows of contact patches that gave an impulse in the last step; none for a tool that holds.
    pub(crate) touched: Vec<TouchedPoint>,
    /// Nodes that it pushed during the last advance.
    pub(crate) touched_nodes: Vec<usize>,
    /// Coupling to the device, if there is one.
    pub(crate) coupling: Option<VirtualCoupling>,
    /// Impulse λ on the held point in the last step, N s, and the length of that step, s.
    pub(crate) gripped: (DVec3, f64),
    /// Position behind the coupling, m; `None` if it is at the device.
    pub(crate) proxy_m: Option<DVec3>,
    /// Identity of the tool, 0 without one.
    pub(crate) identity: u64,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Hold {
    /// A driven node: it has the tool's position plus an offset, and the tool's velocity.
    Node { node: usize, offset_m: DVec3 },
    /// A point, by a bilateral row.
    Point { point: BodyPoint, offset_m: DVec3 },
    /// No hold: it touches with friction if it is `clear`, that is, not inside the body or out again.
    Nothing { shape: ToolShape, friction: f64, clear: bool },
}

impl ToolContact {
    /// Creates a tool at `tool_m` (m) that holds `node` permanently at its present offset. The node takes the tool's
    /// motion.
    ///
    /// # Errors
    /// [`BodyError::InvalidNode`] if the node does not exist or is fixed; [`BodyError::Path`] if `tool_m` is not
    /// finite.
    pub fn hold(body: &Body, node: usize, tool_m: DVec3) -> Result<Self, BodyError> {
        can_hold(body, &[node])?;
        let offset_m = body.positions_m()[node] - finite(tool_m)?;
        Ok(Self::new(Hold::Node { node, offset_m }))
    }

    /// Creates a tool at `tool_m` (m) that holds `point` permanently at its present offset, by impulses on its nodes.
    ///
    /// # Errors
    /// [`BodyError::InvalidNode`] if the point has a node that does not exist, or no free node; [`BodyError::Path`] if
    /// `tool_m` is not finite.
    pub fn hold_point(body: &Body, point: BodyPoint, tool_m: DVec3) -> Result<Self, BodyError> {
        can_hold(body, &point.named())?;
        let offset_m = point.of(body.positions_m()) - finite(tool_m)?;
        Ok(Self::new(Hold::Point { point, offset_m }))
    }

    /// Creates a touching tool without contacts. It pushes on the surface in at most four contact patches,
    /// unilaterally and with coefficient of friction `friction`. It may slide, roll over edges, leave and return. A
    /// tool that starts with its centre inside the body, or jumps there, touches nothing until all of it has come
    /// out.
    ///
    /// # Errors
    /// [`BodyError::Tool`] for an invalid shape, [`BodyError::Parameter`] if the friction is negative or not finite.
    pub fn touch(shape: ToolShape, friction: f64) -> Result<Self, BodyError> {
        shape.validate()?;
        let ok = friction.is_finite() && friction >= 0.0;
        crate::error::check("coefficient of friction", friction, ok, "finite and at least 0")?;
        Ok(Self::new(Hold::Nothing { shape, friction, clear: true }))
    }

    fn new(hold: Hold) -> Self {
        let (touched, touched_nodes, gripped) = (Vec::new(), Vec::new(), (DVec3::ZERO, 0.0));
        Self { hold, touched, touched_nodes, gripped, coupling: None, proxy_m: None, identity: 0 }
    }

    /// Puts the tool behind `coupling`: the body touches a proxy, and the coupling pulls the proxy to the device with
    /// a limited force. A device deeper than the body can follow leaves the proxy behind. Without a coupling the tool
    /// follows the device with any force. A held node becomes a held point.
    ///
    /// # Errors
    /// [`BodyError::Tool`] for an invalid coupling.
    pub fn with_coupling(mut self, coupling: VirtualCoupling) -> Result<Self, BodyError> {
        coupling.validate()?;
        self.coupling = Some(coupling);
        if let Hold::Node { node, offset_m } = self.hold {
            self.hold = Hold::Point { point: BodyPoint::node(node), offset_m };
        }
        Ok(self)
    }

    /// Gives the tool an identity, by which the local models of other tools follow its force between two model steps.
    #[must_use]
    pub fn with_identity(mut self, identity: u64) -> Self {
        self.identity = identity;
        self
    }

    /// Identity of the tool, 0 without one.
    #[must_use]
    pub fn identity(&self) -> u64 {
        self.identity
    }

    /// Force of the tool on the body in the last step, N: the sum of its impulses over the length of the step. Zero for a driven node.
    #[must_use]
    pub fn applied_force_n(&self) -> DVec3 {
        let (impulse_ns, step_s) = self.gripped;
        match &self.hold {
            Hold::Node { .. } => DVec3::ZERO,
            Hold::Point { .. } if step_s > 0.0 => impulse_ns / step_s,
            Hold::Point { .. } => DVec3::ZERO,
            Hold::Nothing { .. } => self.touched.iter().map(TouchedPoint::force_n).sum(),
        }
    }

    /// Shares of the nodes in the force of the tool on the body in the last step: their sum is 1. Empty for a tool that neither touches nor
    /// holds the body, and for a driven node.
    #[must_use]
    pub fn force_shares(&self) -> Vec<(usize, f64)> {
        let mut shares = Vec::new();
        match &self.hold {
            Hold::Node { .. } => {}
            Hold::Point { point, .. } => shares.extend_from_slice(point.nodes()),
            Hold::Nothing { .. } => {
                let sum: f64 = self.touched.iter().map(TouchedPoint::pressing_n).sum();
                for touched in self.touched.iter().filter(|_| sum > 0.0) {
                    let share = touched.pressing_n() / sum;
                    touched.nodes.iter().for_each(|&(node, w)| add_weight(&mut shares, node, share * w));
                }
            }
        }
        shares
    }

    /// Coupling to the device, if there is one.
    #[must_use]
    pub fn coupling(&self) -> Option<VirtualCoupling> {
        self.coupling
    }

    /// Position of the tool, m, with the device at `device_m`.
    #[must_use]
    pub fn proxy_m(&self, device_m: DVec3) -> DVec3 {
        self.proxy_m.unwrap_or(device_m)
    }

    /// The driven node, if the tool drives one.
    #[must_use]
    pub fn driven_node(&self) -> Option<usize> {
        match self.hold {
            Hold::Node { node, .. } => Some(node),
            Hold::Point { .. } | Hold::Nothing { .. } => None,
        }
    }

    /// The held point, if the tool holds one by impulses.
    #[must_use]
    pub fn held_point(&self) -> Option<&BodyPoint> {
        match &self.hold {
            Hold::Point { point, .. } => Some(point),
            Hold::Node { .. } | Hold::Nothing { .. } => None,
        }
    }

    /// Shape and coefficient of friction of a touching tool.
    #[must_use]
    pub fn shape(&self) -> Option<(ToolShape, f64)> {
        match self.hold {
            Hold::Nothing { shape, friction, .. } => Some((shape, friction)),
            Hold::Node { .. } | Hold::Point { .. } => None,
        }
    }

    /// Whether the tool acts on the body: it touches or holds it, or is behind its coupling.
    pub(crate) fn acts(&self) -> bool {
        self.touches() || self.proxy_m.is_some()
    }

    /// Whether the tool touches or holds the body.
    pub(crate) fn touches(&self) -> bool {
        !self.touched.is_empty() || !matches!(self.hold, Hold::Nothing { .. })
    }

    /// Notes that the tool has been out of reach of the body.
    pub(crate) fn set_out_of_reach(&mut self) {
        self.touched_nodes.clear();
        if let Hold::Nothing { clear, .. } = &mut self.hold {
            *clear = true;
        }
    }

    /// Whether the tool can touch: it holds nothing and is not inside the body.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        matches!(self.hold, Hold::Nothing { clear: true, .. })
    }

    /// Rows that gave an impulse in the last step, patch by patch. A patch is one row, or nine under a contact wider
    /// than 0.8 cells. Empty for a tool that holds.
    #[must_use]
    pub fn touched(&self) -> &[TouchedPoint] {
        &self.touched
    }

    /// Nodes of the triangles that the tool pushed during the last advance, each once. Empty for a tool that holds.
    #[must_use]
    pub fn touched_nodes(&self) -> &[usize] {
        &self.touched_nodes
    }

    /// Points at which the tool acts on the body now: the held point, or for each active row the mean of the surface
    /// under its part of the pressure.
    #[must_use]
    pub fn points(&self) -> Vec<BodyPoint> {
        match &self.hold {
            Hold::Node { node, .. } => vec![BodyPoint::node(*node)],
            Hold::Point { point, .. } => vec![point.clone()],
            Hold::Nothing { .. } => self.touched.iter().map(TouchedPoint::body_point).collect(),
        }
    }

    /// Mean outward unit normal of the touched surface, weighted by the normal impulses; `None` without contact.
    #[must_use]
    pub fn normal(&self) -> Option<DVec3> {
        let push: DVec3 = self.touched.iter().map(|t| t.impulse_ns.dot(t.normal) * t.normal).sum();
        (-push).try_normalize()
    }

    /// Force of the body on the hand, N, in the frame of the body, without the inertia of the held or touched nodes.
    ///
    /// It is the internal force on the driven node or on the held point, Σ w_i F_i / Σ w_i². For a touch it is the
    /// sum over all rows that gave an impulse in the last step, each projected into its friction cone (see
    /// [`ToolContact::touched`]). A coupling limits it to its maximum force.
    ///
    /// # Panics
    /// If the contact belongs to a body with more nodes; see [`ToolContact::validate`].
    #[must_use]
    pub fn displayed_force_n(&self, body: &Body) -> DVec3 {
        Self::shared_force_n([(self, body)])
    }

    /// Force on the hand of a tool with several `contacts`, each with its body, N: the sum of their forces, see
    /// [`ToolContact::displayed_force_n`]. The coupling limits the sum, not its parts: a tool that is clamped between two bodies may bear
    /// more from each of them.
    ///
    /// # Panics
    /// As [`ToolContact::displayed_force_n`].
    #[must_use]
    pub fn shared_force_n<'a>(contacts: impl IntoIterator<Item = (&'a Self, &'a Body)>) -> DVec3 {
        let mut coupling = None;
        let forces = contacts.into_iter().map(|(contact, body)| {
            coupling = coupling.or(contact.coupling);
            contact.force_of_body_n(body)
        });
        let force_n = forces.reduce(|a, b| a + b).unwrap_or_default();
        coupling.map_or(force_n, |coupling| coupling.limit(force_n))
    }

    /// Force of `body` on the tool, N, as [`ToolContact::displayed_force_n`] without the limit of the coupling.
    ///
    /// # Panics
    /// As [`ToolContact::displayed_force_n`].
    #[must_use]
    pub fn force_of_body_n(&self, body: &Body) -> DVec3 {
        match &self.hold {
            Hold::Node { node, .. } => body.internal_force_on_n(*node),
            Hold::Point { point, .. } => point.internal_force_n(body),
            Hold::Nothing { friction, .. } => {
                touched_point::displayed_force_n(&self.touched, *friction, body)
            }
        }
    }

    /// Adds the forces of the tool on the nodes in the last step to `force_n`, N. The force on a driven node is not
    /// included.
    ///
    /// # Panics
    /// If `force_n` has no entry for a touched or held node.
    pub fn add_force_n(&self, force_n: &mut [DVec3]) {
        for touched in self.touched.iter().filter(|touched| touched.step_s > 0.0) {
            let f = touched.impulse_ns / touched.step_s;
            touched.nodes.iter().for_each(|&(node, w)| force_n[node] += w * f);
        }
        if let (Hold::Point { point, .. }, (impulse_ns, step_s)) = (&self.hold, self.gripped)
            && step_s > 0.0
        {
            point.nodes().iter().for_each(|&(node, w)| force_n[node] += w * impulse_ns / step_s);
        }
    }

    /// Rejects a contact with nodes that do not exist in `body` or are fixed.
    ///
    /// # Errors
    /// [`BodyError::InvalidNode`].
    pub fn validate(&self, body: &Body) -> Result<(), BodyError> {
        match &self.hold {
            Hold::Node { node, .. } => can_hold(body, &[*node]),
            Hold::Point { point, .. } => can_hold(body, &point.named()),
            Hold::Nothing { .. } => {
                let nodes: Vec<usize> =
                    self.touched.iter().flat_map(|t| t.nodes.iter().map(|(n, _)| *n)).collect();
                if nodes.is_empty() { Ok(()) } else { can_hold(body, &nodes) }
            }
        }
    }

    /// Releases the touched surface. Returns whether there was a contact. A held point stays held; a touching proxy
    /// returns to the device.
    pub fn release(&mut self) -> bool {
        if let Hold::Nothing { .. } = self.hold {
            self.proxy_m = None;
        }
        let touching = !self.touched.is_empty();
        self.touched.clear();
        self.touched_nodes.clear();
        touching
    }

    /// Contact law of a tool that pushes along `push`.
    pub(crate) fn law(&self, push: DVec3) -> Option<Coulomb> {
        let (_, friction) = self.shape()?;
        Coulomb::new(push, friction).ok()
    }
}

fn finite(tool_m: DVec3) -> Result<DVec3, BodyError> {
    if tool_m.is_finite() { Ok(tool_m) } else { Err(BodyError::Path { index: 0 }) }
}

/// Rejects nodes that `body` does not have, and sets of nodes that are all fixed.
fn can_hold(body: &Body, nodes: &[usize]) -> Result<(), BodyError> {
    let network = body.network();
    if let Some(&node) = nodes.iter().find(|&&node| node >= network.node_count()) {
        return Err(BodyError::InvalidNode { node, reason: "there is no such node" });
    }
    match nodes.first() {
        Some(&node) if nodes.iter().all(|&node| network.is_fixed(node)) => {
            Err(BodyError::InvalidNode { node, reason: "it is fixed" })
        }
        _ => Ok(()),
    }
}
