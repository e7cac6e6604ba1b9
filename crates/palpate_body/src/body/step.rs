//! Time stepping of a body.

use super::StepReport;
use super::obstacles::check_finite;
use super::substep::{Substep, ToolStep};
use super::tool_patches::ToolPatches;
use super::{Body, MAX_QUIET_CHECK_S, QUIET_M_PER_S, spring_forces};
use crate::energy::EnergyLedger;
use crate::integrator::{LinearlyImplicitEuler, SolvedBy, Workspace};
use crate::obstacle_step::ObstacleStep;
use crate::tool::{Hold, TouchedPoint};
use crate::{BodyError, Integrator, Tie, ToolContact, ToolPoint};
use glam::DVec3;
use std::sync::Arc;

/// A tool and its path during an advance.
#[derive(Debug)]
pub struct ToolRun<'a> {
    /// Contact of the tool with the body.
    pub contact: &'a mut ToolContact,
    /// `path[0]` is the tool's point at the end of the previous step, `path[i]` at the end of tick i.
    pub path: &'a [ToolPoint],
}

/// Ticks between two estimates of the stable step of a body of linear springs.
const STABILITY_CHECK_TICKS: usize = 10;

impl Body {
    /// Advances by `ticks` ticks while the tool follows its path. `path[0]` is its point at the end of the previous
    /// step, `path[i]` at the end of tick i. Between two points its position is linear, and its velocity is that of
    /// the later point.
    ///
    /// # Errors
    /// [`BodyError::PathLength`] and [`BodyError::Path`] for a path of the wrong length or with values that are not
    /// finite; [`BodyError::InvalidNode`] for a contact with another body; [`BodyError::Parameter`],
    /// [`BodyError::Substeps`], [`BodyError::TooLarge`], [`BodyError::NotConverged`] and [`BodyError::Indefinite`] if
    /// the integrator cannot take the step; [`BodyError::Diverged`] if a value is no longer finite. Body and tool are
    /// then unchanged.
    pub fn advance(
        &mut self,
        tool: Option<(&mut ToolContact, &[ToolPoint])>,
        ticks: usize,
        integrator: impl Into<Integrator>,
    ) -> Result<StepReport, BodyError> {
        self.advance_observed(tool, ticks, integrator, |_, _| ())
    }

    /// [`Body::advance`] with an observer. `observe` gets the number of each tick (from 1) and the force that the
    /// body then displays to the tool, N. If a step spans several ticks, it is called after the last of them.
    ///
    /// # Errors
    /// As [`Body::advance`].
    pub fn advance_observed(
        &mut self,
        tool: Option<(&mut ToolContact, &[ToolPoint])>,
        ticks: usize,
        integrator: impl Into<Integrator>,
        mut observe: impl FnMut(usize, DVec3),
    ) -> Result<StepReport, BodyError> {
        let has_tool = tool.is_some();
        let mut tools: Vec<ToolRun<'_>> =
            tool.into_iter().map(|(contact, path)| ToolRun { contact, path }).collect();
        let mut on_tick = |tick: usize, forces: &[DVec3]| match forces {
            [force] if has_tool => observe(tick, *force),
            _ => observe(tick, DVec3::ZERO),
        };
        self.advance_tools(&mut tools, ticks, integrator, &mut on_tick)
    }

    /// [`Body::advance_observed`] with several tools, of which at most one may drive a node. `observe` gets the
    /// displayed forces of all tools in their order.
    ///
    /// # Errors
    /// As [`Body::advance`]; [`BodyError::InvalidNode`] also if two tools drive nodes.
    pub fn advance_tools(
        &mut self,
        tools: &mut [ToolRun<'_>],
        ticks: usize,
        integrator: impl Into<Integrator>,
        mut observe: impl FnMut(usize, &[DVec3]),
    ) -> Result<StepReport, BodyError> {
        let integrator = integrator.into();
        let mut driven = None;
        for ToolRun { contact, path } in &*tools {
            contact.validate(self)?;
            if let (Some(node), Some(_)) = (contact.driven_node(), driven) {
                return Err(BodyError::InvalidNode {
                    node,
                    reason: "another tool drives a node of the body",
                });
            }
            driven = driven.or(contact.driven_node());
            if path.len().checked_sub(1) != Some(ticks) {
                return Err(BodyError::PathLength { ticks, points: path.len() });
            }
            if let Some(index) = path.iter().position(|p| !p.is_finite()) {
                return Err(BodyError::Path { index });
            }
        }
        let (quiet, touched) = (self.quiet_s, self.is_touched);
        // A tool that is gone no longer holds the body in its shape.
        if ticks > 0 && touched && !tools.iter().any(|tool| tool.contact.acts()) {
            (self.quiet_s, self.is_touched) = (0.0, false);
        }
        self.set_coupling_duration(integrator.tick_s() * ticks as f64);
        if ticks > 0 && self.may_sleep(tools) {
            integrator.steps(None)?;
            let report = self.sleep(tools, ticks, integrator.tick_s() * ticks as f64);
            let forces = vec![DVec3::ZERO; tools.len()];
            (1..=ticks).for_each(|tick| observe(tick, &forces));
            return Ok(report);
        }
        self.before.0.copy_from_slice(&self.x);
        self.before.1.copy_from_slice(&self.v);
        let (ledger, ties) = (self.ledger.clone(), self.ties.clone());
        let (contacts, reactions, obstacles) =
            (self.contacts.clone(), self.reactions.clone(), self.obstacles.clone());
        let tools_before: Vec<ToolContact> = tools.iter().map(|tool| tool.contact.clone()).collect();
        let stepped = self.advance_ticks(tools, ticks, &integrator, &mut observe);
        let report = stepped.inspect_err(|_| {
            self.x.copy_from_slice(&self.before.0);
            self.v.copy_from_slice(&self.before.1);
            (self.quiet_s, self.is_touched, self.ledger, self.ties) = (quiet, touched, ledger, ties);
            (self.contacts, self.reactions, self.obstacles) = (contacts, reactions, obstacles);
            tools.iter_mut().zip(tools_before).for_each(|(tool, before)| *tool.contact = before);
        })?;
        if ticks > 0 {
            self.is_touched = tools.iter().any(|tool| tool.contact.acts());
        }
        Ok(report)
    }

    fn advance_ticks(
        &mut self,
        tools: &mut [ToolRun<'_>],
        ticks: usize,
        integrator: &Integrator,
        observe: &mut dyn FnMut(usize, &[DVec3]),
    ) -> Result<StepReport, BodyError> {
        if let Some(implicit) = &mut self.implicit {
            implicit.forget();
        }
        tools.iter_mut().for_each(|tool| tool.contact.touched_nodes.clear());
        self.begin_fixed_motion();
        self.begin_obstacles(integrator.tick_s() * ticks as f64);
        let mut forces = vec![DVec3::ZERO; tools.len()];
        let mut rates = integrator.spring_rates(self.network_state());
        let (ticks_per_step, mut spring_substeps) = (integrator.ticks_per_step(), integrator.steps(rates)?);
        let mut report = StepReport { ticks, substeps: spring_substeps, ..StepReport::default() };
        let mut tick = 0;
        while tick < ticks {
            // Stiffness and stable step change with the shape, and rapidly where a law stiffens.
            if tick > 0 && (tick % STABILITY_CHECK_TICKS == 0 || !self.network.is_linear()) {
                rates = integrator.spring_rates(self.network_state());
                spring_substeps = integrator.steps(rates)?;
            }
            let span = ticks_per_step.min(ticks - tick);
            let span_s = integrator.tick_s() * span as f64;
            let substeps = if rates.is_some() {
                // The stiffness of a barrier depends on the compression of its cell.
                let barriers =
                    self.active_cells.rate_bound(&self.network, (&self.x, &self.v), integrator.tick_s());
                integrator.steps_with_barriers(spring_substeps, rates, barriers)
            } else {
                spring_substeps
            };
            report.substeps = report.substeps.max(substeps);
            let mut tool_patches: Vec<ToolPatches> = Vec::with_capacity(tools.len());
            for ToolRun { contact, path } in &mut *tools {
                let way = (path[tick].position_m, path[tick + span].position_m);
                let patches = self.find_tool_patches(contact, way, span_s);
                report.left_out = report.left_out.max(patches.left_out);
                tool_patches.push(patches);
            }
            let steps = substeps;
            let h = span_s / steps as f64;
            for i in 1..=steps {
                let share = |i: usize| i as f64 / steps as f64;
                let mut steps = Vec::with_capacity(tools.len());
                for (ToolRun { contact, path }, patches) in tools.iter_mut().zip(&mut tool_patches) {
                    let (from, to) = (path[tick], path[tick + span]);
                    let at = |share: f64| from.position_m + (to.position_m - from.position_m) * share;
                    let device = (at(share(i - 1)), at(share(i)));
                    steps.push(ToolStep::new(contact, (device, to.velocity_m_per_s), &mut patches.patches));
                }
                // Fractions of the advance before and after this step.
                let over = |i: usize| (tick as f64 + span as f64 * share(i)) / ticks as f64;
                let along = (over(i - 1), over(i));
                self.step(steps, h, along, integrator, &mut report)?;
            }
            tick += span;
            let moving = self.network.free().iter().any(|&node| self.v[node].length() > QUIET_M_PER_S);
            let checked_s = (integrator.tick_s() * span as f64).min(MAX_QUIET_CHECK_S);
            let moving = moving || self.fixed_target.is_some() || self.has_moving_obstacle(QUIET_M_PER_S);
            let at_rest = !moving && self.active_cells.inverted_count(self.network.barriers(), &self.x) == 0;
            self.quiet_s = if at_rest { self.quiet_s + checked_s } else { 0.0 };
            for (force, tool) in forces.iter_mut().zip(&*tools) {
                *force = tool.contact.displayed_force_n(self);
            }
            observe(tick, &forces);
        }
        match (0..self.x.len()).find(|&i| !(self.x[i].is_finite() && self.v[i].is_finite())) {
            Some(node) => Err(BodyError::Diverged { node }),
            None => {
                check_finite(&self.obstacles)?;
                if ticks > 0 {
                    self.ties.iter_mut().for_each(Tie::arrive);
                    self.end_obstacles();
                    self.end_fixed_motion();
                }
                report.inverted_cells = self.active_cells.inverted_count(self.network.barriers(), &self.x);
                Ok(report)
            }
        }
    }

    fn step(
        &mut self,
        tools: Vec<ToolStep<'_>>,
        h: f64,
        along: (f64, f64),
        integrator: &Integrator,
        report: &mut StepReport,
    ) -> Result<(), BodyError> {
        self.ledger = self.ledger.take().map(|ledger| ledger.begin_step(self));
        let mut drive = None;
        for ToolStep { contact, way, velocity_m_per_s, .. } in &tools {
            if let Hold::Node { node, offset_m } = contact.hold {
                let at = way.to_m + offset_m;
                drive = Some((node, at - self.x[node]));
                (self.x[node], self.v[node]) = (at, *velocity_m_per_s);
            }
        }
        let mut given = self.carry_fixed(along.1, h);
        spring_forces(&self.network, &self.x, &self.v, &mut self.force);
        self.active_cells.add_forces(self.network.barriers(), &self.x, &mut self.force);
        let driven = drive.map(|(node, _)| node);
        if let Some(node) = driven {
            self.ledger = self.ledger.take().map(|ledger| ledger.add_drive(self, node, self.force[node]));
        }
        let carried = given.clone();
        given.extend(drive);
        given.sort_unstable_by_key(|(node, _)| *node);
        let obstacles = self.obstacles.iter().map(|of| ObstacleStep::new(of, along, h)).collect();
        let mut step = Substep { h, along, integrator, drive, given, tools, obstacles };
        let constrained = step.constrains() || !(self.obstacles.is_empty() && self.ties.is_empty());
        let network = Arc::clone(&self.network);
        let moving = || network.free().iter().copied().filter(move |&node| driven != Some(node));
        match integrator {
            Integrator::SemiImplicitEuler(_) => {
                for node in moving() {
                    let per_mass = h / network.mass_kg()[node];
                    let force = self.force[node] + self.loads_n[node];
                    self.v[node] += force * per_mass + self.gravity_m_per_s2 * h;
                }
            }
            Integrator::LinearlyImplicitEuler(settings) => {
                self.add_carried_tension(&carried);
                self.implicit_velocities(driven, h, settings, constrained, report)?;
            }
        }
        carried.iter().for_each(|&(node, moved)| self.x[node] += moved);
        let is_explicit = matches!(integrator, Integrator::SemiImplicitEuler(_));
        if self.fixed_target.is_some() && is_explicit {
            self.ledger = self.ledger.take().map(|ledger| ledger.add_carried(self, &self.force));
        }
        let mut closing = None;
        if constrained {
            closing = self.solve_constraints(&mut step, report)?;
        } else {
            for tool in &mut step.tools {
                tool.contact.touched.clear();
                // Nothing nearby holds the proxy back from the device.
                tool.contact.proxy_m = None;
            }
        }
        if let Some(closing) = &closing {
            // Closing a gap works against the body's forces; loads are accounted for by the displacement of nodes.
            let outer = matches!(integrator, Integrator::SemiImplicitEuler(_));
            let force = |node: usize| {
                let weight = network.mass_kg()[node] * self.gravity_m_per_s2;
                self.force[node] + if outer { weight } else { -self.loads_n[node] }
            };
            let work = moving().map(|node| -force(node).dot(closing.nodes[node] - self.v[node]) * h).sum();
            self.ledger = self.ledger.take().map(|ledger| ledger.add_gap_closing(work));
        }
        let v = closing.as_ref().map_or(&self.v, |closing| &closing.nodes);
        moving().for_each(|node| self.x[node] += v[node] * h);
        if !step.obstacles.is_empty() {
            let closing = closing.as_ref().map(|closing| closing.obstacles.as_slice());
            self.end_obstacle_step(&step.obstacles, closing, h);
        }
        if let Some(mut ledger) = self.ledger.take() {
            if self.fixed_target.is_some() && !is_explicit {
                let mut force = vec![DVec3::ZERO; self.x.len()];
                self.internal_forces_n(&mut force);
                ledger = ledger.add_carried(self, &force);
            }
            let touched = step.tools.iter().flat_map(|tool| &tool.contact.touched);
            let contact_j = touched.map(TouchedPoint::stored_j).sum();
            self.ledger = Some(ledger.end_step(self, h, contact_j));
        }
        Ok(())
    }

    fn implicit_velocities(
        &mut self,
        driven: Option<usize>,
        h: f64,
        settings: &LinearlyImplicitEuler,
        constrained: bool,
        report: &mut StepReport,
    ) -> Result<(), BodyError> {
        for &node in self.network.free() {
            let outer = self.outer_force_on_n(node);
            self.force[node] += outer;
        }
        let mut implicit = self.implicit.take().unwrap_or_else(|| Box::new(Workspace::new(&self.network)));
        let solved = implicit.solve(self.network_state(), driven, &self.force, h, settings, constrained);
        for (index, &node) in self.network.free().iter().enumerate() {
            if driven != Some(node) && solved.is_ok() {
                self.v[node] += implicit.change(index);
            }
        }
        self.implicit = Some(implicit);
        let (solved_by, clamped) = solved?;
        report.clamped += usize::from(clamped);
        report.solved_by = match (report.solved_by, solved_by) {
            (
                SolvedBy::ConjugateGradients { iterations: before },
                SolvedBy::ConjugateGradients { iterations },
            ) => SolvedBy::ConjugateGradients { iterations: iterations.max(before) },
            (_, now) => now,
        };
        Ok(())
    }

    /// Starts energy accounting from zero; see [`Body::energy_balance`].
    pub fn start_energy_accounting(&mut self) {
        self.ledger = Some(EnergyLedger::start(self));
    }
}
