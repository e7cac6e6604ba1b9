//! From a body's state to its near field, exact, and its far field, reduced.

mod basis;
mod estimate;
mod implicit;
mod ring;
mod room;
mod support;
mod surface;
mod tetrahedra;

pub(crate) use room::capacity;

/// The exact stiffness of a field's near tetrahedra over z; `None` where none of their barriers acts.
pub(crate) fn barrier_stiffness(field: &NearField) -> Option<Mat<f64>> {
    tetrahedra::stiffness(field, false)
}

use crate::{BuilderOptions, ReduceError};
use basis::Basis;
use faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Mat, Side};
use glam::{DMat3, DVec3};
use palpate_body::{
    BarrierTetrahedron, Body, Network, SemiImplicitEuler, SurfaceTree, Tangent, TangentPattern, ToolContact,
    ToolPoint, VolumeBarrier,
};
use palpate_local::{
    LocalModel, LocalModelError, NearEnd, NearField, NearSpring, NearTetrahedron, TickIntegrator,
};
use support::SupportSet;

/// How the loop integrates the ticks of a near field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LocalIntegrator {
    /// As the body where that takes at most four substeps a tick, linearly implicit in two steps otherwise.
    #[default]
    Auto,
    /// Semi-implicit Euler with the body's own substeps, whatever they cost, 64 at most.
    Explicit,
    /// Linearly implicit Euler.
    Implicit {
        /// Steps in a tick, 1 to 64.
        substeps: u32,
    },
}

/// Most explicit substeps of `Auto`, and its implicit ones.
const MOST_SUBSTEPS: usize = 4;
const IMPLICIT_SUBSTEPS: u32 = 2;
/// Most substeps that a loop takes at all.
const LARGEST_SUBSTEPS: usize = 64;
/// Tetrahedra with a node in S are near up to this volume ratio: a tool may compress them further before the next model step.
const NEAR_RATIO: f64 = VolumeBarrier::ONSET + 0.2;

/// Room to build near fields of one body in, and what does not change in its life.
#[derive(Debug)]
pub(crate) struct Workspace {
    symbolic: SymbolicLlt<usize>,
    matrix: Vec<f64>,
    /// Of the surface, once a tool touches.
    tree: Option<SurfaceTree>,
    internal_n: Vec<DVec3>,
    outer_n: Vec<DVec3>,
    /// Place of every node in S, and in the ring.
    place: Vec<Place>,
    /// S of the last near field, and its ring.
    support: Vec<usize>,
    ring: Vec<usize>,
    /// V of the last local model with one.
    basis: Option<Basis>,
}

/// What a near field is built of.
pub(crate) struct Moment<'a> {
    pub(crate) body: &'a Body,
    /// That of the body, exact or clamped.
    pub(crate) tangent: &'a Tangent,
    pub(crate) is_clamped: bool,
    pub(crate) contact: &'a ToolContact,
    pub(crate) tool: ToolPoint,
    /// The other tools on the body: what they do stays as it was in the last step.
    pub(crate) others: &'a [&'a ToolContact],
    pub(crate) options: &'a BuilderOptions,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Elsewhere,
    Support(usize),
    Ring(usize),
}

impl Workspace {
    pub(crate) fn new(body: &Body, pattern: &TangentPattern) -> Result<Self, ReduceError> {
        let unknowns = pattern.symbolic().ncols();
        let symbolic = SymbolicLlt::try_new(pattern.symbolic(), Side::Lower)
            .map_err(|_| ReduceError::Symbolic { unknowns })?;
        let nodes = body.network().node_count();
        Ok(Self {
            symbolic,
            matrix: vec![0.0; pattern.symbolic().row_idx().len()],
            tree: None,
            internal_n: vec![DVec3::ZERO; nodes],
            outer_n: vec![DVec3::ZERO; nodes],
            place: vec![Place::Elsewhere; nodes],
            support: Vec::new(),
            ring: Vec::new(),
            basis: None,
        })
    }

    /// The nodes of S of the last near field, as the body numbers them.
    pub(crate) fn support(&self) -> &[usize] {
        &self.support
    }

    /// Writes the near field of a moment into `field`; it stays empty where the tool can reach nothing. Returns a bound of its
    /// error, as far as there is one.
    pub(crate) fn build(
        &mut self,
        moment: &Moment<'_>,
        field: &mut NearField,
    ) -> Result<Option<f64>, ReduceError> {
        let &Moment { body, tangent, contact, tool, others, options, .. } = moment;
        field.clear();
        self.support.clear();
        let room = field.capacity();
        let (nodes, order) = room::limits(contact, options, room);
        let tree = contact.shape().map(|_| {
            let tree = self.tree.get_or_insert_with(|| SurfaceTree::new(body));
            tree.refit(body);
            &*tree
        });
        let Some(support) = SupportSet::of(body, contact, tree, tool, options.horizon_s, (nodes, room))
        else {
            self.write_surface(moment, field)?;
            return Ok(None);
        };
        self.support.extend(&support.nodes);
        body.internal_forces_n(&mut self.internal_n);
        self.collect_outer_forces(body, others);
        let basis = self.basis(body, tangent, &support, options, order)?;
        self.write(moment, &support, &basis, field).inspect_err(|_| field.clear())?;
        // Along which the tool pushes or moves.
        let direction = contact.normal().or(tool.velocity_m_per_s.try_normalize()).unwrap_or(DVec3::Z);
        let bound =
            estimate::error_bound(field, (body.network(), tangent), (&basis, &support.nodes), direction);
        self.basis = Some(basis);
        Ok(bound)
    }

    /// Writes the surface alone, for a tool that can reach no node before the next hand-over unless it is very fast.
    fn write_surface(&mut self, moment: &Moment<'_>, field: &mut NearField) -> Result<(), ReduceError> {
        let &Moment { body, contact, tool, options, .. } = moment;
        let Some((shape, friction)) = contact.shape().filter(|_| contact.is_clear()) else { return Ok(()) };
        let support = SupportSet::out_of_reach(shape, friction);
        (field.support, field.start_m) = (support.support, tool.position_m);
        (field.coupling, field.proxy_m) = (contact.coupling(), contact.proxy_m(tool.position_m));
        (field.energy_j, field.tick_s) = (body.energy().total_j(), options.tick_s);
        field.integrator = TickIntegrator::Explicit { substeps: 1 };
        surface::write(body, contact, (&support, &[]), field.proxy_m, field).inspect_err(|_| field.clear())
    }

    /// The next local model has no basis, unless one is built for it.
    pub(crate) fn forget_basis(&mut self) {
        self.basis = None;
    }

    /// Columns of V of the last local model, and one of them over all free degrees of freedom.
    pub(crate) fn basis_order(&self) -> usize {
        self.basis.as_ref().map_or(0, Basis::order)
    }

    pub(crate) fn basis_column(&self, network: &Network, column: usize) -> Option<Vec<f64>> {
        let basis = self.basis.as_ref().filter(|basis| column < basis.order())?;
        let one: Vec<f64> = (0..basis.order()).map(|j| if j == column { 1.0 } else { 0.0 }).collect();
        Some(basis.columns(network, &one))
    }

    /// What acts from outside and from other tools.
    fn collect_outer_forces(&mut self, body: &Body, others: &[&ToolContact]) {
        body.outer_forces_n(&mut self.outer_n);
        others.iter().for_each(|other| other.add_force_n(&mut self.outer_n));
    }

    /// V of `most` columns at most: the static response, its high-frequency end, the responses at the shifts, v_N, and the static correction.
    fn basis(
        &mut self,
        body: &Body,
        tangent: &Tangent,
        support: &SupportSet,
        options: &BuilderOptions,
        most: usize,
    ) -> Result<Basis, ReduceError> {
        let network = body.network();
        let free: Vec<usize> = support.nodes.iter().filter_map(|&node| network.free_index(node)).collect();
        let (unknowns, coupled) = (3 * network.free().len(), 3 * free.len());
        let (k, b) = (tangent.stiffness(), tangent.damping());
        let mut is_support = vec![false; network.free().len()];
        free.iter().for_each(|&index| is_support[index] = true);
        let in_s = |dof: usize| is_support[dof / 3];
        // K_rS, then F_r.
        let mut static_rhs = Mat::zeros(unknowns, coupled + 1);
        for (i, &index) in free.iter().enumerate() {
            for axis in 0..3 {
                let column = 3 * index + axis;
                for (row, &value) in k.row_idx_of_col(column).zip(k.val_of_col(column)) {
                    if !in_s(row) {
                        static_rhs[(row, 3 * i + axis)] = value;
                    }
                }
            }
        }
        let mut basis = Basis::new(network, &is_support, most);
        for (index, &node) in network.free().iter().enumerate().filter(|(index, _)| !is_support[*index]) {
            let force = self.internal_n[node] + self.outer_n[node];
            (0..3).for_each(|axis| static_rhs[(3 * index + axis, coupled)] = force[axis]);
        }
        let sigma0 = options.regularisation_per_s;
        let mut solve = |sigma: f64, rhs: &mut Mat<f64>| -> Result<(), ReduceError> {
            let symbolic = tangent.stiffness().symbolic();
            // At rest the regularisation alone; at a shift the inertia and the dampers.
            let (mass, damping) = if sigma == 0.0 { (sigma0 * sigma0, 0.0) } else { (sigma * sigma, sigma) };
            for column in 0..unknowns {
                let m = mass * network.mass_kg()[network.free()[column / 3]];
                let range = symbolic.col_range(column);
                for (place, &row) in range.clone().zip(&symbolic.row_idx()[range]) {
                    self.matrix[place] = match (row == column, in_s(row) || in_s(column)) {
                        (true, true) => 1.0,
                        (false, true) => 0.0,
                        (diagonal, false) => {
                            k.val()[place] + damping * b.val()[place] + if diagonal { m } else { 0.0 }
                        }
                    };
                }
            }
            let factor = factorise(&self.symbolic, symbolic, &self.matrix)?;
            factor.solve_in_place(rhs);
            Ok(())
        };
        // What matters most comes first, for there may not be room for all.
        let tolerance = options.basis_tolerance;
        let coupling = static_rhs.subcols(0, coupled).to_owned();
        solve(0.0, &mut static_rhs)?;
        basis.take(static_rhs.as_ref(), tolerance);
        let v = body.velocities_m_per_s();
        let velocity = Mat::from_fn(unknowns, 1, |dof, _| v[network.free()[dof / 3]][dof % 3]);
        basis.take(velocity.as_ref(), tolerance);
        for shift_hz in options.shifts_hz.into_iter().flatten() {
            if basis.room() == 0 {
                break;
            }
            // What a shift adds is A⁻¹(σ²M + σB) times the static response: most for those motions of S that move most mass.
            let response = static_rhs.subcols(0, coupled);
            let few = (basis.room() < coupled)
                .then(|| basis::leading_inputs(basis.weighted(response).as_ref(), basis.room()))
                .flatten();
            let mut shifted = few.map_or_else(|| coupling.clone(), |few| &coupling * few);
            solve(std::f64::consts::TAU * shift_hz, &mut shifted)?;
            basis.take(shifted.as_ref(), tolerance);
        }
        basis.take(coupling.as_ref(), tolerance);
        basis.finish();
        Ok(basis)
    }

    fn write(
        &mut self,
        moment: &Moment<'_>,
        support: &SupportSet,
        basis: &Basis,
        field: &mut NearField,
    ) -> Result<(), ReduceError> {
        let &Moment { body, is_clamped, contact, tool, options, .. } = moment;
        let (network, x, v) = (body.network(), body.positions_m(), body.velocities_m_per_s());
        let room = field.capacity();
        let too_many = |what, found, room| ReduceError::from(LocalModelError::Room { what, found, room });
        let (s, p) = (support.nodes.len(), basis.order());
        if s > room.nodes {
            return Err(too_many("nodes of S", s, room.nodes));
        }
        (field.nodes, field.order) = (s, p);
        (field.support, field.start_m) = (support.support, tool.position_m);
        (field.coupling, field.proxy_m) = (contact.coupling(), contact.proxy_m(tool.position_m));
        field.energy_j = body.energy().total_j();
        (field.tick_s, field.is_cut) = (options.tick_s, support.is_cut);
        self.place.fill(Place::Elsewhere);
        self.ring.clear();
        for (i, &node) in support.nodes.iter().enumerate() {
            self.place[node] = Place::Support(i);
            field.weight[i] = support.weights[i];
            field.node_m[i] = x[node];
            let is_free = !network.is_fixed(node);
            field.node_per_kg[i] = if is_free { 1.0 / network.mass_kg()[node] } else { 0.0 };
            field.force[3 * i..3 * i + 3].copy_from_slice(&self.outer_n[node].to_array());
            field.velocity[3 * i..3 * i + 3].copy_from_slice(&v[node].to_array());
        }
        // The springs with a free end in S are near; F_far is what remains when they are taken away.
        let mut far_n = self.internal_n.clone();
        let mut is_near = vec![false; network.links().len()];
        for &node in support.nodes.iter().filter(|&&node| !network.is_fixed(node)) {
            for &index in network.incident_links(node) {
                if std::mem::replace(&mut is_near[index], true) {
                    continue;
                }
                let link = &network.links()[index];
                let f = link.spring.force_on_a(x[link.b] - x[link.a], v[link.b] - v[link.a]);
                far_n[link.a] -= f;
                far_n[link.b] += f;
                let other = if link.a == node { link.b } else { link.a };
                if field.springs == room.springs {
                    return Err(too_many("near springs", field.springs + 1, room.springs));
                }
                let Place::Support(a) = self.place[node] else { continue };
                let b = match self.place[other] {
                    Place::Support(i) => NearEnd::Support(i),
                    Place::Ring(i) => NearEnd::Ring(i),
                    Place::Elsewhere if network.is_fixed(other) => NearEnd::Fixed(x[other]),
                    Place::Elsewhere => {
                        let i = field.ring;
                        if i == room.ring {
                            return Err(too_many("nodes of the ring", i + 1, room.ring));
                        }
                        self.place[other] = Place::Ring(i);
                        field.ring_m[i] = x[other];
                        self.ring.push(other);
                        field.ring += 1;
                        NearEnd::Ring(i)
                    }
                };
                // The force of a spring is the same seen from either end, but for its sign.
                field.near[field.springs] = NearSpring { a, b, spring: link.spring };
                field.springs += 1;
            }
        }
        surface::write(body, contact, (support, &self.ring), field.proxy_m, field)?;
        let far_tetrahedra = self.write_tetrahedra(body, field, &mut far_n)?;
        let entries = 3 * field.ring;
        for (i, &node) in self.ring.iter().enumerate() {
            basis.write_rows(node, |axis, j, v| field.basis[entries * j + 3 * i + axis] = v);
        }
        let force = |node: usize| far_n[node] + self.outer_n[node];
        basis.project(
            force,
            |node| network.mass_kg()[node] * v[node],
            |j, f, momentum| {
                field.force[3 * s + j] = f;
                field.velocity[3 * s + j] = momentum;
            },
        );
        let far = (&is_near[..], &far_tetrahedra[..]);
        basis.congruence(body, far, is_clamped, &mut field.stiffness, &mut field.damping);
        let substeps =
            SemiImplicitEuler { tick_s: options.tick_s, ..SemiImplicitEuler::default() }.substeps(body);
        let explicit = |most: usize| {
            let substeps = substeps.as_ref().ok().filter(|&&substeps| substeps <= most)?;
            Some(TickIntegrator::Explicit { substeps: *substeps as u32 })
        };
        field.integrator = match options.integrator {
            LocalIntegrator::Auto => explicit(MOST_SUBSTEPS),
            LocalIntegrator::Explicit => explicit(LARGEST_SUBSTEPS),
            LocalIntegrator::Implicit { substeps } => Some(TickIntegrator::Implicit { substeps }),
        }
        .unwrap_or(TickIntegrator::Implicit { substeps: IMPLICIT_SUBSTEPS });
        if let TickIntegrator::Implicit { substeps } = field.integrator {
            implicit::make_implicit(field, field.tick_s / f64::from(substeps))?;
        }
        Ok(())
    }

    /// Writes the near tetrahedra, and takes their forces away from `far_n`. Returns the other tetrahedra whose barriers act.
    fn write_tetrahedra(
        &mut self,
        body: &Body,
        field: &mut NearField,
        far_n: &mut [DVec3],
    ) -> Result<Vec<BarrierTetrahedron>, ReduceError> {
        let (network, x, room) = (body.network(), body.positions_m(), field.capacity());
        let too_many = |what, found, room| ReduceError::from(LocalModelError::Room { what, found, room });
        let mut far = Vec::new();
        for tetrahedron in body.barriers_below(NEAR_RATIO) {
            let moves =
                |&node: &usize| matches!(self.place[node], Place::Support(_)) && !network.is_fixed(node);
            if !tetrahedron.nodes.iter().any(moves) {
                far.extend(VolumeBarrier::is_active(tetrahedron.ratio(x)).then_some(tetrahedron));
                continue;
            }
            for (&node, force) in tetrahedron.nodes.iter().zip(tetrahedron.forces_n(x)) {
                far_n[node] -= force;
            }
            let mut near = NearTetrahedron { nodes: [0; 4], barrier: tetrahedron.barrier };
            for (to, &node) in near.nodes.iter_mut().zip(&tetrahedron.nodes) {
                if self.place[node] == Place::Elsewhere {
                    let i = field.ring;
                    if i == room.ring {
                        return Err(too_many("nodes of the ring", i + 1, room.ring));
                    }
                    // The rows of V of a fixed node are zero.
                    self.place[node] = Place::Ring(i);
                    field.ring_m[i] = x[node];
                    self.ring.push(node);
                    field.ring += 1;
                }
                *to = match self.place[node] {
                    Place::Support(i) => i,
                    Place::Ring(i) => field.nodes + i,
                    Place::Elsewhere => continue,
                };
            }
            let Some(to) = field.tetrahedron.get_mut(field.tetrahedra) else {
                return Err(too_many("near tetrahedra", field.tetrahedra + 1, field.tetrahedron.len()));
            };
            *to = near;
            field.tetrahedra += 1;
        }
        Ok(far)
    }

    /// Writes the linear reduced system of `body` driven at `node` into `model`, with the same basis.
    pub(crate) fn build_linear(
        &mut self,
        (body, others): (&Body, &[&ToolContact]),
        tangent: &Tangent,
        node: usize,
        options: &BuilderOptions,
        model: &mut LocalModel,
    ) -> Result<(), ReduceError> {
        let network = body.network();
        let support = SupportSet::driven(node);
        body.internal_forces_n(&mut self.internal_n);
        self.collect_outer_forces(body, others);
        let basis =
            self.basis(body, tangent, &support, options, options.order_limit.min(model.reduced.capacity()))?;
        let (p, h, r) = (basis.order(), options.tick_s, &mut model.reduced);
        (r.order, r.step_s) = (p, h);
        let (x, v) = (body.positions_m(), body.velocities_m_per_s());
        let force = |node: usize| self.internal_n[node] + self.outer_n[node];
        basis.project(
            force,
            |node| network.mass_kg()[node] * v[node],
            |j, f, momentum| {
                (r.force[j], r.velocity[j]) = (f, momentum);
            },
        );
        let none_near = vec![false; network.links().len()];
        let barriers: Vec<BarrierTetrahedron> = body.active_barriers().collect();
        basis.congruence(body, (&none_near, &barriers), model.clamped, &mut r.stiffness, &mut r.damping);
        r.stiffness_rc[..3 * p].fill(0.0);
        r.damping_rc[..3 * p].fill(0.0);
        (model.stiffness_n_per_m, model.damping_ns_per_m) = (DMat3::ZERO, DMat3::ZERO);
        for &index in network.incident_links(node) {
            let link = &network.links()[index];
            let other = if link.a == node { link.b } else { link.a };
            let t = link.spring.tangent(x[link.b] - x[link.a], model.clamped);
            model.stiffness_n_per_m += t.stiffness;
            model.damping_ns_per_m += t.damping;
            basis.subtract_coupling(other, t.stiffness, &mut r.stiffness_rc);
            basis.subtract_coupling(other, t.damping, &mut r.damping_rc);
        }
        for tetrahedron in &barriers {
            let Some(own) = tetrahedron.nodes.iter().position(|&other| other == node) else { continue };
            for ((i, &other), blocks) in
                tetrahedron.nodes.iter().enumerate().zip(tetrahedron.stiffness(x, model.clamped))
            {
                if i == own {
                    model.stiffness_n_per_m += blocks[own];
                } else {
                    // The block of the driven node's row and the other's column.
                    basis.subtract_coupling(other, -blocks[own].transpose(), &mut r.stiffness_rc);
                }
            }
        }
        let implicit: Vec<f64> = (0..p * p)
            .map(|at| if at / p == at % p { 1.0 / h } else { 0.0 } + r.damping[at] + h * r.stiffness[at])
            .collect();
        self.basis = Some(basis);
        Ok(r.implicit.factorise(p, &implicit)?)
    }
}

fn factorise(
    symbolic: &SymbolicLlt<usize>,
    pattern: SymbolicSparseColMatRef<'_, usize>,
    values: &[f64],
) -> Result<Llt<usize, f64>, ReduceError> {
    let matrix = SparseColMatRef::new(pattern, values);
    Llt::try_new_with_symbolic(symbolic.clone(), matrix, Side::Lower).map_err(|error| match error {
        LltError::Numeric(NonPositivePivot { index }) => ReduceError::Singular { pivot: index },
        LltError::Generic(_) => ReduceError::Symbolic { unknowns: matrix.ncols() },
    })
}
