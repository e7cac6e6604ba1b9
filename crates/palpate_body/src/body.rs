//! A body: a network with its state, surface and constraints.

mod constraint;
mod constraint_solver;
mod deformation;
mod energy_accounting;
mod fixed_motion;
mod joint_step;
mod obstacle_candidates;
mod obstacle_rows;
mod obstacle_search;
mod obstacles;
mod point_forces;
mod shared_tool;
mod sleep;
mod stability;
mod state;
mod step;
mod step_report;
mod stress;
mod substep;
mod substep_motion;
mod surface_tree;
mod tangent;
mod tie_rows;
mod tool_patches;
mod tool_rows;

pub use deformation::{CellPlace, Deformation};
pub use joint_step::advance_bodies;
pub use shared_tool::SharedTool;
pub use state::BodyState;
pub use step::ToolRun;
pub use step_report::StepReport;

use crate::cells::ActiveCells;
use crate::energy::EnergyLedger;
use crate::integrator::Workspace;
use crate::network::NetworkState;
use crate::obstacle::Pose;
use crate::obstacle_points::ObstaclePoints;
use crate::surface::PartialCells;
use crate::{
    BarrierTetrahedron, BodyError, ContactSurface, Network, Obstacle, ObstacleContact, ObstacleReaction,
    Surface, SurfaceTree, Tie,
};
use glam::DVec3;
use obstacle_candidates::ObstacleCandidates;
use palpate_laws::RelaxedStress;
use std::sync::Arc;

/// A deformable body: a [`Network`] with positions and velocities of its nodes, a [`Surface`], loads, obstacles and
/// ties.
#[derive(Clone, Debug)]
pub struct Body {
    network: Arc<Network>,
    surface: Arc<Surface>,
    contact_surface: Arc<ContactSurface>,
    partial_cells: Option<Arc<PartialCells>>,
    /// Whether contact gets the compliance that the grid lacks, where the grid permits it.
    adds_compliance: bool,
    gravity_m_per_s2: DVec3,
    /// External force on every node except gravity and tools, N.
    loads_n: Vec<DVec3>,
    obstacles: Vec<Obstacle>,
    ties: Vec<Tie>,
    /// Contacts with obstacles in the last step.
    contacts: Vec<ObstacleContact>,
    /// Pose of the fixed nodes relative to rest, and that at the end of the next advance, if they move.
    fixed_pose: Pose,
    fixed_target: Option<Pose>,
    /// Reaction on each obstacle in the last advance.
    reactions: Vec<ObstacleReaction>,
    obstacle_points: Arc<ObstaclePoints>,
    candidates: ObstacleCandidates,
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    /// Relaxed stress of every hexahedron, and then of every smoothed domain of a node; empty where none relaxes.
    relaxed: Vec<RelaxedStress>,
    /// The largest stress that has not relaxed, over the shear modulus.
    to_relax: f64,
    /// Time for which the body has been at rest, s.
    quiet_s: f64,
    /// Whether a tool touched or held the body at the end of the last advance.
    is_touched: bool,
    force: Vec<DVec3>,
    before: (Vec<DVec3>, Vec<DVec3>),
    pub(crate) ledger: Option<EnergyLedger>,
    implicit: Option<Box<Workspace>>,
    /// Tree of the surface, created when a tool comes near.
    tree: Option<Box<SurfaceTree>>,
    /// Cells whose volume barriers may act.
    active_cells: ActiveCells,
}

/// Speed below which a node counts as at rest, m/s.
const QUIET_M_PER_S: f64 = 1e-4;
/// Time at rest after which a body is settled, s.
const SETTLED_S: f64 = 0.1;
/// Maximum time at rest that one check accounts for, s.
const MAX_QUIET_CHECK_S: f64 = 0.02;

impl Body {
    /// Creates a body at rest without gravity.
    ///
    /// Triangles of `surface` that face inward are flipped by exchanging two of their vertices. Triangles that share
    /// an edge with exactly one other are made consistent with it. Each connected part is then oriented:
    ///
    /// * away from the nodes that springs join to its own nodes, if these lie on one side; this includes cavities and
    ///   open sheets, for example the top of a block,
    /// * otherwise, if it is closed, away from the volume that it encloses; inward if it is a cavity within another
    ///   closed part,
    /// * otherwise as the majority of its triangles were given: an open sheet without tissue on either side has no
    ///   inside.
    ///
    /// Degenerate triangles are left unchanged.
    ///
    /// # Errors
    /// [`BodyError::Surface`] and [`BodyError::Parameter`] if `surface` does not fit `network`;
    /// [`BodyError::OneSidedSurface`] for a surface that cannot be oriented, for example a Möbius strip.
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
            fixed_pose: Pose::at(DVec3::ZERO),
            fixed_target: None,
            reactions: Vec::new(),
            obstacle_points: Arc::new(ObstaclePoints::new(&surface, &network)),
            candidates: ObstacleCandidates::default(),
            quiet_s: 0.0,
            is_touched: false,
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
            relaxed: vec![RelaxedStress::default(); network.relaxed_count()],
            to_relax: 0.0,
            network: Arc::new(network),
            surface: Arc::new(surface),
        })
    }

    /// The network with the positions and velocities of its nodes.
    pub(crate) fn network_state(&self) -> NetworkState<'_> {
        NetworkState { network: &self.network, x: &self.x, v: &self.v, relaxed: &self.relaxed }
    }

    /// Network of the body.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Touchable surface of the body.
    #[must_use]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Triangles of the surface on which contact patches are found.
    #[must_use]
    pub fn contact_surface(&self) -> &ContactSurface {
        &self.contact_surface
    }

    /// Whether contacts get the compliance that the grid lacks; see [`Body::add_compliance`].
    #[must_use]
    pub fn adds_compliance(&self) -> bool {
        self.adds_compliance && self.network.grid().is_some_and(crate::Grid::adds_compliance)
    }

    /// Sets whether contacts get the compliance that the grid of cells lacks below its size; on by default.
    ///
    /// Without it, a contact gives way by the springs, as in the paper, and by a twentieth of the smooth law, which
    /// keeps the problem well posed. The same holds for lattices of equal springs. Networks without cells have
    /// neither.
    pub fn add_compliance(&mut self, adds: bool) {
        self.adds_compliance = adds;
    }

    /// Acceleration of gravity, m/s².
    #[must_use]
    pub fn gravity_m_per_s2(&self) -> DVec3 {
        self.gravity_m_per_s2
    }

    /// Sets the acceleration of gravity, m/s², for example (0, 0, −9.81).
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if it is not finite.
    pub fn set_gravity(&mut self, gravity_m_per_s2: DVec3) -> Result<(), BodyError> {
        let largest = gravity_m_per_s2.abs().max_element();
        crate::error::check("gravity, m/s2", largest, gravity_m_per_s2.is_finite(), "finite")?;
        if gravity_m_per_s2 != self.gravity_m_per_s2 {
            self.quiet_s = 0.0;
        }
        let before = self.gravitational_j();
        self.gravity_m_per_s2 = gravity_m_per_s2;
        // The potential energy has changed without any work.
        let change = self.gravitational_j() - before;
        if let Some(ledger) = &mut self.ledger {
            ledger.shift_initial(change);
        }
        Ok(())
    }

    /// External force on every node, N, without gravity and tools.
    #[must_use]
    pub fn loads_n(&self) -> &[DVec3] {
        &self.loads_n
    }

    /// Sets the external force on every node, N. The forces act until they are set again.
    ///
    /// # Errors
    /// [`BodyError::Length`] if the number of forces is not the number of nodes, [`BodyError::Load`] if a force is
    /// not finite. The loads are then unchanged.
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

    /// Ties of the body.
    #[must_use]
    pub fn ties(&self) -> &[Tie] {
        &self.ties
    }

    /// Sets the ties.
    ///
    /// # Errors
    /// [`BodyError::InvalidNode`] if a tie names a node that does not exist. The ties are then unchanged.
    pub fn set_ties(&mut self, ties: Vec<Tie>) -> Result<(), BodyError> {
        ties.iter().try_for_each(|tie| tie.validate(self.x.len()))?;
        self.ties = ties;
        self.quiet_s = 0.0;
        Ok(())
    }

    /// Moves the anchor of the tie at `index`. It moves at constant speed and reaches `to_m`, m, at the end of the
    /// next advance.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if there is no such tie, it has no anchor, or the position is not finite.
    pub fn move_tie(&mut self, index: usize, to_m: DVec3) -> Result<(), BodyError> {
        let Some(tie) = self.ties.get_mut(index) else {
            return Err(BodyError::Parameter {
                what: "index of a tie",
                value: index as f64,
                allowed: "that of one of the body's ties",
            });
        };
        if tie.move_to(to_m)? {
            self.quiet_s = 0.0;
        }
        Ok(())
    }

    /// External force on `node`, N: gravity and its load.
    #[must_use]
    pub fn outer_force_on_n(&self, node: usize) -> DVec3 {
        self.network.mass_kg()[node] * self.gravity_m_per_s2 + self.loads_n[node]
    }

    /// Writes the external force on every node to `force_n`, N: gravity, loads, and the forces of obstacles and ties
    /// in the last step. Tools are not included.
    ///
    /// # Panics
    /// If `force_n` does not have one entry for each node.
    pub fn outer_forces_n(&self, force_n: &mut [DVec3]) {
        assert_eq!(force_n.len(), self.x.len(), "one force for each node");
        force_n.iter_mut().enumerate().for_each(|(node, force)| *force = self.outer_force_on_n(node));
        for contact in self.contacts.iter().filter(|contact| contact.step_s > 0.0) {
            let on_point = contact.impulse_ns / contact.step_s;
            let nodes = self.obstacle_points.points[contact.point].nodes();
            nodes.iter().for_each(|&(node, w)| force_n[node] += w * on_point);
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

    /// Relaxed stress of every element, see [`BodyState::relaxed_stress_j`].
    #[must_use]
    pub fn relaxed_stress_j(&self) -> &[RelaxedStress] {
        &self.relaxed
    }

    /// The part of the smoothed domains in [`Body::relaxed_stress_j`], in the order of the domains of nodes.
    #[must_use]
    pub fn relaxed_stress_of_domains_j(&self) -> &[RelaxedStress] {
        self.network.split_relaxed(&self.relaxed).1
    }

    /// Whether the body is at rest: no node and no rigid obstacle was faster than 0.1 mm/s for 0.1 s.
    ///
    /// While its surroundings do not change, it needs no steps: [`Body::advance`] without a tool sets its velocities to
    /// zero and leaves its state unchanged ([`StepReport::is_asleep`]). A tool that comes or leaves, a moved obstacle or tie, and
    /// setting gravity, loads, obstacles, ties or the state to other values wake it.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.quiet_s >= SETTLED_S
    }

    /// Writes the internal force (springs, dampers, elements and volume barriers) with the drag on every node to `force_n`, N.
    ///
    /// # Panics
    /// If `force_n` does not have one entry for each node.
    pub fn internal_forces_n(&self, force_n: &mut [DVec3]) {
        assert_eq!(force_n.len(), self.x.len(), "one force for each node");
        spring_forces(&self.network, &self.x, &self.v, force_n);
        self.network.add_element_forces((&self.x, &self.v, &self.relaxed), force_n);
        self.network.add_drag(&self.v, force_n);
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
        sum += self.network.element_force_on_n((&self.x, &self.v, &self.relaxed), node);
        sum -= self.network.drag_ns_per_m().get(node).copied().unwrap_or_default() * self.v[node];
        match self.network.barriers().force_on_n(&self.x, node) {
            Some(force) => sum + force,
            None => sum,
        }
    }

    /// Tetrahedra whose volume barriers act in the current state.
    pub fn active_barriers(&self) -> impl Iterator<Item = BarrierTetrahedron> + '_ {
        self.barriers_below(palpate_laws::VolumeBarrier::ONSET)
    }

    /// Tetrahedra whose volume ratio is below `ratio` in the current state.
    pub fn barriers_below(&self, ratio: f64) -> impl Iterator<Item = BarrierTetrahedron> + '_ {
        self.network.barriers().tetrahedra_below(ratio, &self.x)
    }

    /// Indices in [`Network::cells`] of the inverted cells, ascending. A cell of springs is inverted if the volume ratio J of at least one of its
    /// ten tetrahedra is zero or negative (see [`BarrierTetrahedron`]), a hexahedral element if the determinant of its mean deformation gradient is.
    pub fn inverted_cells(&self) -> impl Iterator<Item = usize> + '_ {
        let cells = self.network.barriers();
        let of_springs = (0..cells.with_barriers()).filter(|&cell| cells.is_inverted(cell, &self.x));
        let of_elements = self.network.hexahedra().inverted(&self.x);
        of_springs.chain(of_elements.map(|element| cells.with_barriers() + element))
    }

    /// Indices in [`Network::tetrahedra`] of the inverted tetrahedra, ascending.
    pub fn inverted_tetrahedra(&self) -> impl Iterator<Item = usize> + '_ {
        self.network.tetrahedra().inverted(&self.x)
    }
}

/// Writes the forces of springs and dampers on all nodes, N.
///
/// The roots and quotients of four links are computed together, for which processors have instructions. The sums have the order of the
/// links.
fn spring_forces(network: &Network, x: &[DVec3], v: &[DVec3], force: &mut [DVec3]) {
    force.fill(DVec3::ZERO);
    let (fours, rest) = network.links().as_chunks::<4>();
    for links in fours {
        let (mut d, mut length, mut per_length) = ([DVec3::ZERO; 4], [0.0; 4], [0.0; 4]);
        for i in 0..4 {
            d[i] = x[links[i].b] - x[links[i].a];
            length[i] = d[i].length_squared();
        }
        for i in 0..4 {
            length[i] = f64::sqrt(length[i]);
            per_length[i] = length[i].recip();
        }
        for (i, link) in links.iter().enumerate() {
            let (a, b) = (link.a, link.b);
            let f = link.spring.force_on_a_along(d[i], length[i], per_length[i], v[b] - v[a]);
            force[a] += f;
            force[b] -= f;
        }
    }
    for link in rest {
        let (a, b) = (link.a, link.b);
        let f = link.spring.force_on_a(x[b] - x[a], v[b] - v[a]);
        force[a] += f;
        force[b] -= f;
    }
}
