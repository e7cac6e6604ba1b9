//! The tool as the body sees it: a point that drives one node, by grip or by touch.

use crate::error::check_positive;
use crate::{Body, BodyError, SurfaceNode};
use glam::DVec3;
use palpate_laws::one_sided;

/// One point of the tool's path, in the body's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolPoint {
    /// Centre of the tool, m.
    pub position_m: DVec3,
    /// Its velocity, m/s. It need not be the derivative of the positions: an estimator may have smoothed it.
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

/// A node that the tool has touched and now drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touched {
    /// The node.
    pub node: usize,
    /// Outward unit normal of the surface there, at rest.
    pub normal: DVec3,
    /// Position of the node minus position of the tool, m. Constant while touched: the node sticks.
    pub offset_m: DVec3,
}

/// How a tool acts on a body.
///
/// While a node is driven its position is the tool's plus an offset and its velocity the tool's; the force on
/// the hand is the internal force on that node (springs and dampers, without its inertia).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolContact {
    /// Two-sided: the node follows the tool for ever, pushed and pulled.
    Held {
        /// The node.
        node: usize,
        /// Position of the node minus position of the tool, m.
        offset_m: DVec3,
    },
    /// One-sided, the seed paper's rule: touch begins when the sphere's foremost point comes below a surface
    /// node, and ends when the force on the driven node no longer pushes along the normal.
    Touch {
        /// Radius of the tool, m.
        radius_m: f64,
        /// The node touched now, if any.
        touched: Option<Touched>,
    },
}

impl ToolContact {
    /// A tool at `tool_m` that holds `node` where it is now.
    ///
    /// # Errors
    /// [`BodyError::CannotHold`] when there is no such node or it is fixed; [`BodyError::Path`] when `tool_m`
    /// is not finite.
    pub fn hold(body: &Body, node: usize, tool_m: DVec3) -> Result<Self, BodyError> {
        can_drive(body, node)?;
        if !tool_m.is_finite() {
            return Err(BodyError::Path { index: 0 });
        }
        Ok(Self::Held { node, offset_m: body.positions_m()[node] - tool_m })
    }

    /// A tool of radius `radius_m` that touches nothing yet.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] when the radius is not finite and above zero.
    pub fn touch(radius_m: f64) -> Result<Self, BodyError> {
        Ok(Self::Touch { radius_m: check_positive("tool radius, m", radius_m)?, touched: None })
    }

    /// The node that the tool drives now.
    #[must_use]
    pub fn driven_node(&self) -> Option<usize> {
        self.driven().map(|(node, _)| node)
    }

    /// The surface normal of a one-sided contact that is closed now.
    #[must_use]
    pub fn touched(&self) -> Option<Touched> {
        match self {
            Self::Touch { touched, .. } => *touched,
            Self::Held { .. } => None,
        }
    }

    /// What the body does to the hand now, N, in the body's frame: the internal force on the driven node; for
    /// a touch only while it pushes along the normal; zero when nothing is driven.
    ///
    /// # Panics
    /// When the contact belongs to a body with more nodes; see [`ToolContact::validate`].
    #[must_use]
    pub fn displayed_force_n(&self, body: &Body) -> DVec3 {
        match *self {
            Self::Held { node, .. } => body.internal_force_on_n(node),
            Self::Touch { touched: Some(Touched { node, normal, .. }), .. } => {
                one_sided(body.internal_force_on_n(node), normal)
            }
            Self::Touch { touched: None, .. } => DVec3::ZERO,
        }
    }

    /// Refuses a contact that belongs to another body: one that drives a node which `body` has not, or has fixed.
    ///
    /// # Errors
    /// [`BodyError::CannotHold`].
    pub fn validate(&self, body: &Body) -> Result<(), BodyError> {
        self.driven_node().map_or(Ok(()), |node| can_drive(body, node))
    }

    /// Lets go of what is touched; whether something was. What is held stays held.
    pub fn let_go(&mut self) -> bool {
        match self {
            Self::Touch { touched, .. } => touched.take().is_some(),
            Self::Held { .. } => false,
        }
    }

    /// The driven node and its offset from the tool.
    pub(crate) fn driven(&self) -> Option<(usize, DVec3)> {
        match *self {
            Self::Held { node, offset_m } => Some((node, offset_m)),
            Self::Touch { touched, .. } => touched.map(|t| (t.node, t.offset_m)),
        }
    }

    /// Begins a touch if the tool at `tool_m` has come below a free surface node of `body`.
    pub(crate) fn make(&mut self, body: &Body, tool_m: DVec3) {
        let Self::Touch { radius_m, touched: touched @ None } = self else {
            return;
        };
        let surface = body.surface();
        let reach2 = surface.reach_m * surface.reach_m;
        let mut nearest = reach2;
        for SurfaceNode { node, normals } in &surface.nodes {
            if body.network().is_fixed(*node) {
                continue;
            }
            let from_node = tool_m - body.positions_m()[*node];
            // Of the faces that meet here, the one that the tool is least inside of.
            let height = |n: &&DVec3| from_node.dot(**n);
            let Some(&normal) = normals.iter().max_by(|a, b| height(a).total_cmp(&height(b))) else {
                continue;
            };
            let gap = from_node.dot(normal) - *radius_m;
            let across = from_node - from_node.dot(normal) * normal;
            // A tool deep inside (a start in the middle of the body, say) touches nothing until it comes out.
            if gap < 0.0 && gap > -surface.reach_m && across.length_squared() < nearest {
                nearest = across.length_squared();
                *touched = Some(Touched { node: *node, normal, offset_m: -across - *radius_m * normal });
            }
        }
    }

    /// Ends a touch whose internal force `force_n` on the driven node no longer pushes.
    pub(crate) fn release(&mut self, force_n: DVec3) {
        if let Self::Touch { touched, .. } = self
            && touched.is_some_and(|t| one_sided(force_n, t.normal) == DVec3::ZERO)
        {
            *touched = None;
        }
    }
}

fn can_drive(body: &Body, node: usize) -> Result<(), BodyError> {
    let why = if node >= body.network().node_count() {
        "there is no such node"
    } else if body.network().is_fixed(node) {
        "it is fixed"
    } else {
        return Ok(());
    };
    Err(BodyError::CannotHold { node, why })
}
