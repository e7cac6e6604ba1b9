//! The tool as the body sees it: it holds a point of the body, or touches its surface.

mod touched_point;

pub use touched_point::TouchedPoint;

use crate::{Body, BodyError, BodyPoint};
use glam::DVec3;
use palpate_laws::{Coulomb, ToolShape, VirtualCoupling};

/// One point of the tool's path, in the body's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolPoint {
    /// Centre of the tool, m.
    pub position_m: DVec3,
    /// Its velocity, m/s. It need not be the derivative of the positions: an estimator may have smoothed it. Only a held
    /// node takes it over; what is touched or held elsewhere goes by the positions.
    pub velocity_m_per_s: DVec3,
}

impl ToolPoint {
    /// A tool that stands still at `position_m`.
    #[must_use]
    pub fn at_rest(position_m: DVec3) -> Self {
        Self { position_m, velocity_m_per_s: DVec3::ZERO }
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.position_m.is_finite() && self.velocity_m_per_s.is_finite()
    }
}

/// How a tool acts on a body, and where it does now.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolContact {
    pub(crate) hold: Hold,
    /// The rows of contact patches that gave an impulse in the last step; none for a tool that holds.
    pub(crate) touched: Vec<TouchedPoint>,
    /// The nodes on which it pushed at any time in the last advance.
    pub(crate) touched_nodes: Vec<usize>,
    /// What draws it to the device, unless it is the device.
    pub(crate) coupling: Option<VirtualCoupling>,
    /// λ of what it holds in the last step, N s, and that step's length, s.
    pub(crate) gripped: (DVec3, f64),
    /// Where it is behind its coupling, m; where the device is if that is not known.
    pub(crate) proxy_m: Option<DVec3>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Hold {
    /// A node, driven: it is where the tool is, plus an offset, and as fast.
    Node { node: usize, offset_m: DVec3 },
    /// A point, by a two-sided row.
    Point { point: BodyPoint, offset_m: DVec3 },
    /// Nothing: it pushes and rubs, if it is `clear`: not in the body, or come out of it.
    Nothing { shape: ToolShape, friction: f64, clear: bool },
}

impl ToolContact {
    /// A tool at `tool_m` that holds `node` where it is now, for ever, pushing and pulling. The node's position and
    /// velocity are the tool's.
    ///
    /// # Errors
    /// [`BodyError::CannotHold`] when there is no such node or it is fixed; [`BodyError::Path`] when `tool_m`
    /// is not finite.
    pub fn hold(body: &Body, node: usize, tool_m: DVec3) -> Result<Self, BodyError> {
        can_hold(body, &[node])?;
        let offset_m = body.positions_m()[node] - finite(tool_m)?;
        Ok(Self::new(Hold::Node { node, offset_m }))
    }

    /// A tool at `tool_m` that holds `point` where it is now, for ever, pushing and pulling: a place on a triangle or in a
    /// cell, by impulses on its nodes.
    ///
    /// # Errors
    /// [`BodyError::CannotHold`] when the point has a node that the body has not, or none that is free;
    /// [`BodyError::Path`] when `tool_m` is not finite.
    pub fn hold_point(body: &Body, point: BodyPoint, tool_m: DVec3) -> Result<Self, BodyError> {
        can_hold(body, &point.named())?;
        let offset_m = point.of(body.positions_m()) - finite(tool_m)?;
        Ok(Self::new(Hold::Point { point, offset_m }))
    }

    /// A tool that touches nothing yet. It pushes the surface of the body before it in contact patches, at most four, one-sided and with
    /// coefficient of friction `friction`, wherever it meets it and it is not fixed: it slides, rolls over edges, leaves and comes again. One that begins with
    /// its centre in the body, or jumps there, touches nothing until all of it has come out.
    ///
    /// # Errors
    /// [`BodyError::Tool`] when the shape makes no sense, [`BodyError::Parameter`] when the friction is negative or not
    /// finite.
    pub fn touch(shape: ToolShape, friction: f64) -> Result<Self, BodyError> {
        shape.validate()?;
        let ok = friction.is_finite() && friction >= 0.0;
        crate::error::check("coefficient of friction", friction, ok, "finite and at least 0")?;
        Ok(Self::new(Hold::Nothing { shape, friction, clear: true }))
    }

    fn new(hold: Hold) -> Self {
        let (touched, touched_nodes, gripped) = (Vec::new(), Vec::new(), (DVec3::ZERO, 0.0));
        Self { hold, touched, touched_nodes, gripped, coupling: None, proxy_m: None }
    }

    /// The same tool behind `coupling`: what the body meets is a proxy, which the coupling draws to the device with its
    /// largest force at most, so that a device deeper than the body can go leaves it behind. Without one the tool is where
    /// the device is, whatever that takes. A node that is held is then held as a point, by impulses.
    ///
    /// # Errors
    /// [`BodyError::Tool`] when the coupling makes no sense.
    pub fn with_coupling(mut self, coupling: VirtualCoupling) -> Result<Self, BodyError> {
        coupling.validate()?;
        self.coupling = Some(coupling);
        if let Hold::Node { node, offset_m } = self.hold {
            self.hold = Hold::Point { point: BodyPoint::node(node), offset_m };
        }
        Ok(self)
    }

    /// Its coupling, if it has one.
    #[must_use]
    pub fn coupling(&self) -> Option<VirtualCoupling> {
        self.coupling
    }

    /// Where the tool is, m, with the device at `device_m`: there, or behind its coupling.
    #[must_use]
    pub fn proxy_m(&self, device_m: DVec3) -> DVec3 {
        self.proxy_m.unwrap_or(device_m)
    }

    /// The node that it drives, if it holds one.
    #[must_use]
    pub fn driven_node(&self) -> Option<usize> {
        match self.hold {
            Hold::Node { node, .. } => Some(node),
            Hold::Point { .. } | Hold::Nothing { .. } => None,
        }
    }

    /// The point that it holds, unless it drives a node or holds nothing.
    #[must_use]
    pub fn held_point(&self) -> Option<&BodyPoint> {
        match &self.hold {
            Hold::Point { point, .. } => Some(point),
            Hold::Node { .. } | Hold::Nothing { .. } => None,
        }
    }

    /// Shape and coefficient of friction of a tool that touches.
    #[must_use]
    pub fn shape(&self) -> Option<(ToolShape, f64)> {
        match self.hold {
            Hold::Nothing { shape, friction, .. } => Some((shape, friction)),
            Hold::Node { .. } | Hold::Point { .. } => None,
        }
    }

    /// Whether it holds nothing and can touch: it is not in the body.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        matches!(self.hold, Hold::Nothing { clear: true, .. })
    }

    /// Where it touches the surface: the rows that pushed it in the last step, those of each contact patch one after another. A patch is one
    /// row, or nine under a contact wider than 0.8 cells. Empty for a tool that holds.
    #[must_use]
    pub fn touched(&self) -> &[TouchedPoint] {
        &self.touched
    }

    /// The nodes of the triangles under it on which it pushed at any time in the last advance, each once. Empty for a tool that holds.
    #[must_use]
    pub fn touched_nodes(&self) -> &[usize] {
        &self.touched_nodes
    }

    /// The points through which it acts on the body now: the one that it holds, or for each row that pushes the mean of the surface under its
    /// part of the tool's pressure.
    #[must_use]
    pub fn points(&self) -> Vec<BodyPoint> {
        match &self.hold {
            Hold::Node { node, .. } => vec![BodyPoint::node(*node)],
            Hold::Point { point, .. } => vec![point.clone()],
            Hold::Nothing { .. } => self.touched.iter().map(TouchedPoint::body_point).collect(),
        }
    }

    /// The unit normal of the surface where it is touched, out of the body, in the mean over what pushes; `None` when nothing
    /// is touched.
    #[must_use]
    pub fn normal(&self) -> Option<DVec3> {
        let push: DVec3 = self.touched.iter().map(|t| t.impulse_ns.dot(t.normal) * t.normal).sum();
        (-push).try_normalize()
    }

    /// What the body does to the hand now, N, in the body's frame, without the inertia of what is held or touched: the
    /// internal force on the driven node, or on the row that is held, Σ w_i F_i / Σ w_i²; for a touch on all rows that
    /// pushed in the last step, each as far as it lies in its friction cone (see [`ToolContact::touched`]). Behind a coupling
    /// no more than the coupling's largest.
    ///
    /// # Panics
    /// When the contact belongs to a body with more nodes; see [`ToolContact::validate`].
    #[must_use]
    pub fn displayed_force_n(&self, body: &Body) -> DVec3 {
        let force_n = match &self.hold {
            Hold::Node { node, .. } => body.internal_force_on_n(*node),
            Hold::Point { point, .. } => point.internal_force_n(body),
            Hold::Nothing { friction, .. } => {
                touched_point::displayed_force_n(&self.touched, *friction, body)
            }
        };
        self.coupling.map_or(force_n, |coupling| coupling.limit(force_n))
    }

    /// Adds what it did to the nodes in the last step, N, to `force_n`: its impulses over the length of the step. What a driven
    /// node takes is not among it.
    ///
    /// # Panics
    /// When `force_n` has no entry for a node that it touches or holds.
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

    /// Refuses a contact that belongs to another body: one with nodes that `body` has not, or has fixed.
    ///
    /// # Errors
    /// [`BodyError::CannotHold`].
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

    /// Lets go of what is touched; whether something was. What is held stays held; a proxy that touched is where the device
    /// is.
    pub fn release(&mut self) -> bool {
        if let Hold::Nothing { .. } = self.hold {
            self.proxy_m = None;
        }
        let touching = !self.touched.is_empty();
        self.touched.clear();
        self.touched_nodes.clear();
        touching
    }

    /// The law of a touch whose tool pushes along `push`.
    pub(crate) fn law(&self, push: DVec3) -> Option<Coulomb> {
        let (_, friction) = self.shape()?;
        Coulomb::new(push, friction).ok()
    }
}

fn finite(tool_m: DVec3) -> Result<DVec3, BodyError> {
    if tool_m.is_finite() { Ok(tool_m) } else { Err(BodyError::Path { index: 0 }) }
}

/// Refuses nodes that `body` does not have, and nodes of which none can move.
fn can_hold(body: &Body, nodes: &[usize]) -> Result<(), BodyError> {
    let network = body.network();
    if let Some(&node) = nodes.iter().find(|&&node| node >= network.node_count()) {
        return Err(BodyError::CannotHold { node, why: "there is no such node" });
    }
    match nodes.first() {
        Some(&node) if nodes.iter().all(|&node| network.is_fixed(node)) => {
            Err(BodyError::CannotHold { node, why: "it is fixed" })
        }
        _ => Ok(()),
    }
}
