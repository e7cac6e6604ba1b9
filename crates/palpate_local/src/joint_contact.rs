//! The solution of the tool's constraints on all bodies in a substep, as in the body's step.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::dense::touched_capacity;
use crate::near_field_contact::{BodyContacts, ContactRow, MAX_ROWS, SupportResponse};
use crate::{MAX_BODIES, NearField};
use glam::{DMat3, DVec3};
use palpate_laws::{
    ConstraintRow, ImpulseResponse, SolverLimits, ToolMove, solve_projected_gauss_seidel, solve_with_proxy,
};

/// Maximum number of passes of the active-set method in a step.
const MAX_ACTIVE_SET_PASSES: usize = 4;
/// Limits of projected Gauss-Seidel in one pass.
const SOLVER_LIMITS: SolverLimits = SolverLimits { max_iterations: 60, tolerance: 1e-6 };
/// Upper bound of the row updates in a tick for each body, which bounds the duration of the tick.
const MAX_ROW_UPDATES: usize = 1000;

/// A body under the tool in a substep.
pub(crate) struct BodyInStep<'a> {
    pub(crate) field: &'a NearField,
    pub(crate) contacts: &'a mut BodyContacts,
    pub(crate) z: &'a [f64],
    /// ż of the step, without impulses at first.
    pub(crate) z_dot: &'a mut [f64],
}

/// The bodies under the tool; `None` for one that has no near field.
pub(crate) type Bodies<'a> = [Option<BodyInStep<'a>>; MAX_BODIES];

/// Solves for the impulses of the tool on all bodies. The proxy of the tool is the only thing that they share.
#[derive(Debug)]
pub(crate) struct JointContacts {
    /// The active rows of all bodies.
    problem: Vec<ConstraintRow>,
    /// Row updates left in this tick, and their number at its beginning.
    row_updates_left: usize,
    max_row_updates: usize,
    is_unconverged: bool,
}

impl Clone for JointContacts {
    /// Allocates the capacity of the original: a tick must not allocate.
    fn clone(&self) -> Self {
        Self::new()
    }
}

impl JointContacts {
    pub(crate) fn new() -> Self {
        let ContactRow { law, gap: gap_m, impulse_ns, .. } = ContactRow::default();
        let row = ConstraintRow { law, gap_m, inv_effective_mass_per_kg: DMat3::ZERO, impulse_ns };
        let problem = touched_capacity(MAX_BODIES * MAX_ROWS, row);
        Self { problem, row_updates_left: 0, max_row_updates: 0, is_unconverged: false }
    }

    /// Begins a tick with `bodies` bodies.
    pub(crate) fn begin_tick(&mut self, bodies: usize) {
        self.max_row_updates = bodies.saturating_mul(MAX_ROW_UPDATES);
        (self.row_updates_left, self.is_unconverged) = (self.max_row_updates, false);
    }

    /// Number of row updates in this tick.
    pub(crate) fn row_updates(&self) -> usize {
        self.max_row_updates.saturating_sub(self.row_updates_left)
    }

    /// Whether a solve of this tick did not converge.
    pub(crate) fn is_unconverged(&self) -> bool {
        self.is_unconverged
    }

    /// Solves the constraints of a step of length `h` in which the tool moves by `tool`, and changes the velocities of the bodies to
    /// satisfy them. The active-set method: activates every row whose gap closes, solves for the impulses of all active rows, and repeats
    /// until no further row is activated.
    ///
    /// Returns the tool's position at the end, m, behind its coupling, and whether a gap was violated before the step. In that case each
    /// body has kept the velocities by which the positions move ([`BodyContacts::correction`]); its ż keeps nothing of the correction.
    pub(crate) fn resolve(&mut self, bodies: &mut Bodies<'_>, tool: &ToolMove, h: f64) -> (bool, DVec3) {
        let mut proxy_m = tool.remaining_m();
        let mut has_rows = false;
        for BodyInStep { field, contacts, z, z_dot } in bodies.iter_mut().flatten() {
            contacts.begin_step(field, tool, h, z, z_dot);
            has_rows |= contacts.has_rows();
        }
        let mut is_corrected = false;
        for _ in 0..if has_rows { MAX_ACTIVE_SET_PASSES } else { 0 } {
            let mut is_new = false;
            for BodyInStep { field, contacts, z_dot, .. } in bodies.iter_mut().flatten() {
                is_new |= contacts.activate(field, h, z_dot, proxy_m);
            }
            if !is_new {
                break;
            }
            is_corrected = bodies.iter().flatten().any(|body| body.contacts.has_initial_violation());
            if is_corrected {
                proxy_m = self.solve(bodies, tool, h, |row| row.gap);
                let all = bodies.iter_mut().flatten();
                all.for_each(|body| body.contacts.keep_correction(body.z_dot));
                self.solve(bodies, tool, h, |row| row.gap - row.initial_violation);
            } else {
                proxy_m = self.solve(bodies, tool, h, |row| row.gap);
            }
        }
        bodies.iter_mut().flatten().for_each(|body| body.contacts.end_step(h));
        (is_corrected, tool.to_m + proxy_m)
    }

    /// Solves for the impulses of the active rows with the given gaps, and writes the resulting velocities. Returns the displacement of the
    /// tool by its coupling, m.
    fn solve(
        &mut self,
        bodies: &mut Bodies<'_>,
        tool: &ToolMove,
        h: f64,
        gap: impl Fn(&ContactRow) -> DVec3,
    ) -> DVec3 {
        self.problem.clear();
        let first_count =
            bodies.first().and_then(Option::as_ref).map_or(0, |body| body.contacts.active_count());
        let problem = &mut self.problem;
        let responses = bodies.each_mut().map(|body| {
            let BodyInStep { field, contacts, z_dot, .. } = body.as_mut()?;
            let (response, rows) = contacts.begin_solve(field, z_dot);
            for (index, row) in rows.enumerate() {
                problem.push(ConstraintRow {
                    law: row.law,
                    gap_m: gap(row),
                    inv_effective_mass_per_kg: response.inv_effective_mass_per_kg(index),
                    // Cold start, as in the body's step: redundant rows then share a load in the same way.
                    impulse_ns: DVec3::ZERO,
                });
            }
            Some(response)
        });
        let mut response = JointResponse { responses, first_count };
        let count = self.problem.len();
        let max_iterations = SOLVER_LIMITS.max_iterations.min(self.row_updates_left / count.max(1)).max(1);
        let limits = SolverLimits { max_iterations, ..SOLVER_LIMITS };
        let (report, proxy_m) = match tool.proxy {
            Some(proxy) => solve_with_proxy(&mut self.problem, &mut response, |_| true, proxy, h, limits),
            None => (solve_projected_gauss_seidel(&mut self.problem, &mut response, h, limits), DVec3::ZERO),
        };
        self.row_updates_left = self.row_updates_left.saturating_sub(report.iterations * count);
        self.is_unconverged |= !report.converged;
        let mut impulses = self.problem.iter().map(|row| row.impulse_ns);
        for BodyInStep { field, contacts, z_dot, .. } in bodies.iter_mut().flatten() {
            let own = contacts.active_count();
            contacts.end_solve(field, impulses.by_ref().take(own), z_dot);
        }
        proxy_m
    }
}

/// The Delassus operator of all bodies: block diagonal, because an impulse moves only the body of its row.
struct JointResponse<'a> {
    responses: [Option<SupportResponse<'a>>; MAX_BODIES],
    /// Number of rows of the first body; those of the second follow.
    first_count: usize,
}

impl JointResponse<'_> {
    /// Body of a row, and index of the row there.
    fn place(&self, row: usize) -> (usize, usize) {
        row.checked_sub(self.first_count).map_or((0, row), |row| (1, row))
    }
}

impl ImpulseResponse for JointResponse<'_> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        let (body, row) = self.place(row);
        let response = self.responses.get(body).and_then(Option::as_ref);
        response.map_or(DVec3::ZERO, |response| response.velocity_m_per_s(row))
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        let (body, row) = self.place(row);
        if let Some(response) = self.responses.get_mut(body).and_then(Option::as_mut) {
            response.apply_impulse(row, impulse_ns);
        }
    }
}
