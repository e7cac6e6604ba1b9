//! A body: a network with its state.

mod constraint;
mod constraint_solver;
mod energy_accounting;
mod point_forces;
mod stability;
mod step;
mod step_report;
mod substep;
mod surface_tree;
mod tangent;
mod tie_rows;
mod tool_patches;
mod tool_rows;

pub use step::ToolRun;
pub use step_report::StepReport;

use crate::cells::ActiveCells;
use crate::energy::EnergyLedger;
use crate::integrator::Workspace;
use crate::network::NetworkState;
use crate::surface::PartialCells;
use crate::{
    BarrierTetrahedron, BodyError, ContactSurface, Network, NodeContact, Obstacle, Surface, SurfaceTree, Tie,
};
use glam::DVec3;
use std::sync::Arc;

/// A deformable body: a [`Network`], the positions and velocities of its nodes, and its [`Surface`].
#[derive(Clone, Debug)]
pub struct Body {
    network: Arc<Network>,
    surface: Arc<Surface>,
    contact_surface: Arc<ContactSurface>,
    partial_cells: Option<Arc<PartialCells>>,
    /// Whether contact gets the compliance that the grid lacks, where it can.
    adds_compliance: bool,
    gravity_m_per_s2: DVec3,
    /// What acts on the nodes from outside, beside gravity and the tool.
    loads_n: Vec<DVec3>,
    obstacles: Vec<Obstacle>,
    ties: Vec<Tie>,
    /// With the obstacles, in the last step.
    contacts: Vec<NodeContact>,
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    /// How long nothing has moved to speak of, s.
    quiet_s: f64,
    force: Vec<DVec3>,
    before: (Vec<DVec3>, Vec<DVec3>),
    pub(crate) ledger: Option<EnergyLedger>,
    implicit: Option<Box<Workspace>>,
    /// Of the surface, once a tool has come near.
    tree: Option<Box<SurfaceTree>>,
    /// Of its cells.
    active_cells: ActiveCells,
}

/// Nodes slower than that stand still to the eye and to the hand: a hair's breadth in a second.
const QUIET_M_PER_S: f64 = 1e-4;
/// Time of quiet after which a body is settled.
const SETTLED_S: f64 = 0.1;
/// Time of quiet that one look at the body counts for, at most.
const LOOK_S: f64 = 0.02;

/// The state of a body: what a step changes. Gravity, loads and obstacles are not in it, nor is the tool.
///
/// Restored into a body of the same network, with the same gravity, loads and obstacles, it leads to the same steps, to the
/// bit. Books of energy begin anew. A file keeps the bits if its format does (serde_json with `float_roundtrip`).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BodyState {
    /// Position of every node, m.
    pub positions_m: Vec<DVec3>,
    /// Velocity of every node, m/s.
    pub velocities_m_per_s: Vec<DVec3>,
    /// How long nothing has moved to speak of, s: see [`Body::is_settled`].
    pub quiet_s: f64,
    /// What holds points of it, torn or not.
    pub ties: Vec<Tie>,
}

impl Body {
    /// A body at rest, without gravity.
    ///
    /// Triangles of `surface` that face inward are turned: two of their vertices change places, and nothing else. Triangles that share an
    /// edge with one other are made to agree with it, and each part that is joined so faces away from the tissue:
    ///
    /// * away from the nodes that springs join to its own, where these lie on one side of it; so does a cavity and an open sheet, such
    ///   as the top of a block,
    /// * else, if it is closed, away from what it encloses; into it where it is within another closed part, as a cavity is,
    /// * else as most of its triangles were given: an open sheet without tissue on either side has no inside.
    ///
    /// Triangles with two corners at one point are left as they are.
    ///
    /// # Errors
    /// [`BodyError::Surface`], [`BodyError::Parameter`] when `surface` does not fit `network`; [`BodyError::OneSidedSurface`] for a
    /// surface that cannot be turned to agree, such as a Möbius strip.
    pub fn new(network: Network, surface: Surface) -> Result<Self, BodyError> {
        surface.validate(network.node_count())?;
        let surface = surface.facing_outward(&network)?;
        let (x, still) = (network.rest_m().to_vec(), vec![DVec3::ZERO; network.node_count()]);
        let contact_surface = ContactSurface::new(&surface, &network);
        Ok(Self {
            gravity_m_per_s2: DVec3::ZERO,
            loads_n: still.clone(),
            obstacles: Vec::new(),
            ties: Vec::new(),
            contacts: Vec::new(),
            quiet_s: 0.0,
            force: still.clone(),
            before: (x.clone(), still.clone()),
            ledger: None,
            implicit: None,
            tree: None,
            adds_compliance: true,
            partial_cells: PartialCells::new(&network, &contact_surface).map(Arc::new),
            contact_surface: Arc::new(contact_surface),
            active_cells: ActiveCells::default(),
            v: still,
            x,
            network: Arc::new(network),
            surface: Arc::new(surface),
        })
    }

    /// Its network with the positions and velocities of its nodes.
    pub(crate) fn network_state(&self) -> NetworkState<'_> {
        NetworkState { network: &self.network, x: &self.x, v: &self.v }
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

    /// The triangles of its surface on which contact patches are found.
    #[must_use]
    pub fn contact_surface(&self) -> &ContactSurface {
        &self.contact_surface
    }

    /// Whether a contact that is smaller than a cell gets the compliance which the grid lacks: see [`Body::add_compliance`].
    #[must_use]
    pub fn adds_compliance(&self) -> bool {
        self.adds_compliance && self.network.grid().is_some_and(crate::Grid::adds_compliance)
    }

    /// Sets whether a contact that is smaller than a cell gets the compliance which the grid lacks, so that the hand feels the tissue and not
    /// the grid; on at first. Without it contact gives way by what the springs give way, as in the paper, and by a
    /// twentieth of the smooth law, so that the problem stays well posed. So do lattices of equal springs; networks without cells have
    /// neither.
    pub fn add_compliance(&mut self, adds: bool) {
        self.adds_compliance = adds;
    }

    /// The acceleration of gravity, m/s².
    #[must_use]
    pub fn gravity_m_per_s2(&self) -> DVec3 {
        self.gravity_m_per_s2
    }

    /// Sets the acceleration of gravity, m/s², for instance (0, 0, −9.81).
    ///
    /// # Errors
    /// [`BodyError::Parameter`] when it is not finite.
    pub fn set_gravity(&mut self, gravity_m_per_s2: DVec3) -> Result<(), BodyError> {
        let largest = gravity_m_per_s2.abs().max_element();
        crate::error::check("gravity, m/s2", largest, gravity_m_per_s2.is_finite(), "finite")?;
        if gravity_m_per_s2 != self.gravity_m_per_s2 {
            self.quiet_s = 0.0;
        }
        let before = self.gravitational_j();
        self.gravity_m_per_s2 = gravity_m_per_s2;
        // What a height is worth has changed; nobody has done work.
        let change = self.gravitational_j() - before;
        if let Some(ledger) = &mut self.ledger {
            ledger.shift_initial(change);
        }
        Ok(())
    }

    /// The forces that act on the nodes from outside, beside gravity and the tool, N.
    #[must_use]
    pub fn loads_n(&self) -> &[DVec3] {
        &self.loads_n
    }

    /// Sets the forces that act on the nodes from outside, N. They stay until they are set again.
    ///
    /// # Errors
    /// [`BodyError::Length`] when there is not one for each node, [`BodyError::Load`] when one is not finite. The body
    /// keeps its loads then.
    pub fn set_loads(&mut self, loads_n: &[DVec3]) -> Result<(), BodyError> {
        let nodes = self.network.node_count();
        if loads_n.len() != nodes {
            return Err(BodyError::Length { what: "the list of loads", found: loads_n.len(), nodes });
        }
        if let Some(node) = loads_n.iter().position(|load| !load.is_finite()) {
            return Err(BodyError::Load { node });
        }
        if self.loads_n != loads_n {
            self.quiet_s = 0.0;
        }
        self.loads_n.copy_from_slice(loads_n);
        Ok(())
    }

    /// What is in the body's way.
    #[must_use]
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// Sets what is in the body's way. A node that is inside an obstacle is pushed out at 1 m/s.
    pub fn set_obstacles(&mut self, obstacles: Vec<Obstacle>) {
        self.obstacles = obstacles;
        self.contacts.clear();
        self.quiet_s = 0.0;
    }

    /// What holds points of it.
    #[must_use]
    pub fn ties(&self) -> &[Tie] {
        &self.ties
    }

    /// Sets what holds points of it.
    ///
    /// # Errors
    /// [`BodyError::CannotHold`] when a tie names a node that the body does not have. The ties are kept then.
    pub fn set_ties(&mut self, ties: Vec<Tie>) -> Result<(), BodyError> {
        ties.iter().try_for_each(|tie| tie.validate(self.x.len()))?;
        self.ties = ties;
        self.quiet_s = 0.0;
        Ok(())
    }

    /// Moves the anchor of the tie at `index`: it is at `to_m` at the end of the next advance, and on the way there at an
    /// even speed.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] when there is no such tie, it has no anchor, or the place is not finite.
    pub fn move_tie(&mut self, index: usize, to_m: DVec3) -> Result<(), BodyError> {
        let Some(tie) = self.ties.get_mut(index) else {
            return Err(BodyError::Parameter {
                what: "index of a tie",
                value: index as f64,
                allowed: "that of one of the body's ties",
            });
        };
        tie.move_to(to_m)?;
        self.quiet_s = 0.0;
        Ok(())
    }

    /// The contacts with the obstacles in the last step that gave an impulse.
    #[must_use]
    pub fn contacts(&self) -> &[NodeContact] {
        &self.contacts
    }

    /// What acts on `node` beside springs, dampers and the tool: gravity and its load, N.
    #[must_use]
    pub fn outer_force_on_n(&self, node: usize) -> DVec3 {
        self.network.mass_kg()[node] * self.gravity_m_per_s2 + self.loads_n[node]
    }

    /// What acts on every node from outside, N, into `force_n`: gravity, loads, and what obstacles and ties gave in the last
    /// step. The tool is not among it.
    ///
    /// # Panics
    /// When `force_n` has not one entry for each node.
    pub fn outer_forces_n(&self, force_n: &mut [DVec3]) {
        assert_eq!(force_n.len(), self.x.len(), "one force for each node");
        force_n.iter_mut().enumerate().for_each(|(node, force)| *force = self.outer_force_on_n(node));
        for contact in self.contacts.iter().filter(|contact| contact.step_s > 0.0) {
            force_n[contact.node] += contact.impulse_ns / contact.step_s;
        }
        for tie in &self.ties {
            tie.add_force_n(force_n);
        }
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

    /// Whether no node was seen to move faster than 0.1 mm/s for the last 0.1 s: it may be left unstepped as long as
    /// nothing about it changes.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.quiet_s >= SETTLED_S
    }

    /// Its state now.
    #[must_use]
    pub fn state(&self) -> BodyState {
        BodyState {
            positions_m: self.x.clone(),
            velocities_m_per_s: self.v.clone(),
            quiet_s: self.quiet_s,
            ties: self.ties.clone(),
        }
    }

    /// Puts the body into `state`, to the bit if it is one of this body's network.
    ///
    /// # Errors
    /// As [`Body::set_state`].
    pub fn restore(&mut self, state: &BodyState) -> Result<(), BodyError> {
        state.ties.iter().try_for_each(|tie| tie.validate(self.x.len()))?;
        self.set_state(&state.positions_m, &state.velocities_m_per_s)?;
        self.ties.clone_from(&state.ties);
        self.quiet_s = state.quiet_s;
        Ok(())
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
        self.quiet_s = 0.0;
        // What is fixed does not move, whatever the list says.
        for node in (0..nodes).filter(|&node| self.network.is_fixed(node)) {
            self.v[node] = DVec3::ZERO;
        }
        self.contacts.clear();
        // A state that was set is no work that was done.
        self.ledger = self.ledger.take().map(|_| EnergyLedger::start(self));
        Ok(())
    }

    /// Internal force (springs, dampers and volume barriers) on every node at the present state, N, into `force_n`.
    ///
    /// # Panics
    /// When `force_n` has not one entry for each node.
    pub fn internal_forces_n(&self, force_n: &mut [DVec3]) {
        assert_eq!(force_n.len(), self.x.len(), "one force for each node");
        spring_forces(&self.network, &self.x, &self.v, force_n);
        self.network.barriers().add_all_forces(&self.x, force_n);
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
        match self.network.barriers().force_on_n(&self.x, node) {
            Some(force) => sum + force,
            None => sum,
        }
    }

    /// The tetrahedra of cells whose volume barriers act at the present state.
    pub fn active_barriers(&self) -> impl Iterator<Item = BarrierTetrahedron> + '_ {
        self.barriers_below(palpate_laws::VolumeBarrier::ONSET)
    }

    /// The tetrahedra of cells whose volume ratio is below `ratio` at the present state.
    pub fn barriers_below(&self, ratio: f64) -> impl Iterator<Item = BarrierTetrahedron> + '_ {
        self.network.barriers().tetrahedra_below(ratio, &self.x)
    }

    /// Indices in [`Network::cells`] of the inverted cells, ascending. A cell is inverted where the volume ratio J of at least one
    /// of its ten tetrahedra is zero or negative (see [`BarrierTetrahedron`]).
    pub fn inverted_cells(&self) -> impl Iterator<Item = usize> + '_ {
        let cells = self.network.barriers();
        (0..cells.nodes().len()).filter(|&cell| cells.is_inverted(cell, &self.x))
    }
}

/// The forces of springs and dampers on all nodes, N.
fn spring_forces(network: &Network, x: &[DVec3], v: &[DVec3], force: &mut [DVec3]) {
    force.fill(DVec3::ZERO);
    for link in network.links() {
        let (a, b) = (link.a, link.b);
        let f = link.spring.force_on_a(x[b] - x[a], v[b] - v[a]);
        force[a] += f;
        force[b] -= f;
    }
}
