//! The near field with the reduced far field, as plain data.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod capacity;
mod elements;
mod surface;
mod validation;

pub use capacity::NearFieldCapacity;
pub use elements::{NearDomain, NearEnd, NearHexahedron, NearSpring, NearTetrahedron};
pub use surface::{NearContact, NearPatch, NearPoint, NearTriangle};

use crate::dense::{Cholesky, zeros};
use crate::{LocalModelError, OtherToolForce};
use glam::DVec3;
use palpate_laws::{HexahedronShape, Spring, ToolShape, VirtualCoupling};

/// How the tool acts on the support set S.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Support {
    /// The tool prescribes the position of the only node of S, at the offset of the model step.
    #[default]
    Driven,
    /// The tool holds the point Σ w_i x_i over S, bilaterally.
    Held,
    /// The tool touches the surface of S, unilaterally and with friction.
    Touched {
        /// Shape of the tool.
        shape: ToolShape,
        /// Friction coefficient μ.
        friction: f64,
    },
}

/// Integrator of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickIntegrator {
    /// Semi-implicit Euler with the force laws at the current state, as in the body's step.
    Explicit {
        /// Substeps in a tick, 1 to 64.
        substeps: u32,
    },
    /// Linearly implicit Euler with the tangent of the model step.
    Implicit {
        /// Substeps in a tick, 1 to 64.
        substeps: u32,
    },
}

impl TickIntegrator {
    /// Substeps in a tick.
    #[must_use]
    pub fn substeps(self) -> u32 {
        match self {
            Self::Explicit { substeps } | Self::Implicit { substeps } => substeps,
        }
    }

    /// Whether the integrator is implicit.
    #[must_use]
    pub fn is_implicit(self) -> bool {
        matches!(self, Self::Implicit { .. })
    }
}

/// The support set S with exact springs and elements, and the rest of the body linearised about the model step and reduced to δx_r = V q.
///
/// The springs, elements and strongly compressed cells incident to S keep their nonlinear laws. V is orthonormal with respect to the mass
/// matrix: Vᵀ M V = 1. The state is z = (δx_S, q) of 3s + p numbers. Buffers have the length of their capacity; matrices are
/// stored by rows in the first entries.
#[derive(Clone, Debug, PartialEq)]
pub struct NearField {
    /// Number s of nodes of S; 0 where the tool reaches no node.
    pub nodes: usize,
    /// Number p of columns of V.
    pub order: usize,
    /// Number of ring nodes.
    pub ring: usize,
    /// Number of near springs.
    pub springs: usize,
    /// Number of near tetrahedra.
    pub tetrahedra: usize,
    /// Number of near hexahedra.
    pub hexahedra: usize,
    /// Number of shapes of near hexahedra.
    pub shapes: usize,
    /// Number of near smoothed domains of tetrahedra.
    pub domains: usize,
    /// Number of surface points.
    pub points: usize,
    /// Number of surface triangles.
    pub triangles: usize,
    /// How the tool acts on S.
    pub support: Support,
    /// Weights w over S of the held point of [`Support::Held`].
    pub weight: Vec<f64>,
    /// Positions of S at the model step, m.
    pub node_m: Vec<DVec3>,
    /// Inverse masses of S, 1/kg; 0 for a fixed node.
    pub node_per_kg: Vec<f64>,
    /// Drag on the nodes of S, N s/m: the force on a node is this times its velocity, opposed to it.
    pub drag_ns_per_m: Vec<f64>,
    /// Positions of the ring at the model step, m.
    pub ring_m: Vec<DVec3>,
    /// The 3 × `ring` rows of V of the ring nodes, stored by columns.
    pub basis: Vec<f64>,
    /// Near springs: the springs incident to S.
    pub near: Vec<NearSpring>,
    /// Near tetrahedra: those of strongly compressed cells that have a node in S.
    pub tetrahedron: Vec<NearTetrahedron>,
    /// Near hexahedra: the elements incident to S.
    pub hexahedron: Vec<NearHexahedron>,
    /// Shapes of the near hexahedra at rest.
    pub shape: Vec<HexahedronShape>,
    /// Near smoothed domains of tetrahedra: those incident to S.
    pub domain: Vec<NearDomain>,
    /// Nodes of the near domains, one domain after the other: an index i < s is node i of S, s + i is node i of the ring.
    pub domain_node: Vec<u16>,
    /// Gradients of the nodes of the near domains, 1/m.
    pub domain_gradient_per_m: Vec<DVec3>,
    /// Surface points.
    pub point: Vec<NearPoint>,
    /// Surface triangles.
    pub triangle: Vec<NearTriangle>,
    /// Contact parameters of the body, and the patches at the model step.
    pub contact: NearContact,
    /// Compliance of the grid below S, for the contact compliance that the grid lacks: the displacement of node i along the normal by a
    /// unit force on node j, times Young's modulus, s × s, 1/m. Used where [`NearContact::adds_compliance`] is set.
    pub compliance: Vec<f64>,
    /// K̃ = Vᵀ K_far V, 1/s².
    pub stiffness: Vec<f64>,
    /// B̃ = Vᵀ B_far V, 1/s.
    pub damping: Vec<f64>,
    /// External force on S, N, then Vᵀ F_far,N.
    pub force: Vec<f64>,
    /// v_S, then q̇_N = Vᵀ M v_N.
    pub velocity: Vec<f64>,
    /// Length of a tick, s.
    pub tick_s: f64,
    /// Integrator of the tick.
    pub integrator: TickIntegrator,
    /// For implicit ticks: the stiffness over z at the model step, n × n, n = 3s + p.
    pub tangent: Vec<f64>,
    /// For implicit ticks: the factor of M/h + B + h K over z, h the length of a substep.
    pub factor: Cholesky,
    /// For implicit ticks: the change of ż by a unit impulse on each degree of freedom of S, n numbers for each of 3s.
    pub impulse_response: Vec<f64>,
    /// Another tool on the body at the model step, whose present force the samples hold ([`crate::Sample::other`]). Its tool is 0 where
    /// there is none: the forces of all other tools are then constant.
    pub other: OtherToolForce,
    /// The forces on z by a unit force of that tool on the body along x, y and z, n numbers each: (w, Vᵀ w) with the shares w of the nodes
    /// in its force at the model step.
    pub other_influence: Vec<f64>,
    /// Energy of the whole body at the model step, J.
    pub energy_j: f64,
    /// Position of the device at the model step, m.
    pub start_m: DVec3,
    /// Virtual coupling between tool and device; `None` where the tool is at the device.
    pub coupling: Option<VirtualCoupling>,
    /// Position of the tool (the proxy of the coupling) at the model step, m.
    pub proxy_m: DVec3,
    /// Whether S is truncated: nodes within reach were left out because of its maximum size.
    pub is_cut: bool,
}

impl NearField {
    /// An empty near field with buffers for `capacity`.
    #[must_use]
    pub fn with_capacity(capacity: NearFieldCapacity) -> Self {
        let NearFieldCapacity { nodes, order, ring, springs, hexahedra, points, triangles, .. } = capacity;
        let n = 3 * nodes + order;
        Self {
            nodes: 0,
            order: 0,
            ring: 0,
            springs: 0,
            tetrahedra: 0,
            hexahedra: 0,
            shapes: 0,
            domains: 0,
            points: 0,
            triangles: 0,
            support: Support::Driven,
            weight: zeros(nodes),
            node_m: vec![DVec3::ZERO; nodes],
            node_per_kg: zeros(nodes),
            drag_ns_per_m: zeros(nodes),
            ring_m: vec![DVec3::ZERO; ring],
            basis: zeros(3 * ring * order),
            near: vec![
                NearSpring { a: 0, b: NearEnd::Fixed(DVec3::ZERO), spring: Spring::default() };
                springs
            ],
            tetrahedron: vec![NearTetrahedron::default(); 2 * springs],
            hexahedron: vec![NearHexahedron::default(); hexahedra],
            shape: vec![HexahedronShape::default(); hexahedra],
            domain: vec![NearDomain::default(); capacity.domains],
            domain_node: vec![0; capacity.domain_nodes],
            domain_gradient_per_m: vec![DVec3::ZERO; capacity.domain_nodes],
            point: vec![NearPoint::default(); points],
            triangle: vec![NearTriangle::default(); triangles],
            contact: NearContact::default(),
            compliance: zeros(nodes * nodes),
            stiffness: zeros(order * order),
            damping: zeros(order * order),
            force: zeros(n),
            velocity: zeros(n),
            tick_s: 0.0,
            integrator: TickIntegrator::Explicit { substeps: 1 },
            tangent: zeros(n * n),
            factor: Cholesky::with_capacity(n),
            impulse_response: zeros(n * 3 * nodes),
            other: OtherToolForce::default(),
            other_influence: zeros(3 * n),
            energy_j: 0.0,
            start_m: DVec3::ZERO,
            coupling: None,
            proxy_m: DVec3::ZERO,
            is_cut: false,
        }
    }

    /// Maximum sizes.
    #[must_use]
    pub fn capacity(&self) -> NearFieldCapacity {
        NearFieldCapacity {
            nodes: self.node_m.len(),
            order: self.force.len().saturating_sub(3 * self.node_m.len()),
            ring: self.ring_m.len(),
            springs: self.near.len(),
            hexahedra: self.hexahedron.len(),
            domains: self.domain.len(),
            domain_nodes: self.domain_node.len(),
            points: self.point.len(),
            triangles: self.triangle.len(),
        }
    }

    /// Length of the state z, 3s + p.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        3 * self.nodes + self.order
    }

    /// Number of nodes of the near domains, each counted once in each of its domains.
    #[must_use]
    pub fn domain_nodes(&self) -> usize {
        let last = self.domains.checked_sub(1).and_then(|last| self.domain.get(last));
        last.map_or(0, |domain| domain.entries.0.saturating_add(domain.entries.1))
    }

    /// Approximate cost of a tick without contacts, in multiplications.
    pub(crate) fn multiplications(&self) -> usize {
        let (p, n) = (self.order, self.unknowns());
        let on_z = match self.integrator {
            TickIntegrator::Explicit { .. } => 2 * p * p,
            TickIntegrator::Implicit { .. } => 2 * p * p + 2 * n * n,
        };
        let step = on_z.saturating_add(6 * self.ring * p).saturating_add(SPRING_WORK * self.springs);
        let step = step.saturating_add(TETRAHEDRON_WORK.saturating_mul(self.tetrahedra));
        let step = step.saturating_add(HEXAHEDRON_WORK.saturating_mul(self.hexahedra));
        let step = step.saturating_add(DOMAIN_WORK.saturating_mul(self.domains));
        let step = step.saturating_add(DOMAIN_NODE_WORK.saturating_mul(self.domain_nodes()));
        step.saturating_mul(self.integrator.substeps() as usize)
    }

    /// Whether the tool reaches nothing: there is neither a node nor a triangle.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes == 0 && self.triangles == 0
    }

    /// Removes all nodes, springs, triangles and patches.
    pub fn clear(&mut self) {
        (self.nodes, self.order, self.ring) = (0, 0, 0);
        (self.springs, self.points, self.triangles) = (0, 0, 0);
        (self.tetrahedra, self.hexahedra, self.shapes) = (0, 0, 0);
        self.domains = 0;
        self.is_cut = false;
        self.other = OtherToolForce::default();
        self.contact.count = 0;
    }

    /// Checks that the sizes are at most `capacity`.
    ///
    /// # Errors
    /// [`LocalModelError::Capacity`].
    pub(crate) fn fits(&self, capacity: NearFieldCapacity) -> Result<(), LocalModelError> {
        for (what, found, capacity) in [
            ("nodes of S", self.nodes, capacity.nodes),
            ("columns of the basis", self.order, capacity.order),
            ("nodes of the ring", self.ring, capacity.ring),
            ("near springs", self.springs, capacity.springs),
            ("near tetrahedra", self.tetrahedra, capacity.springs.saturating_mul(2)),
            ("near hexahedra", self.hexahedra, capacity.hexahedra),
            ("shapes of near hexahedra", self.shapes, capacity.hexahedra),
            ("near domains", self.domains, capacity.domains),
            ("nodes of near domains", self.domain_nodes(), capacity.domain_nodes),
            ("points of the surface", self.points, capacity.points),
            ("triangles", self.triangles, capacity.triangles),
        ] {
            if found > capacity {
                return Err(LocalModelError::Capacity { what, found, capacity });
            }
        }
        Ok(())
    }

    /// The lists of numbers with their names and the number of entries in use.
    fn parts(&self) -> [(&'static str, &Vec<f64>, usize); 12] {
        let (s, p, n) = (self.nodes, self.order, self.unknowns());
        // Explicit ticks do not use the matrices of implicit ones.
        let implicit = if self.integrator.is_implicit() { n } else { 0 };
        let of_other = if self.other.tool == 0 { 0 } else { 3 * n };
        [
            ("weights", &self.weight, s),
            ("inverse masses", &self.node_per_kg, s),
            ("drag", &self.drag_ns_per_m, s),
            ("basis", &self.basis, 3 * self.ring * p),
            ("far stiffness", &self.stiffness, p * p),
            ("far damping", &self.damping, p * p),
            ("far force", &self.force, n),
            ("near-field velocity", &self.velocity, n),
            ("near-field tangent", &self.tangent, implicit * implicit),
            ("near-field impulse response", &self.impulse_response, implicit * 3 * s),
            ("grid compliance", &self.compliance, if self.contact.adds_compliance { s * s } else { 0 }),
            ("influence of another tool", &self.other_influence, of_other),
        ]
    }

    /// Copies `other` without allocation.
    ///
    /// # Errors
    /// [`LocalModelError::Capacity`] when `other` exceeds the capacity; `self` is then unchanged.
    pub(crate) fn copy_from(&mut self, other: &Self) -> Result<(), LocalModelError> {
        other.fits(self.capacity())?;
        if other.integrator.is_implicit() {
            self.factor.copy_from(&other.factor)?;
        }
        (self.nodes, self.order, self.ring) = (other.nodes, other.order, other.ring);
        (self.springs, self.points, self.triangles) = (other.springs, other.points, other.triangles);
        (self.tetrahedra, self.hexahedra, self.shapes) = (other.tetrahedra, other.hexahedra, other.shapes);
        self.domains = other.domains;
        (self.support, self.integrator) = (other.support, other.integrator);
        (self.tick_s, self.is_cut) = (other.tick_s, other.is_cut);
        (self.start_m, self.energy_j) = (other.start_m, other.energy_j);
        (self.coupling, self.proxy_m) = (other.coupling, other.proxy_m);
        self.other = other.other;
        self.contact = other.contact;
        copy(&mut self.node_m, &other.node_m, other.nodes);
        copy(&mut self.ring_m, &other.ring_m, other.ring);
        copy(&mut self.near, &other.near, other.springs);
        copy(&mut self.tetrahedron, &other.tetrahedron, other.tetrahedra);
        copy(&mut self.hexahedron, &other.hexahedron, other.hexahedra);
        copy(&mut self.shape, &other.shape, other.shapes);
        copy(&mut self.domain, &other.domain, other.domains);
        copy(&mut self.domain_node, &other.domain_node, other.domain_nodes());
        copy(&mut self.domain_gradient_per_m, &other.domain_gradient_per_m, other.domain_nodes());
        copy(&mut self.point, &other.point, other.points);
        copy(&mut self.triangle, &other.triangle, other.triangles);
        let targets = [
            &mut self.weight,
            &mut self.node_per_kg,
            &mut self.drag_ns_per_m,
            &mut self.basis,
            &mut self.stiffness,
            &mut self.damping,
            &mut self.force,
            &mut self.velocity,
            &mut self.tangent,
            &mut self.impulse_response,
            &mut self.compliance,
            &mut self.other_influence,
        ];
        for (to, (_, from, used)) in targets.into_iter().zip(other.parts()) {
            copy(to, from, used);
        }
        Ok(())
    }
}

/// Cost of a spring, in multiplications.
const SPRING_WORK: usize = 60;
/// Cost of a volume barrier, in multiplications.
const TETRAHEDRON_WORK: usize = 60;
/// Cost of a hexahedron, in multiplications.
const HEXAHEDRON_WORK: usize = 600;
/// Cost of a smoothed domain, and of each of its nodes, in multiplications.
const DOMAIN_WORK: usize = 100;
const DOMAIN_NODE_WORK: usize = 27;
/// Maximum number of substeps of a tick.
pub(crate) const MAX_SUBSTEPS: u32 = 64;

fn copy<T: Copy>(to: &mut [T], from: &[T], used: usize) {
    to.iter_mut().zip(from).take(used).for_each(|(to, from)| *to = *from);
}

#[cfg(test)]
mod tests;
