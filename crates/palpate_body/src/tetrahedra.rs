//! The tetrahedral elements of a network.

use crate::BodyError;
use crate::cell_tissue::CellTissue;
use crate::incidence::Incidence;
use crate::smoothed_domains::SmoothedDomains;
use glam::{DMat3, DQuat, DVec3};
use palpate_laws::{DomainMaterial, ElementMaterial, LameParameters};

/// Four-node tetrahedra with averaged deformation; see [`DomainMaterial`]. They are evaluated by their [`SmoothedDomains`]. Those of different
/// tissues are averaged apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tetrahedra {
    nodes: Vec<[u32; 4]>,
    /// Index of the tissue of each.
    tissue: Vec<u32>,
    tissues: Vec<ScaledTissue>,
    domains: SmoothedDomains,
}

/// A tissue with factors of its stiffness and its damping.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ScaledTissue {
    tissue: CellTissue,
    stiffness: f64,
    damping: f64,
}

/// Volume of a tetrahedron, m³, and the gradients of the shape functions of its corners, 1/m. `None` unless it is finite and the edges from the
/// first corner are right-handed.
pub(crate) fn shape([o, a, b, c]: [DVec3; 4]) -> Option<(f64, [DVec3; 4])> {
    let edges = DMat3::from_cols(a - o, b - o, c - o);
    let volume_m3 = edges.determinant() / 6.0;
    if !(volume_m3 > 0.0 && volume_m3.is_finite()) {
        return None;
    }
    let inverse = edges.inverse();
    let [a, b, c] = [inverse.row(0), inverse.row(1), inverse.row(2)];
    let gradients = [-(a + b + c), a, b, c];
    gradients.iter().all(|b| b.is_finite()).then_some((volume_m3, gradients))
}

impl Tetrahedra {
    /// Adds an element of `tissue`.
    pub(crate) fn push(&mut self, nodes: [usize; 4], tissue: &CellTissue) {
        let tissue = self.tissue_index(ScaledTissue { tissue: *tissue, stiffness: 1.0, damping: 1.0 });
        self.nodes.push(nodes.map(|node| node as u32));
        self.tissue.push(tissue);
    }

    /// Index of a tissue, which is added if it is new.
    fn tissue_index(&mut self, tissue: ScaledTissue) -> u32 {
        let known = self.tissues.iter().rposition(|other| *other == tissue);
        known.unwrap_or_else(|| {
            self.tissues.push(tissue);
            self.tissues.len() - 1
        }) as u32
    }

    /// Multiplies the stiffness and the damping of the element at `index`.
    pub(crate) fn scale(&mut self, index: usize, stiffness: f64, damping: f64) {
        let of = self.tissues[self.tissue[index] as usize];
        let scaled =
            ScaledTissue { stiffness: stiffness * of.stiffness, damping: damping * of.damping, ..of };
        self.tissue[index] = self.tissue_index(scaled);
    }

    /// Forms the domains of the elements with the nodes at `rest_m`, m.
    pub(crate) fn form_domains(&mut self, rest_m: &[DVec3]) -> Result<(), BodyError> {
        self.domains = SmoothedDomains::default();
        if self.is_empty() {
            return Ok(());
        }
        let shapes = (0..self.len()).map(|element| {
            let found = shape(self.get(element).map(|node| rest_m[node]));
            found.ok_or(BodyError::ElementShape { element })
        });
        let shapes: Vec<(f64, [DVec3; 4])> = shapes.collect::<Result<_, _>>()?;
        let materials = shapes.iter().enumerate().map(|(element, shape)| self.material(element, shape.0));
        let materials = materials.collect::<Result<Vec<ElementMaterial>, _>>()?;
        let incidence = Incidence::new(rest_m.len(), (0..self.len()).map(|element| self.get(element)));
        let mut domains = SmoothedDomains::default();
        let (mut around, mut sums): (Vec<usize>, Vec<(u32, DVec3)>) = (Vec::new(), Vec::new());
        for node in 0..rest_m.len() {
            around.clear();
            around.extend(incidence.of(node));
            around.sort_by_key(|element| self.tissue[*element]);
            for alike in around.chunk_by(|a, b| self.tissue[*a] == self.tissue[*b]) {
                sums.clear();
                let (mut volume_m3, mut parameters_j) = (0.0, LameParameters::default());
                for &element in alike {
                    let (of_element_m3, gradients) = shapes[element];
                    let share_m3 = of_element_m3 / 4.0;
                    volume_m3 += share_m3;
                    let LameParameters { mu, lambda } = materials[element].parameters_j;
                    parameters_j.mu += mu / 4.0;
                    parameters_j.lambda += lambda / 4.0;
                    sums.extend(self.nodes[element].into_iter().zip(gradients.map(|b| share_m3 * b)));
                }
                sums.sort_by_key(|(node, _)| *node);
                let of_nodes = sums.chunk_by(|a, b| a.0 == b.0);
                let gradients =
                    of_nodes.map(|of| (of[0].0, of.iter().map(|(_, b)| *b).sum::<DVec3>() / volume_m3));
                let material = ElementMaterial { parameters_j, ..materials[alike[0]] };
                domains.push_of_node((node, volume_m3), gradients, DomainMaterial::of_node(material));
            }
        }
        for ((nodes, (_, gradients)), material) in self.nodes.iter().zip(shapes).zip(materials) {
            domains.push(nodes.iter().copied().zip(gradients), DomainMaterial::of_tetrahedron(material));
        }
        domains.find_incidence(rest_m.len());
        self.domains = domains;
        Ok(())
    }

    /// Material of the element at `index` of `volume_m3`. Its damping is that of a cube of which it is a sixth.
    fn material(&self, index: usize, volume_m3: f64) -> Result<ElementMaterial, BodyError> {
        let ScaledTissue { tissue, stiffness, damping } = self.tissues[self.tissue[index] as usize];
        let material = tissue.element_material(6.0 * volume_m3, 1.0 / 6.0)?;
        Ok(ElementMaterial {
            parameters_j: material.parameters_j.scaled(stiffness),
            viscous_js: material.viscous_js.scaled(damping),
            ..material
        })
    }

    /// Rotates the domains.
    pub(crate) fn turn(&mut self, rotation: DQuat) {
        self.domains.turn(rotation);
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

    /// Nodes of the element at `index`. The edges from the first one are right-handed at rest.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub fn get(&self, index: usize) -> [usize; 4] {
        self.nodes[index].map(|node| node as usize)
    }

    /// Nodes of all elements.
    pub fn iter(&self) -> impl Iterator<Item = [usize; 4]> + '_ {
        (0..self.len()).map(|index| self.get(index))
    }

    /// Smoothed domains by which the elements are evaluated.
    #[must_use]
    pub fn domains(&self) -> &SmoothedDomains {
        &self.domains
    }

    /// Indices of the inverted elements, with all nodes at `x_m`, m.
    pub(crate) fn inverted<'a>(&'a self, x_m: &'a [DVec3]) -> impl Iterator<Item = usize> + 'a {
        let volume = |index: usize| {
            let [o, a, b, c] = self.get(index).map(|node| x_m[node]);
            (a - o).dot((b - o).cross(c - o))
        };
        (0..self.len()).filter(move |&index| volume(index) <= 0.0)
    }
}
