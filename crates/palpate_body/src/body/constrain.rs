//! Obstacles, ties and the tool in a step: the velocities that obey them.

mod touch;

use super::approach::ToolPatch;
use super::{Body, StepReport};
use crate::contact::{DelassusMatrix, LumpedMassResponse, Weights, add_weight};
use crate::integrator::Columns;
use crate::tie::{TieEnd, TieKind};
use crate::tool::Hold;
use crate::{BodyError, Integrator, NodeContact, ToolContact, TouchedPoint};
use glam::{DMat3, DVec3};
use palpate_laws::{
    ConstraintLaw, ConstraintRow, GAP_TOLERANCE_M, ImpulseResponse, MAX_CORRECTION_SPEED_M_PER_S, ProxyState,
    ProxyStep, SolverLimits, SolverReport, ToolMove, solve_projected_gauss_seidel, solve_with_proxies,
};

/// How often obstacles are looked for again after some were met.
const MAX_ACTIVE_SET_PASSES: usize = 8;
/// What is done for the impulses of all rows.
const EFFORT: SolverLimits = SolverLimits { max_iterations: 1000, tolerance: 1e-8 };

/// What is known of a step when its velocities are to be constrained.
pub(super) struct Step<'a> {
    /// Its length, s.
    pub(super) h: f64,
    /// The shares of the advance that are over before and after it.
    pub(super) along: (f64, f64),
    pub(super) integrator: &'a Integrator,
    /// The node that is driven, and how far it has been moved.
    pub(super) drive: Option<(usize, DVec3)>,
    pub(super) tools: Vec<ToolStep<'a>>,
}

/// A tool in a step.
pub(super) struct ToolStep<'a> {
    pub(super) contact: &'a mut ToolContact,
    /// From where to where it goes.
    pub(super) way: ToolMove,
    /// Velocity that a node which it drives takes over, m/s.
    pub(super) velocity_m_per_s: DVec3,
    /// The patches that it may touch.
    pub(super) patches: &'a mut [ToolPatch],
}

impl<'a> ToolStep<'a> {
    /// The step of a tool whose device goes from one place to another, with a velocity in the end.
    pub(super) fn new(
        contact: &'a mut ToolContact,
        (device_m, velocity_m_per_s): ((DVec3, DVec3), DVec3),
        patches: &'a mut [ToolPatch],
    ) -> Self {
        let radius_m = contact.shape().map(|(shape, _)| shape.radius_m());
        let way = ToolMove::new(contact.coupling, device_m, contact.proxy_m(device_m.0), radius_m);
        Self { contact, way, velocity_m_per_s, patches }
    }
}

impl Step<'_> {
    /// Whether a tool may push or pull.
    pub(super) fn constrains(&self) -> bool {
        self.tools.iter().any(|tool| match tool.contact.hold {
            Hold::Node { .. } => false,
            Hold::Point { .. } => true,
            Hold::Nothing { .. } => !tool.patches.is_empty(),
        })
    }
}

/// A row of nodes that has to obey, and where it comes from.
#[derive(Clone)]
struct Constraint {
    source: Source,
    nodes: Weights,
    law: ConstraintLaw,
    gap: DVec3,
    /// The part of the gap that was there before: positions close it, velocities keep nothing of that.
    overdue: DVec3,
}

#[derive(Clone, Copy, PartialEq)]
enum Source {
    /// The tie of this index.
    Tie(usize),
    /// The point that the tool of this index holds.
    Grip(usize),
    /// A node and an obstacle, and how far apart they are.
    Obstacle { node: usize, obstacle: usize, apart_m: f64, normal: DVec3 },
    /// The surface and the tool of this index: with which row of which of its patches, how far apart at the end of the step if the surface stood still, and that as far as
    /// it is to be closed in this step.
    Touch { tool: usize, patch: (usize, usize), apart_m: f64, gap_m: f64, push: DVec3 },
}

impl Source {
    /// The tool whose row it is.
    fn tool(self) -> Option<usize> {
        match self {
            Self::Grip(tool) | Self::Touch { tool, .. } => Some(tool),
            Self::Tie(_) | Self::Obstacle { .. } => None,
        }
    }
}

impl Body {
    /// Makes the velocities those that keep nodes out of obstacles and off the tool, and ties together, at the end of a
    /// step. Where a gap was overdue, the velocities with which positions close it are others, and returned.
    pub(super) fn constrain(
        &mut self,
        step: &mut Step<'_>,
        report: &mut StepReport,
    ) -> Result<Option<Vec<DVec3>>, BodyError> {
        self.contacts.clear();
        let (h, mut closing) = (step.h, None);
        let before = self.v.clone();
        let mut rows = self.tie_rows(step);
        rows.extend(
            step.tools.iter().enumerate().filter_map(|(index, tool)| self.grip_row((index, tool), h)),
        );
        let touchable: Vec<Vec<Constraint>> =
            step.tools.iter().enumerate().map(|(index, tool)| self.touchable((index, tool), h)).collect();
        let mut columns = Columns::default();
        let mut impulses = Vec::new();
        // Without rows a proxy goes as far as it is let.
        let mut drawn: Vec<DVec3> = step.tools.iter().map(|tool| tool.way.short_m()).collect();
        // A push out of one obstacle may lead into another: until no more are met.
        for meeting in 0..MAX_ACTIVE_SET_PASSES {
            let known = rows.len();
            self.meet(step, &mut rows);
            for (index, touchable) in touchable.iter().enumerate() {
                self.meet_tool(touchable, (h, drawn[index]), &mut rows);
            }
            if rows.len() == known && (meeting > 0 || rows.is_empty()) {
                break;
            }
            let overdue = rows.iter().any(|row| row.overdue.length() > GAP_TOLERANCE_M);
            if overdue {
                let whole: Vec<DVec3> = rows.iter().map(|row| row.gap).collect();
                (_, drawn) = self.solve(step, &rows, &whole, &before, &mut columns, report)?;
                closing = Some(self.v.clone());
            } else {
                closing = None;
            }
            let due = |row: &Constraint| if overdue { row.gap - row.overdue } else { row.gap };
            let gaps: Vec<DVec3> = rows.iter().map(due).collect();
            let (found, went) = self.solve(step, &rows, &gaps, &before, &mut columns, report)?;
            (impulses, drawn) = (found, if overdue { drawn } else { went });
        }
        for (tool, drawn) in step.tools.iter_mut().zip(&drawn).filter(|(tool, _)| tool.way.proxy.is_some()) {
            tool.way.to_m += *drawn;
            tool.contact.proxy_m = Some(tool.way.to_m);
        }
        let work = self.settle(step, &rows, &impulses, (closing.as_deref(), &drawn), report);
        if let Some(mut ledger) = self.ledger.take() {
            ledger.meet(self, step.drive.map(|(node, _)| node));
            for (nodes, impulse, moved) in work {
                ledger.handle(self, &nodes, impulse, moved / h);
            }
            self.ledger = Some(ledger);
        }
        Ok(closing)
    }

    /// Notes what every row did, where positions go with the velocities `closing` and the tool was `drawn` by its coupling.
    /// Returns what the tool did: where, its impulse, and how far it moved there.
    fn settle(
        &mut self,
        step: &mut Step<'_>,
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
                Source::Tie(index) => self.ties[index].last = (impulse_ns, h),
                Source::Grip(tool) => {
                    let tool = &mut step.tools[tool];
                    tool.contact.gripped = (impulse_ns, h);
                    work.push((row.nodes.clone(), impulse_ns, tool.way.to_m - tool.way.from_m));
                }
                _ if impulse_ns == DVec3::ZERO => {}
                Source::Obstacle { node, obstacle, apart_m, normal } => self.contacts.push(NodeContact {
                    node,
                    obstacle,
                    normal,
                    gap_m: apart_m + h * closing.dot(normal),
                    impulse_ns,
                    velocity_m_per_s: velocity,
                    step_s: h,
                }),
                Source::Touch { tool, patch: (patch, index), apart_m, push, .. } => {
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
            // The nodes under the tool: a contact's pressure reaches a little farther.
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

    /// Adds the nodes that would be inside an obstacle at the end of the step.
    fn meet(&self, step: &Step<'_>, rows: &mut Vec<Constraint>) {
        let (h, known) = (step.h, rows.len());
        let driven = step.drive.map(|(node, _)| node);
        for &node in self.network.free().iter().filter(|&&node| driven != Some(node)) {
            for (obstacle, what) in self.obstacles.iter().enumerate() {
                let (gap_m, normal) = what.gap_m(self.x[node]);
                let enters = gap_m + h * self.v[node].dot(normal) < 0.0;
                let is_it = |row: &Constraint| matches!(row.source, Source::Obstacle { node: n, obstacle: o, .. } if (n, o) == (node, obstacle));
                if !enters || rows[..known].iter().any(is_it) {
                    continue;
                }
                let Some(law) = what.law(normal) else { continue };
                let (apart_m, gap_m) = (gap_m, gap_m.max(-h * MAX_CORRECTION_SPEED_M_PER_S));
                rows.push(Constraint {
                    source: Source::Obstacle { node, obstacle, apart_m, normal },
                    nodes: vec![(node, 1.0)],
                    law: ConstraintLaw::Unilateral { coulomb: law, series: None },
                    gap: gap_m * normal,
                    overdue: gap_m.min(0.0) * normal,
                });
            }
        }
    }

    /// The rows of the ties that hold.
    fn tie_rows(&mut self, step: &Step<'_>) -> Vec<Constraint> {
        let (h, drive) = (step.h, step.drive);
        let mut rows = Vec::new();
        for (index, tie) in self.ties.iter_mut().enumerate() {
            tie.last = (DVec3::ZERO, h);
            if tie.is_torn() {
                continue;
            }
            let mut nodes = tie.a.nodes().to_vec();
            let at = tie.a.of(&self.x);
            // Where the other end is now, and how far it is moved by others than the body in this step.
            let (other, moved) = match &tie.b {
                TieEnd::Point(b) => {
                    b.nodes().iter().for_each(|&(node, w)| add_weight(&mut nodes, node, -w));
                    (b.of(&self.x), DVec3::ZERO)
                }
                TieEnd::Anchor { from_m, to_m } => {
                    let place = |share: f64| *from_m + (*to_m - *from_m) * share;
                    (place(step.along.0), place(step.along.1) - place(step.along.0))
                }
            };
            // A driven node is already where it is at the end of the step.
            let pulled = drive.map_or(DVec3::ZERO, |(driven, by)| {
                nodes.iter().filter(|(node, _)| *node == driven).map(|(_, w)| *w * by).sum()
            });
            let (apart, moved) = (at - other - pulled, moved - pulled);
            nodes.retain(|(node, _)| drive.is_none_or(|(driven, _)| driven != *node));
            let (law, gap, overdue) = match tie.kind {
                TieKind::Joint => {
                    let closing = apart.clamp_length_max(h * MAX_CORRECTION_SPEED_M_PER_S);
                    (ConstraintLaw::Bilateral, closing - moved, closing)
                }
                TieKind::Thread { length_m, stiffness_n_per_m } => {
                    // Along the line between its ends at the end of the step, as far as that is known.
                    let Some(along) = (apart - moved).try_normalize() else { continue };
                    let slack = length_m - (apart - moved).length();
                    match stiffness_n_per_m {
                        // What it is stretched by is no gap that was to be closed.
                        Some(k) => {
                            let law = ConstraintLaw::Tension { along, compliance_per_kg: 1.0 / (k * h * h) };
                            (law, -slack * along, DVec3::ZERO)
                        }
                        None => {
                            let law = ConstraintLaw::Tension { along, compliance_per_kg: 0.0 };
                            let slack = slack.max(-h * MAX_CORRECTION_SPEED_M_PER_S - moved.length());
                            let before =
                                (length_m - apart.length()).clamp(-h * MAX_CORRECTION_SPEED_M_PER_S, 0.0);
                            (law, -slack * along, -before * along)
                        }
                    }
                }
            };
            rows.push(Constraint { source: Source::Tie(index), nodes, law, gap, overdue });
        }
        rows
    }

    /// Makes the velocities, `before` without impulses, those with which every row closes its gap as its law says, and
    /// returns the impulses, and how far the tools' couplings have drawn them.
    fn solve(
        &mut self,
        step: &Step<'_>,
        constraints: &[Constraint],
        gaps: &[DVec3],
        before: &[DVec3],
        columns: &mut Columns,
        report: &mut StepReport,
    ) -> Result<(Vec<DVec3>, Vec<DVec3>), BodyError> {
        // What is fixed or driven answers to no impulse.
        let driven = step.drive.map(|(node, _)| node);
        let movable =
            |(node, _): &(usize, f64)| self.network.free_index(*node).is_some() && driven != Some(*node);
        let nodes: Vec<Weights> =
            constraints.iter().map(|row| row.nodes.iter().copied().filter(movable).collect()).collect();
        let asked = |(row, &gap_m): (&Constraint, &DVec3)| ConstraintRow {
            law: row.law,
            gap_m,
            inv_effective_mass_per_kg: DMat3::ZERO,
            impulse_ns: DVec3::ZERO,
        };
        let mut rows: Vec<ConstraintRow> = constraints.iter().zip(gaps).map(asked).collect();
        self.v.copy_from_slice(before);
        let proxies: Vec<Option<ProxyStep>> = step.tools.iter().map(|tool| tool.way.proxy).collect();
        let (sweeps, drawn) = match (step.integrator, &self.implicit) {
            (Integrator::LinearlyImplicitEuler(settings), Some(implicit)) => {
                let touched = nodes.iter().flatten().map(|(node, _)| *node);
                implicit.answer(&self.network, touched, settings, columns)?;
                let mut answer =
                    DelassusMatrix::new(&nodes, before, |i, j| columns.block(&self.network, i, j));
                rows.iter_mut()
                    .enumerate()
                    .for_each(|(i, row)| row.inv_effective_mass_per_kg = answer.own_per_kg(i));
                let solved = solve(constraints, &mut rows, &mut answer, &proxies, step.h);
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
                let mut answer = LumpedMassResponse { rows: &nodes, mass_kg, v: &mut self.v };
                rows.iter_mut()
                    .enumerate()
                    .for_each(|(i, row)| row.inv_effective_mass_per_kg = answer.own_per_kg(i));
                solve(constraints, &mut rows, &mut answer, &proxies, step.h)
            }
        };
        report.sweeps = report.sweeps.max(sweeps.iterations);
        report.unconverged += usize::from(!sweeps.converged);
        Ok((rows.into_iter().map(|row| row.impulse_ns).collect(), drawn))
    }
}

/// Solves the rows of `constraints`, and for how far the tools' couplings draw them.
fn solve(
    constraints: &[Constraint],
    rows: &mut [ConstraintRow],
    answer: &mut impl ImpulseResponse,
    proxies: &[Option<ProxyStep>],
    h: f64,
) -> (SolverReport, Vec<DVec3>) {
    let mut drawn = vec![DVec3::ZERO; proxies.len()];
    let behind: Vec<usize> = (0..proxies.len()).filter(|&tool| proxies[tool].is_some()).collect();
    let mut tools: Vec<ProxyState> = proxies.iter().flatten().map(|proxy| ProxyState::new(*proxy)).collect();
    if tools.is_empty() {
        return (solve_projected_gauss_seidel(rows, answer, h, EFFORT), drawn);
    }
    let tool_of = |row: usize| {
        let tool = constraints[row].source.tool()?;
        behind.iter().position(|behind| *behind == tool)
    };
    let sweeps = solve_with_proxies(rows, answer, &mut tools, tool_of, h, EFFORT);
    behind.iter().zip(&tools).for_each(|(&index, tool)| drawn[index] = tool.displacement_m(h));
    (sweeps, drawn)
}
