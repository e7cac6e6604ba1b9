//! The smoothed domains of tetrahedra.

use crate::incidence::Incidence;
use crate::relaxed_stress::relaxed_of;
use glam::{DMat3, DQuat, DVec3};
use palpate_laws::{
    DomainMaterial, RelaxedStress, StressState, StressTangent, domain_gradient, stress_block, stress_change,
};

/// Smoothed domains; see [`DomainMaterial`]. First those of the nodes, whose stress may relax, then those of the tetrahedra.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SmoothedDomains {
    /// Nodes of domain i and their gradients: entries from `start[i]` to `start[i + 1]`.
    start: Vec<u32>,
    nodes: Vec<u32>,
    gradients_per_m: Vec<DVec3>,
    materials: Vec<DomainMaterial>,
    /// Node of each of the domains of nodes.
    centers: Vec<u32>,
    /// Volume of each of the domains of nodes, m³.
    volumes_m3: Vec<f64>,
    /// Domains of each node.
    incidence: Incidence,
}

/// A smoothed domain of a network.
#[derive(Clone, Copy, Debug)]
pub struct SmoothedDomain<'a> {
    /// Nodes.
    pub nodes: &'a [u32],
    /// Gradient b_i of each node, 1/m: the deformation gradient is Σ_i x_i ⊗ b_i.
    pub gradients_per_m: &'a [DVec3],
    /// Material.
    pub material: DomainMaterial,
}

/// Number of rings of tetrahedra around a nearly flat or inverted one whose nodes have a reduced volume stiffness. Without them folds can remain.
const RINGS: usize = 2;

impl SmoothedDomains {
    /// Adds a domain of `nodes` with their gradients.
    pub(crate) fn push(&mut self, nodes: impl Iterator<Item = (u32, DVec3)>, material: DomainMaterial) {
        if self.start.is_empty() {
            self.start.push(0);
        }
        for (node, gradient) in nodes {
            self.nodes.push(node);
            self.gradients_per_m.push(gradient);
        }
        self.start.push(self.nodes.len() as u32);
        self.materials.push(material);
    }

    /// Adds the domain of the node `center`, of `volume_m3`. Those of nodes come before those of tetrahedra.
    pub(crate) fn push_of_node(
        &mut self,
        (center, volume_m3): (usize, f64),
        nodes: impl Iterator<Item = (u32, DVec3)>,
        material: DomainMaterial,
    ) {
        self.centers.push(center as u32);
        self.volumes_m3.push(volume_m3);
        self.push(nodes, material);
    }

    /// Lists the domains of each of `nodes` nodes.
    pub(crate) fn find_incidence(&mut self, nodes: usize) {
        let lists = (0..self.len()).map(|index| self.get(index).nodes.iter().map(|node| *node as usize));
        self.incidence = Incidence::new(nodes, lists);
    }

    /// Rotates the gradients.
    pub(crate) fn turn(&mut self, rotation: DQuat) {
        self.gradients_per_m.iter_mut().for_each(|gradient| *gradient = rotation * *gradient);
    }

    /// By node, the share of the volume stiffness that is in force: 1 unless a tetrahedron near the node is almost flat or inverted. Empty where all
    /// are 1.
    #[must_use]
    pub fn volume_shares(&self, x: &[DVec3]) -> Vec<f64> {
        let mut shares = Vec::new();
        for domain in self.of_tetrahedra() {
            let share = DomainMaterial::volume_share(domain.gradient(x).determinant());
            if share < 1.0 {
                if shares.is_empty() {
                    shares.resize(x.len(), 1.0);
                }
                domain.lower(&mut shares, share);
            }
        }
        if !shares.is_empty() {
            for _ in 0..RINGS {
                let before = shares.clone();
                for domain in self.of_tetrahedra() {
                    let share = domain.nodes.iter().map(|node| before[*node as usize]).fold(1.0, f64::min);
                    domain.lower(&mut shares, share);
                }
            }
        }
        shares
    }

    /// Domains of tetrahedra.
    fn of_tetrahedra(&self) -> impl Iterator<Item = SmoothedDomain<'_>> {
        (self.of_nodes()..self.len()).map(|index| self.get(index))
    }

    /// The domain at `index` with its material at given [`SmoothedDomains::volume_shares`].
    ///
    /// # Panics
    /// If there is none, or the shares are of another network.
    #[must_use]
    pub fn at_shares(&self, index: usize, shares: &[f64]) -> SmoothedDomain<'_> {
        let domain = self.get(index);
        if shares.is_empty() {
            return domain;
        }
        let share = self.centers.get(index).map_or(1.0, |center| shares[*center as usize]);
        SmoothedDomain { material: domain.material.with_volume_share(share), ..domain }
    }

    /// All domains with their material at given shares, with their indices.
    fn all_at_shares<'a>(&'a self, shares: &'a [f64]) -> impl Iterator<Item = (usize, SmoothedDomain<'a>)> {
        (0..self.len()).map(move |index| (index, self.at_shares(index, shares)))
    }

    /// Number of domains.
    #[must_use]
    pub fn len(&self) -> usize {
        self.materials.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.materials.is_empty()
    }

    /// Number of domains of nodes, the first ones. There are several of a node between tissues.
    #[must_use]
    pub fn of_nodes(&self) -> usize {
        self.centers.len()
    }

    /// The domain at `index`.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub fn get(&self, index: usize) -> SmoothedDomain<'_> {
        let range = self.start[index] as usize..self.start[index + 1] as usize;
        SmoothedDomain {
            nodes: &self.nodes[range.clone()],
            gradients_per_m: &self.gradients_per_m[range],
            material: self.materials[index],
        }
    }

    /// All domains.
    pub fn iter(&self) -> impl Iterator<Item = SmoothedDomain<'_>> {
        (0..self.len()).map(|index| self.get(index))
    }

    /// Indices of the domains of `node`.
    #[must_use]
    pub fn incident(&self, node: usize) -> &[usize] {
        self.incidence.of(node)
    }

    /// Whether the stress of a domain relaxes.
    pub(crate) fn relax_at_all(&self) -> bool {
        self.materials.iter().any(|of| of.material.relaxes())
    }

    /// Advances the relaxed stress by `h` seconds at constant positions. Returns the largest part that has not relaxed, over the shear modulus: a
    /// strain.
    pub(crate) fn relax(&self, x: &[DVec3], h: f64, relaxed: &mut [RelaxedStress]) -> f64 {
        let of = |(domain, relaxed): (SmoothedDomain<'_>, &mut RelaxedStress)| {
            domain.material.relax(&domain.gradient(x), relaxed, h)
        };
        self.iter().zip(relaxed).map(of).fold(0.0, f64::max)
    }

    /// Adds the forces of all domains, N.
    pub(crate) fn add_forces(
        &self,
        (x, v, relaxed): (&[DVec3], &[DVec3], &[RelaxedStress]),
        force: &mut [DVec3],
    ) {
        let shares = self.volume_shares(x);
        for (index, domain) in self.all_at_shares(&shares) {
            let stress_j = domain.stress_j(x, v, relaxed_of(relaxed, index));
            for (node, b) in domain.nodes.iter().zip(domain.gradients_per_m) {
                force[*node as usize] -= stress_j * *b;
            }
        }
    }

    /// Force of the domains of `node` on it, N.
    pub(crate) fn force_on_n(
        &self,
        (x, v, relaxed): (&[DVec3], &[DVec3], &[RelaxedStress]),
        node: usize,
    ) -> DVec3 {
        let shares = self.volume_shares(x);
        let of = |&index: &usize| {
            let domain = self.at_shares(index, &shares);
            let b = domain.gradient_of(node).unwrap_or_default();
            -(domain.stress_j(x, v, relaxed_of(relaxed, index)) * b)
        };
        self.incident(node).iter().map(of).sum()
    }

    /// Of each domain of a node: the node, the volume, m³, and stress and strain.
    pub(crate) fn stress_states(
        &self,
        x: &[DVec3],
        relaxed: &[RelaxedStress],
    ) -> impl Iterator<Item = (usize, f64, StressState)> {
        let shares = self.volume_shares(x);
        (0..self.of_nodes()).map(move |index| {
            let domain = self.at_shares(index, &shares);
            let volume_m3 = self.volumes_m3[index];
            let material = domain.material.material;
            let state = material.stress_state(&domain.gradient(x), relaxed_of(relaxed, index), volume_m3);
            (self.centers[index] as usize, volume_m3, state)
        })
    }

    /// Energy of all domains, J.
    pub(crate) fn energy_j(&self, x: &[DVec3], relaxed: &[RelaxedStress]) -> f64 {
        let shares = self.volume_shares(x);
        let of = |(index, domain): (usize, SmoothedDomain<'_>)| {
            domain.material.energy_j(&domain.gradient(x), relaxed_of(relaxed, index))
        };
        self.all_at_shares(&shares).map(of).sum()
    }

    /// Power that the dampers dissipate, W.
    pub(crate) fn dissipated_w(&self, x: &[DVec3], v: impl Fn(usize) -> DVec3) -> f64 {
        let of = |domain: SmoothedDomain<'_>| {
            let rates = domain.nodes.iter().map(|node| v(*node as usize));
            let rate_per_s = domain_gradient(domain.gradients_per_m, rates);
            domain.material.dissipated_w(&domain.gradient(x), &rate_per_s)
        };
        self.iter().map(of).sum()
    }

    /// Adds bounds of stiffness, N/m, and damping, N s/m, to those of every node; see [`DomainMaterial::bounds_j`].
    pub(crate) fn add_bounds(&self, x: &[DVec3], bounds: &mut [(f64, f64)]) {
        let shares = self.volume_shares(x);
        for (_, domain) in self.all_at_shares(&shares) {
            let (k, b) = domain.material.bounds_j(&domain.gradient(x));
            let sum: f64 = domain.gradients_per_m.iter().map(|of| of.length()).sum();
            for (node, of) in domain.nodes.iter().zip(domain.gradients_per_m) {
                let share = of.length() * sum;
                bounds[*node as usize].0 += share * k;
                bounds[*node as usize].1 += share * b;
            }
        }
    }

    /// Adds the change of the forces on all nodes but `node` by its displacement `moved`, m, to first order.
    pub(crate) fn add_force_change(
        &self,
        (x, relaxed): (&[DVec3], &[RelaxedStress]),
        (node, moved): (usize, DVec3),
        force: &mut [DVec3],
    ) {
        let shares = self.volume_shares(x);
        for &index in self.incident(node) {
            let domain = self.at_shares(index, &shares);
            let tangent = domain.tangent_j(x, relaxed_of(relaxed, index), false);
            let change = stress_change(&tangent, domain.gradient_of(node).unwrap_or_default());
            let others = domain.nodes.iter().zip(domain.gradients_per_m);
            for (other, b) in others.filter(|(other, _)| **other as usize != node) {
                force[*other as usize] -= stress_block(&change, *b) * moved;
            }
        }
    }
}

impl SmoothedDomain<'_> {
    /// Gradient of the values of all nodes.
    #[must_use]
    pub fn gradient(&self, of: &[DVec3]) -> DMat3 {
        domain_gradient(self.gradients_per_m, self.nodes.iter().map(|node| of[*node as usize]))
    }

    /// Lowers the values of the nodes to at most `most`.
    fn lower(&self, values: &mut [f64], most: f64) {
        self.nodes.iter().for_each(|node| {
            let value = &mut values[*node as usize];
            *value = value.min(most);
        });
    }

    /// Gradient b of a node, 1/m.
    fn gradient_of(&self, node: usize) -> Option<DVec3> {
        self.nodes.iter().position(|other| *other as usize == node).map(|at| self.gradients_per_m[at])
    }

    /// Stress times the volume, J, for the positions and velocities of all nodes, and the relaxed stress. The force on a node is minus its
    /// product with the node's gradient.
    #[must_use]
    pub fn stress_j(&self, x_m: &[DVec3], v_m_per_s: &[DVec3], relaxed: &RelaxedStress) -> DMat3 {
        self.material.stress_j(&self.gradient(x_m), || self.gradient(v_m_per_s), relaxed)
    }

    /// Derivative of the stress, J, for the positions of all nodes, and the relaxed stress; see [`DomainMaterial::tangent_j`].
    #[must_use]
    pub fn tangent_j(&self, x_m: &[DVec3], relaxed: &RelaxedStress, clamped: bool) -> StressTangent {
        self.material.tangent_j(&self.gradient(x_m), relaxed, clamped)
    }
}
