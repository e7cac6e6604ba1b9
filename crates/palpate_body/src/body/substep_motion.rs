//! The motion of a body in a substep, before and after the solution of its constraints.

use super::constraint_solver::Closing;
use super::substep::{Substep, ToolStep};
use super::{Body, StepReport, spring_forces};
use crate::integrator::{LinearlyImplicitEuler, SolvedBy, Workspace};
use crate::obstacle_step::ObstacleStep;
use crate::tool::{Hold, TouchedPoint};
use crate::{BodyError, Integrator};
use glam::DVec3;
use palpate_laws::RelaxedStress;
use std::sync::Arc;

impl Body {
    /// Begins a step of length `h` with `tools`: moves the nodes whose motion is given, and computes the velocities of the others without
    /// constraints.
    pub(super) fn begin_substep<'a>(
        &mut self,
        tools: Vec<ToolStep<'a>>,
        h: f64,
        along: (f64, f64),
        integrator: &'a Integrator,
        report: &mut StepReport,
    ) -> Result<Substep<'a>, BodyError> {
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
        self.network.add_element_forces((&self.x, &self.v, &self.relaxed), &mut self.force);
        self.network.add_drag(&self.v, &mut self.force);
        self.active_cells.add_forces(self.network.barriers(), &self.x, &mut self.force);
        let driven = drive.map(|(node, _)| node);
        if let Some(node) = driven {
            self.ledger = self.ledger.take().map(|ledger| ledger.add_drive(self, node, self.force[node]));
        }
        let carried = given.clone();
        given.extend(drive);
        given.sort_unstable_by_key(|(node, _)| *node);
        let obstacles = self.obstacles.iter().map(|of| ObstacleStep::new(of, along, h)).collect();
        let mut step = Substep { h, along, integrator, drive, given, tools, obstacles, constrained: false };
        step.constrained = step.constrains() || !(self.obstacles.is_empty() && self.ties.is_empty());
        match integrator {
            Integrator::SemiImplicitEuler(_) => {
                let network = Arc::clone(&self.network);
                for node in step.moving(&network) {
                    let per_mass = h / network.mass_kg()[node];
                    let force = self.force[node] + self.loads_n[node];
                    self.v[node] += force * per_mass + self.gravity_m_per_s2 * h;
                }
            }
            Integrator::LinearlyImplicitEuler(settings) => {
                self.add_carried_tension(&carried);
                self.implicit_velocities(driven, h, settings, step.constrained, report)?;
            }
        }
        carried.iter().for_each(|&(node, moved)| self.x[node] += moved);
        if self.fixed_target.is_some() && matches!(integrator, Integrator::SemiImplicitEuler(_)) {
            self.ledger = self.ledger.take().map(|ledger| ledger.add_carried(self, &self.force));
        }
        Ok(step)
    }

    /// Ends a step after the constraints have been solved: moves the nodes with their velocities, or with those of `closing`.
    pub(super) fn end_substep(&mut self, mut step: Substep<'_>, closing: Option<Closing>) {
        let (h, network) = (step.h, Arc::clone(&self.network));
        let is_explicit = matches!(step.integrator, Integrator::SemiImplicitEuler(_));
        if !step.constrained {
            step.tools.iter_mut().for_each(|tool| tool.contact.touched.clear());
        }
        if let Some(closing) = &closing {
            // Closing a gap works against the body's forces; loads are accounted for by the displacement of nodes.
            let force = |node: usize| {
                let weight = network.mass_kg()[node] * self.gravity_m_per_s2;
                self.force[node] + if is_explicit { weight } else { -self.loads_n[node] }
            };
            let moving = step.moving(&network);
            let work = moving.map(|node| -force(node).dot(closing.nodes[node] - self.v[node]) * h).sum();
            self.ledger = self.ledger.take().map(|ledger| ledger.add_gap_closing(work));
        }
        let v = closing.as_ref().map_or(&self.v, |closing| &closing.nodes);
        step.moving(&network).for_each(|node| self.x[node] += v[node] * h);
        let relaxation_j = self.relax(h);
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
            self.ledger = Some(ledger.add_relaxation(relaxation_j).end_step(self, h, contact_j));
        }
    }

    /// Relaxes the stress of the elements over a step of length `h`. Returns the energy that this dissipates, J; 0 without accounting.
    fn relax(&mut self, h: f64) -> f64 {
        if self.relaxed.is_empty() {
            return 0.0;
        }
        let energy = |relaxed: &[RelaxedStress]| {
            self.ledger.as_ref().map_or(0.0, |_| self.network.element_energy_j(&self.x, relaxed))
        };
        let before = energy(&self.relaxed);
        let mut relaxed = std::mem::take(&mut self.relaxed);
        let to_relax = self.network.relax_elements(&self.x, h, &mut relaxed);
        let dissipated = before - energy(&relaxed);
        (self.relaxed, self.to_relax) = (relaxed, to_relax);
        dissipated
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
}
