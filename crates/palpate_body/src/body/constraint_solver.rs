//! Solution of the constraints of obstacles, ties and tools in a substep.

use super::constraint::{Constraint, ConstraintSource, is_prescribed};
use super::substep::Substep;
use super::{Body, StepReport};
use crate::contact_newton;
use crate::impulse_response::{DelassusMatrix, LumpedMassResponse, ResponseRow};
use crate::integrator::Columns;
use crate::obstacle_step::RigidVelocity;
use crate::weights::Weights;
use crate::{BodyError, Integrator, ObstacleContact, ToolContact, TouchedPoint};
use glam::{DMat3, DVec3};
use palpate_laws::{
    ConstraintRow, GAP_TOLERANCE_M, ImpulseResponse, ProxyState, ProxyStep, SolverLimits, SolverReport,
    solve_projected_gauss_seidel, solve_with_proxies,
};

/// Maximum number of passes over the active set.
const MAX_ACTIVE_SET_PASSES: usize = 8;
/// Limits of the solver.
const SOLVER_LIMITS: SolverLimits = SolverLimits { max_iterations: 1000, tolerance: 1e-8 };
/// Number of iterations after each of which Newton's method improves the impulses of an implicit step, and the maximum number of
/// rows for it.
const EARLY_ITERATIONS: usize = 100;
const MAX_NEWTON_ROWS: usize = 300;

/// Velocities for the position update, which close gaps that existed before the step.
pub(super) struct Closing {
    pub(super) nodes: Vec<DVec3>,
    /// Of the rigid bodies among the obstacles.
    pub(super) obstacles: Vec<Option<RigidVelocity>>,
}

/// Velocities without impulses.
struct Unconstrained {
    nodes: Vec<DVec3>,
    obstacles: Vec<Option<RigidVelocity>>,
}

impl Body {
    /// Changes the velocities at the end of a step to satisfy the constraints of obstacles, ties and tools.
    ///
    /// If a gap existed before the step, returns separate velocities for the position update, which close that gap.
    pub(super) fn solve_constraints(
        &mut self,
        step: &mut Substep<'_>,
        report: &mut StepReport,
    ) -> Result<Option<Closing>, BodyError> {
        self.contacts.clear();
        if step.tools.is_empty() && self.ties.is_empty() && !self.is_near_obstacle(step) {
            return Ok(None);
        }
        let (h, mut closing) = (step.h, None);
        let before = Unconstrained { nodes: self.v.clone(), obstacles: rigid_velocities(step) };
        let mut near = Vec::new();
        let mut rows = self.tie_rows(step);
        rows.extend(
            step.tools.iter().enumerate().filter_map(|(index, tool)| self.grip_row((index, tool), step)),
        );
        let touchable: Vec<Vec<Constraint>> = step
            .tools
            .iter()
            .enumerate()
            .map(|(index, tool)| self.tool_contact_rows((index, tool), step))
            .collect();
        let mut columns = Columns::default();
        let mut impulses = Vec::new();
        // Without rows a proxy is displaced freely.
        let mut drawn: Vec<DVec3> = step.tools.iter().map(|tool| tool.way.remaining_m()).collect();
        // A push out of one obstacle may lead into another: repeat until no constraint is added.
        for pass in 0..MAX_ACTIVE_SET_PASSES {
            let active_count = rows.len();
            self.activate_obstacle_contacts(step, &mut near, &mut rows);
            for (index, touchable) in touchable.iter().enumerate() {
                self.activate_tool_contacts(touchable, (step, drawn[index]), &mut rows);
            }
            if rows.len() == active_count && (pass > 0 || rows.is_empty()) {
                break;
            }
            let overdue = rows.iter().any(|row| row.overdue.length() > GAP_TOLERANCE_M);
            if overdue {
                let whole: Vec<DVec3> = rows.iter().map(|row| row.gap).collect();
                (_, drawn) = self.solve_rows(step, &rows, &whole, &before, &mut columns, report)?;
                closing = Some(Closing { nodes: self.v.clone(), obstacles: rigid_velocities(step) });
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
        let moving = closing.as_ref().map(|closing| closing.nodes.as_slice());
        if !(rows.is_empty() || self.obstacles.is_empty()) {
            self.candidates.step_m = self.max_approach_m(step, moving.unwrap_or(&self.v));
        }
        let closing_obstacles = closing.as_ref().map_or(&[][..], |closing| &closing.obstacles);
        let work = self.record_impulses(step, &rows, &impulses, (moving, closing_obstacles, &drawn), report);
        if let Some(mut ledger) = self.ledger.take() {
            ledger.add_contacts(self, step.drive.map(|(node, _)| node));
            for (nodes, impulse, moved) in work {
                ledger.add_tool(self, &nodes, impulse, moved / h);
            }
            self.ledger = Some(ledger);
        }
        Ok(closing)
    }

    /// Stores the result of every row. Nodes and obstacles move with the closing velocities, and `drawn` is the
    /// displacement of each tool by its coupling. Returns each tool row's nodes, impulse and the tool's displacement.
    fn record_impulses(
        &mut self,
        step: &mut Substep<'_>,
        rows: &[Constraint],
        impulses: &[DVec3],
        (closing, closing_obstacles, drawn): (Option<&[DVec3]>, &[Option<RigidVelocity>], &[DVec3]),
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
            let responding =
                row.nodes.iter().filter(|(node, _)| !is_prescribed(&self.network, step.drive, *node));
            let closing = closing.unwrap_or(&self.v);
            let (velocity, closing): (_, DVec3) =
                (of(&self.v), responding.map(|&(node, w)| w * closing[node]).sum());
            match row.source {
                ConstraintSource::Tie(index) => self.ties[index].last = (impulse_ns, h),
                ConstraintSource::Grip(tool) => {
                    let tool = &mut step.tools[tool];
                    tool.contact.gripped = (impulse_ns, h);
                    work.push((row.nodes.clone(), impulse_ns, tool.way.to_m - tool.way.from_m));
                }
                _ if impulse_ns == DVec3::ZERO => {}
                ConstraintSource::Obstacle { point, obstacle, apart_m, normal, at_m } => {
                    let motion = &step.obstacles[obstacle];
                    let (carried_m_per_s, end_m_per_s) = motion.velocities_m_per_s(at_m, h);
                    let rigid = match (row.rigid, closing_obstacles.get(obstacle)) {
                        (Some(rigid), Some(Some(velocity))) => velocity.at(rigid.arm_m),
                        (Some(_), _) => end_m_per_s,
                        (None, _) => DVec3::ZERO,
                    };
                    self.contacts.push(ObstacleContact {
                        point,
                        obstacle,
                        normal,
                        gap_m: apart_m + h * (closing - rigid).dot(normal),
                        impulse_ns,
                        velocity_m_per_s: velocity,
                        slip_m_per_s: velocity - end_m_per_s,
                        step_s: h,
                        carried_m_per_s,
                    });
                    self.reactions[obstacle].add(motion, at_m, -impulse_ns);
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

    /// Solves the rows for the given gaps. Velocities start at `before` and end with all impulses applied. Returns
    /// the impulses, and the displacement of each tool by its coupling.
    fn solve_rows(
        &mut self,
        step: &mut Substep<'_>,
        constraints: &[Constraint],
        gaps: &[DVec3],
        before: &Unconstrained,
        columns: &mut Columns,
        report: &mut StepReport,
    ) -> Result<(Vec<DVec3>, Vec<DVec3>), BodyError> {
        let drive = step.drive;
        let responding = |(node, _): &(usize, f64)| !is_prescribed(&self.network, drive, *node);
        let of_nodes: Vec<ResponseRow> = constraints
            .iter()
            .map(|row| ResponseRow {
                nodes: row.nodes.iter().copied().filter(responding).collect(),
                rigid: row.rigid,
            })
            .collect();
        let row_without_impulse = |(row, &gap_m): (&Constraint, &DVec3)| ConstraintRow {
            law: row.law,
            gap_m,
            inv_effective_mass_per_kg: DMat3::ZERO,
            impulse_ns: DVec3::ZERO,
        };
        let mut rows: Vec<ConstraintRow> = constraints.iter().zip(gaps).map(row_without_impulse).collect();
        self.v.copy_from_slice(&before.nodes);
        set_rigid_velocities(step, &before.obstacles);
        let proxies: Vec<Option<ProxyStep>> = step.tools.iter().map(|tool| tool.way.proxy).collect();
        let (solver, drawn) = match (step.integrator, &self.implicit) {
            (Integrator::LinearlyImplicitEuler(settings), Some(implicit)) => {
                let touched = of_nodes.iter().flat_map(|row| &row.nodes).map(|(node, _)| *node);
                implicit.add_columns(&self.network, touched, settings, columns)?;
                let mut response = DelassusMatrix::new(&of_nodes, &before.nodes, &step.obstacles, |i, j| {
                    columns.block(&self.network, i, j)
                });
                rows.iter_mut().enumerate().for_each(|(i, row)| {
                    row.inv_effective_mass_per_kg = response.inv_effective_mass_per_kg(i);
                });
                let solved = solve_strongly_coupled(constraints, &mut rows, &mut response, &proxies, step.h);
                for (row, ConstraintRow { impulse_ns, .. }) in of_nodes.iter().zip(&rows) {
                    for &(node, w) in &row.nodes {
                        columns.push(&self.network, node, w * *impulse_ns, &mut self.v);
                    }
                    if let Some(rigid) = &row.rigid {
                        rigid.apply(&mut step.obstacles, -*impulse_ns);
                    }
                }
                solved
            }
            _ => {
                let mass_kg = self.network.mass_kg();
                let obstacles = &mut step.obstacles;
                let mut response = LumpedMassResponse { rows: &of_nodes, mass_kg, v: &mut self.v, obstacles };
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

/// [`solve_with_couplings`] for the strongly coupled rows of an implicit step: if Gauss-Seidel has not converged early,
/// Newton's method improves its start.
fn solve_strongly_coupled(
    constraints: &[Constraint],
    rows: &mut [ConstraintRow],
    response: &mut DelassusMatrix,
    proxies: &[Option<ProxyStep>],
    h: f64,
) -> (SolverReport, Vec<DVec3>) {
    let has_coupling = proxies.iter().any(Option::is_some);
    if has_coupling
        || rows.len() > MAX_NEWTON_ROWS
        || !rows.iter().all(|row| contact_newton::applies(&row.law))
    {
        return solve_with_couplings(constraints, rows, response, proxies, h);
    }
    let early = SolverLimits { max_iterations: EARLY_ITERATIONS, ..SOLVER_LIMITS };
    let mut solved = solve_projected_gauss_seidel(rows, response, h, early);
    while !solved.converged && solved.iterations < SOLVER_LIMITS.max_iterations {
        contact_newton::improve(rows, response, h);
        let again = solve_projected_gauss_seidel(rows, response, h, early);
        solved = SolverReport { iterations: solved.iterations + again.iterations, ..again };
    }
    (solved, vec![DVec3::ZERO; proxies.len()])
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

fn rigid_velocities(step: &Substep<'_>) -> Vec<Option<RigidVelocity>> {
    step.obstacles.iter().map(|of| of.rigid.as_ref().map(|rigid| rigid.velocity)).collect()
}

fn set_rigid_velocities(step: &mut Substep<'_>, velocities: &[Option<RigidVelocity>]) {
    for (of, velocity) in step.obstacles.iter_mut().zip(velocities) {
        if let (Some(rigid), Some(velocity)) = (&mut of.rigid, velocity) {
            rigid.velocity = *velocity;
        }
    }
}
