//! Energy of a body and its accounting.

use super::Body;
use crate::energy::EnergyLedger;
use crate::tie::TieEnd;
use crate::{BodyPoint, Energy, EnergyBalance, ObstacleContact};
use glam::DVec3;

impl Body {
    /// Current energy. Fixed nodes have none.
    #[must_use]
    pub fn energy(&self) -> Energy {
        let (network, x, v) = (self.network(), self.positions_m(), self.velocities_m_per_s());
        let kinetic = |&node: &usize| 0.5 * network.mass_kg()[node] * v[node].length_squared();
        let elastic = |link: &crate::Link| link.spring.energy_j(x[link.b] - x[link.a]);
        Energy {
            kinetic_j: network.free().iter().map(kinetic).sum(),
            elastic_j: network.links().iter().map(elastic).sum::<f64>()
                + network.element_energy_j(x, self.relaxed_stress_j())
                + network.barriers().energy_j(x),
            gravitational_j: self.gravitational_j(),
        }
    }

    /// Potential energy −Σ m g·(x − x_rest) of the free nodes, J.
    pub(crate) fn gravitational_j(&self) -> f64 {
        let (network, x, g) = (self.network(), self.positions_m(), self.gravity_m_per_s2());
        let height = |&node: &usize| -network.mass_kg()[node] * g.dot(x[node] - network.rest_m()[node]);
        network.free().iter().map(height).sum()
    }

    /// Energy balance since [`Body::start_energy_accounting`]; `None` without it.
    #[must_use]
    pub fn energy_balance(&self) -> Option<EnergyBalance> {
        let ledger = self.ledger.as_ref()?;
        let contact_j = ledger.contact_j.map_or(0.0, |(first, now)| now - first);
        let stored_j = self.energy().total_j() - ledger.initial_j + contact_j;
        let EnergyLedger { work_in_j, damping_loss_j, friction_loss_j, .. } = *ledger;
        let integrator_j = work_in_j - stored_j - damping_loss_j - friction_loss_j;
        Some(EnergyBalance { work_in_j, stored_j, damping_loss_j, friction_loss_j, integrator_j })
    }
}

impl EnergyLedger {
    pub(crate) fn start(body: &Body) -> Self {
        Self {
            initial_j: body.energy().total_j(),
            work_in_j: 0.0,
            damping_loss_j: 0.0,
            friction_loss_j: 0.0,
            contact_j: None,
            x: body.positions_m().to_vec(),
            v: body.velocities_m_per_s().to_vec(),
        }
    }

    /// Accounts for a change of energy without work.
    pub(crate) fn shift_initial(&mut self, change_j: f64) {
        self.initial_j += change_j;
    }

    /// Stores the state at the beginning of a step.
    pub(crate) fn begin_step(mut self, body: &Body) -> Self {
        self.x.copy_from_slice(body.positions_m());
        self.v.copy_from_slice(body.velocities_m_per_s());
        self
    }

    /// Adds the work on the driven node in this step: against `internal_n` and external forces, and for its kinetic
    /// energy.
    pub(crate) fn add_drive(mut self, body: &Body, node: usize, internal_n: DVec3) -> Self {
        let m = body.network().mass_kg()[node];
        let (v, moved) = (body.velocities_m_per_s()[node], body.positions_m()[node] - self.x[node]);
        self.work_in_j += 0.5 * m * (v.length_squared() - self.v[node].length_squared());
        self.work_in_j -= (internal_n + body.outer_force_on_n(node)).dot(moved);
        self
    }

    /// Adds the work on moved fixed nodes in this step, against `internal_n` and loads. They have no energy of their own.
    pub(crate) fn add_carried(mut self, body: &Body, internal_n: &[DVec3]) -> Self {
        for node in (0..self.x.len()).filter(|&node| body.network().is_fixed(node)) {
            let moved = body.positions_m()[node] - self.x[node];
            self.work_in_j -= (internal_n[node] + body.loads_n()[node]).dot(moved);
        }
        self
    }

    /// Adds the effect of obstacles and ties in this step, at mean velocities: anchors and elastic threads do work,
    /// and the rest is dissipated.
    pub(crate) fn add_contacts(&mut self, body: &Body, driven: Option<usize>) {
        let lost = |c: &ObstacleContact| {
            let mean = 0.5 * (body.obstacle_points()[c.point].of(&self.v) + c.velocity_m_per_s);
            c.impulse_ns.dot(c.carried_m_per_s - mean)
        };
        self.friction_loss_j += body.contacts().iter().map(lost).sum::<f64>();
        self.work_in_j += body.contacts().iter().map(|c| c.impulse_ns.dot(c.carried_m_per_s)).sum::<f64>();
        let fixed = |node: usize| body.network().is_fixed(node);
        for c in body.contacts() {
            // Moved fixed nodes pass on their share.
            for &(node, w) in body.obstacle_points()[c.point].nodes().iter().filter(|(node, _)| fixed(*node))
            {
                self.work_in_j -= w * c.impulse_ns.dot(body.velocities_m_per_s()[node]);
            }
        }
        for tie in body.ties() {
            let (impulse, h) = tie.last;
            for &node in tie.nodes().iter().filter(|node| fixed(**node)) {
                self.work_in_j -= tie.weight(node) * impulse.dot(body.velocities_m_per_s()[node]);
            }
            // The drive does the work of the ties on its node.
            if let Some(node) = driven.filter(|_| h > 0.0) {
                let moved = body.positions_m()[node] - self.x[node];
                self.work_in_j -= tie.weight(node) * impulse.dot(moved) / h;
            }
            let mean = |point: &BodyPoint| 0.5 * (point.of(&self.v) + point.of(body.velocities_m_per_s()));
            match &tie.b {
                TieEnd::Anchor { .. } => self.work_in_j += impulse.dot(mean(&tie.a)),
                TieEnd::Point(b) => {
                    let done = impulse.dot(mean(&tie.a) - mean(b));
                    if tie.stretches() { self.work_in_j += done } else { self.friction_loss_j -= done }
                }
            }
        }
    }

    /// Adds the effect of a tool's impulse on a row in this step. The tool moves at `tool_m_per_s`; the slip relative
    /// to the row dissipates energy.
    pub(crate) fn add_tool(
        &mut self,
        body: &Body,
        row: &[(usize, f64)],
        impulse_ns: DVec3,
        tool_m_per_s: DVec3,
    ) {
        let v = body.velocities_m_per_s();
        let mean: DVec3 = row.iter().map(|&(node, w)| 0.5 * w * (self.v[node] + v[node])).sum();
        self.work_in_j += impulse_ns.dot(tool_m_per_s);
        self.friction_loss_j += impulse_ns.dot(tool_m_per_s - mean);
    }

    /// Adds the work of closing gaps that existed before the step.
    pub(crate) fn add_gap_closing(mut self, work_j: f64) -> Self {
        self.work_in_j += work_j;
        self
    }

    /// Adds the energy that the relaxation of stress dissipated in this step.
    pub(crate) fn add_relaxation(mut self, dissipated_j: f64) -> Self {
        self.damping_loss_j += dissipated_j;
        self
    }

    /// Adds the losses of dampers in this step, at mean velocities, and the work of loads. The series compliance of
    /// contacts now stores `contact_j`, which is not a loss.
    pub(crate) fn end_step(mut self, body: &Body, h: f64, contact_j: f64) -> Self {
        let (first, before) = self.contact_j.unwrap_or((contact_j, contact_j));
        self.friction_loss_j -= contact_j - before;
        self.contact_j = Some((first, contact_j));
        let v = body.velocities_m_per_s();
        let mean = |node: usize| 0.5 * (self.v[node] + v[node]);
        let power = |link: &crate::Link| {
            let d = self.x[link.b] - self.x[link.a];
            link.spring.dissipated_w(d, mean(link.b) - mean(link.a))
        };
        let taken: f64 = body.network().links().iter().map(power).sum();
        let drag = body.network().drag_ns_per_m().iter().enumerate();
        let dragged: f64 = drag.map(|(node, drag)| drag * mean(node).length_squared()).sum();
        self.damping_loss_j += h * (taken + dragged + body.network().element_dissipated_w(&self.x, mean));
        let (x, loads) = (body.positions_m(), body.loads_n());
        self.work_in_j += (0..x.len()).map(|node| loads[node].dot(x[node] - self.x[node])).sum::<f64>();
        self
    }
}
