//! A block: a regular lattice of nodes in three dimensions, each joined to its 26 neighbours.

mod elements;
mod slit;
mod tissue;

pub use elements::cell_tetrahedra;

pub use slit::Slit;

use crate::error::{check_damping_ratio, check_positive};
use crate::lattice;
use crate::{BodyError, BodyPoint, Face, Grid, Link, Network, NetworkBuilder, Region, Surface, Tissue};
use glam::{DQuat, DVec3};
use palpate_laws::Spring;
use slit::LipShares;

/// Geometry of a block lattice. [`Block::uniform`] or [`Block::tissue`](Self::tissue) gives it a material.
///
/// Node (i, j, k) has index i + nx (j + ny k) and lies at centre − size/2 + (i, j, k) · cell.
#[derive(Clone, Debug)]
pub struct Block {
    nodes: [usize; 3],
    size_m: DVec3,
    center_m: DVec3,
    fixed: Vec<Face>,
    fixed_within: Vec<Region>,
    allow_free: bool,
    slit: Option<Slit>,
    regions: Vec<(Region, Tissue)>,
}

/// A block with its material.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockBody {
    /// Nodes, masses and springs.
    pub network: Network,
    /// Surface of the six faces.
    pub surface: Surface,
}

/// Material with equal node masses and equal spring stiffnesses, as in the seed paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformLattice {
    /// Stiffness k of every spring, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping ratio: every damper is this times √(k m), with the mass m of one node.
    pub damping_ratio: f64,
    /// Mass of the block, distributed equally over its nodes, kg.
    pub mass_kg: f64,
}

/// Material of the nodes and springs of a block.
pub(crate) struct LatticeMaterial<'a> {
    /// Mass of every node, kg.
    pub(crate) mass_kg: Vec<f64>,
    /// Coefficient of the drag on every node, N s/m.
    pub(crate) drag_ns_per_m: Vec<f64>,
    /// Young's modulus at every node, Pa.
    pub(crate) youngs_modulus_pa: Vec<f64>,
    /// Stiffness, N/m, and damping, N s/m, of the spring from node (i, j, k) in the direction of a step, for the masses of its ends, kg.
    pub(crate) spring: &'a dyn Fn([usize; 3], [i32; 3], (f64, f64)) -> (f64, f64),
    /// Shares of what lies in the plane of a slit.
    pub(crate) lips: LipShares<'a>,
}

impl BlockBody {
    /// Rotates the block by `rotation` about the origin and then translates it by `translation_m`, m.
    ///
    /// # Errors
    /// As [`Network::placed`].
    pub fn placed(mut self, rotation: DQuat, translation_m: DVec3) -> Result<Self, BodyError> {
        self.network = self.network.placed(rotation, translation_m)?;
        Ok(self)
    }
}

impl Block {
    /// Maximum number of nodes along one side.
    pub const MAX_NODES_PER_SIDE: usize = crate::limits::MAX_NODES_PER_SIDE;

    /// Creates a block of `nodes` nodes along x, y, z and of outer size `size_m`, centred on the origin, without
    /// fixed nodes.
    ///
    /// # Errors
    /// [`BodyError::LatticeNodes`] for fewer than two nodes along an axis or more than [`Block::MAX_NODES_PER_SIDE`];
    /// [`BodyError::Parameter`] for a size that is not finite or not above zero.
    pub fn new(nodes: [usize; 3], size_m: DVec3) -> Result<Self, BodyError> {
        if nodes.iter().any(|n| !(2..=Self::MAX_NODES_PER_SIDE).contains(n)) {
            return Err(BodyError::LatticeNodes { nodes });
        }
        for axis in 0..3 {
            check_positive(["size along x, m", "size along y, m", "size along z, m"][axis], size_m[axis])?;
        }
        Ok(Self {
            nodes,
            size_m,
            center_m: DVec3::ZERO,
            fixed: Vec::new(),
            fixed_within: Vec::new(),
            allow_free: false,
            slit: None,
            regions: Vec::new(),
        })
    }

    /// Centres the block on `center_m`, m.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] if a coordinate is not finite.
    pub fn centered_at(mut self, center_m: DVec3) -> Result<Self, BodyError> {
        for axis in 0..3 {
            let what = ["centre x, m", "centre y, m", "centre z, m"][axis];
            crate::error::check(what, center_m[axis], center_m[axis].is_finite(), "finite")?;
        }
        self.center_m = center_m;
        Ok(self)
    }

    /// Fixes all nodes of `face`.
    #[must_use]
    pub fn fix(mut self, face: Face) -> Self {
        if !self.fixed.contains(&face) {
            self.fixed.push(face);
        }
        self
    }

    /// Fixes the nodes in `region`.
    #[must_use]
    pub fn fix_within(mut self, region: Region) -> Self {
        self.fixed_within.push(region);
        self
    }

    /// Allows a block without fixed nodes.
    #[must_use]
    pub fn allow_unconstrained(mut self) -> Self {
        self.allow_free = true;
        self
    }

    /// Cuts a slit into the block. An invalid slit is reported when the block gets its material.
    #[must_use]
    pub fn slit(mut self, slit: Slit) -> Self {
        self.slit = Some(slit);
        self
    }

    /// Fills `region` with `tissue`; later regions override earlier ones. A cell takes the mean over 4 × 4 × 4 places in it.
    /// [`Block::tissue`](Self::tissue) uses the regions; [`Block::uniform`] has none.
    #[must_use]
    pub fn region(mut self, region: Region, tissue: Tissue) -> Self {
        self.regions.push((region, tissue));
        self
    }

    /// Number of nodes along x, y, z.
    #[must_use]
    pub fn nodes(&self) -> [usize; 3] {
        self.nodes
    }

    /// Size of a cell, m.
    #[must_use]
    pub fn cell_m(&self) -> DVec3 {
        self.size_m / DVec3::from_array(self.nodes.map(|n| (n - 1) as f64))
    }

    /// Index of node (i, j, k).
    ///
    /// # Panics
    /// In debug builds, if an index is not below the number of nodes along its axis.
    #[must_use]
    pub fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        debug_assert!(i < self.nodes[0] && j < self.nodes[1] && k < self.nodes[2], "node out of the lattice");
        i + self.nodes[0] * (j + self.nodes[1] * k)
    }

    /// Creates the block with equal springs and equal masses.
    ///
    /// # Errors
    /// [`BodyError`] if a parameter is invalid, all nodes are fixed or, without [`Block::allow_unconstrained`], none
    /// is.
    pub fn uniform(&self, lattice: &UniformLattice) -> Result<BlockBody, BodyError> {
        let k = check_positive("spring stiffness, N/m", lattice.stiffness_n_per_m)?;
        let mass = check_positive("mass of the block, kg", lattice.mass_kg)?;
        let ratio = check_damping_ratio(lattice.damping_ratio)?;
        let m = mass / self.node_total() as f64;
        // An isotropic network has E = Σ k ℓ²/(6 V) over the springs of a cell.
        let cell = self.cell_m();
        let squares: f64 = lattice::steps()
            .map(|step| (cell * DVec3::from_array(step.map(f64::from))).length_squared())
            .sum();
        let modulus = k * squares / (6.0 * cell.element_product());
        let material = LatticeMaterial {
            mass_kg: vec![m; self.node_total()],
            drag_ns_per_m: vec![0.0; self.node_total()],
            youngs_modulus_pa: vec![modulus; self.node_total()],
            spring: &|_, _, _| (k, ratio * (k * m).sqrt()),
            lips: LipShares::HALVES,
        };
        self.build(material, Grid::of_equal_springs)
    }

    pub(crate) fn node_total(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Builds the lattice, whose grid is changed by `change`.
    pub(crate) fn build(
        &self,
        material: LatticeMaterial<'_>,
        change: impl FnOnce(Grid) -> Grid,
    ) -> Result<BlockBody, BodyError> {
        let LatticeMaterial { mut mass_kg, mut drag_ns_per_m, mut youngs_modulus_pa, spring, lips } =
            material;
        let mut rest_m: Vec<DVec3> = self.grid().map(|ijk| self.rest(ijk)).collect();
        let mut links = Vec::with_capacity(13 * rest_m.len());
        for ijk in self.grid() {
            for step in lattice::steps() {
                let Some(other) = lattice::neighbour(self.nodes, ijk, step) else {
                    continue;
                };
                let (a, b) = (self.node(ijk), self.node(other));
                let (k, c) = spring(ijk, step, (mass_kg[a], mass_kg[b]));
                let spring = Spring::linear(k, rest_m[a].distance(rest_m[b]), c)
                    .map_err(|source| BodyError::Law { link: links.len(), source })?;
                links.push(Link { a, b, spring });
            }
        }
        let mut fixed = self.fixed_nodes();
        let mut surface = self.surface();
        let mut cells = self.cells();
        if let Some(slit) = self.slit {
            let (rest_m, mass_kg, fixed) = (&mut rest_m, &mut mass_kg, &mut fixed);
            let (drag_ns_per_m, youngs_modulus_pa) = (&mut drag_ns_per_m, &mut youngs_modulus_pa);
            slit::cut(
                slit,
                (self.nodes, self.cell_m()),
                &mut slit::Pieces {
                    rest_m,
                    mass_kg,
                    drag_ns_per_m,
                    youngs_modulus_pa,
                    lips,
                    fixed,
                    links: &mut links,
                    cells: &mut cells,
                    surface: &mut surface,
                },
            )?;
        }
        let network = NetworkBuilder::of(rest_m, mass_kg, fixed, links);
        let network = network.with_drag(drag_ns_per_m).with_cells(cells);
        let network = if self.allow_free { network.allow_unconstrained() } else { network }.build()?;
        let grid = Grid::new(self.cell_m().element_product().cbrt(), youngs_modulus_pa);
        Ok(BlockBody { network: network.with_grid(change(grid)), surface })
    }

    /// Whether each node is fixed.
    fn fixed_nodes(&self) -> Vec<bool> {
        let is_fixed = |ijk: [usize; 3]| {
            self.fixed.iter().any(|&face| self.on_face(ijk, face))
                || self.fixed_within.iter().any(|region| region.contains(self.rest(ijk)))
        };
        self.grid().map(is_fixed).collect()
    }

    /// All (i, j, k), in the order of their indices.
    pub(crate) fn grid(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        lattice::grid(self.nodes)
    }

    /// Nodes of all cells, in the order of their lowest corners.
    fn cells(&self) -> Vec<[usize; 8]> {
        let corner =
            |[i, j, k]: [usize; 3], c: usize| self.node([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]);
        let lowest = lattice::grid(self.nodes.map(|n| n - 1));
        lowest.map(|ijk| std::array::from_fn(|c| corner(ijk, c))).collect()
    }

    fn rest(&self, ijk: [usize; 3]) -> DVec3 {
        let cell = self.cell_m();
        self.center_m - 0.5 * self.size_m + cell * DVec3::from_array(ijk.map(|n| n as f64))
    }

    fn on_face(&self, ijk: [usize; 3], face: Face) -> bool {
        let axis = face.axis();
        ijk[axis] == if face.is_positive() { self.nodes[axis] - 1 } else { 0 }
    }

    fn surface(&self) -> Surface {
        let mut surface = Surface::default();
        for face in Face::ALL {
            self.add_face(face, &mut surface);
        }
        surface
    }

    fn add_face(&self, face: Face, surface: &mut Surface) {
        let axis = face.axis();
        // (u, v, normal) is right-handed for a positive face; the winding is reversed for a negative one.
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let first = surface.vertices.len();
        let mut point_of: std::collections::HashMap<usize, usize> =
            surface.points.iter().enumerate().map(|(point, at)| (at.nodes()[0].0, point)).collect();
        for q in 0..self.nodes[v] {
            for p in 0..self.nodes[u] {
                let mut ijk = [0; 3];
                ijk[u] = p;
                ijk[v] = q;
                ijk[axis] = if face.is_positive() { self.nodes[axis] - 1 } else { 0 };
                let node = self.node(ijk);
                let point = *point_of.entry(node).or_insert_with(|| {
                    surface.points.push(BodyPoint::node(node));
                    surface.points.len() - 1
                });
                surface.vertices.push(point);
            }
        }
        let at = |p: usize, q: usize| first + p + self.nodes[u] * q;
        for q in 0..self.nodes[v] - 1 {
            for p in 0..self.nodes[u] - 1 {
                let (a, b, c, d) = (at(p, q), at(p + 1, q), at(p + 1, q + 1), at(p, q + 1));
                for [i, j, k] in [[a, b, c], [a, c, d]] {
                    surface.triangles.push(if face.is_positive() { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
