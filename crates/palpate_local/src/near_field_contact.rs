//! The tool's constraints on one body in a tick of its near field: a held point, or the contact patches.

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

pub(crate) use contact_row::ContactRow;
pub(crate) use placed_surface::NodeMotion;
pub(crate) use support_response::SupportResponse;

use crate::dense::{touched_capacity, zeros};
use crate::{NearField, NearFieldCapacity, Support, TickIntegrator};
use contact_patches::ContactPatches;
use contact_row::{row_weights, weighted_sum};
use displayed_force::DisplayedForce;
use glam::DVec3;
use palpate_laws::{GAP_TOLERANCE_M, MAX_PATCHES, PATCH_ROWS, ToolMove};

/// Maximum number of rows of a tick.
pub(crate) const MAX_ROWS: usize = MAX_PATCHES * PATCH_ROWS;

/// Detects the tool's contacts with one body in a tick, and holds their rows for the solver. All buffers are allocated at construction.
#[derive(Debug)]
pub(crate) struct BodyContacts {
    patches: ContactPatches,
    rows: Vec<ContactRow>,
    /// Weights of the rows over S, s numbers a row.
    weights: Vec<f64>,
    /// Weights of the mean of a patch over S.
    mean: Vec<f64>,
    /// Indices of the active rows of a step.
    active: Vec<usize>,
    /// For implicit ticks: the velocities of S that unit impulses on the rows cause, 3 × 3s numbers a row.
    responses: Vec<f64>,
    /// ż without contact impulses.
    free_velocity: Vec<f64>,
    /// ż that moves the positions where a gap was violated before the step.
    correction_velocity: Vec<f64>,
    /// Velocities of S, and the sum of the impulses on its nodes.
    support_velocity: Vec<f64>,
    impulses: Vec<f64>,
    /// Whether contacts of this tick were dropped because a buffer is full.
    is_full: bool,
    displayed_force: DisplayedForce,
    capacity: NearFieldCapacity,
}

impl Clone for BodyContacts {
    /// Clones the patches, and allocates all buffers with the capacity of the original: a tick must not allocate.
    fn clone(&self) -> Self {
        let mut copy = Self::with_capacity(self.capacity);
        copy.patches.copy_from(&self.patches);
        copy
    }
}

impl BodyContacts {
    pub(crate) fn with_capacity(capacity: NearFieldCapacity) -> Self {
        let (n, of_support) = (3 * capacity.nodes + capacity.order, 3 * capacity.nodes);
        Self {
            patches: ContactPatches::with_capacity(capacity),
            rows: touched_capacity(MAX_ROWS, ContactRow::default()),
            weights: zeros((MAX_ROWS + PATCH_ROWS) * capacity.nodes),
            mean: zeros(capacity.nodes),
            active: touched_capacity(MAX_ROWS, 0),
            responses: zeros(MAX_ROWS * 3 * of_support),
            free_velocity: zeros(n),
            correction_velocity: zeros(n),
            support_velocity: zeros(of_support),
            impulses: zeros(of_support),
            is_full: false,
            displayed_force: DisplayedForce::with_capacity(MAX_ROWS),
            capacity,
        }
    }

    /// Resets to the contacts of the model step of `field`.
    pub(crate) fn restart(&mut self, field: &NearField) {
        self.patches.restart(field);
        self.rows.clear();
        self.is_full = false;
    }

    /// Begins a tick: detects the contacts of a tool that moves by `tool`, and writes their rows.
    pub(crate) fn begin_tick(&mut self, field: &NearField, tool: &ToolMove, motion: &NodeMotion<'_>) {
        self.is_full = false;
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
                self.is_full = is_full || self.patches.is_full;
            }
        }
        support_response::write_row_responses(field, &self.weights, self.rows.len(), &mut self.responses);
    }

    /// Whether contacts of this tick were dropped because a buffer is full.
    pub(crate) fn is_full(&self) -> bool {
        self.is_full
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

    /// Whether the tick has rows.
    pub(crate) fn has_rows(&self) -> bool {
        !self.rows.is_empty()
    }

    /// Begins a step of length `h` in which the tool moves by `tool`: sets the gaps of all rows, and keeps `z_dot` as the velocities
    /// without impulses.
    pub(crate) fn begin_step(
        &mut self,
        field: &NearField,
        tool: &ToolMove,
        h: f64,
        z: &[f64],
        z_dot: &[f64],
    ) {
        for (index, row) in self.rows.iter_mut().enumerate() {
            let weights = row_weights(&self.weights, field.nodes, index);
            if field.support == Support::Held {
                row.set_held_gap(field, weights, tool, h, z);
            } else {
                row.set_contact_gap(weights, tool, h, z);
            }
        }
        self.free_velocity.iter_mut().zip(z_dot).for_each(|(to, from)| *to = *from);
        self.active.clear();
    }

    /// Activates every row whose gap closes with the velocities `z_dot`, and the tool displaced by `proxy_m`. Returns whether there was
    /// one.
    pub(crate) fn activate(&mut self, field: &NearField, h: f64, z_dot: &[f64], proxy_m: DVec3) -> bool {
        let (before, is_held) = (self.active.len(), field.support == Support::Held);
        for (index, row) in self.rows.iter_mut().enumerate() {
            let weights = row_weights(&self.weights, field.nodes, index);
            let gap = row.gap_m + (h * weighted_sum(weights, z_dot) - proxy_m).dot(row.inward);
            if !row.is_active && (is_held || gap < 0.0) {
                row.is_active = true;
                self.active.push(index);
            }
        }
        self.active.len() > before
    }

    /// Number of active rows.
    pub(crate) fn active_count(&self) -> usize {
        self.active.len()
    }

    /// Whether the gap of an active row was violated before the step.
    pub(crate) fn has_initial_violation(&self) -> bool {
        self.rows.iter().any(|row| row.is_active && row.initial_violation.length() > GAP_TOLERANCE_M)
    }

    /// Resets `z_dot` and the buffers of a solve to the velocities without impulses. Returns the active rows with their response.
    pub(crate) fn begin_solve<'a>(
        &'a mut self,
        field: &'a NearField,
        z_dot: &mut [f64],
    ) -> (SupportResponse<'a>, impl Iterator<Item = &'a ContactRow>) {
        let s = 3 * field.nodes;
        z_dot.iter_mut().zip(&self.free_velocity).for_each(|(to, from)| *to = *from);
        let velocity = self.support_velocity.get_mut(..s).unwrap_or_default();
        velocity.iter_mut().zip(&*z_dot).for_each(|(to, from)| *to = *from);
        let impulses = self.impulses.get_mut(..s).unwrap_or_default();
        impulses.fill(0.0);
        let rows = &self.rows;
        let response = SupportResponse {
            active: &self.active,
            weights: &self.weights,
            response: &self.responses,
            field,
            velocity,
            impulses,
        };
        (response, self.active.iter().filter_map(|row| rows.get(*row)))
    }

    /// Stores the impulses of the active rows after a solve, and writes the resulting velocities into `z_dot`.
    pub(crate) fn end_solve(
        &mut self,
        field: &NearField,
        impulses_ns: impl Iterator<Item = DVec3>,
        z_dot: &mut [f64],
    ) {
        for (index, impulse_ns) in self.active.iter().zip(impulses_ns) {
            if let Some(to) = self.rows.get_mut(*index) {
                to.impulse_ns = impulse_ns;
            }
        }
        let s = 3 * field.nodes;
        match field.integrator {
            TickIntegrator::Explicit { .. } => {
                z_dot.iter_mut().zip(&self.support_velocity).take(s).for_each(|(to, from)| *to = *from);
            }
            TickIntegrator::Implicit { .. } => {
                let n = z_dot.len();
                for (column, impulse) in
                    field.impulse_response.chunks_exact(n.max(1)).zip(&self.impulses).take(s)
                {
                    if *impulse != 0.0 {
                        z_dot.iter_mut().zip(column).for_each(|(v, c)| *v += impulse * c);
                    }
                }
            }
        }
    }

    /// Keeps `z_dot` as the velocities that move the positions, because a gap was violated before the step.
    pub(crate) fn keep_correction(&mut self, z_dot: &[f64]) {
        self.correction_velocity.iter_mut().zip(z_dot).for_each(|(to, from)| *to = *from);
    }

    /// The first `len` of the velocities that were last kept as a correction.
    pub(crate) fn correction(&self, len: usize) -> Option<&[f64]> {
        self.correction_velocity.get(..len)
    }

    /// Force of the tool on the body in the last step, N.
    pub(crate) fn applied_n(&self) -> DVec3 {
        self.rows.iter().map(|row| row.body_force_n).sum()
    }

    /// Ends a step of length `h`: stores the forces of the rows and of the patches.
    pub(crate) fn end_step(&mut self, h: f64) {
        self.rows.iter_mut().for_each(|row| row.store_force(h));
        let rows = &self.rows;
        self.patches.store_forces(|patch, index| {
            rows.iter()
                .find(|row| row.patch_row == Some((patch, index)))
                .map_or((0.0, DVec3::ZERO), |row| (row.normal_force_n, row.body_force_n))
        });
    }
}
