//! Solution of the constraints of obstacles, ties and tools in a substep, jointly for the bodies that share tools.

use super::constraint::{Constraint, ConstraintSource, is_prescribed};
use super::obstacle_rows::NearPoint;
use super::substep::Substep;
use super::{Body, StepReport};
use crate::contact_newton;
use crate::impulse_response::{BodyResponse, DelassusMatrix, JointResponse, LumpedMassResponse, ResponseRow};
use crate::integrator::Columns;
use crate::obstacle_step::RigidVelocity;
use crate::weights::Weights;
use crate::{BodyError, Integrator, ObstacleContact, ToolContact, TouchedPoint};
use glam::{DMat3, DVec3};
use palpate_laws::{
    ConstraintRow, GAP_TOLERANCE_M, ImpulseResponse, ProxyState, ProxyStep, SolverLimits, SolverReport,
    ToolMove, solve_projected_gauss_seidel, solve_with_proxies,
};

/// Maximum number of passes over the active set.
const MAX_ACTIVE_SET_PASSES: usize = 8;
/// Limits of the solver.
const SOLVER_LIMITS: SolverLimits = SolverLimits { max_iterations: 1000, tolerance: 1e-8 };
/// Number of iterations after each of which Newton's method improves the impulses of an implicit step, and the maximum number of
/// rows for it.
const EARLY_ITERATIONS: usize = 100;
const MAX_NEWTON_ROWS: usize = 300;

/// A body of a joint step, with its substep.
pub(super) struct SteppedBody<'m, 's> {
    /// Index of the body in the joint step.
    pub(super) index: usize,
    pub(super) body: &'m mut Body,
    pub(super) step: Substep<'s>,
    pub(super) report: &'m mut StepReport,
    /// Velocities that move the positions, if they differ from those at the end of the step.
    pub(super) closing: Option<Closing>,
}

impl SteppedBody<'_, '_> {
    /// Whether impulses act through the linear system of an implicit step.
    fn is_implicit(&self) -> bool {
        matches!(self.step.integrator, Integrator::LinearlyImplicitEuler(_)) && self.body.implicit.is_some()
    }
}

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

/// The constraint rows of one body in a substep, and their solution.
struct BodyRows<'r, 'm, 's> {
    of: &'r mut SteppedBody<'m, 's>,
    before: Unconstrained,
    near: Vec<NearPoint>,
    touchable: Vec<Vec<Constraint>>,
    rows: Vec<Constraint>,
    impulses: Vec<DVec3>,
    columns: Columns,
}

/// Changes the velocities of `bodies` at the end of a step to satisfy the constraints of obstacles, ties and tools. `tools` holds the
/// motion of every tool of the joint step.
///
/// If a gap existed before the step, it sets separate velocities for the position update, which close that gap. Returns the
/// displacement of each tool by its coupling, m.
///
/// # Errors
/// As [`Body::advance`], with the index of the body.
pub(super) fn solve_constraints(
    bodies: &mut [SteppedBody<'_, '_>],
    tools: &[ToolMove],
) -> Result<Vec<DVec3>, (usize, BodyError)> {
    let mut all = Vec::with_capacity(bodies.len());
    for of in bodies {
        if !of.step.constrained {
            continue;
        }
        let SteppedBody { body, step, .. } = &mut *of;
        body.contacts.clear();
        if step.tools.is_empty() && body.ties.is_empty() && !body.is_near_obstacle(step) {
            continue;
        }
        let before = Unconstrained { nodes: body.v.clone(), obstacles: rigid_velocities(step) };
        let mut rows = body.tie_rows(step);
        rows.extend(
            step.tools.iter().enumerate().filter_map(|(index, tool)| body.grip_row((index, tool), step)),
        );
        let touchable = step
            .tools
            .iter()
            .enumerate()
            .map(|(index, tool)| body.tool_contact_rows((index, tool), step))
            .collect();
        let (near, impulses, columns) = (Vec::new(), Vec::new(), Columns::default());
        all.push(BodyRows { of, before, near, touchable, rows, impulses, columns });
    }
    let row_count = |all: &[BodyRows<'_, '_, '_>]| -> usize { all.iter().map(|of| of.rows.len()).sum() };
    // Without rows a proxy is displaced freely.
    let mut displacements: Vec<DVec3> = tools.iter().map(ToolMove::remaining_m).collect();
    // A push out of one obstacle may lead into another: repeat until no constraint is added.
    for pass in 0..MAX_ACTIVE_SET_PASSES {
        let active_count = row_count(&all);
        for of in &mut all {
            of.activate(&displacements);
        }
        let count = row_count(&all);
        if count == active_count && (pass > 0 || count == 0) {
            break;
        }
        let is_violated = |row: &Constraint| row.initial_violation.length() > GAP_TOLERANCE_M;
        let is_any_violated = all.iter().any(|of| of.rows.iter().any(is_violated));
        if is_any_violated {
            displacements = solve_rows(&mut all, |row| row.gap, tools)?;
        }
        for of in &mut all {
            of.of.closing = is_any_violated
                .then(|| Closing { nodes: of.of.body.v.clone(), obstacles: rigid_velocities(&of.of.step) });
        }
        if is_any_violated {
            solve_rows(&mut all, |row| row.gap - row.initial_violation, tools)?;
        } else {
            displacements = solve_rows(&mut all, |row| row.gap, tools)?;
        }
    }
    for of in &mut all {
        of.store(&displacements);
    }
    Ok(displacements)
}

impl BodyRows<'_, '_, '_> {
    /// Adds the rows that would be violated at the end of the step, with the tools displaced by `displacements`.
    fn activate(&mut self, displacements: &[DVec3]) {
        let SteppedBody { body, step, .. } = &mut *self.of;
        body.activate_obstacle_contacts(step, &mut self.near, &mut self.rows);
        for (tool, touchable) in step.tools.iter().zip(&self.touchable) {
            body.activate_tool_contacts(touchable, (step, displacements[tool.index]), &mut self.rows);
        }
    }

    /// Stores the results of all rows. `displacements` is the displacement of each tool by its coupling.
    fn store(&mut self, displacements: &[DVec3]) {
        let SteppedBody { body, step, report, closing, .. } = &mut *self.of;
        let h = step.h;
        let displacements: Vec<DVec3> = step.tools.iter().map(|tool| displacements[tool.index]).collect();
        for (tool, displacement_m) in
            step.tools.iter_mut().zip(&displacements).filter(|(tool, _)| tool.way.proxy.is_some())
        {
            tool.way.to_m += *displacement_m;
        }
        let moving = closing.as_ref().map(|closing| closing.nodes.as_slice());
        if !(self.rows.is_empty() || body.obstacles.is_empty()) {
            body.candidates.step_m = body.max_approach_m(step, moving.unwrap_or(&body.v));
        }
        let closing_obstacles = closing.as_ref().map_or(&[][..], |closing| &closing.obstacles);
        let work = body.record_impulses(
            step,
            &self.rows,
            &self.impulses,
            (moving, closing_obstacles, &displacements),
            report,
        );
        if let Some(mut ledger) = body.ledger.take() {
            ledger.add_contacts(body, step.drive.map(|(node, _)| node));
            for (nodes, impulse, moved) in work {
                ledger.add_tool(body, &nodes, impulse, moved / h);
            }
            body.ledger = Some(ledger);
        }
    }
}

impl Body {
    /// Stores the result of every row. Nodes and obstacles move with the closing velocities, and `displacements` is the
    /// displacement of each tool by its coupling. Returns each tool row's nodes, impulse and the tool's displacement.
    fn record_impulses(
        &mut self,
        step: &mut Substep<'_>,
        rows: &[Constraint],
        impulses: &[DVec3],
        (closing, closing_obstacles, displacements): (Option<&[DVec3]>, &[Option<RigidVelocity>], &[DVec3]),
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
                    let response = row.rigid.map(|point| point.per_kg(&point, &step.obstacles));
                    self.contacts.push(ObstacleContact {
                        point,
                        obstacle,
                        normal,
                        gap_m: apart_m + h * (closing - rigid).dot(normal),
                        impulse_ns,
                        velocity_m_per_s: velocity,
                        slip_m_per_s: velocity - end_m_per_s,
                        step_s: h,
                        response_per_kg: response.unwrap_or(DMat3::ZERO),
                        carried_m_per_s,
                    });
                    self.reactions[obstacle].add(motion, at_m, -impulse_ns);
                }
                ConstraintSource::Touch { tool, patch: (patch, index), apart_m, push, .. } => {
                    let displacement_m = displacements[tool];
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
                        gap_m: apart_m + (h * closing - displacement_m).dot(push),
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
}

/// Solves the rows of all bodies for the gaps `gap`. Velocities start at those without impulses and end with all impulses applied.
/// Stores the impulses, and returns the displacement of each tool by its coupling.
///
/// Only couplings join the bodies: the motion of a tool without one is prescribed, and each body is then solved by itself.
fn solve_rows(
    bodies: &mut [BodyRows<'_, '_, '_>],
    gap: impl Fn(&Constraint) -> DVec3,
    tools: &[ToolMove],
) -> Result<Vec<DVec3>, (usize, BodyError)> {
    let h = bodies.first().map_or(0.0, |of| of.of.step.h);
    let mut of_nodes: Vec<Vec<ResponseRow>> = Vec::with_capacity(bodies.len());
    for of in &mut *bodies {
        let SteppedBody { index, body, step, .. } = &mut *of.of;
        let drive = step.drive;
        let responding = |(node, _): &(usize, f64)| !is_prescribed(&body.network, drive, *node);
        let rows: Vec<ResponseRow> = of
            .rows
            .iter()
            .map(|row| ResponseRow {
                nodes: row.nodes.iter().copied().filter(responding).collect(),
                rigid: row.rigid,
            })
            .collect();
        body.v.copy_from_slice(&of.before.nodes);
        set_rigid_velocities(step, &of.before.obstacles);
        if let (Integrator::LinearlyImplicitEuler(settings), Some(implicit)) =
            (step.integrator, &body.implicit)
        {
            let nodes = rows.iter().map(|row| &row.nodes[..]);
            implicit
                .add_columns(&body.network, nodes, settings, &mut of.columns)
                .map_err(|error| (*index, error))?;
        }
        of_nodes.push(rows);
    }
    let (mut constraints, mut problems, mut responses) = (Vec::new(), Vec::new(), Vec::new());
    for (of, of_nodes) in bodies.iter_mut().zip(&of_nodes) {
        let BodyRows { of, rows, columns, .. } = of;
        let is_implicit = of.is_implicit();
        let SteppedBody { body, step, .. } = &mut **of;
        let Body { network, v, .. } = &mut **body;
        let response = if is_implicit {
            let block = |nodes: &[(usize, f64)], row| columns.block(network, nodes, row);
            BodyResponse::Implicit(DelassusMatrix::new(of_nodes, v, &step.obstacles, block))
        } else {
            let (mass_kg, obstacles) = (network.mass_kg(), &mut step.obstacles[..]);
            BodyResponse::LumpedMasses(LumpedMassResponse { rows: of_nodes, mass_kg, v, obstacles })
        };
        let problem = |(index, row): (usize, &Constraint)| ConstraintRow {
            law: row.law,
            gap_m: gap(row),
            inv_effective_mass_per_kg: response.inv_effective_mass_per_kg(index),
            impulse_ns: DVec3::ZERO,
        };
        problems.push(rows.iter().enumerate().map(problem).collect::<Vec<_>>());
        let tool_of = |row: &Constraint| Some(step.tools[row.source.tool()?].index);
        constraints.push(rows.iter().map(tool_of).collect::<Vec<_>>());
        responses.push(response);
    }
    let proxies: Vec<Option<ProxyStep>> = tools.iter().map(|tool| tool.proxy).collect();
    let mut displacements = vec![DVec3::ZERO; tools.len()];
    let reports: Vec<SolverReport> = if proxies.iter().any(Option::is_some) {
        let mut response = JointResponse::new(responses, problems.iter().map(Vec::len));
        let mut rows = problems.concat();
        let tools: Vec<Option<usize>> = constraints.concat();
        let solved =
            solve_with_couplings(&mut rows, &mut response, (&tools, &proxies), h, &mut displacements);
        let mut rest = &rows[..];
        for problem in &mut problems {
            let (own, after) = rest.split_at(problem.len());
            problem.copy_from_slice(own);
            rest = after;
        }
        vec![solved; bodies.len()]
    } else {
        let solve = |(problem, response): (&mut Vec<ConstraintRow>, &mut BodyResponse<'_>)| match response {
            BodyResponse::Implicit(response) => solve_strongly_coupled(problem, response, h),
            response @ BodyResponse::LumpedMasses(_) => {
                solve_projected_gauss_seidel(problem, response, h, SOLVER_LIMITS)
            }
        };
        problems.iter_mut().zip(&mut responses).map(solve).collect()
    };
    for ((of, of_nodes), (problem, solver)) in
        bodies.iter_mut().zip(&of_nodes).zip(problems.into_iter().zip(reports))
    {
        let BodyRows { of, columns, impulses, .. } = of;
        let is_implicit = of.is_implicit();
        let SteppedBody { body, step, report, .. } = &mut **of;
        *impulses = problem.into_iter().map(|row| row.impulse_ns).collect();
        report.iterations = report.iterations.max(solver.iterations);
        report.unconverged += usize::from(!solver.converged);
        // The response of lumped masses has applied the impulses to the velocities.
        for (index, (row, impulse_ns)) in of_nodes.iter().zip(&*impulses).enumerate().filter(|_| is_implicit)
        {
            if *impulse_ns != DVec3::ZERO {
                columns.push(&body.network, index, *impulse_ns, &mut body.v);
            }
            if let Some(rigid) = &row.rigid {
                rigid.apply(&mut step.obstacles, -*impulse_ns);
            }
        }
    }
    Ok(displacements)
}

/// [`solve_projected_gauss_seidel`] for the strongly coupled rows of an implicit step: if Gauss-Seidel has not converged early,
/// Newton's method improves its start.
fn solve_strongly_coupled(rows: &mut [ConstraintRow], response: &mut DelassusMatrix, h: f64) -> SolverReport {
    if rows.len() > MAX_NEWTON_ROWS || !rows.iter().all(|row| contact_newton::applies(&row.law)) {
        return solve_projected_gauss_seidel(rows, response, h, SOLVER_LIMITS);
    }
    let early = SolverLimits { max_iterations: EARLY_ITERATIONS, ..SOLVER_LIMITS };
    let mut solved = solve_projected_gauss_seidel(rows, response, h, early);
    while !solved.converged && solved.iterations < SOLVER_LIMITS.max_iterations {
        contact_newton::improve(rows, response, h);
        let again = solve_projected_gauss_seidel(rows, response, h, early);
        solved = SolverReport { iterations: solved.iterations + again.iterations, ..again };
    }
    solved
}

/// Solves `rows` with the couplings of tools. `tool_of_row` holds the tool of every row, and `proxies` those behind couplings. Writes the
/// displacement of each of these by its coupling.
fn solve_with_couplings(
    rows: &mut [ConstraintRow],
    response: &mut impl ImpulseResponse,
    (tool_of_row, proxies): (&[Option<usize>], &[Option<ProxyStep>]),
    h: f64,
    displacements: &mut [DVec3],
) -> SolverReport {
    let behind: Vec<usize> = (0..proxies.len()).filter(|&tool| proxies[tool].is_some()).collect();
    let mut tools: Vec<ProxyState> = proxies.iter().flatten().map(|proxy| ProxyState::new(*proxy)).collect();
    let tool_of = |row: usize| {
        let tool = tool_of_row[row]?;
        behind.iter().position(|behind| *behind == tool)
    };
    let solved = solve_with_proxies(rows, response, &mut tools, tool_of, h, SOLVER_LIMITS);
    behind.iter().zip(&tools).for_each(|(&index, tool)| displacements[index] = tool.displacement_m(h));
    solved
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
