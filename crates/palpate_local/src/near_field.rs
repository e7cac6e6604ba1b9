//! The near field exact, the far field reduced: as data.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod elements;
mod surface;

pub use elements::{NearEnd, NearSpring, NearTetrahedron};
pub use surface::{NearContact, NearPatch, NearPoint, NearTriangle};

use crate::LocalModelError;
use crate::dense::{Cholesky, zeros};
use glam::DVec3;
use palpate_laws::{MAX_PATCHES, Spring, ToolShape, VirtualCoupling};

/// How much a near field can hold; fixed at construction, and refused beyond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NearFieldCapacity {
    /// Nodes of the support set S.
    pub nodes: usize,
    /// p, columns of the far field's basis V.
    pub order: usize,
    /// Nodes at the other ends of the near springs.
    pub ring: usize,
    /// Near springs.
    pub springs: usize,
    /// Points of the surface that nodes of S and of the ring carry.
    pub points: usize,
    /// Triangles of the surface between those.
    pub triangles: usize,
}

impl Default for NearFieldCapacity {
    /// For sixteen nodes in a lattice of 26 neighbours.
    fn default() -> Self {
        Self { nodes: 16, order: 64, ring: 112, springs: 400, points: 96, triangles: 192 }
    }
}

/// How the tool acts on S.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Support {
    /// The tool drives the only node of S: it is where the tool is, plus what was between them at the model step.
    #[default]
    Driven,
    /// The tool holds Σ w_i x_i over S, two-sided.
    Held,
    /// The tool touches the triangles of S, one-sided and with friction.
    Touched {
        /// Its shape.
        shape: ToolShape,
        /// μ.
        friction: f64,
    },
}

/// How a tick is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickIntegrator {
    /// Semi-implicit Euler as the body's, that many substeps a tick.
    Explicit {
        /// Substeps in a tick.
        substeps: u32,
    },
    /// Linearly implicit Euler with the tangent of the model step.
    Implicit {
        /// Steps in a tick.
        substeps: u32,
    },
}

impl TickIntegrator {
    /// Steps in a tick.
    #[must_use]
    pub fn substeps(self) -> u32 {
        match self {
            Self::Explicit { substeps } | Self::Implicit { substeps } => substeps,
        }
    }

    /// Whether it is implicit.
    #[must_use]
    pub fn is_implicit(self) -> bool {
        matches!(self, Self::Implicit { .. })
    }
}

/// S dynamic, the springs and compressed cells incident to S exact, all others linear about the model step and reduced to δx_r = V q, with V
/// orthonormal in the masses: Vᵀ M V = 1.
///
/// The state is z = (δx_S, q) of 3s + p numbers. Matrices row by row, the first entries of their buffers; buffers have the
/// length of what they can hold at most.
#[derive(Clone, Debug, PartialEq)]
pub struct NearField {
    /// s; 0 where there is nothing within reach.
    pub nodes: usize,
    /// p.
    pub order: usize,
    /// Nodes of the ring.
    pub ring: usize,
    /// Near springs.
    pub springs: usize,
    /// Near tetrahedra.
    pub tetrahedra: usize,
    /// Points of the surface.
    pub points: usize,
    /// Triangles.
    pub triangles: usize,
    /// How the tool acts.
    pub support: Support,
    /// w of `Held`.
    pub weight: Vec<f64>,
    /// x_S at the model step, m.
    pub node_m: Vec<DVec3>,
    /// 1/m of S, 1/kg; 0 for a fixed node.
    pub node_per_kg: Vec<f64>,
    /// x of the ring at the model step, m.
    pub ring_m: Vec<DVec3>,
    /// The ring nodes' rows of V, 3 × `ring` in all, column after column: p of them.
    pub basis: Vec<f64>,
    /// The springs incident to S.
    pub near: Vec<NearSpring>,
    /// The tetrahedra of strongly compressed cells that have a node in S; room for twice as many as springs.
    pub tetrahedron: Vec<NearTetrahedron>,
    /// The points of the surface that nodes of S and of the ring carry.
    pub point: Vec<NearPoint>,
    /// The triangles between them.
    pub triangle: Vec<NearTriangle>,
    /// What else contact needs to know.
    pub contact: NearContact,
    /// Where contact gets the compliance that the grid lacks: what a unit force on a node of S, along the normal, does to each by the grid
    /// below it, times Young's modulus, s × s, 1/m.
    pub compliance: Vec<f64>,
    /// K̃ = Vᵀ K_far V, 1/s².
    pub stiffness: Vec<f64>,
    /// B̃ = Vᵀ B_far V, 1/s.
    pub damping: Vec<f64>,
    /// What acts from outside on S, N, then Vᵀ F_far,N.
    pub force: Vec<f64>,
    /// v_S, then q̇_N = Vᵀ M v_N.
    pub velocity: Vec<f64>,
    /// h, s: the tick.
    pub tick_s: f64,
    /// How it is integrated.
    pub integrator: TickIntegrator,
    /// `Implicit`: the tangent of all of z at the model step.
    pub tangent: Vec<f64>,
    /// `Implicit`: the factor of M/h + B + h K of all of z, h the length of a substep.
    pub factor: Cholesky,
    /// `Implicit`: A⁻¹ of an impulse on S over h, n for each of 3s.
    pub impulse_response: Vec<f64>,
    /// Energy of the whole body at the model step, J.
    pub energy_j: f64,
    /// Where the device was at the model step, m.
    pub start_m: DVec3,
    /// What draws the tool to the device, unless it is the device.
    pub coupling: Option<VirtualCoupling>,
    /// Where the tool was at the model step, m: behind its coupling, or where the device was.
    pub proxy_m: DVec3,
    /// Whether nodes within reach had to be left out of S.
    pub is_cut: bool,
}

impl NearField {
    /// An empty one with room for `capacity`.
    #[must_use]
    pub fn with_capacity(capacity: NearFieldCapacity) -> Self {
        let NearFieldCapacity { nodes, order, ring, springs, points, triangles } = capacity;
        let n = 3 * nodes + order;
        Self {
            nodes: 0,
            order: 0,
            ring: 0,
            springs: 0,
            tetrahedra: 0,
            points: 0,
            triangles: 0,
            support: Support::Driven,
            weight: zeros(nodes),
            node_m: vec![DVec3::ZERO; nodes],
            node_per_kg: zeros(nodes),
            ring_m: vec![DVec3::ZERO; ring],
            basis: zeros(3 * ring * order),
            near: vec![
                NearSpring { a: 0, b: NearEnd::Fixed(DVec3::ZERO), spring: Spring::default() };
                springs
            ],
            tetrahedron: vec![NearTetrahedron::default(); 2 * springs],
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
            energy_j: 0.0,
            start_m: DVec3::ZERO,
            coupling: None,
            proxy_m: DVec3::ZERO,
            is_cut: false,
        }
    }

    /// What it has room for.
    #[must_use]
    pub fn capacity(&self) -> NearFieldCapacity {
        NearFieldCapacity {
            nodes: self.node_m.len(),
            order: self.force.len().saturating_sub(3 * self.node_m.len()),
            ring: self.ring_m.len(),
            springs: self.near.len(),
            points: self.point.len(),
            triangles: self.triangle.len(),
        }
    }

    /// Length of its state, 3s + p.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        3 * self.nodes + self.order
    }

    /// About how many multiplications a tick of its takes, without its contacts.
    pub(crate) fn multiplications(&self) -> usize {
        let (p, n) = (self.order, self.unknowns());
        let on_z = match self.integrator {
            TickIntegrator::Explicit { .. } => 2 * p * p,
            TickIntegrator::Implicit { .. } => 2 * p * p + 2 * n * n,
        };
        let step = on_z.saturating_add(6 * self.ring * p).saturating_add(SPRING * self.springs);
        let step = step.saturating_add(TETRAHEDRON.saturating_mul(self.tetrahedra));
        step.saturating_mul(self.integrator.substeps() as usize)
    }

    /// Whether there is nothing within reach: no node, and no triangle of a surface that stands still.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes == 0 && self.triangles == 0
    }

    /// Empties it.
    pub fn clear(&mut self) {
        (self.nodes, self.order, self.ring) = (0, 0, 0);
        (self.springs, self.points, self.triangles) = (0, 0, 0);
        self.tetrahedra = 0;
        self.is_cut = false;
        self.contact.count = 0;
    }

    /// Refuses what is larger than `capacity`.
    ///
    /// # Errors
    /// [`LocalModelError::Room`].
    pub(crate) fn fits(&self, capacity: NearFieldCapacity) -> Result<(), LocalModelError> {
        for (what, found, room) in [
            ("nodes of S", self.nodes, capacity.nodes),
            ("columns of the basis", self.order, capacity.order),
            ("nodes of the ring", self.ring, capacity.ring),
            ("near springs", self.springs, capacity.springs),
            ("near tetrahedra", self.tetrahedra, capacity.springs.saturating_mul(2)),
            ("points of the surface", self.points, capacity.points),
            ("triangles", self.triangles, capacity.triangles),
        ] {
            if found > room {
                return Err(LocalModelError::Room { what, found, room });
            }
        }
        Ok(())
    }

    /// The numbers by name, with how many of them are in use.
    fn parts(&self) -> [(&'static str, &Vec<f64>, usize); 10] {
        let (s, p, n) = (self.nodes, self.order, self.unknowns());
        // What explicit ticks do not need is not looked at.
        let implicit = if self.integrator.is_implicit() { n } else { 0 };
        [
            ("weights", &self.weight, s),
            ("inverse masses", &self.node_per_kg, s),
            ("basis", &self.basis, 3 * self.ring * p),
            ("far stiffness", &self.stiffness, p * p),
            ("far damping", &self.damping, p * p),
            ("far force", &self.force, n),
            ("near-field velocity", &self.velocity, n),
            ("near-field tangent", &self.tangent, implicit * implicit),
            ("near-field answer", &self.impulse_response, implicit * 3 * s),
            ("grid compliance", &self.compliance, if self.contact.adds_compliance { s * s } else { 0 }),
        ]
    }

    /// Checks sizes, indices and numbers.
    ///
    /// # Errors
    /// [`LocalModelError::Room`], [`LocalModelError::Size`], [`LocalModelError::NotFinite`], [`LocalModelError::Index`],
    /// [`LocalModelError::Setting`].
    pub fn validate(&self) -> Result<(), LocalModelError> {
        // First, so that no product below can overflow.
        self.fits(self.capacity())?;
        if self.is_empty() {
            return Ok(());
        }
        for (what, values, needed) in self.parts() {
            match values.get(..needed) {
                None => {
                    let (found, order) = (values.len(), self.order);
                    return Err(LocalModelError::Size { what, found, needed, order });
                }
                Some(used) if !used.iter().all(|v| v.is_finite()) => {
                    return Err(LocalModelError::NotFinite { what });
                }
                Some(_) => {}
            }
        }
        let finite = |places: &[DVec3]| places.iter().all(|x| x.is_finite());
        let end_is_finite = |end: &NearEnd| !matches!(end, NearEnd::Fixed(x) if !x.is_finite());
        let springs = self.near.get(..self.springs).unwrap_or_default();
        let tetrahedra = self.tetrahedron.get(..self.tetrahedra).unwrap_or_default();
        let points = self.point.get(..self.points).unwrap_or_default();
        let triangles = self.triangle.get(..self.triangles).unwrap_or_default();
        for (what, ok) in [
            ("places of S", self.node_m.get(..self.nodes).is_some_and(finite)),
            ("places of the ring", self.ring_m.get(..self.ring).is_some_and(finite)),
            ("ends of near springs", springs.iter().all(|spring| end_is_finite(&spring.b))),
            (
                "weights of the surface",
                points.iter().all(|point| {
                    point.nodes.iter().all(|(_, w)| w.is_finite())
                        && point.fixed_m.is_finite()
                        && point.modulus_pa.is_finite()
                }),
            ),
            ("normals of triangles", triangles.iter().all(|triangle| triangle.rest_normal.is_finite())),
            ("contact", self.contact.is_finite()),
            ("step", self.tick_s.is_finite() && self.tick_s > 0.0),
            ("start of the tool", self.start_m.is_finite() && self.proxy_m.is_finite()),
            ("coupling of the tool", self.coupling.is_none_or(|coupling| coupling.validate().is_ok())),
            ("energy", self.energy_j.is_finite()),
            ("factor", !self.integrator.is_implicit() || self.factor.is_finite()),
        ] {
            if !ok {
                return Err(LocalModelError::NotFinite { what });
            }
        }
        let in_range = |end: &NearEnd| match *end {
            NearEnd::Support(node) => node < self.nodes,
            NearEnd::Ring(node) => node < self.ring,
            NearEnd::Fixed(_) => true,
        };
        for (what, ok) in [
            ("a near spring", springs.iter().all(|spring| spring.a < self.nodes && in_range(&spring.b))),
            (
                "a near tetrahedron",
                tetrahedra
                    .iter()
                    .flat_map(|tetrahedron| tetrahedron.nodes)
                    .all(|node| node < self.nodes + self.ring),
            ),
            (
                "a point of the surface",
                points.iter().flat_map(NearPoint::carriers).all(|(node, _)| node < self.nodes + self.ring),
            ),
            (
                "a triangle",
                triangles.iter().flat_map(|triangle| triangle.points).all(|point| point < self.points),
            ),
            (
                "a neighbour of a triangle",
                triangles
                    .iter()
                    .flat_map(|triangle| triangle.neighbours)
                    .all(|n| n.triangle.is_none_or(|triangle| (triangle as usize) < self.triangles)),
            ),
            (
                "a patch",
                self.contact.count <= MAX_PATCHES
                    && self.contact.patches().iter().all(|p| p.patch.foot.triangle < self.triangles),
            ),
        ] {
            if !ok {
                return Err(LocalModelError::Index { what });
            }
        }
        let (found, needed) = (self.factor.order(), self.unknowns());
        if self.integrator.is_implicit() && found != needed {
            let (what, order) = ("implicit factor", self.order);
            return Err(LocalModelError::Size { what, found: found * found, needed: needed * needed, order });
        }
        let substeps = self.integrator.substeps();
        if !(1..=MOST_SUBSTEPS).contains(&substeps) {
            return Err(LocalModelError::Setting {
                what: "substeps of a local tick",
                value: f64::from(substeps),
                allowed: "1 to 64",
            });
        }
        let mass = self.node_per_kg.iter().take(self.nodes);
        let lightest = mass.clone().fold(f64::INFINITY, |a, b| a.min(*b));
        let free = self.weight.iter().zip(mass).filter(|(_, per_kg)| **per_kg > 0.0);
        let squares: f64 = free.map(|(w, _)| w * w).sum();
        let (value, allowed, what, ok) = match self.support {
            _ if lightest < 0.0 => (lightest, "at least 0", "inverse mass, 1/kg", false),
            Support::Driven => (self.nodes as f64, "1", "nodes that are driven", self.nodes == 1),
            Support::Held => {
                let ok = squares.is_finite() && squares > 0.0;
                (squares, "finite and above 0", "squares of the weights of what is held", ok)
            }
            Support::Touched { shape, .. }
                if shape.validate().is_err() || shape.radius_m() < LEAST_RADIUS_M =>
            {
                (shape.radius_m(), "a radius of at least 1e-6 and an axis of length 1", "tool, m", false)
            }
            Support::Touched { friction, .. } => {
                (friction, "finite and at least 0", "friction", friction.is_finite() && friction >= 0.0)
            }
        };
        if ok { Ok(()) } else { Err(LocalModelError::Setting { what, value, allowed }) }
    }

    /// Becomes `other`, without allocating.
    ///
    /// # Errors
    /// [`LocalModelError::Room`] when there is no room; `self` is unchanged then.
    pub(crate) fn copy_from(&mut self, other: &Self) -> Result<(), LocalModelError> {
        other.fits(self.capacity())?;
        if other.integrator.is_implicit() {
            self.factor.copy_from(&other.factor)?;
        }
        (self.nodes, self.order, self.ring) = (other.nodes, other.order, other.ring);
        (self.springs, self.points, self.triangles) = (other.springs, other.points, other.triangles);
        self.tetrahedra = other.tetrahedra;
        (self.support, self.integrator) = (other.support, other.integrator);
        (self.tick_s, self.is_cut) = (other.tick_s, other.is_cut);
        (self.start_m, self.energy_j) = (other.start_m, other.energy_j);
        (self.coupling, self.proxy_m) = (other.coupling, other.proxy_m);
        self.contact = other.contact;
        copy(&mut self.node_m, &other.node_m, other.nodes);
        copy(&mut self.ring_m, &other.ring_m, other.ring);
        copy(&mut self.near, &other.near, other.springs);
        copy(&mut self.tetrahedron, &other.tetrahedron, other.tetrahedra);
        copy(&mut self.point, &other.point, other.points);
        copy(&mut self.triangle, &other.triangle, other.triangles);
        let targets = [
            &mut self.weight,
            &mut self.node_per_kg,
            &mut self.basis,
            &mut self.stiffness,
            &mut self.damping,
            &mut self.force,
            &mut self.velocity,
            &mut self.tangent,
            &mut self.impulse_response,
            &mut self.compliance,
        ];
        for (to, (_, from, used)) in targets.into_iter().zip(other.parts()) {
            copy(to, from, used);
        }
        Ok(())
    }
}

/// The smallest tool, m: below that of a cell.
const LEAST_RADIUS_M: f64 = 1e-6;
/// A spring is worth so many multiplications.
const SPRING: usize = 60;
/// A volume barrier is worth so many multiplications.
const TETRAHEDRON: usize = 60;
/// Most substeps of a tick.
pub(crate) const MOST_SUBSTEPS: u32 = 64;

fn copy<T: Copy>(to: &mut [T], from: &[T], used: usize) {
    to.iter_mut().zip(from).take(used).for_each(|(to, from)| *to = *from);
}

#[cfg(test)]
mod tests;
