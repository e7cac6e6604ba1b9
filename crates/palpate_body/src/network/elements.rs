//! The element families of a network together.

use super::Network;
use glam::DVec3;
use palpate_laws::{ElementMaterial, RelaxedStress};

/// Corners of a hexahedron that share an edge: their numbers differ in one bit.
const HEXAHEDRON_EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];
/// Corners of a tetrahedron that share an edge.
const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Positions, m, and velocities, m/s, of all nodes, and the relaxed stress of the elements.
type ElementState<'a> = (&'a [DVec3], &'a [DVec3], &'a [RelaxedStress]);

impl Network {
    /// Whether there are elements of any family.
    #[must_use]
    pub fn has_elements(&self) -> bool {
        !(self.hexahedra.is_empty() && self.tetrahedra.is_empty())
    }

    /// Pairs of nodes on the edges of elements, each once, ascending.
    pub(super) fn element_edges(&self) -> Vec<[usize; 2]> {
        let of_hexahedra =
            self.hexahedra.iter().flat_map(|of| HEXAHEDRON_EDGES.map(|edge| edge.map(|c| of.nodes[c])));
        let of_tetrahedra =
            self.tetrahedra.iter().flat_map(|of| TETRAHEDRON_EDGES.map(|edge| edge.map(|c| of[c])));
        let pairs = of_hexahedra.chain(of_tetrahedra).map(|[a, b]| [a.min(b), a.max(b)]);
        let mut edges: Vec<[usize; 2]> = pairs.collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Length of the list of relaxed stress: one for each hexahedron and then for each smoothed domain of a node, or none if no stress relaxes.
    pub(crate) fn relaxed_count(&self) -> usize {
        let relaxes = self.hexahedra.relax_at_all() || self.tetrahedra.domains().relax_at_all();
        if relaxes { self.hexahedra.len() + self.tetrahedra.domains().of_nodes() } else { 0 }
    }

    /// Materials of the elements that have an entry in the list of relaxed stress.
    pub(crate) fn relaxing_materials(&self) -> impl Iterator<Item = ElementMaterial> + '_ {
        let domains = self.tetrahedra.domains();
        let of_domains = domains.iter().take(domains.of_nodes()).map(|domain| domain.material.material);
        self.hexahedra.iter().map(|element| *element.material).chain(of_domains)
    }

    /// The parts of hexahedra and of smoothed domains in the list of relaxed stress.
    pub(crate) fn split_relaxed<'a>(
        &self,
        relaxed: &'a [RelaxedStress],
    ) -> (&'a [RelaxedStress], &'a [RelaxedStress]) {
        relaxed.split_at(self.hexahedra.len().min(relaxed.len()))
    }

    /// Adds the forces of all elements, N.
    pub(crate) fn add_element_forces(&self, (x, v, relaxed): ElementState<'_>, force: &mut [DVec3]) {
        let (hexahedra, domains) = self.split_relaxed(relaxed);
        self.hexahedra.add_forces((x, v, hexahedra), force);
        self.tetrahedra.domains().add_forces((x, v, domains), force);
    }

    /// Force of the elements of `node` on it, N.
    pub(crate) fn element_force_on_n(&self, (x, v, relaxed): ElementState<'_>, node: usize) -> DVec3 {
        let (hexahedra, domains) = self.split_relaxed(relaxed);
        self.hexahedra.force_on_n((x, v, hexahedra), node)
            + self.tetrahedra.domains().force_on_n((x, v, domains), node)
    }

    /// Elastic energy of all elements, J.
    pub(crate) fn element_energy_j(&self, x: &[DVec3], relaxed: &[RelaxedStress]) -> f64 {
        let (hexahedra, domains) = self.split_relaxed(relaxed);
        self.hexahedra.energy_j(x, hexahedra) + self.tetrahedra.domains().energy_j(x, domains)
    }

    /// Power that the dampers of all elements dissipate, W.
    pub(crate) fn element_dissipated_w(&self, x: &[DVec3], v: impl Fn(usize) -> DVec3) -> f64 {
        self.hexahedra.dissipated_w(x, &v) + self.tetrahedra.domains().dissipated_w(x, &v)
    }

    /// Advances the relaxed stress of all elements by `h` seconds at constant positions. Returns the largest part that has not relaxed, over the
    /// shear modulus: a strain.
    pub(crate) fn relax_elements(&self, x: &[DVec3], h: f64, relaxed: &mut [RelaxedStress]) -> f64 {
        let (hexahedra, domains) = relaxed.split_at_mut(self.hexahedra.len().min(relaxed.len()));
        let of_hexahedra = self.hexahedra.relax(x, h, hexahedra);
        of_hexahedra.max(self.tetrahedra.domains().relax(x, h, domains))
    }

    /// Bounds of stiffness, N/m, and damping, N s/m, of the elements at every node; empty without elements. Their maximum over the masses bounds
    /// the eigenvalues of M⁻¹K and M⁻¹B.
    pub(crate) fn element_bounds(&self, x: &[DVec3]) -> Vec<(f64, f64)> {
        let mut bounds = Vec::new();
        if self.has_elements() {
            bounds.resize(self.node_count(), (0.0, 0.0));
            self.hexahedra.add_bounds(x, &mut bounds);
            self.tetrahedra.domains().add_bounds(x, &mut bounds);
        }
        bounds
    }

    /// Adds the change of the forces of elements on the other nodes by the displacement of a node, m, to first order.
    pub(crate) fn add_element_force_change(
        &self,
        (x, relaxed): (&[DVec3], &[RelaxedStress]),
        moved: (usize, DVec3),
        force: &mut [DVec3],
    ) {
        let (hexahedra, domains) = self.split_relaxed(relaxed);
        self.hexahedra.add_force_change((x, hexahedra), moved, force);
        self.tetrahedra.domains().add_force_change((x, domains), moved, force);
    }

    /// Nodes that share an element with `node`, with repetitions and itself.
    pub(crate) fn element_mates(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        let hexahedra =
            self.hexahedra.incident(node).iter().flat_map(|index| self.hexahedra.get(*index).nodes);
        let domains = self.tetrahedra.domains();
        let of_domains = domains.incident(node).iter().flat_map(|index| domains.get(*index).nodes);
        hexahedra.chain(of_domains.map(|other| *other as usize))
    }
}
