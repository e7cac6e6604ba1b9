//! A network of point masses with the springs, dampers and elements between them: a body without its state.

mod builder;
mod elements;
mod grid;
mod state;

pub use builder::NetworkBuilder;
pub use grid::Grid;
pub(crate) use state::NetworkState;

use crate::cells::{Cells, spring_energies_j};
use crate::error::check;
use crate::incidence::Incidence;
use crate::{BodyError, Hexahedra, Link, Tetrahedra};
use glam::{DQuat, DVec3};
use std::collections::HashMap;

/// Lists from which a network is assembled.
#[derive(Clone, Debug, Default)]
struct NetworkParts {
    rest_m: Vec<DVec3>,
    mass_kg: Vec<f64>,
    drag_ns_per_m: Vec<f64>,
    fixed: Vec<bool>,
    links: Vec<Link>,
    /// Nodes of each hexahedral cell of springs.
    cells: Vec<[usize; 8]>,
    hexahedra: Hexahedra,
    tetrahedra: Tetrahedra,
    allow_free: bool,
}

/// Nodes with masses and rest positions, some of them fixed, and the links and elements between them. Immutable once built.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    rest_m: Vec<DVec3>,
    mass_kg: Vec<f64>,
    /// Drag of each node; empty where no node has drag.
    drag_ns_per_m: Vec<f64>,
    fixed: Vec<bool>,
    links: Vec<Link>,
    free: Vec<usize>,
    free_index: Vec<Option<usize>>,
    /// Links of each node.
    incidence: Incidence,
    /// Nodes that share a link or an element with node i: `neighbour[neighbour_start[i]..neighbour_start[i + 1]]`.
    neighbour: Vec<u32>,
    neighbour_start: Vec<usize>,
    /// Pairs of nodes on the edges of elements.
    element_edges: Vec<[usize; 2]>,
    hexahedra: Hexahedra,
    tetrahedra: Tetrahedra,
    cells: Cells,
    allow_free: bool,
    linear: bool,
    grid: Option<Grid>,
}

impl Network {
    /// Creates a network of nodes at `rest_m` (m) with masses `mass_kg` (kg), fixed nodes `fixed` and `links`. Use
    /// [`NetworkBuilder`] for networks with unconstrained parts, or to build step by step.
    ///
    /// # Errors
    /// As [`NetworkBuilder::build`]; [`BodyError::Length`] if the lists differ in length.
    pub fn new(
        rest_m: Vec<DVec3>,
        mass_kg: Vec<f64>,
        fixed: Vec<bool>,
        links: Vec<Link>,
    ) -> Result<Self, BodyError> {
        Self::assemble(NetworkParts { rest_m, mass_kg, fixed, links, ..NetworkParts::default() })
    }

    fn assemble(parts: NetworkParts) -> Result<Self, BodyError> {
        let NetworkParts {
            rest_m,
            mass_kg,
            mut drag_ns_per_m,
            fixed,
            links,
            cells,
            mut hexahedra,
            mut tetrahedra,
            allow_free,
        } = parts;
        validate_nodes(&rest_m, &mass_kg, &fixed)?;
        validate_links(&links, &rest_m)?;
        if drag_ns_per_m.iter().all(|drag| *drag == 0.0) {
            drag_ns_per_m = Vec::new();
        }
        let free: Vec<usize> = (0..rest_m.len()).filter(|&i| !fixed[i]).collect();
        let mut free_index = vec![None; rest_m.len()];
        for (index, &node) in free.iter().enumerate() {
            free_index[node] = Some(index);
        }
        let incidence = Incidence::new(rest_m.len(), links.iter().map(|link| [link.a, link.b]));
        hexahedra.find_incidence(rest_m.len());
        tetrahedra.form_domains(&rest_m)?;
        let energies_j = spring_energies_j(&cells, &rest_m, &links, &incidence);
        let of_elements = hexahedra.iter().map(|of| of.nodes);
        let cells = Cells::new(cells.into_iter().zip(energies_j), of_elements, &rest_m);
        let mut network = Self {
            linear: links.iter().all(|link| link.spring.law().is_linear()),
            rest_m,
            mass_kg,
            drag_ns_per_m,
            fixed,
            links,
            free,
            free_index,
            incidence,
            neighbour: Vec::new(),
            neighbour_start: Vec::new(),
            element_edges: Vec::new(),
            hexahedra,
            tetrahedra,
            cells,
            allow_free,
            grid: None,
        };
        network.linear &= !network.has_elements();
        network.find_neighbours();
        network.element_edges = network.element_edges();
        if !allow_free {
            network.validate_parts()?;
        }
        Ok(network)
    }

    /// Rejects parts without a fixed node, and free nodes that are not connected to the first one.
    fn validate_parts(&self) -> Result<(), BodyError> {
        let mut part = vec![usize::MAX; self.node_count()];
        for &start in &self.free {
            if part[start] != usize::MAX {
                continue;
            }
            part[start] = start;
            let (mut front, mut nodes, mut held) = (vec![start], 1, false);
            while let Some(node) = front.pop() {
                held |= self.is_fixed(node);
                for other in self.neighbours(node) {
                    if part[other] == usize::MAX {
                        part[other] = start;
                        nodes += 1;
                        front.push(other);
                    }
                }
            }
            if !held {
                return Err(BodyError::Unconstrained { node: start, nodes });
            }
            if start != self.free[0] {
                return Err(BodyError::Disconnected { node: start, first: self.free[0] });
            }
        }
        Ok(())
    }

    /// Rotates the network by `rotation` about the origin and then translates it by `translation_m`, m.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if `rotation` is not a unit quaternion or `translation_m` is not finite.
    pub fn placed(mut self, rotation: DQuat, translation_m: DVec3) -> Result<Self, BodyError> {
        let length = rotation.length();
        check("length of the rotation", length, (length - 1.0).abs() < 1e-6, "1 within 1e-6")?;
        let far = translation_m.abs().max_element();
        check("translation, m", far, translation_m.is_finite(), "finite")?;
        self.rest_m.iter_mut().for_each(|x| *x = rotation * *x + translation_m);
        self.hexahedra.turn(rotation);
        self.tetrahedra.turn(rotation);
        self.grid = self.grid.map(|grid| grid.turned(rotation));
        Ok(self)
    }

    /// Adds the grid of cells, which has a modulus for each node.
    pub(crate) fn with_grid(mut self, grid: Grid) -> Self {
        debug_assert_eq!(grid.youngs_modulus_pa.len(), self.node_count(), "a modulus for each node");
        self.grid = Some(grid);
        self
    }

    /// The grid of cells, if the network has one.
    #[must_use]
    pub fn grid(&self) -> Option<&Grid> {
        self.grid.as_ref()
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.rest_m.len()
    }

    /// Rest position of every node, m.
    #[must_use]
    pub fn rest_m(&self) -> &[DVec3] {
        &self.rest_m
    }

    /// Mass of every node, kg.
    #[must_use]
    pub fn mass_kg(&self) -> &[f64] {
        &self.mass_kg
    }

    /// Drag of every node, N s/m: the force on it is this times its velocity relative to the world, opposed to it. Empty where no node has
    /// drag.
    #[must_use]
    pub fn drag_ns_per_m(&self) -> &[f64] {
        &self.drag_ns_per_m
    }

    /// Adds the drag on all nodes, N.
    pub(crate) fn add_drag(&self, v: &[DVec3], force: &mut [DVec3]) {
        for ((force, v), drag) in force.iter_mut().zip(v).zip(&self.drag_ns_per_m) {
            *force -= *drag * *v;
        }
    }

    /// Whether node `node` is fixed.
    #[must_use]
    pub fn is_fixed(&self, node: usize) -> bool {
        self.fixed[node]
    }

    /// Links.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Hexahedral elements.
    #[must_use]
    pub fn hexahedra(&self) -> &Hexahedra {
        &self.hexahedra
    }

    /// Pairs of nodes that a link joins, and those on the edges of elements.
    pub fn edges(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.links.iter().map(|link| [link.a, link.b]).chain(self.element_edges.iter().copied())
    }

    /// Tetrahedral elements.
    #[must_use]
    pub fn tetrahedra(&self) -> &Tetrahedra {
        &self.tetrahedra
    }

    /// Whether the force of every spring is proportional to its extension, and there are no elements.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        self.linear
    }

    /// Free nodes in ascending order.
    #[must_use]
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Index of node `node` in [`Network::free`]; `None` for a fixed node.
    #[must_use]
    pub fn free_index(&self, node: usize) -> Option<usize> {
        self.free_index[node]
    }

    /// Nodes of each hexahedral cell, of springs with volume barriers or of an element. Corner c of a cell lies towards +x if bit 0 of c is set,
    /// +y with bit 1, +z with bit 2, before the network is placed. Blocks and cell lattices have cells; other
    /// networks have none.
    #[must_use]
    pub fn cells(&self) -> &[[usize; 8]] {
        self.cells.nodes()
    }

    pub(crate) fn barriers(&self) -> &Cells {
        &self.cells
    }

    /// Indices of the links that end at node `node`.
    #[must_use]
    pub fn incident_links(&self, node: usize) -> &[usize] {
        self.incidence.of(node)
    }

    /// Nodes that share a link or an element with `node`.
    pub fn neighbours(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        self.neighbour[self.neighbour_range(node)].iter().map(|other| *other as usize)
    }

    /// Lists the nodes that share a link or an element with each node: first the linked ones in the order of the links.
    fn find_neighbours(&mut self) {
        let (mut neighbour, mut start) = (Vec::with_capacity(2 * self.links.len()), vec![0]);
        for node in 0..self.node_count() {
            let first = neighbour.len();
            for &link in self.incidence.of(node) {
                let Link { a, b, .. } = self.links[link];
                neighbour.push(if a == node { b } else { a } as u32);
            }
            let linked = neighbour.len();
            let mut mates: Vec<u32> = self.element_mates(node).map(|other| other as u32).collect();
            mates.sort_unstable();
            mates.dedup();
            mates.retain(|other| *other as usize != node && !neighbour[first..linked].contains(other));
            neighbour.extend(mates);
            start.push(neighbour.len());
        }
        (self.neighbour, self.neighbour_start) = (neighbour, start);
    }

    /// Number of nodes that share a link or an element with `node`.
    #[must_use]
    pub fn neighbour_count(&self, node: usize) -> usize {
        self.neighbour_range(node).len()
    }

    /// Range of the neighbours of `node` in a list of those of all nodes.
    pub(crate) fn neighbour_range(&self, node: usize) -> std::ops::Range<usize> {
        self.neighbour_start[node]..self.neighbour_start[node + 1]
    }
}

fn validate_nodes(rest_m: &[DVec3], mass_kg: &[f64], fixed: &[bool]) -> Result<(), BodyError> {
    let nodes = rest_m.len();
    if nodes == 0 {
        return Err(BodyError::NoNodes);
    }
    for (what, found) in [("the list of masses", mass_kg.len()), ("the list of fixed nodes", fixed.len())] {
        if found != nodes {
            return Err(BodyError::Length { what, found, nodes });
        }
    }
    if let Some(node) = rest_m.iter().position(|x| !x.is_finite()) {
        return Err(BodyError::Position { node });
    }
    if let Some(node) = mass_kg.iter().position(|m| !(m.is_finite() && *m > 0.0)) {
        return Err(BodyError::Mass { node, mass_kg: mass_kg[node] });
    }
    if fixed.iter().all(|&f| f) {
        return Err(BodyError::AllFixed(nodes));
    }
    Ok(())
}

fn validate_links(links: &[Link], rest_m: &[DVec3]) -> Result<(), BodyError> {
    let nodes = rest_m.len();
    let mut seen = HashMap::with_capacity(links.len());
    for (link, &Link { a, b, .. }) in links.iter().enumerate() {
        if let Some(node) = [a, b].into_iter().find(|&node| node >= nodes) {
            return Err(BodyError::NodeOutOfRange { link, node, nodes });
        }
        if a == b {
            return Err(BodyError::SelfLink { link, node: a });
        }
        if rest_m[a] == rest_m[b] {
            return Err(BodyError::ZeroLength { link, a, b });
        }
        if let Some(earlier) = seen.insert((a.min(b), a.max(b)), link) {
            return Err(BodyError::DuplicateLink { link, earlier, a, b });
        }
    }
    Ok(())
}
