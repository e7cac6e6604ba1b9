//! The state of a near field in a tick: the nodes of S and the reduced far field, between the solutions of the tool's constraints.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::dense::{add_columns, dot, set_vec3, subtract_product, vec3_at, zeros};
use crate::joint_contact::BodyInStep;
use crate::near_field_contact::{BodyContacts, NodeMotion};
use crate::{NearDomain, NearEnd, NearField, NearFieldCapacity, Sample, Support, TickIntegrator};
use glam::DVec3;
use palpate_laws::{RelaxedStress, ToolMove, VolumeBarrier, domain_gradient};

/// The state z = (δx_S, q) of a near field, and the buffers of its tick.
#[derive(Clone, Debug)]
pub(crate) struct NearFieldState {
    /// δx_S, then q.
    z: Vec<f64>,
    /// v_S, then q̇.
    z_dot: Vec<f64>,
    /// Forces on S, N, then the generalised forces on q.
    force: Vec<f64>,
    /// Internal force on each node of S, N: springs, dampers, elements, volume barriers and drag.
    internal_n: Vec<DVec3>,
    /// Displacements and velocities of the ring, and the forces of near springs, elements and tetrahedra on it, three numbers a node.
    ring_dx: Vec<f64>,
    ring_v: Vec<f64>,
    ring_n: Vec<f64>,
    /// The nodes of S, then those of the ring.
    ends: Vec<NodeState>,
    /// Relaxed stress of the near hexahedra, and of the near domains, J.
    relaxed: Vec<RelaxedStress>,
    domain_relaxed: Vec<RelaxedStress>,
    /// Whether `internal_n` and `ring_n` belong to the current state.
    are_forces_current: bool,
    scratch: Vec<f64>,
    contacts: BodyContacts,
}

/// A node of S or of the ring: position, m, velocity, m/s, and the sum of the forces of springs and elements on it, N.
#[derive(Clone, Copy, Debug, Default)]
struct NodeState {
    x: DVec3,
    v: DVec3,
    force_n: DVec3,
}

impl NearFieldState {
    pub(crate) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        let n = 3 * capacity.nodes + capacity.order;
        let (zero, still) = (zeros(n), zeros(3 * capacity.ring));
        Self {
            z: zero.clone(),
            z_dot: zero.clone(),
            force: zero.clone(),
            internal_n: vec![DVec3::ZERO; capacity.nodes],
            ring_dx: still.clone(),
            ring_v: still.clone(),
            ring_n: still,
            ends: vec![NodeState::default(); capacity.nodes + capacity.ring],
            relaxed: vec![RelaxedStress::default(); capacity.hexahedra],
            domain_relaxed: vec![RelaxedStress::default(); capacity.domains],
            are_forces_current: false,
            scratch: zero,
            contacts: BodyContacts::with_capacity(capacity),
        }
    }

    /// Resets to the model step: z = 0, ż = ż_N.
    pub(crate) fn start(&mut self, field: &NearField) {
        self.z.fill(0.0);
        self.z_dot.fill(0.0);
        self.z_dot.iter_mut().zip(&field.velocity).take(field.unknowns()).for_each(|(to, from)| *to = *from);
        self.ring_dx.fill(0.0);
        self.ring_v.fill(0.0);
        self.are_forces_current = false;
        let relaxed = field.hexahedron.iter().map(|element| element.relaxed).take(field.hexahedra);
        self.relaxed.iter_mut().zip(relaxed).for_each(|(to, from)| *to = from);
        let relaxed = field.domain.iter().map(|domain| domain.relaxed).take(field.domains);
        self.domain_relaxed.iter_mut().zip(relaxed).for_each(|(to, from)| *to = from);
        let s = 3 * field.nodes;
        multiply_ring_basis(field, self.z_dot.get(s..field.unknowns()).unwrap_or_default(), &mut self.ring_v);
        self.contacts.restart(field);
    }

    /// Whether contacts of this tick were dropped because a buffer is full.
    pub(crate) fn is_full(&self) -> bool {
        self.contacts.is_full()
    }

    /// Begins a tick in which the tool moves by `tool`: detects its contacts.
    pub(crate) fn begin_tick(&mut self, field: &NearField, tool: &ToolMove) {
        let motion = NodeMotion { z: &self.z, z_dot: &self.z_dot, ring_dx: &self.ring_dx };
        self.contacts.begin_tick(field, tool, &motion);
    }

    /// Begins a substep of length `h`, at whose end the device is at `device_m` with the velocity of `sample`: computes the velocities
    /// without constraints.
    pub(crate) fn begin_step(&mut self, field: &NearField, device_m: DVec3, sample: &Sample, h: f64) {
        if field.support == Support::Driven {
            set_vec3(&mut self.z, 0, device_m - field.start_m);
            set_vec3(&mut self.z_dot, 0, sample.velocity_m_per_s);
            self.are_forces_current = false;
        }
        self.update_internal_forces(field);
        self.collect_forces(field, sample);
        self.accelerate(field, h);
    }

    /// Force of the tool on the body in the last substep, N.
    pub(crate) fn applied_n(&self) -> DVec3 {
        self.contacts.applied_n()
    }

    /// The body for the solution of the constraints in a substep.
    pub(crate) fn in_step<'a>(&'a mut self, field: &'a NearField) -> Option<BodyInStep<'a>> {
        let n = field.unknowns();
        let (z, z_dot) = (self.z.get(..n)?, self.z_dot.get_mut(..n)?);
        Some(BodyInStep { field, contacts: &mut self.contacts, z, z_dot })
    }

    /// Force of the body on the tool after the last substep of a tick, of length `h`, N, without the limit of the coupling.
    pub(crate) fn force_n(&mut self, field: &NearField, h: f64) -> DVec3 {
        self.update_internal_forces(field);
        match field.support {
            Support::Driven => self.internal_n.first().copied().unwrap_or_default(),
            Support::Held => {
                // Fixed nodes do not contribute.
                let free = |(w, per_kg): (&f64, &f64)| if *per_kg > 0.0 { *w } else { 0.0 };
                let weights = || field.weight.iter().zip(&field.node_per_kg).map(free).take(field.nodes);
                let sum: DVec3 = weights().zip(&self.internal_n).map(|(w, f)| w * *f).sum();
                sum / weights().map(|w| w * w).sum::<f64>()
            }
            Support::Touched { friction, .. } => {
                self.contacts.displayed_n(field, &self.internal_n, friction, h)
            }
        }
    }

    /// Energy of the whole body in this state, J: the energy at the model step plus the change by z. External forces count as a
    /// potential.
    pub(crate) fn energy_j(&self, field: &NearField) -> f64 {
        let (n, s) = (field.unknowns(), 3 * field.nodes);
        let (z, v) = (self.z.get(..n).unwrap_or_default(), self.z_dot.get(..n).unwrap_or_default());
        let squares = |v: &[f64]| -> f64 {
            let per_kg = field.node_per_kg.iter().flat_map(|per_kg| [*per_kg; 3]).take(s);
            let kg = per_kg.map(|per_kg| if per_kg > 0.0 { 1.0 / per_kg } else { 0.0 });
            v.iter().zip(kg.chain(std::iter::repeat(1.0))).map(|(v, m)| 0.5 * m * v * v).sum()
        };
        let kinetic = squares(v) - squares(field.velocity.get(..n).unwrap_or_default());
        let mut elastic = 0.0;
        for near in field.near.iter().take(field.springs) {
            let place = |i: usize| field.node_m.get(i).copied().unwrap_or_default();
            let (before, after) = match near.b {
                NearEnd::Support(i) => (place(i), place(i) + vec3_at(z, i)),
                NearEnd::Ring(i) => {
                    let x = field.ring_m.get(i).copied().unwrap_or_default();
                    (x, x + vec3_at(&self.ring_dx, i))
                }
                NearEnd::Fixed(x) => (x, x),
            };
            let a = place(near.a);
            elastic +=
                near.spring.energy_j(after - a - vec3_at(z, near.a)) - near.spring.energy_j(before - a);
        }
        for tetrahedron in field.tetrahedron.iter().take(field.tetrahedra) {
            let place = |node| placed(field, z, &self.ring_dx, node);
            let [Some(o), Some(a), Some(b), Some(c)] = tetrahedron.nodes.map(place) else { continue };
            let energy = |[o, a, b, c]: [DVec3; 4]| {
                tetrahedron.barrier.energy_j(tetrahedron.barrier.ratio([a - o, b - o, c - o]))
            };
            elastic += energy([o.1, a.1, b.1, c.1]) - energy([o.0, a.0, b.0, c.0]);
        }
        for (element, relaxed) in field.hexahedron.iter().zip(&self.relaxed).take(field.hexahedra) {
            let place = |node: u16| placed(field, z, &self.ring_dx, node.into()).unwrap_or_default();
            let Some(shape) = field.shape.get(element.shape) else { continue };
            let corners = element.nodes.map(place);
            elastic += shape.energy_j(&corners.map(|of| of.1), &element.material, relaxed)
                - shape.energy_j(&corners.map(|of| of.0), &element.material, &element.relaxed);
        }
        for (domain, relaxed) in field.domain.iter().zip(&self.domain_relaxed).take(field.domains) {
            let places = || domain.part(&field.domain_node).iter().map(|node| usize::from(*node));
            let place = |node| placed(field, z, &self.ring_dx, node).unwrap_or_default();
            let gradients = domain.part(&field.domain_gradient_per_m);
            let before = domain_gradient(gradients, places().map(|node| place(node).0));
            let now = domain_gradient(gradients, places().map(|node| place(node).1));
            elastic +=
                domain.material.energy_j(&now, relaxed) - domain.material.energy_j(&before, &domain.relaxed);
        }
        // −(F_far,N + B̃ q̇_N)ᵀ q + ½ qᵀ K̃ q: the damper forces at the model step are excluded.
        let (q, p) = (z.get(s..).unwrap_or_default(), field.order.max(1));
        let q_dot_n = field.velocity.get(s..n).unwrap_or_default();
        let matrices = field.stiffness.chunks_exact(p).zip(field.damping.chunks_exact(p));
        let far: f64 = q
            .iter()
            .zip(matrices)
            .zip(field.force.get(s..).unwrap_or_default())
            .map(|((q_i, (k, b)), f)| q_i * (0.5 * dot(k, q) - dot(b, q_dot_n) - f))
            .sum();
        let outer: f64 = z.iter().zip(&field.force).take(s).map(|(z, f)| -z * f).sum();
        field.energy_j + kinetic + elastic + far + outer
    }

    /// Changes the velocities by the forces over a substep of length `h`.
    fn accelerate(&mut self, field: &NearField, h: f64) {
        let (n, s) = (field.unknowns(), 3 * field.nodes);
        let first = first_moving(field);
        let (Some(z_dot), Some(force), Some(scratch)) =
            (self.z_dot.get_mut(..n), self.force.get_mut(..n), self.scratch.get_mut(..n))
        else {
            return;
        };
        match field.integrator {
            TickIntegrator::Explicit { .. } => {
                let (v_s, q_dot) = z_dot.split_at_mut(s);
                let (on_s, on_q) = force.split_at(s);
                if first == 0 {
                    let nodes = v_s.as_chunks_mut::<3>().0.iter_mut().zip(on_s.as_chunks::<3>().0);
                    for ((v, f), per_kg) in nodes.zip(&field.node_per_kg) {
                        v.iter_mut().zip(f).for_each(|(v, f)| *v += h * per_kg * f);
                    }
                }
                q_dot.iter_mut().zip(on_q).for_each(|(v, f)| *v += h * f);
            }
            TickIntegrator::Implicit { .. } => {
                // (M/h + B + hK) Δż = f − hK ż; driven velocities are prescribed.
                for (i, (to, v)) in scratch.iter_mut().zip(&*z_dot).enumerate() {
                    *to = if i < first { 0.0 } else { h * v };
                }
                subtract_product(force, &field.tangent, scratch);
                // Forces do not accelerate driven or fixed nodes.
                if let Some(driven) = force.get_mut(..first) {
                    driven.fill(0.0);
                }
                for (on_node, per_kg) in force.chunks_exact_mut(3).zip(&field.node_per_kg).take(field.nodes) {
                    if *per_kg == 0.0 {
                        on_node.fill(0.0);
                    }
                }
                field.factor.solve_in_place(force);
                z_dot.iter_mut().zip(&*force).skip(first).for_each(|(v, change)| *v += change);
            }
        }
    }

    /// Ends a substep of length `h`: moves the positions with the velocities, or with those of the correction where a gap was violated.
    pub(crate) fn end_step(&mut self, field: &NearField, is_corrected: bool, h: f64) {
        let (n, s) = (field.unknowns(), 3 * field.nodes);
        let first = first_moving(field);
        let (Some(z), Some(z_dot)) = (self.z.get_mut(..n), self.z_dot.get(..n)) else { return };
        let correction = self.contacts.correction(n).filter(|_| is_corrected);
        let v = correction.unwrap_or(z_dot);
        let moving = z.get_mut(first..).into_iter().flatten().zip(v.get(first..).into_iter().flatten());
        moving.for_each(|(z, v)| *z += h * v);
        // The ring follows q: integrated from its velocities, or recomputed where a correction moved the positions.
        multiply_ring_basis(field, z_dot.get(s..).unwrap_or_default(), &mut self.ring_v);
        self.are_forces_current = false;
        if is_corrected {
            multiply_ring_basis(field, z.get(s..).unwrap_or_default(), &mut self.ring_dx);
        } else {
            let moved = self.ring_dx.iter_mut().zip(&self.ring_v).take(3 * field.ring);
            moved.for_each(|(dx, v)| *dx += h * v);
        }
        self.relax(field, h);
    }

    /// Relaxes the stress of the near elements over a substep of length `h`.
    fn relax(&mut self, field: &NearField, h: f64) {
        let Self { z, ring_dx, relaxed, domain_relaxed, .. } = self;
        let place =
            |node: u16| placed(field, z, ring_dx, node.into()).map(|(_, now)| now).unwrap_or_default();
        for (element, relaxed) in field.hexahedron.iter().zip(relaxed).take(field.hexahedra) {
            let Some(shape) = field.shape.get(element.shape).filter(|_| element.material.relaxes()) else {
                continue;
            };
            shape.relax(&element.nodes.map(place), &element.material, relaxed, h);
        }
        for (domain, relaxed) in field.domain.iter().zip(domain_relaxed).take(field.domains) {
            if domain.material.material.relaxes() {
                let nodes = domain.part(&field.domain_node).iter().map(|node| place(*node));
                let f = domain_gradient(domain.part(&field.domain_gradient_per_m), nodes);
                domain.material.relax(&f, relaxed, h);
            }
        }
    }

    /// Computes the forces of the near springs, elements and tetrahedra on S and on the ring, unless they are current.
    fn update_internal_forces(&mut self, field: &NearField) {
        if std::mem::replace(&mut self.are_forces_current, true) {
            return;
        }
        let Self { z, z_dot, ring_dx, ring_v, ends, internal_n, ring_n, relaxed, domain_relaxed, .. } = self;
        // Positions and velocities are computed once a node, not once a spring.
        let of_s = field.node_m.iter().zip(vectors(z)).zip(vectors(z_dot)).take(field.nodes);
        let of_ring = field.ring_m.iter().zip(vectors(ring_dx)).zip(vectors(ring_v)).take(field.ring);
        for (to, ((rest, dx), v)) in ends.iter_mut().zip(of_s.chain(of_ring)) {
            *to = NodeState { x: *rest + dx, v, force_n: DVec3::ZERO };
        }
        for near in field.near.iter().take(field.springs) {
            let Some(a) = ends.get(near.a) else { continue };
            let (index, x, v) = match near.b {
                NearEnd::Support(i) | NearEnd::Ring(i) => {
                    let index = if matches!(near.b, NearEnd::Ring(_)) { field.nodes + i } else { i };
                    let Some(b) = ends.get(index) else { continue };
                    (Some(index), b.x, b.v)
                }
                NearEnd::Fixed(x) => (None, x, DVec3::ZERO),
            };
            let f = near.spring.force_on_a(x - a.x, v - a.v);
            if let Some(a) = ends.get_mut(near.a) {
                a.force_n += f;
            }
            if let Some(b) = index.and_then(|index| ends.get_mut(index)) {
                b.force_n -= f;
            }
        }
        for (element, relaxed) in field.hexahedron.iter().zip(&*relaxed).take(field.hexahedra) {
            let Some(shape) = field.shape.get(element.shape) else { continue };
            let corners = element.nodes.map(|node| ends.get(usize::from(node)).copied().unwrap_or_default());
            let (x, v) = (corners.map(|of| of.x), corners.map(|of| of.v));
            let forces = shape.forces_n(&x, &v, &element.material, relaxed);
            for (node, force) in element.nodes.iter().zip(forces) {
                if let Some(end) = ends.get_mut(usize::from(*node)) {
                    end.force_n += force;
                }
            }
        }
        for (domain, relaxed) in field.domain.iter().zip(&*domain_relaxed).take(field.domains) {
            add_domain_forces(field, domain, relaxed, ends);
        }
        let (of_s, of_ring) = ends.split_at(field.nodes.min(ends.len()));
        let with_drag = internal_n.iter_mut().zip(of_s).zip(&field.drag_ns_per_m);
        with_drag.for_each(|((to, end), drag)| *to = end.force_n - *drag * end.v);
        let of_ring = ring_n.as_chunks_mut::<3>().0.iter_mut().zip(of_ring).take(field.ring);
        of_ring.for_each(|(to, end)| *to = end.force_n.to_array());
        self.add_barrier_forces(field);
    }

    /// Adds the forces of the volume barriers of the near tetrahedra.
    fn add_barrier_forces(&mut self, field: &NearField) {
        for tetrahedron in field.tetrahedron.iter().take(field.tetrahedra) {
            let place = |node| placed(field, &self.z, &self.ring_dx, node).map(|(_, now)| now);
            let [Some(o), Some(a), Some(b), Some(c)] = tetrahedron.nodes.map(place) else { continue };
            let edges = [a - o, b - o, c - o];
            if !VolumeBarrier::is_active(tetrahedron.barrier.ratio(edges)) {
                continue;
            }
            let [a, b, c] = tetrahedron.barrier.forces_n(edges);
            for (node, force) in tetrahedron.nodes.into_iter().zip([-(a + b + c), a, b, c]) {
                match node.checked_sub(field.nodes) {
                    None => {
                        if let Some(sum) = self.internal_n.get_mut(node) {
                            *sum += force;
                        }
                    }
                    Some(i) => {
                        let sum = vec3_at(&self.ring_n, i) + force;
                        set_vec3(&mut self.ring_n, i, sum);
                    }
                }
            }
        }
    }

    /// Sums the forces on z: near springs and tetrahedra, far field, external forces, and the change of another tool's force since the model
    /// step.
    fn collect_forces(&mut self, field: &NearField, sample: &Sample) {
        let (n, s, p) = (field.unknowns(), 3 * field.nodes, field.order);
        let (Some(force), Some(z), Some(z_dot)) =
            (self.force.get_mut(..n), self.z.get(..n), self.z_dot.get(..n))
        else {
            return;
        };
        force.iter_mut().zip(&field.force).for_each(|(to, from)| *to = *from);
        let of_other = sample
            .other
            .filter(|now| now.tool != 0 && (now.tool, now.body) == (field.other.tool, field.other.body));
        if let Some(now) = of_other {
            let change_n = now.force_n - field.other.force_n;
            add_columns(force, &field.other_influence, &change_n.to_array(), 1.0);
        }
        let (on_s, on_q) = force.split_at_mut(s.min(n));
        let (q, q_dot) = (z.get(s..).unwrap_or_default(), z_dot.get(s..).unwrap_or_default());
        add_columns(on_q, &field.stiffness, q, -1.0);
        // B̃ (q̇ − q̇_N).
        if let (Some(scratch), Some(q_dot_n)) = (self.scratch.get_mut(..p), field.velocity.get(s..)) {
            for ((to, v), v_n) in scratch.iter_mut().zip(q_dot).zip(q_dot_n) {
                *to = v - v_n;
            }
            add_columns(on_q, &field.damping, scratch, -1.0);
        }
        for (to, f) in on_s.chunks_exact_mut(3).zip(&self.internal_n) {
            to.iter_mut().zip(f.to_array()).for_each(|(to, f)| *to += f);
        }
        if let Some(ring_n) = self.ring_n.get(..3 * field.ring).filter(|ring_n| !ring_n.is_empty()) {
            for (to, column) in on_q.iter_mut().zip(field.basis.chunks_exact(ring_n.len())) {
                *to += dot(column, ring_n);
            }
        }
    }
}

/// Adds the forces of a smoothed domain to its nodes.
fn add_domain_forces(
    field: &NearField,
    domain: &NearDomain,
    relaxed: &RelaxedStress,
    ends: &mut [NodeState],
) {
    let (nodes, gradients) = (domain.part(&field.domain_node), domain.part(&field.domain_gradient_per_m));
    let at = |node: &u16| ends.get(usize::from(*node)).copied().unwrap_or_default();
    let f = domain_gradient(gradients, nodes.iter().map(|node| at(node).x));
    let rate_per_s = || domain_gradient(gradients, nodes.iter().map(|node| at(node).v));
    let stress_j = domain.material.stress_j(&f, rate_per_s, relaxed);
    for (node, b) in nodes.iter().zip(gradients) {
        if let Some(end) = ends.get_mut(usize::from(*node)) {
            end.force_n -= stress_j * *b;
        }
    }
}

/// Positions at the model step and now, m, of node i of S for i < s, and of node i of the ring for s + i.
fn placed(field: &NearField, z: &[f64], ring_dx: &[f64], node: usize) -> Option<(DVec3, DVec3)> {
    match node.checked_sub(field.nodes) {
        None => field.node_m.get(node).map(|x| (*x, *x + vec3_at(z, node))),
        Some(i) => field.ring_m.get(i).map(|x| (*x, *x + vec3_at(ring_dx, i))),
    }
}

/// First degree of freedom of z whose velocity is not prescribed: that after the driven node.
fn first_moving(field: &NearField) -> usize {
    if field.support == Support::Driven { 3 * field.nodes } else { 0 }
}

/// Writes the ring's rows of V q into `to`.
fn multiply_ring_basis(field: &NearField, q: &[f64], to: &mut [f64]) {
    if let Some(to) = to.get_mut(..3 * field.ring) {
        to.fill(0.0);
        add_columns(to, &field.basis, q, 1.0);
    }
}

/// The vectors of a list of three numbers each.
fn vectors(list: &[f64]) -> impl Iterator<Item = DVec3> {
    list.as_chunks::<3>().0.iter().map(|v| DVec3::from_array(*v))
}
