//! The tool in a tick: the point of S that it holds, or the contact patches with which it runs into it, as the body's step has them.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod displayed;
mod near_triangles;
mod patches;
mod row;

pub(crate) use patches::Placed;

use crate::dense::{Cholesky, room, zeros};
use crate::near_tick::{set_vec3, vec3_at};
use crate::{NearField, NearFieldCapacity, Support, TickIntegrator};
use glam::{DMat3, DVec3};
use palpate_laws::{
    GAP_TOLERANCE_M, ImpulseResponse, MAX_PATCHES, PATCH_ROWS, SolverLimits, ToolMove,
    solve_projected_gauss_seidel, solve_with_proxy,
};
use patches::Patches;
use row::ContactRow;

/// Most rows of a tick.
const MAX_ROWS: usize = MAX_PATCHES * PATCH_ROWS;
/// How often rows are looked for again after some were met.
const MAX_ACTIVE_SET_PASSES: usize = 4;
/// What is done for the impulses of all rows in a step.
const EFFORT: SolverLimits = SolverLimits { max_iterations: 60, tolerance: 1e-6 };
/// So often a row is asked for its impulse in a tick at most, so that no tick takes long.
const MAX_ROW_UPDATES: usize = 1000;

/// The rows of a tick, and room to find their impulses in.
#[derive(Debug)]
pub(crate) struct ContactSolver {
    patches: Patches,
    rows: Vec<ContactRow>,
    /// Of S in each row, s of them for each; and in the mean of a patch.
    weights: Vec<f64>,
    mean: Vec<f64>,
    /// The rows that take part in the problem of a step, and what they are to it.
    active: Vec<usize>,
    problem: Vec<palpate_laws::ConstraintRow>,
    /// `Implicit`: the velocities of S that a unit impulse on each row gives, 3 × 3s for each.
    response: Vec<f64>,
    before: Vec<f64>,
    correction_velocity: Vec<f64>,
    /// Of S: velocities, and the impulses that all rows give.
    velocity: Vec<f64>,
    given: Vec<f64>,
    /// How often rows may still be asked in this tick.
    row_updates_left: usize,
    /// Whether impulses of this tick were not found as well as they should be.
    is_unconverged: bool,
    /// Gram matrix of the rows, its factor, and forces.
    gram: Vec<f64>,
    factor: Cholesky,
    shares: [Vec<f64>; 3],
    capacity: NearFieldCapacity,
}

impl Clone for ContactSolver {
    /// With the room of the original: a tick must not have to make it.
    fn clone(&self) -> Self {
        let mut copy = Self::with_capacity(self.capacity);
        copy.patches.copy_from(&self.patches);
        copy
    }
}

impl ContactSolver {
    pub(crate) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        let (n, of_support) = (3 * capacity.nodes + capacity.order, 3 * capacity.nodes);
        let forces = zeros(MAX_ROWS);
        let ContactRow { law, gap: gap_m, impulse_ns, .. } = ContactRow::default();
        let row =
            palpate_laws::ConstraintRow { law, gap_m, inv_effective_mass_per_kg: DMat3::ZERO, impulse_ns };
        Self {
            patches: Patches::with_capacity(capacity),
            rows: room(MAX_ROWS, ContactRow::default()),
            weights: zeros((MAX_ROWS + PATCH_ROWS) * capacity.nodes),
            mean: zeros(capacity.nodes),
            active: room(MAX_ROWS, 0),
            problem: room(MAX_ROWS, row),
            response: zeros(MAX_ROWS * 3 * of_support),
            before: zeros(n),
            correction_velocity: zeros(n),
            velocity: zeros(of_support),
            given: zeros(of_support),
            row_updates_left: MAX_ROW_UPDATES,
            is_unconverged: false,
            gram: zeros(MAX_ROWS * MAX_ROWS),
            factor: Cholesky::with_capacity(MAX_ROWS),
            shares: [forces.clone(), forces.clone(), forces],
            capacity,
        }
    }

    /// Begins at the model step.
    pub(crate) fn restart(&mut self, field: &NearField) {
        self.patches.restart(field);
        self.rows.clear();
        self.is_unconverged = false;
    }

    /// Begins a tick in which the tool moves so, from where S and the ring are.
    pub(crate) fn begin(&mut self, field: &NearField, tool: &ToolMove, placed: &Placed<'_>) {
        (self.row_updates_left, self.is_unconverged) = (MAX_ROW_UPDATES, false);
        match field.support {
            Support::Driven => self.rows.clear(),
            Support::Held => {
                self.rows.clear();
                self.rows.push(ContactRow::default());
                self.weights.iter_mut().zip(&field.weight).take(field.nodes).for_each(|(to, w)| *to = *w);
            }
            Support::Touched { shape, friction } => {
                self.patches.find(field, &shape, tool, placed);
                let room = (&mut self.rows, &mut self.weights[..], &mut self.mean[..]);
                let is_full = row::rows_of_patches(field, &mut self.patches, friction, placed, room);
                self.is_unconverged |= is_full || self.patches.is_full;
            }
        }
        self.respond(field);
    }

    /// How often rows were asked in this tick.
    pub(crate) fn row_updates(&self) -> usize {
        MAX_ROW_UPDATES - self.row_updates_left
    }

    /// Whether impulses of this tick were not found as well as they should be.
    pub(crate) fn is_unconverged(&self) -> bool {
        self.is_unconverged
    }

    /// Makes the velocities `z_dot` those with which the tool, moving so in a step of length `h`, is held or not entered.
    /// Where a gap was overdue, the velocities with which positions close it are others, and returned; and where the tool
    /// is then.
    pub(crate) fn resolve(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z: &[f64],
        z_dot: &mut [f64],
    ) -> (Option<&[f64]>, DVec3) {
        let (was_overdue, drawn) = self.solve_active_set(field, tool, h, z, z_dot);
        self.rows.iter_mut().for_each(|row| row.note(h));
        let rows = &self.rows;
        self.patches.note(|patch, index| {
            rows.iter()
                .find(|row| row.of == Some((patch, index)))
                .map_or((0.0, DVec3::ZERO), ContactRow::force_n)
        });
        let closing = self.correction_velocity.get(..z_dot.len()).filter(|_| was_overdue);
        (closing, tool.to_m + drawn)
    }

    /// As [`Meeting::meet`]; whether a gap was overdue, and how far the tool is drawn by its coupling, m.
    fn solve_active_set(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z: &[f64],
        z_dot: &mut [f64],
    ) -> (bool, DVec3) {
        let mut drawn = tool.short_m();
        let s = field.nodes;
        let is_held = field.support == Support::Held;
        for (index, row) in self.rows.iter_mut().enumerate() {
            let weights = row::weights_of(&self.weights, s, index);
            if is_held {
                row.aim_held(field, weights, tool, h, z);
            } else {
                row.aim(weights, tool, h, z);
            }
        }
        let (Some(before), false) = (self.before.get_mut(..z_dot.len()), self.rows.is_empty()) else {
            return (false, drawn);
        };
        before.copy_from_slice(z_dot);
        self.active.clear();
        let mut was_overdue = false;
        for _ in 0..MAX_ACTIVE_SET_PASSES {
            let known = self.active.len();
            for (index, row) in self.rows.iter_mut().enumerate() {
                let weights = row::weights_of(&self.weights, s, index);
                let gap = row.gap_m + (h * row::of_nodes(weights, z_dot) - drawn).dot(row.inward);
                if !row.is_active && (is_held || gap < 0.0) {
                    row.is_active = true;
                    self.active.push(index);
                }
            }
            if self.active.len() == known {
                break;
            }
            was_overdue =
                self.rows.iter().any(|row| row.is_active && row.initial_violation.length() > GAP_TOLERANCE_M);
            if was_overdue {
                drawn = self.solve_impulses(field, tool, h, z_dot, |row| row.gap);
                if let Some(closing) = self.correction_velocity.get_mut(..z_dot.len()) {
                    closing.copy_from_slice(z_dot);
                }
                self.solve_impulses(field, tool, h, z_dot, |row| row.gap - row.initial_violation);
            } else {
                drawn = self.solve_impulses(field, tool, h, z_dot, |row| row.gap);
            }
        }
        (was_overdue, drawn)
    }

    /// Makes `z_dot` the velocities with which the rows that are met close their gaps as their laws say, and returns how far
    /// the tool's coupling draws it, m.
    fn solve_impulses(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z_dot: &mut [f64],
        gap: impl Fn(&ContactRow) -> DVec3,
    ) -> DVec3 {
        z_dot.iter_mut().zip(&self.before).for_each(|(to, from)| *to = *from);
        let s = 3 * field.nodes;
        let (Some(velocity), Some(given), Some(of_support)) =
            (self.velocity.get_mut(..s), self.given.get_mut(..s), z_dot.get_mut(..s))
        else {
            return tool.short_m();
        };
        velocity.copy_from_slice(of_support);
        given.fill(0.0);
        let mut answer = SupportResponse {
            met: &self.active,
            weights: &self.weights,
            response: &self.response,
            field,
            velocity,
            given,
        };
        self.problem.clear();
        for (index, row) in self.active.iter().enumerate() {
            let Some(row) = self.rows.get(*row) else { continue };
            // From nothing, as the body does: where rows share a load in more than one way, that decides how.
            let (own_per_kg, impulse_ns) = (answer.own_per_kg(index), DVec3::ZERO);
            self.problem.push(palpate_laws::ConstraintRow {
                law: row.law,
                gap_m: gap(row),
                inv_effective_mass_per_kg: own_per_kg,
                impulse_ns,
            });
        }
        let met = self.active.len();
        let sweeps = EFFORT.max_iterations.min(self.row_updates_left / met.max(1)).max(1);
        let effort = SolverLimits { max_iterations: sweeps, ..EFFORT };
        let (sweeps, drawn) = match tool.proxy {
            Some(proxy) => solve_with_proxy(&mut self.problem, &mut answer, |_| true, proxy, h, effort),
            None => (solve_projected_gauss_seidel(&mut self.problem, &mut answer, h, effort), DVec3::ZERO),
        };
        self.row_updates_left = self.row_updates_left.saturating_sub(sweeps.iterations * met);
        self.is_unconverged |= !sweeps.converged;
        for (index, row) in self.active.iter().zip(&self.problem) {
            if let Some(to) = self.rows.get_mut(*index) {
                to.impulse_ns = row.impulse_ns;
            }
        }
        match field.integrator {
            TickIntegrator::Explicit { .. } => of_support.copy_from_slice(velocity),
            TickIntegrator::Implicit { .. } => {
                let n = z_dot.len();
                for (column, impulse) in field.impulse_response.chunks_exact(n.max(1)).zip(&*given) {
                    if *impulse != 0.0 {
                        z_dot.iter_mut().zip(column).for_each(|(v, c)| *v += impulse * c);
                    }
                }
            }
        }
        drawn
    }

    /// Computes what unit impulses on the rows of the tick do to S, where that is not its masses' affair alone.
    fn respond(&mut self, field: &NearField) {
        if !field.integrator.is_implicit() {
            return;
        }
        let (s, n) = (3 * field.nodes, field.unknowns());
        let rows =
            self.weights.chunks_exact(field.nodes.max(1)).zip(self.response.chunks_exact_mut((3 * s).max(1)));
        for (weights, response) in rows.take(self.rows.len()) {
            response.fill(0.0);
            for (axis, to) in response.chunks_exact_mut(s.max(1)).enumerate() {
                for (node, w) in weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                    let start = n * (3 * node + axis);
                    let column = field.impulse_response.get(start..start + s).unwrap_or_default();
                    to.iter_mut().zip(column).for_each(|(v, c)| *v += w * c);
                }
            }
        }
    }
}

/// What impulses on rows do to the velocities of S.
struct SupportResponse<'a> {
    met: &'a [usize],
    weights: &'a [f64],
    response: &'a [f64],
    field: &'a NearField,
    velocity: &'a mut [f64],
    given: &'a mut [f64],
}

impl SupportResponse<'_> {
    fn weights(&self, index: usize) -> &[f64] {
        let row = self.met.get(index).copied();
        row.map_or(&[], |row| row::weights_of(self.weights, self.field.nodes, row))
    }

    /// The velocities of S that a unit impulse along each axis on a row gives.
    fn response(&self, index: usize) -> &[f64] {
        let size = 9 * self.field.nodes;
        let row = self.met.get(index).copied().unwrap_or(usize::MAX / (size + 1));
        self.response.get(row * size..(row + 1) * size).unwrap_or_default()
    }

    /// H A⁻¹ Hᵀ of a row with itself.
    fn own_per_kg(&self, index: usize) -> DMat3 {
        let weights = self.weights(index);
        if self.field.integrator.is_implicit() {
            let s = 3 * self.field.nodes;
            let mut columns = self.response(index).chunks_exact(s.max(1)).map(|v| row::of_nodes(weights, v));
            let mut next = || columns.next().unwrap_or_default();
            return DMat3::from_cols(next(), next(), next());
        }
        let per_kg: f64 = weights.iter().zip(&self.field.node_per_kg).map(|(w, per_kg)| w * w * per_kg).sum();
        DMat3::from_diagonal(DVec3::splat(per_kg))
    }
}

impl ImpulseResponse for SupportResponse<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        row::of_nodes(self.weights(row), self.velocity)
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        let nodes = self.field.nodes;
        let Some(at) = self.met.get(row).map(|row| row * nodes) else { return };
        let weights = self.weights.get(at..at + nodes).unwrap_or_default();
        let weighted = weights.iter().enumerate().filter(|(_, w)| **w != 0.0);
        match self.field.integrator {
            TickIntegrator::Explicit { .. } => {
                for ((node, w), per_kg) in
                    weighted.map(|(node, w)| ((node, w), self.field.node_per_kg.get(node)))
                {
                    let v = vec3_at(self.velocity, node) + *w * per_kg.copied().unwrap_or(0.0) * impulse_ns;
                    set_vec3(self.velocity, node, v);
                }
            }
            TickIntegrator::Implicit { .. } => {
                for (node, w) in weighted {
                    let all = vec3_at(self.given, node) + *w * impulse_ns;
                    set_vec3(self.given, node, all);
                }
                let (size, s) = (9 * nodes, 3 * nodes);
                let start = self.met.get(row).map_or(0, |row| row * size);
                let response = self.response.get(start..start + size).unwrap_or_default();
                for (column, part) in response.chunks_exact(s.max(1)).zip(impulse_ns.to_array()) {
                    self.velocity.iter_mut().zip(column).for_each(|(v, c)| *v += part * c);
                }
            }
        }
    }
}
