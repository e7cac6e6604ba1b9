//! What can be wrong with a body, its tool or its step.

use crate::MeshError;
use palpate_laws::LawError;
use thiserror::Error;

/// Why a body could not be built or stepped.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum BodyError {
    /// A network without nodes.
    #[error("a network needs at least one node")]
    NoNodes,
    /// Lists that should have one entry for each node differ in length.
    #[error("{what} has {found} entries for {nodes} nodes; it needs exactly one for each")]
    Length {
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The number of nodes.
        nodes: usize,
    },
    /// A node's position has a coordinate that is not finite.
    #[error("the position of node {node} is not finite")]
    Position {
        /// The node's index.
        node: usize,
    },
    /// A load has a component that is not finite.
    #[error("the load of node {node} is not finite")]
    Load {
        /// The node's index.
        node: usize,
    },
    /// A node's mass makes no sense.
    #[error("the mass of node {node} is {mass_kg} kg; it must be finite and above 0")]
    Mass {
        /// The node's index.
        node: usize,
        /// The mass given.
        mass_kg: f64,
    },
    /// The shape of a tool makes no sense.
    #[error(transparent)]
    Tool(#[from] LawError),
    /// A mesh cannot become a body.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A spring names a node that does not exist.
    #[error("spring {link} joins node {node}, but there are only {nodes} nodes (0 to {})", .nodes - 1)]
    NodeOutOfRange {
        /// The spring's index.
        link: usize,
        /// The index it names.
        node: usize,
        /// The number of nodes.
        nodes: usize,
    },
    /// A spring joins a node with itself.
    #[error("spring {link} joins node {node} with itself")]
    SelfLink {
        /// The spring's index.
        link: usize,
        /// The node.
        node: usize,
    },
    /// A spring joins two nodes that are at the same place, so it has no direction.
    #[error("spring {link} joins the nodes {a} and {b}, which are at the same place; move one of them")]
    ZeroLength {
        /// The spring's index.
        link: usize,
        /// One node.
        a: usize,
        /// The other.
        b: usize,
    },
    /// A node that should be fixed does not exist.
    #[error("node {node} cannot be fixed: there are only {nodes} nodes (0 to {})", .nodes.saturating_sub(1))]
    Fixed {
        /// The index named.
        node: usize,
        /// The number of nodes.
        nodes: usize,
    },
    /// A part of the network has no fixed node.
    #[error(
        "node {node} and what it is joined to, {nodes} nodes, are fixed to nothing; fix one of them, or let it float \
         (`allow_free`; of a component `FixedRegion::Nothing`)"
    )]
    Unheld {
        /// Its first free node.
        node: usize,
        /// How many nodes the part has.
        nodes: usize,
    },
    /// The network is in two parts.
    #[error(
        "node {node} is not joined to node {first} by any springs; join them, make two bodies, or let them float \
         (`allow_free`; of a component `FixedRegion::Nothing`)"
    )]
    Disconnected {
        /// The first free node of the later part.
        node: usize,
        /// The first free node of all.
        first: usize,
    },
    /// Two springs join the same two nodes. Add their stiffnesses instead.
    #[error("spring {link} joins the nodes {a} and {b}, as spring {earlier} does already")]
    DuplicateLink {
        /// The later spring's index.
        link: usize,
        /// The earlier spring's index.
        earlier: usize,
        /// One node.
        a: usize,
        /// The other node.
        b: usize,
    },
    /// A parameter of a spring's law makes no sense.
    #[error("spring {link} makes no sense")]
    Law {
        /// The spring's index.
        link: usize,
        /// What is wrong with it.
        #[source]
        source: LawError,
    },
    /// Every node is fixed: nothing can move.
    #[error("all {0} nodes are fixed; at least one must be free")]
    AllFixed(usize),
    /// A lattice with too few or too many nodes along an axis.
    #[error("a block needs 2 to {max} nodes along each axis; it was given {nodes:?}", max = crate::limits::MAX_NODES_PER_SIDE)]
    LatticeNodes {
        /// Nodes along x, y, z.
        nodes: [usize; 3],
    },
    /// A named quantity is outside what is allowed.
    #[error("{what} is {value}; it must be {allowed}")]
    Parameter {
        /// The quantity with its unit.
        what: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// The step would need more substeps than are allowed. The body has not been stepped.
    #[error(
        "{needed} substeps of a tick are needed; at most {allowed} are allowed: soften the springs or use fewer \
         nodes (or raise `max_substeps`)"
    )]
    Substeps {
        /// Substeps needed for stability.
        needed: f64,
        /// [`crate::SemiImplicitEuler::max_substeps`].
        allowed: usize,
    },
    /// The matrix of an implicit step is not positive definite even when clamped: a number has overflowed.
    #[error(
        "the matrix of the implicit step is not positive definite; are stiffness, mass and step within reason?"
    )]
    Indefinite,
    /// Memory does not last for a factorisation.
    #[error("the factorisation of a body of {nodes} free nodes failed; take conjugate gradients")]
    TooLarge {
        /// Number of free nodes.
        nodes: usize,
    },
    /// Conjugate gradients did not converge. The body is as it was before the step.
    #[error(
        "conjugate gradients are not at {tolerance} after {iterations} iterations; take Cholesky, a shorter step or a \
         larger tolerance"
    )]
    NotConverged {
        /// Iterations taken.
        iterations: usize,
        /// The residual asked for.
        tolerance: f64,
    },
    /// The cells of a lattice are too long in one direction for an isotropic network of springs.
    #[error(
        "cells of {x_m} m x {y_m} m x {z_m} m are too far from cubes for an isotropic tissue: \
         choose the nodes so that no side is more than 1.2 times another"
    )]
    CellShape {
        /// Cell size along x.
        x_m: f64,
        /// Cell size along y.
        y_m: f64,
        /// Cell size along z.
        z_m: f64,
    },
    /// The triangles of a surface cannot all face the same way, as on a Möbius strip: it has no outside.
    #[error(
        "the surface has one side only: triangle {triangle} and its neighbours cannot all face the same way; take out of \
         `Surface::triangles` what closes a strip with a twist"
    )]
    OneSidedSurface {
        /// Index of a triangle where two ways round meet.
        triangle: usize,
    },
    /// A surface names a node or vertex that does not exist.
    #[error("the surface names index {index}, but there are only {below}")]
    Surface {
        /// The index.
        index: usize,
        /// How many there are.
        below: usize,
    },
    /// A node that the tool should hold does not exist or is fixed.
    #[error("the tool cannot hold node {node}: {why}")]
    CannotHold {
        /// The node's index.
        node: usize,
        /// The reason.
        why: &'static str,
    },
    /// A point of the tool's path is not finite. The body has not been stepped.
    #[error("point {index} of the tool's path is not finite")]
    Path {
        /// Its index in the path.
        index: usize,
    },
    /// The tool's path does not fit the ticks to be stepped. The body has not been stepped.
    #[error("a step of {ticks} ticks needs a path of {} points, one more than ticks; it was given {points}", .ticks + 1)]
    PathLength {
        /// Ticks to be stepped.
        ticks: usize,
        /// Points given.
        points: usize,
    },
    /// The step left a node at a place or speed that is not finite. The body is as it was before the step.
    #[error(
        "the step diverged at node {node}; the body is as it was before. Take more substeps or softer springs"
    )]
    Diverged {
        /// The first such node.
        node: usize,
    },
}

/// `value` if `ok`, else a [`BodyError::Parameter`].
pub(crate) fn check(
    what: &'static str,
    value: f64,
    ok: bool,
    allowed: &'static str,
) -> Result<f64, BodyError> {
    if ok { Ok(value) } else { Err(BodyError::Parameter { what, value, allowed }) }
}

/// `value` if it is finite and above zero.
pub(crate) fn check_positive(what: &'static str, value: f64) -> Result<f64, BodyError> {
    check(what, value, value.is_finite() && value > 0.0, "finite and above 0")
}

/// `ratio` if it is a damping ratio: finite and at least zero.
pub(crate) fn check_damping_ratio(ratio: f64) -> Result<f64, BodyError> {
    check("damping ratio", ratio, ratio.is_finite() && ratio >= 0.0, "finite and at least 0")
}
