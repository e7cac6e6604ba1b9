//! The local model of [`palpate_local::Scheme::NearFieldExact`]: the near field of a body, with its far field reduced.

mod capacity;
pub(crate) mod element_stiffness;
mod error_bound;
mod ring_projection;
mod support;
mod surface;
pub(crate) mod tick_integrator;

pub(crate) use capacity::capacity;

use crate::ReduceError;
use crate::far_field::FarField;
use crate::far_field::basis::Basis;
use crate::options::BuilderOptions;
use glam::DVec3;
use palpate_body::{
    BarrierTetrahedron, Body, Network, SurfaceTree, Tangent, ToolContact, ToolPoint, VolumeBarrier,
};
use palpate_local::{
    LocalModelError, NearDomain, NearEnd, NearField, NearHexahedron, NearSpring, NearTetrahedron,
    OtherToolForce, TickIntegrator,
};
use support::{SupportLimits, SupportSet};

/// Volume ratio up to which tetrahedra with a node in S are near: the tool may compress them further before the next model step.
const NEAR_RATIO: f64 = VolumeBarrier::ONSET + 0.2;

/// Builds near fields of one body. It keeps its buffers, and the support set of the last near field.
#[derive(Debug)]
pub(crate) struct NearFieldBuilder {
    /// Search tree of the surface; `None` until a tool touches.
    tree: Option<SurfaceTree>,
    /// Role of every node.
    roles: Vec<NodeRole>,
    /// S of the last near field, and its ring.
    support: Vec<usize>,
    ring: Vec<usize>,
}

/// The state of a body and a tool from which a near field is built.
pub(crate) struct BuildInput<'a> {
    pub(crate) body: &'a Body,
    /// Tangent of the body, exact or clamped.
    pub(crate) tangent: &'a Tangent,
    pub(crate) is_clamped: bool,
    pub(crate) contact: &'a ToolContact,
    pub(crate) tool: ToolPoint,
    /// The other tools on the body; their forces are constant.
    pub(crate) others: &'a [&'a ToolContact],
    /// Identity of the body.
    pub(crate) identity: u64,
    pub(crate) options: &'a BuilderOptions,
    /// Integrator of the ticks, for fields under one tool; `None` for that of the body alone.
    pub(crate) integrator: Option<TickIntegrator>,
}

/// Role of a node in a near field, with its index in S or in the ring.
#[derive(Clone, Copy, Debug, PartialEq)]
enum NodeRole {
    Far,
    Support(usize),
    Ring(usize),
}

impl NearFieldBuilder {
    pub(crate) fn new(body: &Body) -> Self {
        let nodes = body.network().node_count();
        Self { tree: None, roles: vec![NodeRole::Far; nodes], support: Vec::new(), ring: Vec::new() }
    }

    /// Nodes of S of the last near field, as indices of the body.
    pub(crate) fn support(&self) -> &[usize] {
        &self.support
    }

    /// Builds the near field of `input` into `field`, which stays empty where the tool reaches nothing. Returns a bound of its error
    /// where there is one.
    pub(crate) fn build(
        &mut self,
        far_field: &mut FarField,
        input: &BuildInput<'_>,
        field: &mut NearField,
    ) -> Result<Option<f64>, ReduceError> {
        let &BuildInput { body, tangent, contact, tool, others, options, .. } = input;
        field.clear();
        self.support.clear();
        let limits = SupportLimits::new(contact, options, field.capacity());
        let tree = contact.shape().map(|_| {
            let tree = self.tree.get_or_insert_with(|| SurfaceTree::new(body));
            tree.refit(body);
            &*tree
        });
        let Some(support) = SupportSet::of(body, contact, tree, tool, options.horizon_s, &limits) else {
            write_surface_only(input, field)?;
            return Ok(None);
        };
        self.support.extend(&support.nodes);
        far_field.read_forces(body, others);
        let order = options.order_for(support.nodes.len()).min(field.capacity().order);
        let basis = far_field.build_basis(body, tangent, &support.nodes, options, order)?;
        self.write(far_field, input, &support, &basis, field).inspect_err(|_| field.clear())?;
        // The direction in which the tool pushes or moves.
        let direction = contact.normal().or(tool.velocity_m_per_s.try_normalize()).unwrap_or(DVec3::Z);
        let bound =
            error_bound::error_bound(field, (body.network(), tangent), (&basis, &support.nodes), direction);
        far_field.set_basis(Some(basis));
        Ok(bound)
    }

    fn write(
        &mut self,
        far_field: &FarField,
        input: &BuildInput<'_>,
        support: &SupportSet,
        basis: &Basis,
        field: &mut NearField,
    ) -> Result<(), ReduceError> {
        let &BuildInput { body, tangent, is_clamped, contact, options, integrator, .. } = input;
        let (network, v) = (body.network(), body.velocities_m_per_s());
        self.write_support(far_field, input, support, field)?;
        field.order = basis.order();
        // Forces of the far springs, elements and tetrahedra: the near ones are subtracted below.
        let mut far_n = far_field.internal_n().to_vec();
        let is_near = self.write_springs(body, &support.nodes, field, &mut far_n)?;
        self.write_hexahedra(body, &support.nodes, field, &mut far_n)?;
        self.write_domains(body, &support.nodes, field, &mut far_n)?;
        surface::write(body, contact, (support, &self.ring), field.proxy_m, field)?;
        let far_tetrahedra = self.write_tetrahedra(body, field, &mut far_n)?;
        let (s, entries) = (field.nodes, 3 * field.ring);
        for (i, &node) in self.ring.iter().enumerate() {
            basis.for_each_entry(node, |axis, j, v| field.basis[entries * j + 3 * i + axis] = v);
        }
        let external_n = far_field.external_n();
        basis.project(
            |node| far_n[node] + external_n[node],
            |node| network.mass_kg()[node] * v[node],
            |j, f, momentum| {
                field.force[3 * s + j] = f;
                field.velocity[3 * s + j] = momentum;
            },
        );
        write_other(input, basis, &self.roles, field);
        if !network.has_elements() && network.drag_ns_per_m().is_empty() {
            let far = (&is_near[..], &far_tetrahedra[..]);
            basis.congruence(body, far, is_clamped, &mut field.stiffness, &mut field.damping);
        } else {
            basis.congruence_of_tangent(tangent, &mut field.stiffness, &mut field.damping);
            element_stiffness::subtract_near(field, is_clamped);
        }
        field.integrator = integrator.unwrap_or_else(|| tick_integrator::select(body, options));
        tick_integrator::write_matrices(field)
    }

    /// Writes the nodes of S, the tool, and the scalars of the near field.
    fn write_support(
        &mut self,
        far_field: &FarField,
        input: &BuildInput<'_>,
        support: &SupportSet,
        field: &mut NearField,
    ) -> Result<(), ReduceError> {
        let &BuildInput { body, options, .. } = input;
        let (network, x, v) = (body.network(), body.positions_m(), body.velocities_m_per_s());
        let (found, max) = (support.nodes.len(), field.capacity().nodes);
        if found > max {
            return Err(too_many("nodes of S", found, max));
        }
        field.nodes = found;
        write_tool(input, support, field);
        (field.tick_s, field.is_cut) = (options.tick_s, support.is_truncated);
        self.roles.fill(NodeRole::Far);
        self.ring.clear();
        let held: Vec<usize> = far_field.constraints().held_nodes().collect();
        // A node on an obstacle keeps its velocity, as a fixed one.
        let is_held = |node| network.free_index(node).is_some_and(|index| held.contains(&index));
        for (i, &node) in support.nodes.iter().enumerate() {
            self.roles[node] = NodeRole::Support(i);
            field.weight[i] = support.weights[i];
            field.node_m[i] = x[node];
            let is_free = !(network.is_fixed(node) || is_held(node));
            field.node_per_kg[i] = if is_free { 1.0 / network.mass_kg()[node] } else { 0.0 };
            field.drag_ns_per_m[i] = network.drag_ns_per_m().get(node).copied().unwrap_or_default();
            field.force[3 * i..3 * i + 3].copy_from_slice(&far_field.external_n()[node].to_array());
            field.velocity[3 * i..3 * i + 3].copy_from_slice(&v[node].to_array());
        }
        Ok(())
    }

    /// Writes the near springs, those with a free end in S, and subtracts their forces from `far_n`. Returns by link whether it is near.
    fn write_springs(
        &mut self,
        body: &Body,
        support: &[usize],
        field: &mut NearField,
        far_n: &mut [DVec3],
    ) -> Result<Vec<bool>, ReduceError> {
        let (network, x, v) = (body.network(), body.positions_m(), body.velocities_m_per_s());
        let max_springs = field.capacity().springs;
        let mut is_near = vec![false; network.links().len()];
        for &node in support.iter().filter(|&&node| !network.is_fixed(node)) {
            for &index in network.incident_links(node) {
                if std::mem::replace(&mut is_near[index], true) {
                    continue;
                }
                let link = &network.links()[index];
                let f = link.spring.force_on_a(x[link.b] - x[link.a], v[link.b] - v[link.a]);
                far_n[link.a] -= f;
                far_n[link.b] += f;
                let other = if link.a == node { link.b } else { link.a };
                if field.springs == max_springs {
                    return Err(too_many("near springs", field.springs + 1, max_springs));
                }
                let NodeRole::Support(a) = self.roles[node] else { continue };
                let b = match self.roles[other] {
                    NodeRole::Support(i) => NearEnd::Support(i),
                    NodeRole::Ring(i) => NearEnd::Ring(i),
                    NodeRole::Far if network.is_fixed(other) => NearEnd::Fixed(x[other]),
                    NodeRole::Far => NearEnd::Ring(self.add_to_ring(other, x[other], field)?),
                };
                // A spring is symmetric: a may be either of its ends.
                field.near[field.springs] = NearSpring { a, b, spring: link.spring };
                field.springs += 1;
            }
        }
        Ok(is_near)
    }

    /// Writes the near hexahedra, those with a free node in S, and subtracts their forces from `far_n`.
    fn write_hexahedra(
        &mut self,
        body: &Body,
        support: &[usize],
        field: &mut NearField,
        far_n: &mut [DVec3],
    ) -> Result<(), ReduceError> {
        let (network, x, v) = (body.network(), body.positions_m(), body.velocities_m_per_s());
        let elements = network.hexahedra();
        let near = incident_to(network, support, |node| elements.incident(node));
        if near.len() > field.hexahedron.len() {
            return Err(too_many("near hexahedra", near.len(), field.hexahedron.len()));
        }
        field.hexahedra = near.len();
        for (i, index) in near.into_iter().enumerate() {
            let element = elements.get(index);
            let relaxed = body.relaxed_stress_j().get(index).copied().unwrap_or_default();
            for (node, force) in element.nodes.into_iter().zip(element.forces_n(x, v, &relaxed)) {
                far_n[node] -= force;
            }
            let mut nodes = [0; 8];
            for (to, node) in nodes.iter_mut().zip(element.nodes) {
                *to = self.place_of(node, x[node], field)? as u16;
            }
            let known = field.shape[..field.shapes].iter().position(|shape| shape == element.shape);
            let shape = known.unwrap_or(field.shapes);
            if known.is_none() {
                field.shape[shape] = *element.shape;
                field.shapes += 1;
            }
            field.hexahedron[i] = NearHexahedron { nodes, shape, material: *element.material, relaxed };
        }
        Ok(())
    }

    /// Writes the near smoothed domains, those with a free node in S, and subtracts their forces from `far_n`.
    fn write_domains(
        &mut self,
        body: &Body,
        support: &[usize],
        field: &mut NearField,
        far_n: &mut [DVec3],
    ) -> Result<(), ReduceError> {
        let (network, x, v) = (body.network(), body.positions_m(), body.velocities_m_per_s());
        let (domains, relaxed) = (network.tetrahedra().domains(), body.relaxed_stress_of_domains_j());
        let near = incident_to(network, support, |node| domains.incident(node));
        if near.len() > field.domain.len() {
            return Err(too_many("near domains", near.len(), field.domain.len()));
        }
        field.domains = near.len();
        let (shares, mut first) = (domains.volume_shares(x), 0);
        for (i, index) in near.into_iter().enumerate() {
            let domain = domains.at_shares(index, &shares);
            let relaxed = relaxed.get(index).copied().unwrap_or_default();
            let stress_j = domain.stress_j(x, v, &relaxed);
            let end = first + domain.nodes.len();
            if end > field.domain_node.len() {
                return Err(too_many("nodes of near domains", end, field.domain_node.len()));
            }
            for (at, (&node, &b)) in (first..end).zip(domain.nodes.iter().zip(domain.gradients_per_m)) {
                let node = node as usize;
                far_n[node] += stress_j * b;
                field.domain_node[at] = self.place_of(node, x[node], field)? as u16;
                field.domain_gradient_per_m[at] = b;
            }
            let entries = (first, end - first);
            field.domain[i] = NearDomain { entries, material: domain.material, relaxed };
            first = end;
        }
        Ok(())
    }

    /// Writes the near tetrahedra, and subtracts their forces from `far_n`. Returns the other tetrahedra with an active barrier.
    fn write_tetrahedra(
        &mut self,
        body: &Body,
        field: &mut NearField,
        far_n: &mut [DVec3],
    ) -> Result<Vec<BarrierTetrahedron>, ReduceError> {
        let (network, x) = (body.network(), body.positions_m());
        let mut far = Vec::new();
        for tetrahedron in body.barriers_below(NEAR_RATIO) {
            let moves =
                |&node: &usize| matches!(self.roles[node], NodeRole::Support(_)) && !network.is_fixed(node);
            if !tetrahedron.nodes.iter().any(moves) {
                far.extend(VolumeBarrier::is_active(tetrahedron.ratio(x)).then_some(tetrahedron));
                continue;
            }
            for (&node, force) in tetrahedron.nodes.iter().zip(tetrahedron.forces_n(x)) {
                far_n[node] -= force;
            }
            let mut near = NearTetrahedron { nodes: [0; 4], barrier: tetrahedron.barrier };
            for (to, &node) in near.nodes.iter_mut().zip(&tetrahedron.nodes) {
                *to = self.place_of(node, x[node], field)?;
            }
            let Some(to) = field.tetrahedron.get_mut(field.tetrahedra) else {
                return Err(too_many("near tetrahedra", field.tetrahedra + 1, field.tetrahedron.len()));
            };
            *to = near;
            field.tetrahedra += 1;
        }
        Ok(far)
    }

    /// Index of a node in S, or s plus its index in the ring, to which it is added if it is in neither. The ring may contain fixed nodes: their rows
    /// of V are zero.
    fn place_of(&mut self, node: usize, at_m: DVec3, field: &mut NearField) -> Result<usize, ReduceError> {
        Ok(match self.roles[node] {
            NodeRole::Support(i) => i,
            NodeRole::Ring(i) => field.nodes + i,
            NodeRole::Far => field.nodes + self.add_to_ring(node, at_m, field)?,
        })
    }

    /// Adds a node to the ring, and returns its index there.
    fn add_to_ring(&mut self, node: usize, at_m: DVec3, field: &mut NearField) -> Result<usize, ReduceError> {
        let (i, max) = (field.ring, field.capacity().ring);
        if i == max {
            return Err(too_many("nodes of the ring", i + 1, max));
        }
        self.roles[node] = NodeRole::Ring(i);
        field.ring_m[i] = at_m;
        self.ring.push(node);
        field.ring += 1;
        Ok(i)
    }
}

/// Indices of the elements with a free node in `support`, ascending, where `incident` has those of a node.
fn incident_to<'a>(
    network: &Network,
    support: &[usize],
    incident: impl Fn(usize) -> &'a [usize],
) -> Vec<usize> {
    let free = support.iter().filter(|&&node| !network.is_fixed(node));
    let mut found: Vec<usize> = free.flat_map(|&node| incident(node)).copied().collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// Writes the surface alone, for a tool that reaches no node within the horizon.
fn write_surface_only(input: &BuildInput<'_>, field: &mut NearField) -> Result<(), ReduceError> {
    let &BuildInput { body, contact, options, .. } = input;
    let Some((shape, friction)) = contact.shape().filter(|_| contact.is_clear()) else { return Ok(()) };
    let support = SupportSet::empty(shape, friction);
    write_tool(input, &support, field);
    field.tick_s = options.tick_s;
    // Nothing moves.
    let substeps = input.integrator.map_or(1, TickIntegrator::substeps);
    field.integrator = TickIntegrator::Explicit { substeps };
    surface::write(body, contact, (&support, &[]), field.proxy_m, field).inspect_err(|_| field.clear())
}

/// Writes the influence of the nearest other tool with an identity.
fn write_other(input: &BuildInput<'_>, basis: &Basis, roles: &[NodeRole], field: &mut NearField) {
    let &BuildInput { body, contact, tool, others, identity, .. } = input;
    let (at_m, network) = (contact.proxy_m(tool.position_m), body.network());
    let place = |shares: &[(usize, f64)]| -> DVec3 {
        shares.iter().map(|&(node, w)| w * body.positions_m()[node]).sum()
    };
    let acting =
        others.iter().filter(|other| other.identity() != 0).map(|other| (other, other.force_shares()));
    let nearest = acting
        .filter(|(_, shares)| !shares.is_empty())
        .min_by(|(_, a), (_, b)| place(a).distance(at_m).total_cmp(&place(b).distance(at_m)));
    let Some((other, shares)) = nearest else { return };
    let (n, s) = (field.unknowns(), 3 * field.nodes);
    let Some(influence) = field.other_influence.get_mut(..3 * n) else { return };
    influence.fill(0.0);
    for (axis, column) in influence.chunks_exact_mut(n.max(1)).enumerate() {
        for &(node, w) in shares.iter().filter(|(node, _)| !network.is_fixed(*node)) {
            if let NodeRole::Support(i) = roles[node] {
                column[3 * i + axis] += w;
            }
        }
        let mut force = vec![DVec3::ZERO; network.node_count()];
        shares.iter().for_each(|&(node, w)| force[node] = DVec3::AXES[axis] * w);
        basis.project(|node| force[node], |_| DVec3::ZERO, |j, f, _| column[s + j] = f);
    }
    field.other = OtherToolForce { tool: other.identity(), body: identity, force_n: other.applied_force_n() };
}

/// Writes how the tool acts, its coupling and position, and the energy of the body.
fn write_tool(input: &BuildInput<'_>, support: &SupportSet, field: &mut NearField) {
    let &BuildInput { body, contact, tool, .. } = input;
    (field.support, field.start_m) = (support.support, tool.position_m);
    (field.coupling, field.proxy_m) = (contact.coupling(), contact.proxy_m(tool.position_m));
    field.energy_j = body.energy().total_j();
}

fn too_many(what: &'static str, found: usize, max: usize) -> ReduceError {
    LocalModelError::Capacity { what, found, capacity: max }.into()
}
