//! The tool's constraints in a tick of the near field: a held point, or the contact patches, solved as in the body's step.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod candidate_triangles;
mod contact_patches;
mod contact_row;
mod displayed_force;
mod patch_rows;
mod placed_surface;
mod support_response;

pub(crate) use placed_surface::NodeMotion;

use crate::dense::{touched_capacity, zeros};
use crate::{NearField, NearFieldCapacity, Support, TickIntegrator};
use contact_patches::ContactPatches;
use contact_row::{ContactRow, row_weights, weighted_sum};
use displayed_force::DisplayedForce;
use glam::{DMat3, DVec3};
use palpate_laws::{
    ConstraintRow, GAP_TOLERANCE_M, MAX_PATCHES, PATCH_ROWS, SolverLimits, ToolMove,
    solve_projected_gauss_seidel, solve_with_proxy,
};
use support_response::SupportResponse;

/// Maximum number of rows of a tick.
const MAX_ROWS: usize = MAX_PATCHES * PATCH_ROWS;
/// Maximum number of passes of the active-set method in a step.
const MAX_ACTIVE_SET_PASSES: usize = 4;
/// Limits of projected Gauss-Seidel in one pass.
const SOLVER_LIMITS: SolverLimits = SolverLimits { max_iterations: 60, tolerance: 1e-6 };
/// Upper bound of the row updates in a tick, which bounds the duration of the tick.
const MAX_ROW_UPDATES: usize = 1000;

/// Detects the tool's contacts in a tick and solves for their impulses. All buffers are allocated at construction.
#[derive(Debug)]
pub(crate) struct ContactSolver {
    patches: ContactPatches,
    rows: Vec<ContactRow>,
    /// Weights of the rows over S, s numbers a row.
    weights: Vec<f64>,
    /// Weights of the mean of a patch over S.
    mean: Vec<f64>,
    /// Indices of the active rows of a step, and the problem that they form.
    active: Vec<usize>,
    problem: Vec<ConstraintRow>,
    /// For implicit ticks: the velocities of S that unit impulses on the rows cause, 3 × 3s numbers a row.
    responses: Vec<f64>,
    /// ż without contact impulses.
    free_velocity: Vec<f64>,
    /// ż that moves the positions where a gap was violated before the step.
    correction_velocity: Vec<f64>,
    /// Velocities of S, and the sum of the impulses on its nodes.
    support_velocity: Vec<f64>,
    impulses: Vec<f64>,
    /// Row updates left in this tick.
    row_updates_left: usize,
    is_unconverged: bool,
    displayed_force: DisplayedForce,
    capacity: NearFieldCapacity,
}

impl Clone for ContactSolver {
    /// Clones the patches, and allocates all buffers with the capacity of the original: a tick must not allocate.
    fn clone(&self) -> Self {
        let mut copy = Self::with_capacity(self.capacity);
        copy.patches.copy_from(&self.patches);
        copy
    }
}

impl ContactSolver {
    pub(crate) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        let (n, of_support) = (3 * capacity.nodes + capacity.order, 3 * capacity.nodes);
        let ContactRow { law, gap: gap_m, impulse_ns, .. } = ContactRow::default();
        let row = ConstraintRow { law, gap_m, inv_effective_mass_per_kg: DMat3::ZERO, impulse_ns };
        Self {
            patches: ContactPatches::with_capacity(capacity),
            rows: touched_capacity(MAX_ROWS, ContactRow::default()),
            weights: zeros((MAX_ROWS + PATCH_ROWS) * capacity.nodes),
            mean: zeros(capacity.nodes),
            active: touched_capacity(MAX_ROWS, 0),
            problem: touched_capacity(MAX_ROWS, row),
            responses: zeros(MAX_ROWS * 3 * of_support),
            free_velocity: zeros(n),
            correction_velocity: zeros(n),
            support_velocity: zeros(of_support),
            impulses: zeros(of_support),
            row_updates_left: MAX_ROW_UPDATES,
            is_unconverged: false,
            displayed_force: DisplayedForce::with_capacity(MAX_ROWS),
            capacity,
        }
    }

    /// Resets to the contacts of the model step of `field`.
    pub(crate) fn restart(&mut self, field: &NearField) {
        self.patches.restart(field);
        self.rows.clear();
        self.is_unconverged = false;
    }

    /// Begins a tick: detects the contacts of a tool that moves by `tool`, and writes their rows.
    pub(crate) fn begin_tick(&mut self, field: &NearField, tool: &ToolMove, motion: &NodeMotion<'_>) {
        (self.row_updates_left, self.is_unconverged) = (MAX_ROW_UPDATES, false);
        match field.support {
            Support::Driven => self.rows.clear(),
            Support::Held => {
                self.rows.clear();
                self.rows.push(ContactRow::default());
                self.weights.iter_mut().zip(&field.weight).take(field.nodes).for_each(|(to, w)| *to = *w);
            }
            Support::Touched { shape, friction } => {
                self.patches.detect(field, &shape, tool, motion);
                let buffers = (&mut self.rows, &mut self.weights[..], &mut self.mean[..]);
                let is_full =
                    patch_rows::write_patch_rows(field, &mut self.patches, friction, motion, buffers);
                self.is_unconverged |= is_full || self.patches.is_full;
            }
        }
        support_response::write_row_responses(field, &self.weights, self.rows.len(), &mut self.responses);
    }

    /// Number of row updates in this tick.
    pub(crate) fn row_updates(&self) -> usize {
        MAX_ROW_UPDATES - self.row_updates_left
    }

    /// Whether a solve of this tick did not converge, or contacts were dropped because a buffer is full.
    pub(crate) fn is_unconverged(&self) -> bool {
        self.is_unconverged
    }

    /// Solves the constraints of a step of length `h` in which the tool moves by `tool`, and changes `z_dot` to satisfy them.
    ///
    /// Returns the tool's position at the end, m, behind its coupling. Where a gap was violated before the step, it also returns the
    /// velocities by which the positions move, which correct the violation; `z_dot` keeps nothing of the correction.
    pub(crate) fn resolve(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z: &[f64],
        z_dot: &mut [f64],
    ) -> (Option<&[f64]>, DVec3) {
        let (is_corrected, proxy_displacement_m) = self.solve_active_set(field, tool, h, z, z_dot);
        self.rows.iter_mut().for_each(|row| row.store_force(h));
        let rows = &self.rows;
        self.patches.store_forces(|patch, index| {
            rows.iter()
                .find(|row| row.patch_row == Some((patch, index)))
                .map_or((0.0, DVec3::ZERO), |row| (row.normal_force_n, row.body_force_n))
        });
        let correction = self.correction_velocity.get(..z_dot.len()).filter(|_| is_corrected);
        (correction, tool.to_m + proxy_displacement_m)
    }

    /// The force on the hand after the last step of a tick, of length `h`, N: see [`DisplayedForce::compute`]. Only rows with an impulse
    /// contribute.
    pub(crate) fn displayed_n(
        &mut self,
        field: &NearField,
        internal_n: &[DVec3],
        friction: f64,
        h: f64,
    ) -> DVec3 {
        let Self { rows, weights, active, displayed_force, .. } = self;
        active.retain(|index| rows.get(*index).is_some_and(|row| row.impulse_ns != DVec3::ZERO));
        displayed_force.compute(field, (active, rows, weights), internal_n, friction, h)
    }

    /// The active-set method: activates every row whose gap closes, solves for the impulses of all active rows, and repeats until no
    /// further row is activated. Returns whether an initial violation was corrected, and the displacement of the tool by its coupling, m.
    fn solve_active_set(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z: &[f64],
        z_dot: &mut [f64],
    ) -> (bool, DVec3) {
        let mut proxy_m = tool.remaining_m();
        let s = field.nodes;
        let is_held = field.support == Support::Held;
        for (index, row) in self.rows.iter_mut().enumerate() {
            let weights = row_weights(&self.weights, s, index);
            if is_held {
                row.set_held_gap(field, weights, tool, h, z);
            } else {
                row.set_contact_gap(weights, tool, h, z);
            }
        }
        let (Some(free_velocity), false) = (self.free_velocity.get_mut(..z_dot.len()), self.rows.is_empty())
        else {
            return (false, proxy_m);
        };
        free_velocity.copy_from_slice(z_dot);
        self.active.clear();
        let mut is_corrected = false;
        for _ in 0..MAX_ACTIVE_SET_PASSES {
            let active_before = self.active.len();
            for (index, row) in self.rows.iter_mut().enumerate() {
                let weights = row_weights(&self.weights, s, index);
                let gap = row.gap_m + (h * weighted_sum(weights, z_dot) - proxy_m).dot(row.inward);
                if !row.is_active && (is_held || gap < 0.0) {
                    row.is_active = true;
                    self.active.push(index);
                }
            }
            if self.active.len() == active_before {
                break;
            }
            is_corrected =
                self.rows.iter().any(|row| row.is_active && row.initial_violation.length() > GAP_TOLERANCE_M);
            if is_corrected {
                proxy_m = self.solve_impulses(field, tool, h, z_dot, |row| row.gap);
                if let Some(correction) = self.correction_velocity.get_mut(..z_dot.len()) {
                    correction.copy_from_slice(z_dot);
                }
                self.solve_impulses(field, tool, h, z_dot, |row| row.gap - row.initial_violation);
            } else {
                proxy_m = self.solve_impulses(field, tool, h, z_dot, |row| row.gap);
            }
        }
        (is_corrected, proxy_m)
    }

    /// Solves for the impulses of the active rows with the given gaps, and writes the resulting velocities into `z_dot`. Returns the
    /// displacement of the tool by its coupling, m.
    fn solve_impulses(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z_dot: &mut [f64],
        gap: impl Fn(&ContactRow) -> DVec3,
    ) -> DVec3 {
        z_dot.iter_mut().zip(&self.free_velocity).for_each(|(to, from)| *to = *from);
        let s = 3 * field.nodes;
        let (Some(velocity), Some(impulses), Some(of_support)) =
            (self.support_velocity.get_mut(..s), self.impulses.get_mut(..s), z_dot.get_mut(..s))
        else {
            return tool.remaining_m();
        };
        velocity.copy_from_slice(of_support);
        impulses.fill(0.0);
        let mut response = SupportResponse {
            active: &self.active,
            weights: &self.weights,
            response: &self.responses,
            field,
            velocity,
            impulses,
        };
        self.problem.clear();
        for (index, row) in self.active.iter().enumerate() {
            let Some(row) = self.rows.get(*row) else { continue };
            self.problem.push(ConstraintRow {
                law: row.law,
                gap_m: gap(row),
                inv_effective_mass_per_kg: response.inv_effective_mass_per_kg(index),
                // Cold start, as in the body's step: redundant rows then share a load in the same way.
                impulse_ns: DVec3::ZERO,
            });
        }
        let count = self.active.len();
        let max_iterations = SOLVER_LIMITS.max_iterations.min(self.row_updates_left / count.max(1)).max(1);
        let limits = SolverLimits { max_iterations, ..SOLVER_LIMITS };
        let (report, proxy_m) = match tool.proxy {
            Some(proxy) => solve_with_proxy(&mut self.problem, &mut response, |_| true, proxy, h, limits),
            None => (solve_projected_gauss_seidel(&mut self.problem, &mut response, h, limits), DVec3::ZERO),
        };
        self.row_updates_left = self.row_updates_left.saturating_sub(report.iterations * count);
        self.is_unconverged |= !report.converged;
        for (index, row) in self.active.iter().zip(&self.problem) {
            if let Some(to) = self.rows.get_mut(*index) {
                to.impulse_ns = row.impulse_ns;
            }
        }
        match field.integrator {
            TickIntegrator::Explicit { .. } => of_support.copy_from_slice(velocity),
            TickIntegrator::Implicit { .. } => {
                let n = z_dot.len();
                for (column, impulse) in field.impulse_response.chunks_exact(n.max(1)).zip(&*impulses) {
                    if *impulse != 0.0 {
                        z_dot.iter_mut().zip(column).for_each(|(v, c)| *v += impulse * c);
                    }
                }
            }
        }
        proxy_m
    }
}
