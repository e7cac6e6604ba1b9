//! Time stepping of several bodies that share tools.

use super::constraint_solver::{SteppedBody, solve_constraints};
use super::obstacles::check_finite;
use super::shared_tool::SharedTool;
use super::substep::ToolStep;
use super::tool_patches::ToolPatches;
use super::{Body, MAX_QUIET_CHECK_S, QUIET_M_PER_S, StepReport};
use crate::energy::EnergyLedger;
use crate::integrator::Rates;
use crate::{
    BodyError, Integrator, JointStepError, Obstacle, ObstacleContact, ObstacleReaction, Tie, ToolContact,
};
use glam::DVec3;

/// Advances `bodies` together by `ticks` ticks while `tools` follow their paths, as [`Body::advance_tools`] does with one body.
///
/// A tool with contacts on several bodies is one rigid tool behind one coupling: the contacts of all bodies are solved together in each
/// substep, whose length is stable for every body. `observe` gets the number of each tick, from 1, and the displayed force of each tool:
/// see [`ToolContact::shared_force_n`]. A settled body that no tool reaches sleeps while the others are stepped.
///
/// # Errors
/// [`JointStepError`]: the index of a body, with the errors of [`Body::advance_tools`], and [`BodyError::SharedTool`] for a contact with
/// a body that is not in the list, and for contacts of one tool that differ or hold. All bodies and tools are then unchanged.
pub fn advance_bodies(
    bodies: &mut [&mut Body],
    tools: &mut [SharedTool<'_>],
    ticks: usize,
    integrator: impl Into<Integrator>,
    mut observe: impl FnMut(usize, &[DVec3]),
) -> Result<Vec<StepReport>, JointStepError> {
    advance_joint(bodies, tools, ticks, &integrator.into(), &mut observe)
        .map_err(|(body, error)| JointStepError { body, error })
}

/// Ticks between two estimates of the stable step of a body of linear springs.
const STABILITY_CHECK_TICKS: usize = 10;

/// [`advance_bodies`], with the index of the body for an error.
pub(super) fn advance_joint(
    bodies: &mut [&mut Body],
    tools: &mut [SharedTool<'_>],
    ticks: usize,
    integrator: &Integrator,
    observe: &mut dyn FnMut(usize, &[DVec3]),
) -> Result<Vec<StepReport>, (usize, BodyError)> {
    validate(bodies, tools, ticks)?;
    let quiet: Vec<(f64, bool)> = bodies.iter().map(|body| (body.quiet_s, body.is_touched)).collect();
    for (index, body) in bodies.iter_mut().enumerate() {
        body.set_coupling_duration(integrator.tick_s() * ticks as f64);
        // A tool that is gone no longer holds the body in its shape.
        if ticks > 0 && body.is_touched && !tools.iter().any(|tool| tool.acts_on(index)) {
            (body.quiet_s, body.is_touched) = (0.0, false);
        }
    }
    let is_asleep: Vec<bool> =
        bodies.iter().enumerate().map(|(index, body)| ticks > 0 && body.may_sleep(index, tools)).collect();
    let mut reports = vec![StepReport::default(); bodies.len()];
    if is_asleep.contains(&false) {
        let (mut awake, mut before) = (Vec::new(), Vec::new());
        for (index, body) in bodies.iter_mut().enumerate().filter(|(index, _)| !is_asleep[*index]) {
            before.push(BodyBefore::of(body, quiet[index]));
            awake.push((index, &mut **body));
        }
        let contacts: Vec<Vec<ToolContact>> = tools
            .iter()
            .map(|tool| tool.contacts.iter().map(|(_, contact)| (**contact).clone()).collect())
            .collect();
        let stepped = advance_ticks(&mut awake, tools, ticks, integrator, observe).inspect_err(|_| {
            awake.iter_mut().zip(before).for_each(|((_, body), before)| before.restore(body));
            for (tool, before) in tools.iter_mut().zip(contacts) {
                tool.contacts.iter_mut().zip(before).for_each(|((_, contact), before)| **contact = before);
            }
        })?;
        for ((index, body), report) in awake.into_iter().zip(stepped) {
            reports[index] = report;
            if ticks > 0 {
                body.is_touched = tools.iter().any(|tool| tool.acts_on(index));
            }
        }
    } else {
        integrator.steps(None).map_err(|error| (0, error))?;
        let forces = vec![DVec3::ZERO; tools.len()];
        (1..=ticks).for_each(|tick| observe(tick, &forces));
    }
    for (index, body) in bodies.iter_mut().enumerate().filter(|(index, _)| is_asleep[*index]) {
        tools.iter_mut().filter_map(|tool| tool.contact_mut(index)).for_each(ToolContact::set_out_of_reach);
        reports[index] = body.sleep(ticks, integrator.tick_s() * ticks as f64);
    }
    Ok(reports)
}

/// Checks the contacts and paths of `tools`.
fn validate(bodies: &[&mut Body], tools: &[SharedTool<'_>], ticks: usize) -> Result<(), (usize, BodyError)> {
    let mut driven = vec![None; bodies.len()];
    for tool in tools {
        let first = tool.contacts.first().map_or(0, |(body, _)| *body);
        for (place, (index, contact)) in tool.contacts.iter().enumerate() {
            let shared = |reason| (*index, BodyError::SharedTool { reason });
            let body = bodies.get(*index).ok_or(shared("there is no such body"))?;
            contact.validate(body).map_err(|error| (*index, error))?;
            if let (Some(node), Some(_)) = (contact.driven_node(), driven[*index]) {
                let reason = "another tool drives a node of the body";
                return Err((*index, BodyError::InvalidNode { node, reason }));
            }
            driven[*index] = driven[*index].or(contact.driven_node());
            let others = &tool.contacts[..place];
            if others.iter().any(|(other, _)| other == index) {
                return Err(shared("it has two contacts with one body"));
            }
            let is_same = |other: &ToolContact| {
                contact.shape().is_some()
                    && (contact.shape(), contact.coupling()) == (other.shape(), other.coupling())
            };
            if !others.iter().all(|(_, other)| is_same(other)) {
                return Err(shared(
                    "shape, friction and coupling must be the same on all, and no contact may hold",
                ));
            }
        }
        if tool.path.len().checked_sub(1) != Some(ticks) {
            return Err((first, BodyError::PathLength { ticks, points: tool.path.len() }));
        }
        if let Some(index) = tool.path.iter().position(|p| !p.is_finite()) {
            return Err((first, BodyError::Path { index }));
        }
    }
    Ok(())
}

/// What an advance changes in a body, as it was before.
struct BodyBefore {
    quiet: (f64, bool),
    ledger: Option<EnergyLedger>,
    ties: Vec<Tie>,
    contacts: Vec<ObstacleContact>,
    reactions: Vec<ObstacleReaction>,
    obstacles: Vec<Obstacle>,
}

impl BodyBefore {
    /// Of `body`, whose time at rest and touch were `quiet`.
    fn of(body: &mut Body, quiet: (f64, bool)) -> Self {
        body.before.0.copy_from_slice(&body.x);
        body.before.1.copy_from_slice(&body.v);
        Self {
            quiet,
            ledger: body.ledger.clone(),
            ties: body.ties.clone(),
            contacts: body.contacts.clone(),
            reactions: body.reactions.clone(),
            obstacles: body.obstacles.clone(),
        }
    }

    fn restore(self, body: &mut Body) {
        body.x.copy_from_slice(&body.before.0);
        body.v.copy_from_slice(&body.before.1);
        (body.quiet_s, body.is_touched) = self.quiet;
        (body.ledger, body.ties) = (self.ledger, self.ties);
        (body.contacts, body.reactions, body.obstacles) = (self.contacts, self.reactions, self.obstacles);
    }
}

/// Stability and report of a body during an advance.
struct BodyProgress {
    rates: Option<Rates>,
    /// Substeps in a span of ticks that the springs need.
    spring_substeps: usize,
    report: StepReport,
}

/// Advances the awake `bodies`, each with its index.
fn advance_ticks(
    bodies: &mut [(usize, &mut Body)],
    tools: &mut [SharedTool<'_>],
    ticks: usize,
    integrator: &Integrator,
    observe: &mut dyn FnMut(usize, &[DVec3]),
) -> Result<Vec<StepReport>, (usize, BodyError)> {
    for (_, body) in &mut *bodies {
        if let Some(implicit) = &mut body.implicit {
            implicit.forget();
        }
        body.begin_fixed_motion();
        body.begin_obstacles(integrator.tick_s() * ticks as f64);
    }
    for tool in &mut *tools {
        tool.contacts.iter_mut().for_each(|(_, contact)| contact.touched_nodes.clear());
        tool.set_proxy(tool.proxy_m());
    }
    let mut forces = vec![DVec3::ZERO; tools.len()];
    let mut progress = Vec::with_capacity(bodies.len());
    for (index, body) in &*bodies {
        let rates = integrator.spring_rates(body.network_state());
        let spring_substeps = integrator.steps(rates).map_err(|error| (*index, error))?;
        let report = StepReport { ticks, substeps: spring_substeps, ..StepReport::default() };
        progress.push(BodyProgress { rates, spring_substeps, report });
    }
    let mut tick = 0;
    while tick < ticks {
        let span = integrator.ticks_per_step().min(ticks - tick);
        let span_s = integrator.tick_s() * span as f64;
        let mut substeps = 1;
        for ((index, body), of) in bodies.iter_mut().zip(&mut progress) {
            // Stiffness and stable step change with the shape, and rapidly where a law stiffens.
            if tick > 0 && (tick % STABILITY_CHECK_TICKS == 0 || !body.network.is_linear()) {
                of.rates = integrator.spring_rates(body.network_state());
                of.spring_substeps = integrator.steps(of.rates).map_err(|error| (*index, error))?;
            }
            substeps = substeps.max(body.substeps(integrator, of.rates, of.spring_substeps));
        }
        for of in &mut progress {
            of.report.substeps = of.report.substeps.max(substeps);
        }
        let mut patches: Vec<Vec<ToolPatches>> = Vec::with_capacity(tools.len());
        for tool in &mut *tools {
            let way = (tool.path[tick].position_m, tool.path[tick + span].position_m);
            let mut of_tool = Vec::with_capacity(tool.contacts.len());
            for (index, contact) in &mut tool.contacts {
                let place = bodies.iter().position(|(awake, _)| awake == index);
                of_tool.push(place.map_or_else(ToolPatches::default, |place| {
                    let patches = bodies[place].1.find_tool_patches(contact, way, span_s);
                    let report = &mut progress[place].report;
                    report.left_out = report.left_out.max(patches.left_out);
                    patches
                }));
            }
            patches.push(of_tool);
        }
        for i in 1..=substeps {
            let share = |i: usize| i as f64 / substeps as f64;
            // Fractions of the advance before and after this step.
            let over = |i: usize| (tick as f64 + span as f64 * share(i)) / ticks as f64;
            let span_of = (tick, span, (share(i - 1), share(i)));
            let (h, along) = (span_s / substeps as f64, (over(i - 1), over(i)));
            step(bodies, (tools, &mut patches), span_of, (h, along, integrator), &mut progress)?;
        }
        tick += span;
        for (_, body) in &mut *bodies {
            body.note_motion(integrator.tick_s() * span as f64);
        }
        for (force, tool) in forces.iter_mut().zip(&*tools) {
            let contacts = tool.contacts.iter().filter_map(|(index, contact)| {
                let (_, body) = bodies.iter().find(|(awake, _)| awake == index)?;
                Some((&**contact, &**body))
            });
            *force = ToolContact::shared_force_n(contacts);
        }
        observe(tick, &forces);
    }
    for ((index, body), of) in bodies.iter_mut().zip(&mut progress) {
        body.end_advance(ticks, &mut of.report).map_err(|error| (*index, error))?;
    }
    Ok(progress.into_iter().map(|of| of.report).collect())
}

/// Stress over the shear modulus that may still relax in a body at rest.
const SETTLED_STRAIN: f64 = 1e-4;

/// Advances by a substep of length `h`, at the given fractions of the advance. `span_of` holds a tick, the ticks from there that a step
/// spans, and the fractions of these before and after the substep.
fn step(
    bodies: &mut [(usize, &mut Body)],
    (tools, patches): (&mut [SharedTool<'_>], &mut [Vec<ToolPatches>]),
    (tick, span, share): (usize, usize, (f64, f64)),
    (h, along, integrator): (f64, (f64, f64), &Integrator),
    progress: &mut [BodyProgress],
) -> Result<(), (usize, BodyError)> {
    let (mut ways, mut of_bodies) = (Vec::with_capacity(tools.len()), Vec::with_capacity(bodies.len()));
    of_bodies.resize_with(bodies.len(), Vec::new);
    for (number, (tool, patches)) in tools.iter_mut().zip(patches).enumerate() {
        let (from, to) = (tool.path[tick], tool.path[tick + span]);
        let at = |share: f64| from.position_m + (to.position_m - from.position_m) * share;
        let way = tool.way((at(share.0), at(share.1)));
        ways.push(way);
        for ((index, contact), patches) in tool.contacts.iter_mut().zip(patches) {
            let Some(place) = bodies.iter().position(|(awake, _)| awake == index) else { continue };
            of_bodies[place].push(ToolStep {
                index: number,
                contact,
                way,
                velocity_m_per_s: to.velocity_m_per_s,
                patches: &mut patches.patches,
            });
        }
    }
    let mut stepped = Vec::with_capacity(bodies.len());
    for (((index, body), of), tools) in bodies.iter_mut().zip(progress).zip(of_bodies) {
        let report = &mut of.report;
        let step =
            body.begin_substep(tools, h, along, integrator, report).map_err(|error| (*index, error))?;
        stepped.push(SteppedBody { index: *index, body, step, report, closing: None });
    }
    let mut is_held = vec![false; ways.len()];
    for of in stepped.iter().filter(|of| of.step.constrained) {
        of.step.tools.iter().for_each(|tool| is_held[tool.index] = true);
    }
    let displacements = solve_constraints(&mut stepped, &ways)?;
    for SteppedBody { body, step, closing, .. } in stepped {
        body.end_substep(step, closing);
    }
    let held = is_held.into_iter().zip(displacements);
    for ((tool, way), (is_held, displacement_m)) in tools.iter_mut().zip(&ways).zip(held) {
        // Where nothing nearby holds it back, the proxy is at the device.
        tool.set_proxy(way.proxy.filter(|_| is_held).map(|_| way.to_m + displacement_m));
    }
    Ok(())
}

impl Body {
    /// Number of substeps that the body needs, with springs that need `spring_substeps` and have the bounds `rates`.
    fn substeps(&mut self, integrator: &Integrator, rates: Option<Rates>, spring_substeps: usize) -> usize {
        if rates.is_none() {
            return spring_substeps;
        }
        // The stiffness of a barrier depends on the compression of its cell.
        let barriers = self.active_cells.rate_bound(&self.network, (&self.x, &self.v), integrator.tick_s());
        integrator.steps_with_barriers(spring_substeps, rates, barriers)
    }

    /// Counts the time at rest after a span of `span_s`.
    fn note_motion(&mut self, span_s: f64) {
        let moving = self.network.free().iter().any(|&node| self.v[node].length() > QUIET_M_PER_S);
        let moving = moving
            || self.to_relax > SETTLED_STRAIN
            || self.fixed_target.is_some()
            || self.has_moving_obstacle(QUIET_M_PER_S);
        let at_rest = !moving && self.inverted_count() == 0;
        self.quiet_s = if at_rest { self.quiet_s + span_s.min(MAX_QUIET_CHECK_S) } else { 0.0 };
    }

    /// Checks the state at the end of an advance, and ends the prescribed motions.
    fn end_advance(&mut self, ticks: usize, report: &mut StepReport) -> Result<(), BodyError> {
        if let Some(node) = (0..self.x.len()).find(|&i| !(self.x[i].is_finite() && self.v[i].is_finite())) {
            return Err(BodyError::Diverged { node });
        }
        check_finite(&self.obstacles)?;
        if ticks > 0 {
            self.ties.iter_mut().for_each(Tie::arrive);
            self.end_obstacles();
            self.end_fixed_motion();
        }
        report.inverted_cells = self.inverted_count();
        Ok(())
    }

    /// Number of inverted cells and tetrahedra.
    fn inverted_count(&mut self) -> usize {
        self.active_cells.inverted_count(self.network.barriers(), &self.x)
            + self.network.hexahedra().inverted(&self.x).count()
            + self.inverted_tetrahedra().count()
    }
}
