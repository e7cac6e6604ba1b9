//! The hexahedral elements of a network.

use crate::incidence::Incidence;
use crate::relaxed_stress::relaxed_of;
use glam::{DMat3, DQuat, DVec3};
use palpate_laws::{ElementMaterial, HexahedronBlocks, HexahedronShape, RelaxedStress, StressState};

/// Eight-node hexahedra; see [`HexahedronShape`]. Equal shapes are stored once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hexahedra {
    nodes: Vec<[u32; 8]>,
    /// Index of the shape of each.
    shape: Vec<u32>,
    shapes: Vec<HexahedronShape>,
    materials: Vec<ElementMaterial>,
    /// Volume of each that is filled, m³.
    filled_m3: Vec<f64>,
    /// Elements of each node.
    incidence: Incidence,
}

/// One hexahedron of a network.
#[derive(Clone, Copy, Debug)]
pub struct Hexahedron<'a> {
    /// Nodes of the corners. Corner c lies towards +x where bit 0 of c is set, +y with bit 1, +z with bit 2, before the network is placed.
    pub nodes: [usize; 8],
    /// Shape at rest.
    pub shape: &'a HexahedronShape,
    /// Material.
    pub material: &'a ElementMaterial,
    /// Volume that is filled with the material, m³.
    pub filled_m3: f64,
}

/// Number of the shapes last added with which a new one is compared.
const COMPARED_SHAPES: usize = 8;

impl Hexahedra {
    /// Adds an element, of which the share `fill` is filled.
    pub(crate) fn push(
        &mut self,
        nodes: [usize; 8],
        shape: &HexahedronShape,
        material: ElementMaterial,
        fill: f64,
    ) {
        let first = self.shapes.len().saturating_sub(COMPARED_SHAPES);
        let equal = self.shapes[first..].iter().position(|other| other.is_nearly(shape));
        let index = equal.map_or(self.shapes.len(), |at| first + at);
        if equal.is_none() {
            self.shapes.push(*shape);
        }
        self.nodes.push(nodes.map(|node| node as u32));
        self.shape.push(index as u32);
        self.materials.push(material);
        self.filled_m3.push(fill * shape.volume_m3());
    }

    /// Lists the elements of each of `nodes` nodes.
    pub(crate) fn find_incidence(&mut self, nodes: usize) {
        self.incidence = Incidence::new(nodes, self.nodes.iter().map(|of| of.map(|node| node as usize)));
    }

    /// Rotates the shapes at rest.
    pub(crate) fn turn(&mut self, rotation: DQuat) {
        self.shapes.iter_mut().for_each(|shape| *shape = shape.rotated(DMat3::from_quat(rotation)));
    }

    /// Multiplies the stiffness and the damping of the element at `index`.
    pub(crate) fn scale(&mut self, index: usize, stiffness: f64, damping: f64) {
        let material = &mut self.materials[index];
        material.parameters_j = material.parameters_j.scaled(stiffness);
        material.viscous_js = material.viscous_js.scaled(damping);
    }

    /// Number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The element at `index`.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub fn get(&self, index: usize) -> Hexahedron<'_> {
        Hexahedron {
            nodes: self.nodes[index].map(|node| node as usize),
            shape: &self.shapes[self.shape[index] as usize],
            material: &self.materials[index],
            filled_m3: self.filled_m3[index],
        }
    }

    /// All elements.
    pub fn iter(&self) -> impl Iterator<Item = Hexahedron<'_>> {
        (0..self.len()).map(|index| self.get(index))
    }

    /// Indices of the elements of `node`.
    #[must_use]
    pub fn incident(&self, node: usize) -> &[usize] {
        self.incidence.of(node)
    }

    /// Whether the stress of an element relaxes.
    pub(crate) fn relax_at_all(&self) -> bool {
        self.materials.iter().any(ElementMaterial::relaxes)
    }

    /// Advances the relaxed stress of all elements by `h` seconds at constant positions. Returns the largest part that has not relaxed,
    /// over the shear modulus: a strain.
    pub(crate) fn relax(&self, x: &[DVec3], h: f64, relaxed: &mut [RelaxedStress]) -> f64 {
        let of = |(element, relaxed): (Hexahedron<'_>, &mut RelaxedStress)| {
            element.shape.relax(&element.corners(x), element.material, relaxed, h)
        };
        self.iter().zip(relaxed).map(of).fold(0.0, f64::max)
    }

    /// Adds the forces of all elements, N.
    pub(crate) fn add_forces(
        &self,
        (x, v, relaxed): (&[DVec3], &[DVec3], &[RelaxedStress]),
        force: &mut [DVec3],
    ) {
        for (index, element) in self.iter().enumerate() {
            let forces = element.forces_n(x, v, relaxed_of(relaxed, index));
            for (node, f) in element.nodes.into_iter().zip(forces) {
                force[node] += f;
            }
        }
    }

    /// Force of the elements of `node` on it, N.
    pub(crate) fn force_on_n(
        &self,
        (x, v, relaxed): (&[DVec3], &[DVec3], &[RelaxedStress]),
        node: usize,
    ) -> DVec3 {
        let of = |&index: &usize| -> DVec3 {
            let element = self.get(index);
            let forces = element.nodes.into_iter().zip(element.forces_n(x, v, relaxed_of(relaxed, index)));
            forces.filter(|(other, _)| *other == node).map(|(_, force)| force).sum()
        };
        self.incident(node).iter().map(of).sum()
    }

    /// Indices of the inverted elements: the determinant of the mean deformation gradient is zero or negative.
    pub(crate) fn inverted<'a>(&'a self, x: &'a [DVec3]) -> impl Iterator<Item = usize> + 'a {
        let is_inverted =
            |of: Hexahedron<'_>| of.shape.deformation_gradient(&of.corners(x)).determinant() <= 0.0;
        (0..self.len()).filter(move |&index| is_inverted(self.get(index)))
    }

    /// Stress and strain of the element at `index`, from its mean deformation gradient.
    pub(crate) fn stress_state(&self, index: usize, x: &[DVec3], relaxed: &[RelaxedStress]) -> StressState {
        let element = self.get(index);
        let f = element.shape.deformation_gradient(&element.corners(x));
        element.material.stress_state(&f, relaxed_of(relaxed, index), element.filled_m3)
    }

    /// Elastic energy of all elements, J.
    pub(crate) fn energy_j(&self, x: &[DVec3], relaxed: &[RelaxedStress]) -> f64 {
        let of = |(index, of): (usize, Hexahedron<'_>)| {
            of.shape.energy_j(&of.corners(x), of.material, relaxed_of(relaxed, index))
        };
        self.iter().enumerate().map(of).sum()
    }

    /// Power that the dampers of all elements dissipate, W.
    pub(crate) fn dissipated_w(&self, x: &[DVec3], v: impl Fn(usize) -> DVec3) -> f64 {
        self.iter().map(|of| of.shape.dissipated_w(&of.corners(x), &of.nodes.map(&v), of.material)).sum()
    }

    /// Adds bounds of stiffness, N/m, and damping, N s/m, to those of every node: their maximum over the masses bounds the eigenvalues of
    /// M⁻¹K and M⁻¹B, because xᵀKx ≤ Σ λ_e |x_e|² with the largest eigenvalue λ_e of each element.
    pub(crate) fn add_bounds(&self, x: &[DVec3], bounds: &mut [(f64, f64)]) {
        for element in self.iter() {
            let (k, b) = element.shape.bounds(&element.corners(x), element.material);
            for node in element.nodes {
                bounds[node].0 += k;
                bounds[node].1 += b;
            }
        }
    }
}

impl Hexahedra {
    /// Adds the change of the forces on all nodes but `node` by its displacement `moved`, m, to first order.
    pub(crate) fn add_force_change(
        &self,
        (x, relaxed): (&[DVec3], &[RelaxedStress]),
        (node, moved): (usize, DVec3),
        force: &mut [DVec3],
    ) {
        for &index in self.incident(node) {
            let element = self.get(index);
            let blocks = element.stiffness_n_per_m(x, relaxed_of(relaxed, index), false);
            let column = element.nodes.iter().position(|other| *other == node);
            for (row, &other) in element.nodes.iter().enumerate().filter(|(_, other)| **other != node) {
                force[other] -= column.map_or(DMat3::ZERO, |column| blocks[row][column]) * moved;
            }
        }
    }
}

impl Hexahedron<'_> {
    /// The values of all nodes at the corners.
    fn corners(&self, of: &[DVec3]) -> [DVec3; 8] {
        self.nodes.map(|node| of[node])
    }

    /// Forces on the corners, N, for the positions and velocities of all nodes, and the relaxed stress.
    #[must_use]
    pub fn forces_n(&self, x_m: &[DVec3], v_m_per_s: &[DVec3], relaxed: &RelaxedStress) -> [DVec3; 8] {
        self.shape.forces_n(&self.corners(x_m), &self.corners(v_m_per_s), self.material, relaxed)
    }

    /// Stiffness between the corners, N/m, for the positions of all nodes, and the relaxed stress. With `clamped` it is positive semidefinite.
    #[must_use]
    pub fn stiffness_n_per_m(
        &self,
        x_m: &[DVec3],
        relaxed: &RelaxedStress,
        clamped: bool,
    ) -> HexahedronBlocks {
        self.shape.stiffness_n_per_m(&self.corners(x_m), self.material, relaxed, clamped)
    }

    /// Damping between the corners, N s/m, for the positions of all nodes; `None` without damping.
    #[must_use]
    pub fn damping_ns_per_m(&self, x_m: &[DVec3]) -> Option<HexahedronBlocks> {
        self.material.is_damped().then(|| self.shape.damping_ns_per_m(&self.corners(x_m), self.material))
    }
}
