//! Builder of networks.

use super::{Grid, Network, NetworkParts};
use crate::cell_tissue::CellTissue;
use crate::error::{check, check_positive};
use crate::tetrahedra::shape;
use crate::{BodyError, Link, Tissue};
use glam::DVec3;
use palpate_laws::{ForceLaw, HexahedronShape, Spring};

/// A network under construction: nodes, springs, elements, fixed nodes and regions of different material.
///
/// [`NetworkBuilder::build`] reports the first error of all steps.
///
/// ```
/// use glam::DVec3;
/// use palpate_body::NetworkBuilder;
/// use palpate_laws::ForceLaw;
///
/// # fn main() -> Result<(), palpate_body::BodyError> {
/// // Two masses on a hook; the lower spring is twice as stiff.
/// let mut network = NetworkBuilder::new();
/// let nodes = [0.0, -0.1, -0.2].map(|z| network.node(DVec3::Z * z, 0.01));
/// network.spring(nodes[0], nodes[1], ForceLaw::Linear { stiffness_n_per_m: 50.0 }, 0.1);
/// network.spring(nodes[1], nodes[2], ForceLaw::Linear { stiffness_n_per_m: 50.0 }, 0.1);
/// let network = network.fix([nodes[0]]).region(|x| x.z < -0.12, 2.0, 1.0, 1.0).build()?;
/// assert_eq!(network.free(), [1, 2]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct NetworkBuilder {
    parts: NetworkParts,
    /// Grid of an edited network, valid while the number of nodes is unchanged.
    grid: Option<Grid>,
    error: Option<BodyError>,
}

impl Network {
    /// Converts the network back to a builder.
    #[must_use]
    pub fn edit(self) -> NetworkBuilder {
        // Cells of springs come first.
        let cells = self.cells()[..self.cells.with_barriers()].to_vec();
        let Self { rest_m, mass_kg, mut drag_ns_per_m, fixed, links, .. } = self;
        let Self { hexahedra, tetrahedra, allow_free, grid, .. } = self;
        drag_ns_per_m.resize(rest_m.len(), 0.0);
        let parts = NetworkParts {
            rest_m,
            mass_kg,
            drag_ns_per_m,
            fixed,
            links,
            cells,
            hexahedra,
            tetrahedra,
            allow_free,
        };
        NetworkBuilder { parts, grid, error: None }
    }
}

impl NetworkBuilder {
    /// Creates an empty network.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates the builder from the lists of [`Network::new`].
    pub(crate) fn of(rest_m: Vec<DVec3>, mass_kg: Vec<f64>, fixed: Vec<bool>, links: Vec<Link>) -> Self {
        let drag_ns_per_m = vec![0.0; rest_m.len()];
        let parts = NetworkParts { rest_m, mass_kg, drag_ns_per_m, fixed, links, ..NetworkParts::default() };
        Self { parts, ..Self::default() }
    }

    /// Sets the drag of every node, N s/m.
    pub(crate) fn with_drag(mut self, drag_ns_per_m: Vec<f64>) -> Self {
        self.parts.drag_ns_per_m = drag_ns_per_m;
        self
    }

    /// Adds hexahedral cells of springs between the nodes.
    pub(crate) fn with_cells(mut self, cells: Vec<[usize; 8]>) -> Self {
        self.parts.cells = cells;
        self
    }

    /// Adds a free node at `rest_m` (m) of mass `mass_kg`, and returns its index.
    pub fn node(&mut self, rest_m: DVec3, mass_kg: f64) -> usize {
        self.parts.rest_m.push(rest_m);
        self.parts.mass_kg.push(mass_kg);
        self.parts.drag_ns_per_m.push(0.0);
        self.parts.fixed.push(false);
        self.parts.rest_m.len() - 1
    }

    /// Adds a drag of `ns_per_m` on `node`: the force on it is this times its velocity relative to the world, opposed to it.
    pub fn drag(&mut self, node: usize, ns_per_m: f64) {
        let is_valid = ns_per_m.is_finite() && ns_per_m >= 0.0;
        let checked = check("drag of a node, N s/m", ns_per_m, is_valid, "finite and at least 0");
        let nodes = self.parts.rest_m.len();
        match (checked, self.parts.drag_ns_per_m.get_mut(node)) {
            (Ok(_), Some(drag)) => *drag += ns_per_m,
            (Ok(_), None) => drop(self.refuse(BodyError::Fixed { node, nodes })),
            (Err(error), _) => drop(self.refuse(error)),
        }
    }

    /// Adds a spring of law `law` between nodes `a` and `b`, at rest in their positions, with a parallel damper of
    /// `damping_ns_per_m`. Returns its index.
    pub fn spring(&mut self, a: usize, b: usize, law: ForceLaw, damping_ns_per_m: f64) -> usize {
        let (link, nodes) = (self.parts.links.len(), self.parts.rest_m.len());
        let (Some(&x_a), Some(&x_b)) = (self.parts.rest_m.get(a), self.parts.rest_m.get(b)) else {
            let node = if a < nodes { b } else { a };
            return self.refuse(BodyError::NodeOutOfRange { link, node, nodes });
        };
        if a == b {
            return self.refuse(BodyError::SelfLink { link, node: a });
        }
        if x_a == x_b {
            return self.refuse(BodyError::ZeroLength { link, a, b });
        }
        match Spring::new(law, x_a.distance(x_b), damping_ns_per_m) {
            Ok(spring) => self.link(Link { a, b, spring }),
            Err(source) => self.refuse(BodyError::Law { link, source }),
        }
    }

    /// Adds an eight-node hexahedron of `tissue` between `nodes`, of which the share `fill` is filled, and returns its index. Its mass is
    /// distributed equally over its nodes and added to theirs, which may be 0 before. Corner c lies towards +x where bit 0 of c is set, +y with
    /// bit 1, +z with bit 2.
    pub fn hexahedron(&mut self, nodes: [usize; 8], tissue: &Tissue, fill: f64) -> usize {
        let element = self.parts.hexahedra.len();
        match tissue.validate() {
            Ok(()) => self.cell(nodes, &CellTissue::of(tissue), fill),
            Err(error) => drop(self.refuse(error)),
        }
        element
    }

    /// [`NetworkBuilder::hexahedron`] of a mixed tissue.
    pub(crate) fn cell(&mut self, nodes: [usize; 8], tissue: &CellTissue, fill: f64) {
        if let Err(error) = self.add_cell(nodes, tissue, fill) {
            self.refuse(error);
        }
    }

    fn add_cell(&mut self, nodes: [usize; 8], tissue: &CellTissue, fill: f64) -> Result<(), BodyError> {
        check("filled share of an element", fill, fill > 0.0 && fill.is_finite(), "finite and above 0")?;
        let element = self.parts.hexahedra.len();
        let mut corners = [DVec3::ZERO; 8];
        for (to, node) in corners.iter_mut().zip(nodes) {
            let count = self.parts.rest_m.len();
            *to =
                *self.parts.rest_m.get(node).ok_or(BodyError::ElementNode { element, node, nodes: count })?;
        }
        let shape = HexahedronShape::new(&corners).ok_or(BodyError::ElementShape { element })?;
        let volume_m3 = shape.volume_m3();
        let eighth_kg = tissue.density_kg_per_m3 * fill * volume_m3 / 8.0;
        for node in nodes {
            self.parts.mass_kg[node] += eighth_kg;
            self.parts.drag_ns_per_m[node] += tissue.drag_ns_per_m(eighth_kg);
        }
        self.parts.hexahedra.push(nodes, &shape, tissue.element_material(volume_m3, fill)?, fill);
        Ok(())
    }

    /// Adds four-node tetrahedra of `tissue` between nodes, and returns the index of the first. The edges from the first node of each must be
    /// right-handed. Their mass is distributed equally over their nodes and added to theirs, which may be 0 before. The deformation of adjacent
    /// elements of equal tissue is averaged; see [`palpate_laws::DomainMaterial`].
    pub fn tetrahedra(&mut self, elements: &[[usize; 4]], tissue: &Tissue) -> usize {
        let first = self.parts.tetrahedra.len();
        match tissue.validate() {
            Ok(()) => self.tetrahedral_cell(elements, &CellTissue::of(tissue)),
            Err(error) => drop(self.refuse(error)),
        }
        first
    }

    /// [`NetworkBuilder::tetrahedra`] of a mixed tissue.
    pub(crate) fn tetrahedral_cell(&mut self, elements: &[[usize; 4]], tissue: &CellTissue) {
        if let Err(error) = elements.iter().try_for_each(|nodes| self.add_tetrahedron(*nodes, tissue)) {
            self.refuse(error);
        }
    }

    fn add_tetrahedron(&mut self, nodes: [usize; 4], tissue: &CellTissue) -> Result<(), BodyError> {
        let (element, count) = (self.parts.tetrahedra.len(), self.parts.rest_m.len());
        let mut corners = [DVec3::ZERO; 4];
        for (to, node) in corners.iter_mut().zip(nodes) {
            *to =
                *self.parts.rest_m.get(node).ok_or(BodyError::ElementNode { element, node, nodes: count })?;
        }
        let (volume_m3, _) = shape(corners).ok_or(BodyError::ElementShape { element })?;
        let quarter_kg = tissue.density_kg_per_m3 * volume_m3 / 4.0;
        for node in nodes {
            self.parts.mass_kg[node] += quarter_kg;
            self.parts.drag_ns_per_m[node] += tissue.drag_ns_per_m(quarter_kg);
        }
        self.parts.tetrahedra.push(nodes, tissue);
        Ok(())
    }

    /// Adds a link and returns its index. Its spring need not be at rest.
    pub fn link(&mut self, link: Link) -> usize {
        self.parts.links.push(link);
        self.parts.links.len() - 1
    }

    /// Fixes nodes.
    #[must_use]
    pub fn fix(mut self, nodes: impl IntoIterator<Item = usize>) -> Self {
        for node in nodes {
            match self.parts.fixed.get_mut(node) {
                Some(fixed) => *fixed = true,
                None => {
                    let below = self.parts.rest_m.len();
                    self.refuse(BodyError::Fixed { node, nodes: below });
                }
            }
        }
        self
    }

    /// Fixes the nodes whose rest position (m) satisfies `where_at`.
    #[must_use]
    pub fn fix_where(self, where_at: impl Fn(DVec3) -> bool) -> Self {
        let nodes: Vec<usize> =
            (0..self.parts.rest_m.len()).filter(|&node| where_at(self.parts.rest_m[node])).collect();
        self.fix(nodes)
    }

    /// Scales the material of a region: springs and elements with their midpoint at rest (m) `inside` get `stiffness` times their
    /// force and `damping` times their damping, and nodes inside get `mass` times their mass and `damping` times their drag.
    #[must_use]
    pub fn region(mut self, inside: impl Fn(DVec3) -> bool, stiffness: f64, damping: f64, mass: f64) -> Self {
        let checked = check_positive("stiffness of a region, as a factor", stiffness)
            .and(check_positive("mass of a region, as a factor", mass))
            .and(check(
                "damping of a region, as a factor",
                damping,
                damping.is_finite() && damping >= 0.0,
                "finite and at least 0",
            ));
        if let Err(error) = checked {
            self.refuse(error);
            return self;
        }
        for link in 0..self.parts.links.len() {
            let Link { a, b, spring } = self.parts.links[link];
            let (Some(x_a), Some(x_b)) = (self.parts.rest_m.get(a), self.parts.rest_m.get(b)) else {
                continue;
            };
            if inside(0.5 * (*x_a + *x_b)) {
                match spring.scaled(stiffness, damping) {
                    Ok(spring) => self.parts.links[link].spring = spring,
                    Err(source) => {
                        self.refuse(BodyError::Law { link, source });
                    }
                }
            }
        }
        for index in 0..self.parts.hexahedra.len() {
            let corners = self.parts.hexahedra.get(index).nodes.map(|node| self.parts.rest_m[node]);
            if inside(corners.iter().sum::<DVec3>() / 8.0) {
                self.parts.hexahedra.scale(index, stiffness, damping);
            }
        }
        for index in 0..self.parts.tetrahedra.len() {
            let corners = self.parts.tetrahedra.get(index).map(|node| self.parts.rest_m[node]);
            if inside(corners.iter().sum::<DVec3>() / 4.0) {
                self.parts.tetrahedra.scale(index, stiffness, damping);
            }
        }
        for ((m, drag), x) in
            self.parts.mass_kg.iter_mut().zip(&mut self.parts.drag_ns_per_m).zip(&self.parts.rest_m)
        {
            if inside(*x) {
                *m *= mass;
                *drag *= damping;
            }
        }
        if let Some(grid) = &mut self.grid {
            for (modulus, x) in grid.youngs_modulus_pa.iter_mut().zip(&self.parts.rest_m) {
                if inside(*x) {
                    *modulus *= stiffness;
                }
            }
        }
        self
    }

    /// Replaces the law of every spring, but not of elements, with its midpoint at rest (m) `inside` by `law` of its present law.
    #[must_use]
    pub fn law_where(mut self, inside: impl Fn(DVec3) -> bool, law: impl Fn(ForceLaw) -> ForceLaw) -> Self {
        for link in 0..self.parts.links.len() {
            let Link { a, b, spring } = self.parts.links[link];
            let (Some(x_a), Some(x_b)) = (self.parts.rest_m.get(a), self.parts.rest_m.get(b)) else {
                continue;
            };
            if inside(0.5 * (*x_a + *x_b)) {
                match Spring::new(law(spring.law()), spring.rest_length_m(), spring.damping_ns_per_m()) {
                    Ok(spring) => self.parts.links[link].spring = spring,
                    Err(source) => {
                        self.refuse(BodyError::Law { link, source });
                    }
                }
            }
        }
        self
    }

    /// Allows parts without fixed nodes, and separate parts.
    #[must_use]
    pub fn allow_unconstrained(mut self) -> Self {
        self.parts.allow_free = true;
        self
    }

    /// Builds the network.
    ///
    /// # Errors
    /// [`BodyError`] with the index: the first invalid step; no node, or no free one; a position that is not finite;
    /// a mass not above zero; a link that refers to a missing node, joins a node to itself, joins nodes at the same
    /// position or repeats another; without [`NetworkBuilder::allow_unconstrained`] also a part without a fixed node
    /// or separate parts.
    pub fn build(mut self) -> Result<Network, BodyError> {
        match self.error.take() {
            Some(error) => Err(error),
            None => {
                let nodes = self.parts.rest_m.len();
                let grid = self.grid.take().filter(|grid| grid.youngs_modulus_pa.len() == nodes);
                let network = Network::assemble(self.parts)?;
                Ok(match grid {
                    Some(grid) => network.with_grid(grid),
                    None => network,
                })
            }
        }
    }

    /// Stores the first error, and returns the index of the element that was not added.
    fn refuse(&mut self, error: BodyError) -> usize {
        self.error.get_or_insert(error);
        self.parts.links.len()
    }
}
