//! A body: a network with its state, and its step through time.

use crate::{BodyError, Network, SemiImplicitEuler, Surface, ToolContact, ToolPoint};
use glam::DVec3;
use std::sync::Arc;

/// A deformable body: a [`Network`], the positions and velocities of its nodes, and its [`Surface`].
#[derive(Clone, Debug)]
pub struct Body {
    network: Arc<Network>,
    surface: Arc<Surface>,
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    force: Vec<DVec3>,
    before: (Vec<DVec3>, Vec<DVec3>),
}

/// What a model step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Ticks stepped.
    pub ticks: usize,
    /// Substeps in each of them.
    pub substeps: usize,
}

impl Body {
    /// A body at rest.
    ///
    /// # Errors
    /// [`BodyError::Surface`], [`BodyError::Parameter`] when `surface` does not fit `network`.
    pub fn new(network: Network, surface: Surface) -> Result<Self, BodyError> {
        surface.validate(network.node_count())?;
        let (x, still) = (network.rest_m().to_vec(), vec![DVec3::ZERO; network.node_count()]);
        Ok(Self {
            force: still.clone(),
            before: (x.clone(), still.clone()),
            v: still,
            x,
            network: Arc::new(network),
            surface: Arc::new(surface),
        })
    }

    /// What it is made of.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Its touchable surface.
    #[must_use]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Position of every node, m.
    #[must_use]
    pub fn positions_m(&self) -> &[DVec3] {
        &self.x
    }

    /// Velocity of every node, m/s.
    #[must_use]
    pub fn velocities_m_per_s(&self) -> &[DVec3] {
        &self.v
    }

    /// Puts the body into a state. Velocities of fixed nodes count as zero.
    ///
    /// # Errors
    /// [`BodyError::Length`] when a list has not one entry for each node, [`BodyError::Position`] when an
    /// entry is not finite. The body keeps its state then.
    pub fn set_state(&mut self, x_m: &[DVec3], v_m_per_s: &[DVec3]) -> Result<(), BodyError> {
        let nodes = self.network.node_count();
        for (what, list) in [("the list of positions", x_m), ("the list of velocities", v_m_per_s)] {
            if list.len() != nodes {
                return Err(BodyError::Length { what, found: list.len(), nodes });
            }
            if let Some(node) = list.iter().position(|value| !value.is_finite()) {
                return Err(BodyError::Position { node });
            }
        }
        self.x.copy_from_slice(x_m);
        self.v.copy_from_slice(v_m_per_s);
        // What is fixed does not move, whatever the list says.
        for node in (0..nodes).filter(|&node| self.network.is_fixed(node)) {
            self.v[node] = DVec3::ZERO;
        }
        Ok(())
    }

    /// Internal force (springs and dampers) on every node at the present state, N, into `force_n`.
    ///
    /// # Panics
    /// When `force_n` has not one entry for each node.
    pub fn internal_forces_n(&self, force_n: &mut [DVec3]) {
        assert_eq!(force_n.len(), self.x.len(), "one force for each node");
        internal_forces(&self.network, &self.x, &self.v, force_n);
    }

    /// Internal force on one node, N.
    #[must_use]
    pub fn internal_force_on_n(&self, node: usize) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for &index in self.network.incident_links(node) {
            let link = &self.network.links()[index];
            let f = link.spring.force_on_a(self.x[link.b] - self.x[link.a], self.v[link.b] - self.v[link.a]);
            sum += if link.a == node { f } else { -f };
        }
        sum
    }

    /// Advances by `ticks` ticks, the tool following its path: `path[0]` is where it was at the end of the
    /// last step, `path[i]` where it is at the end of tick i; between them its position is linear and its
    /// velocity that of the later point.
    ///
    /// # Errors
    /// [`BodyError::PathLength`], [`BodyError::Path`] for a path that does not fit or is not finite,
    /// [`BodyError::CannotHold`] for a contact with another body,
    /// [`BodyError::Parameter`], [`BodyError::Substeps`] for an integrator that cannot take the step; [`BodyError::Diverged`] when the
    /// step left the finite numbers. In every case body and tool are as they were before.
    pub fn advance(
        &mut self,
        tool: Option<(&mut ToolContact, &[ToolPoint])>,
        ticks: usize,
        integrator: &SemiImplicitEuler,
    ) -> Result<StepReport, BodyError> {
        self.advance_observed(tool, ticks, integrator, |_, _| ())
    }

    /// As [`Body::advance`], and calls `observe` after every tick with its number (from 1) and the force that
    /// the body then displays to the tool, N.
    ///
    /// # Errors
    /// As [`Body::advance`].
    pub fn advance_observed(
        &mut self,
        tool: Option<(&mut ToolContact, &[ToolPoint])>,
        ticks: usize,
        integrator: &SemiImplicitEuler,
        mut observe: impl FnMut(usize, DVec3),
    ) -> Result<StepReport, BodyError> {
        if let Some((contact, path)) = &tool {
            contact.validate(self)?;
            if path.len() != ticks + 1 {
                return Err(BodyError::PathLength { ticks, points: path.len() });
            }
            if let Some(index) = path.iter().position(|p| !p.is_finite()) {
                return Err(BodyError::Path { index });
            }
        }
        let substeps = integrator.substeps(self)?;
        self.before.0.copy_from_slice(&self.x);
        self.before.1.copy_from_slice(&self.v);
        let h = integrator.tick_s / substeps as f64;
        match tool {
            None => {
                for tick in 1..=ticks {
                    (0..substeps).for_each(|_| self.substep(None, h));
                    observe(tick, DVec3::ZERO);
                }
                self.refuse_divergence()?;
            }
            Some((contact, path)) => {
                let contact_before = *contact;
                for tick in 1..=ticks {
                    let (from, to) = (path[tick - 1], path[tick]);
                    for i in 1..=substeps {
                        let along = i as f64 / substeps as f64;
                        let point = ToolPoint {
                            position_m: from.position_m + (to.position_m - from.position_m) * along,
                            velocity_m_per_s: to.velocity_m_per_s,
                        };
                        self.substep(Some((contact, point)), h);
                    }
                    observe(tick, contact.displayed_force_n(self));
                }
                self.refuse_divergence().inspect_err(|_| *contact = contact_before)?;
            }
        }
        Ok(StepReport { ticks, substeps })
    }

    fn substep(&mut self, tool: Option<(&mut ToolContact, ToolPoint)>, h: f64) {
        let mut driven = None;
        if let Some((contact, point)) = tool {
            contact.make(self, point.position_m);
            if let Some((node, offset_m)) = contact.driven() {
                self.x[node] = point.position_m + offset_m;
                self.v[node] = point.velocity_m_per_s;
            }
            internal_forces(&self.network, &self.x, &self.v, &mut self.force);
            if let Some((node, _)) = contact.driven() {
                contact.release(self.force[node]);
            }
            driven = contact.driven_node();
        } else {
            internal_forces(&self.network, &self.x, &self.v, &mut self.force);
        }
        for &node in self.network.free() {
            if driven != Some(node) {
                self.v[node] += self.force[node] * (h / self.network.mass_kg()[node]);
                self.x[node] += self.v[node] * h;
            }
        }
    }

    fn refuse_divergence(&mut self) -> Result<(), BodyError> {
        let Some(node) = (0..self.x.len()).find(|&i| !(self.x[i].is_finite() && self.v[i].is_finite()))
        else {
            return Ok(());
        };
        self.x.copy_from_slice(&self.before.0);
        self.v.copy_from_slice(&self.before.1);
        Err(BodyError::Diverged { node })
    }
}

fn internal_forces(network: &Network, x: &[DVec3], v: &[DVec3], force: &mut [DVec3]) {
    force.fill(DVec3::ZERO);
    for link in network.links() {
        let (a, b) = (link.a, link.b);
        let f = link.spring.force_on_a(x[b] - x[a], v[b] - v[a]);
        force[a] += f;
        force[b] -= f;
    }
}
