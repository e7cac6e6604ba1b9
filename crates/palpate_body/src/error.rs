//! Errors of a body, its tools and its steps.

use crate::MeshError;
use palpate_laws::LawError;
use thiserror::Error;

/// Reason why a body cannot be built or stepped.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum BodyError {
    /// A network without nodes.
    #[error("the network has no nodes; it must have at least one")]
    NoNodes,
    /// A list does not have one entry for each node.
    #[error("{what} has {found} entries for {nodes} nodes; it must have exactly one for each")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Length of the list.
        found: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// The position of a node is not finite.
    #[error("the position of node {node} is not finite")]
    Position {
        /// Index of the node.
        node: usize,
    },
    /// A load is not finite.
    #[error("the load of node {node} is not finite")]
    Load {
        /// Index of the node.
        node: usize,
    },
    /// The mass of a node is not finite or not above 0.
    #[error("the mass of node {node} is {mass_kg} kg; it must be finite and above 0")]
    Mass {
        /// Index of the node.
        node: usize,
        /// Mass given, kg.
        mass_kg: f64,
    },
    /// The shape or the coupling of a tool is invalid.
    #[error(transparent)]
    Tool(#[from] LawError),
    /// The mesh cannot become a body.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A spring refers to a node that does not exist.
    #[error("spring {link} joins node {node}, but there are only {nodes} nodes (0 to {})", .nodes - 1)]
    NodeOutOfRange {
        /// Index of the spring.
        link: usize,
        /// Index of the node.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// A spring joins a node to itself.
    #[error("spring {link} joins node {node} with itself")]
    SelfLink {
        /// Index of the spring.
        link: usize,
        /// Index of the node.
        node: usize,
    },
    /// A spring joins two nodes at the same position and has no direction.
    #[error("spring {link} joins the nodes {a} and {b}, which are at the same place; move one of them")]
    ZeroLength {
        /// Index of the spring.
        link: usize,
        /// Index of one node.
        a: usize,
        /// Index of the other node.
        b: usize,
    },
    /// A state has the relaxed stress of another number of elements.
    #[error("the state has the relaxed stress of {found} elements; it must be that of {needed}, or empty")]
    RelaxedStress {
        /// Number of elements in the state.
        found: usize,
        /// Number of elements of the body that has it.
        needed: usize,
    },
    /// An element refers to a node that does not exist.
    #[error("element {element} has node {node}, but there are only {nodes} nodes (0 to {})", .nodes.saturating_sub(1))]
    ElementNode {
        /// Index of the element.
        element: usize,
        /// Index of the node.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// An element has no volume, or is inverted at rest.
    #[error(
        "element {element} is flat or inverted at rest; its corners must be in order and enclose a volume"
    )]
    ElementShape {
        /// Index of the element.
        element: usize,
    },
    /// A node to be fixed does not exist.
    #[error("node {node} cannot be fixed: there are only {nodes} nodes (0 to {})", .nodes.saturating_sub(1))]
    Fixed {
        /// Index of the node.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// A part of the network has no fixed node.
    #[error(
        "node {node} and its part of {nodes} nodes have no fixed node; fix one of them, or allow an unconstrained body \
         (`allow_unconstrained`, or `FixedRegion::None` of a component)"
    )]
    Unconstrained {
        /// First free node of the part.
        node: usize,
        /// Number of nodes of the part.
        nodes: usize,
    },
    /// The network consists of separate parts.
    #[error(
        "no springs connect node {node} to node {first}; connect them, make two bodies, or allow separate parts \
         (`allow_unconstrained`, or `FixedRegion::None` of a component)"
    )]
    Disconnected {
        /// First free node of the later part.
        node: usize,
        /// First free node of the network.
        first: usize,
    },
    /// Two springs join the same nodes. Use one spring with the sum of their stiffnesses.
    #[error(
        "spring {link} joins the nodes {a} and {b} like spring {earlier}; use one spring with the sum of their stiffnesses"
    )]
    DuplicateLink {
        /// Index of the later spring.
        link: usize,
        /// Index of the earlier spring.
        earlier: usize,
        /// Index of one node.
        a: usize,
        /// Index of the other node.
        b: usize,
    },
    /// The law of a spring is invalid.
    #[error("spring {link} has an invalid law")]
    Law {
        /// Index of the spring.
        link: usize,
        /// Error of the law.
        #[source]
        source: LawError,
    },
    /// All nodes are fixed.
    #[error("all {0} nodes are fixed; at least one must be free")]
    AllFixed(usize),
    /// A lattice has too few or too many nodes along an axis.
    #[error("a block needs 2 to {max} nodes along each axis; it was given {nodes:?}", max = crate::limits::MAX_NODES_PER_SIDE)]
    LatticeNodes {
        /// Numbers of nodes along x, y, z.
        nodes: [usize; 3],
    },
    /// A parameter is outside its allowed range.
    #[error("{what} is {value}; it must be {allowed}")]
    Parameter {
        /// Name of the parameter with its unit.
        what: &'static str,
        /// Value given.
        value: f64,
        /// Allowed range.
        allowed: &'static str,
    },
    /// The step would need too many substeps. The body is unchanged.
    #[error(
        "{needed} substeps of a tick are needed; at most {allowed} are allowed: soften the springs or use fewer \
         nodes (or raise `max_substeps`)"
    )]
    Substeps {
        /// Number of substeps needed for stability.
        needed: f64,
        /// Maximum number, [`crate::SemiImplicitEuler::max_substeps`].
        allowed: usize,
    },
    /// The matrix of an implicit step is not positive definite even when clamped, because a number has overflowed.
    #[error(
        "the matrix of the implicit step is not positive definite; reduce stiffness, mass or step length"
    )]
    Indefinite,
    /// The factorisation exceeds the memory.
    #[error(
        "the factorisation of a body of {nodes} free nodes failed; use `LinearSolver::ConjugateGradients`"
    )]
    TooLarge {
        /// Number of free nodes.
        nodes: usize,
    },
    /// Conjugate gradients did not converge. The body is unchanged.
    #[error(
        "conjugate gradients did not reach {tolerance} in {iterations} iterations; use `LinearSolver::Cholesky`, a shorter \
         step or a larger tolerance"
    )]
    NotConverged {
        /// Number of iterations.
        iterations: usize,
        /// Requested relative residual.
        tolerance: f64,
    },
    /// The cells are too elongated for an isotropic network of springs.
    #[error(
        "cells of {x_m} m x {y_m} m x {z_m} m are too far from cubes for an isotropic tissue: \
         choose the nodes so that no side is more than 1.2 times another"
    )]
    CellShape {
        /// Cell size along x, m.
        x_m: f64,
        /// Cell size along y, m.
        y_m: f64,
        /// Cell size along z, m.
        z_m: f64,
    },
    /// The triangles of a surface cannot be oriented consistently, as on a Möbius strip.
    #[error(
        "the surface is one-sided: triangle {triangle} and its neighbours cannot be oriented consistently; remove the \
         triangles that close a twisted strip from `Surface::triangles`"
    )]
    OneSidedSurface {
        /// Index of an inconsistent triangle.
        triangle: usize,
    },
    /// A surface refers to a node, point or vertex that does not exist.
    #[error("the surface refers to index {index}; it must be below {below}")]
    Surface {
        /// Index given.
        index: usize,
        /// Number of existing ones.
        below: usize,
    },
    /// A tool cannot hold a node.
    #[error("the tool cannot hold node {node}: {reason}")]
    InvalidNode {
        /// Index of the node.
        node: usize,
        /// Reason.
        reason: &'static str,
    },
    /// The contacts of a tool with several bodies do not fit. Bodies and tools are unchanged.
    #[error("the contacts of a tool with several bodies do not fit: {reason}")]
    SharedTool {
        /// Reason.
        reason: &'static str,
    },
    /// A point of the tool's path is not finite. The body is unchanged.
    #[error("point {index} of the tool's path is not finite")]
    Path {
        /// Index in the path.
        index: usize,
    },
    /// The length of the tool's path does not fit the number of ticks. The body is unchanged.
    #[error("the path for {ticks} ticks has {points} points; it must have {}, one more than ticks", .ticks + 1)]
    PathLength {
        /// Number of ticks.
        ticks: usize,
        /// Number of points given.
        points: usize,
    },
    /// A position or velocity is no longer finite. The body is as it was before the step.
    #[error(
        "the step diverged at node {node}; the body is as it was before. Take more substeps or softer springs"
    )]
    Diverged {
        /// Index of the first such node.
        node: usize,
    },
}

/// Failure of a joint advance of several bodies, which are then unchanged.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("body {body} of a joint step cannot be stepped")]
pub struct JointStepError {
    /// Index of the body.
    pub body: usize,
    /// Reason.
    #[source]
    pub error: BodyError,
}

/// Returns `value` if `ok`, else [`BodyError::Parameter`].
pub(crate) fn check(
    what: &'static str,
    value: f64,
    ok: bool,
    allowed: &'static str,
) -> Result<f64, BodyError> {
    if ok { Ok(value) } else { Err(BodyError::Parameter { what, value, allowed }) }
}

/// Returns `value` if it is finite and above zero.
pub(crate) fn check_positive(what: &'static str, value: f64) -> Result<f64, BodyError> {
    check(what, value, value.is_finite() && value > 0.0, "finite and above 0")
}

/// Returns `ratio` if it is finite and at least zero.
pub(crate) fn check_damping_ratio(ratio: f64) -> Result<f64, BodyError> {
    check("damping ratio", ratio, ratio.is_finite() && ratio >= 0.0, "finite and at least 0")
}
