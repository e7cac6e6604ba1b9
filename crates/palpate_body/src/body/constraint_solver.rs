//! Solution of the constraints of obstacles, ties and tools in a substep.

use super::constraint::{Constraint, ConstraintSource};
use super::substep::Substep;
use super::{Body, StepReport};
use crate::impulse_response::{DelassusMatrix, LumpedMassResponse};
use crate::integrator::Columns;
use crate::weights::Weights;
use crate::{BodyError, Integrator, NodeContact, ToolContact, TouchedPoint};
use glam::{DMat3, DVec3};
use palpate_laws::{
    ConstraintLaw, ConstraintRow, GAP_TOLERANCE_M, ImpulseResponse, MAX_CORRECTION_SPEED_M_PER_S, ProxyState,
    ProxyStep, SolverLimits, SolverReport, solve_projected_gauss_seidel, solve_with_proxies,
};

/// Maximum number of passes over the active set.
const MAX_ACTIVE_SET_PASSES: usize = 8;
/// Limits of the solver.
const SOLVER_LIMITS: SolverLimits = SolverLimits { max_iterations: 1000, tolerance: 1e-8 };

impl Body {
    /// Changes the velocities at the end of a step to satisfy the constraints of obstacles, ties and tools.
    ///
    /// If a gap existed before the step, returns separate velocities for the position update, which close that gap.
    pub(super) fn solve_constraints(
        &mut self,
        step: &mut Substep<'_>,
        report: &mut StepReport,
    ) -> Result<Option<Vec<DVec3>>, BodyError> {
        self.contacts.clear();
        let (h, mut closing) = (step.h, None);
        let before = self.v.clone();
        let mut rows = self.tie_rows(step);
        rows.extend(
            step.tools.iter().enumerate().filter_map(|(index, tool)| self.grip_row((index, tool), h)),
        );
        let touchable: Vec<Vec<Constraint>> = step
            .tools
            .iter()
            .enumerate()
            .map(|(index, tool)| self.tool_contact_rows((index, tool), h))
            .collect();
        let mut columns = Columns::default();
        let mut impulses = Vec::new();
        // Without rows a proxy is displaced freely.
        let mut drawn: Vec<DVec3> = step.tools.iter().map(|tool| tool.way.remaining_m()).collect();
        // A push out of one obstacle may lead into another: repeat until no constraint is added.
        for pass in 0..MAX_ACTIVE_SET_PASSES {
            let active_count = rows.len();
            self.activate_obstacle_contacts(step, &mut rows);
            for (index, touchable) in touchable.iter().enumerate() {
                self.activate_tool_contacts(touchable, (h, drawn[index]), &mut rows);
            }
            if rows.len() == active_count && (pass > 0 || rows.is_empty()) {
                break;
            }
            let overdue = rows.iter().any(|row| row.overdue.length() > GAP_TOLERANCE_M);
            if overdue {
                let whole: Vec<DVec3> = rows.iter().map(|row| row.gap).collect();
                (_, drawn) = self.solve_rows(step, &rows, &whole, &before, &mut columns, report)?;
                closing = Some(self.v.clone());
            } else {
                closing = None;
            }
            let due = |row: &Constraint| if overdue { row.gap - row.overdue } else { row.gap };
            let gaps: Vec<DVec3> = rows.iter().map(due).collect();
            let (found, went) = self.solve_rows(step, &rows, &gaps, &before, &mut columns, report)?;
            (impulses, drawn) = (found, if overdue { drawn } else { went });
        }
        for (tool, drawn) in step.tools.iter_mut().zip(&drawn).filter(|(tool, _)| tool.way.proxy.is_some()) {
            tool.way.to_m += *drawn;
            tool.contact.proxy_m = Some(tool.way.to_m);
        }
        let work = self.record_impulses(step, &rows, &impulses, (closing.as_deref(), &drawn), report);
        if let Some(mut ledger) = self.ledger.take() {
            ledger.add_contacts(self, step.drive.map(|(node, _)| node));
            for (nodes, impulse, moved) in work {
                ledger.add_tool(self, &nodes, impulse, moved / h);
            }
            self.ledger = Some(ledger);
        }
        Ok(closing)
    }

    /// Stores the result of every row. Positions move with the velocities `closing`, and `drawn` is the displacement
    /// of each tool by its coupling. Returns each tool row's nodes, impulse and the tool's displacement.
    fn record_impulses(
        &mut self,
        step: &mut Substep<'_>,
        rows: &[Constraint],
        impulses: &[DVec3],
        (closing, drawn): (Option<&[DVec3]>, &[DVec3]),
        report: &mut StepReport,
    ) -> Vec<(Weights, DVec3, DVec3)> {
        let (h, mut work) = (step.h, Vec::new());
        for tool in &mut step.tools {
            tool.contact.touched.clear();
            tool.contact.gripped = (DVec3::ZERO, h);
            let rows = tool.patches.iter_mut().flat_map(|patch| &mut patch.rows);
            rows.for_each(|row| (row.force_n, row.whole_n) = (0.0, DVec3::ZERO));
        }
        for (row, &impulse_ns) in rows.iter().zip(impulses) {
            let of = |v: &[DVec3]| -> DVec3 { row.nodes.iter().map(|&(node, w)| w * v[node]).sum() };
            let (velocity, closing) = (of(&self.v), of(closing.unwrap_or(&self.v)));
            match row.source {
                ConstraintSource::Tie(index) => self.ties[index].last = (impulse_ns, h),
                ConstraintSource::Grip(tool) => {
                    let tool = &mut step.tools[tool];
                    tool.contact.gripped = (impulse_ns, h);
                    work.push((row.nodes.clone(), impulse_ns, tool.way.to_m - tool.way.from_m));
                }
                _ if impulse_ns == DVec3::ZERO => {}
                ConstraintSource::Obstacle { node, obstacle, apart_m, normal } => {
                    self.contacts.push(NodeContact {
                        node,
                        obstacle,
                        normal,
                        gap_m: apart_m + h * closing.dot(normal),
                        impulse_ns,
                        velocity_m_per_s: velocity,
                        step_s: h,
                    });
                }
                ConstraintSource::Touch { tool, patch: (patch, index), apart_m, push, .. } => {
                    let drawn = drawn[tool];
                    let tool = &mut step.tools[tool];
                    let moved = tool.way.to_m - tool.way.from_m;
                    work.push((row.nodes.clone(), impulse_ns, moved));
                    let of = &mut tool.patches[patch];
                    let of_row = &mut of.rows[index];
                    of_row.force_n = (impulse_ns.dot(push) / h).max(0.0);
                    of_row.whole_n = impulse_ns / h;
                    tool.contact.touched.push(TouchedPoint {
                        patch: of.patch,
                        row: of_row.index,
                        rest_normal: of.rest_normal,
                        series: of_row.series,
                        corners: of.corners,
                        nodes: row.nodes.clone(),
                        normal: -push,
                        gap_m: apart_m + (h * closing - drawn).dot(push),
                        impulse_ns,
                        slip_m_per_s: velocity - moved / h,
                        step_s: h,
                    });
                }
            }
        }
        report.contacts = report.contacts.max(self.contacts.len());
        for tool in &mut step.tools {
            let ToolContact { touched, touched_nodes, .. } = &mut *tool.contact;
            report.touched = report.touched.max(touched.len());
            // Nodes under the tool; a contact's pressure reaches slightly further.
            let points = touched.iter().flat_map(|t| t.corners).filter(|(_, w)| *w > 0.0);
            let nodes = points.flat_map(|(point, _)| self.contact_surface.points()[point].nodes());
            for &(node, _) in nodes {
                if !touched_nodes.contains(&node) {
                    touched_nodes.push(node);
                }
            }
        }
        for tie in &mut self.ties {
            let force_n = tie.force_n().length();
            if tie.tear_limit_n.is_some_and(|limit| !tie.is_torn() && force_n > limit) {
                tie.torn_at_n = Some(force_n);
                report.torn += 1;
            }
        }
        work
    }

    /// Adds a row for every node that would be inside an obstacle at the end of the step.
    fn activate_obstacle_contacts(&self, step: &Substep<'_>, rows: &mut Vec<Constraint>) {
        let (h, active_count) = (step.h, rows.len());
        let driven = step.drive.map(|(node, _)| node);
        for &node in self.network.free().iter().filter(|&&node| driven != Some(node)) {
            for (obstacle, what) in self.obstacles.iter().enumerate() {
                let (gap_m, normal) = what.gap_m(self.x[node]);
                let enters = gap_m + h * self.v[node].dot(normal) < 0.0;
                let is_it = |row: &Constraint| row.source.is_contact(node, obstacle);
                if !enters || rows[..active_count].iter().any(is_it) {
                    continue;
                }
                let Some(law) = what.law(normal) else { continue };
                let (apart_m, gap_m) = (gap_m, gap_m.max(-h * MAX_CORRECTION_SPEED_M_PER_S));
                rows.push(Constraint {
                    source: ConstraintSource::Obstacle { node, obstacle, apart_m, normal },
                    nodes: vec![(node, 1.0)],
                    law: ConstraintLaw::Unilateral { coulomb: law, series: None },
                    gap: gap_m * normal,
                    overdue: gap_m.min(0.0) * normal,
                });
            }
        }
    }

    /// Solves the rows for the given gaps. Velocities start at `before` and end with all impulses applied. Returns
    /// the impulses, and the displacement of each tool by its coupling.
    fn solve_rows(
        &mut self,
        step: &Substep<'_>,
        constraints: &[Constraint],
        gaps: &[DVec3],
        before: &[DVec3],
        columns: &mut Columns,
        report: &mut StepReport,
    ) -> Result<(Vec<DVec3>, Vec<DVec3>), BodyError> {
        // Fixed and driven nodes do not respond to impulses.
        let driven = step.drive.map(|(node, _)| node);
        let movable =
            |(node, _): &(usize, f64)| self.network.free_index(*node).is_some() && driven != Some(*node);
        let nodes: Vec<Weights> =
            constraints.iter().map(|row| row.nodes.iter().copied().filter(movable).collect()).collect();
        let row_without_impulse = |(row, &gap_m): (&Constraint, &DVec3)| ConstraintRow {
            law: row.law,
            gap_m,
            inv_effective_mass_per_kg: DMat3::ZERO,
            impulse_ns: DVec3::ZERO,
        };
        let mut rows: Vec<ConstraintRow> = constraints.iter().zip(gaps).map(row_without_impulse).collect();
        self.v.copy_from_slice(before);
        let proxies: Vec<Option<ProxyStep>> = step.tools.iter().map(|tool| tool.way.proxy).collect();
        let (solver, drawn) = match (step.integrator, &self.implicit) {
            (Integrator::LinearlyImplicitEuler(settings), Some(implicit)) => {
                let touched = nodes.iter().flatten().map(|(node, _)| *node);
                implicit.add_columns(&self.network, touched, settings, columns)?;
                let mut response =
                    DelassusMatrix::new(&nodes, before, |i, j| columns.block(&self.network, i, j));
                rows.iter_mut().enumerate().for_each(|(i, row)| {
                    row.inv_effective_mass_per_kg = response.inv_effective_mass_per_kg(i);
                });
                let solved = solve_with_couplings(constraints, &mut rows, &mut response, &proxies, step.h);
                let pushes = nodes.iter().zip(&rows);
                for (node, impulse) in
                    pushes.flat_map(|(row, r)| row.iter().map(|&(node, w)| (node, w * r.impulse_ns)))
                {
                    columns.push(&self.network, node, impulse, &mut self.v);
                }
                solved
            }
            _ => {
                let mass_kg = self.network.mass_kg();
                let mut response = LumpedMassResponse { rows: &nodes, mass_kg, v: &mut self.v };
                rows.iter_mut().enumerate().for_each(|(i, row)| {
                    row.inv_effective_mass_per_kg = response.inv_effective_mass_per_kg(i);
                });
                solve_with_couplings(constraints, &mut rows, &mut response, &proxies, step.h)
            }
        };
        report.iterations = report.iterations.max(solver.iterations);
        report.unconverged += usize::from(!solver.converged);
        Ok((rows.into_iter().map(|row| row.impulse_ns).collect(), drawn))
    }
}

/// Solves the rows of `constraints`, with couplings if tools have any. Returns the displacement of each tool by its
/// coupling.
fn solve_with_couplings(
    constraints: &[Constraint],
    rows: &mut [ConstraintRow],
    response: &mut impl ImpulseResponse,
    proxies: &[Option<ProxyStep>],
    h: f64,
) -> (SolverReport, Vec<DVec3>) {
    let mut drawn = vec![DVec3::ZERO; proxies.len()];
    let behind: Vec<usize> = (0..proxies.len()).filter(|&tool| proxies[tool].is_some()).collect();
    let mut tools: Vec<ProxyState> = proxies.iter().flatten().map(|proxy| ProxyState::new(*proxy)).collect();
    if tools.is_empty() {
        return (solve_projected_gauss_seidel(rows, response, h, SOLVER_LIMITS), drawn);
    }
    let tool_of = |row: usize| {
        let tool = constraints[row].source.tool()?;
        behind.iter().position(|behind| *behind == tool)
    };
    let solved = solve_with_proxies(rows, response, &mut tools, tool_of, h, SOLVER_LIMITS);
    behind.iter().zip(&tools).for_each(|(&index, tool)| drawn[index] = tool.displacement_m(h));
    (solved, drawn)
}
