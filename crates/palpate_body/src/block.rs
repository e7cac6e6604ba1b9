//! A block: a regular lattice of nodes in three dimensions, each joined to its 26 neighbours.

mod slit;

pub use slit::Slit;

use crate::error::{check_damping_ratio, check_positive};
use crate::lattice;
use crate::{BodyError, BodyPoint, Grid, Link, Network, NetworkBuilder, Region, Surface};
use glam::{DQuat, DVec3};
use palpate_laws::Spring;

/// A side of a block, named by the axis of its outward normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Face {
    /// The side towards −x.
    NegX,
    /// The side towards +x.
    PosX,
    /// The side towards −y.
    NegY,
    /// The side towards +y.
    PosY,
    /// The side towards −z.
    NegZ,
    /// The side towards +z.
    PosZ,
}

impl Face {
    /// All six faces.
    pub const ALL: [Self; 6] = [Self::NegX, Self::PosX, Self::NegY, Self::PosY, Self::NegZ, Self::PosZ];

    /// Axis of the normal: 0 for x, 1 for y, 2 for z.
    #[must_use]
    pub fn axis(self) -> usize {
        self as usize / 2
    }

    /// Whether the normal points in the positive direction of its axis.
    #[must_use]
    pub fn is_positive(self) -> bool {
        self as usize % 2 == 1
    }

    /// Outward unit normal.
    #[must_use]
    pub fn normal(self) -> DVec3 {
        if self.is_positive() { DVec3::AXES[self.axis()] } else { -DVec3::AXES[self.axis()] }
    }
}

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

impl BlockBody {
    /// Adds the grid of cells of `cell_m` with Young's modulus `modulus_pa`, Pa.
    pub(crate) fn laid_in(
        mut self,
        change: impl FnOnce(Grid) -> Grid,
        cell_m: DVec3,
        modulus_pa: f64,
    ) -> Self {
        let nodes = self.network.node_count();
        let grid = Grid::new(cell_m.element_product().cbrt(), vec![modulus_pa; nodes]);
        self.network = self.network.with_grid(change(grid));
        self
    }

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
        let built = self.build(vec![m; self.node_total()], |_, _| k, |k, _, _| ratio * (k * m).sqrt())?;
        // An isotropic network has E = Σ k ℓ²/(6 V) over the springs of a cell.
        let cell = self.cell_m();
        let squares: f64 = lattice::steps()
            .map(|step| (cell * DVec3::from_array(step.map(f64::from))).length_squared())
            .sum();
        let modulus = k * squares / (6.0 * cell.element_product());
        Ok(built.laid_in(Grid::of_equal_springs, self.cell_m(), modulus))
    }

    pub(crate) fn node_total(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Builds the lattice from the mass of every node, the stiffness of the spring at node (i, j, k) in the direction
    /// of a step, and the damping as a function of stiffness and the two masses.
    pub(crate) fn build(
        &self,
        mut mass_kg: Vec<f64>,
        stiffness: impl Fn([usize; 3], [i32; 3]) -> f64,
        damping: impl Fn(f64, f64, f64) -> f64,
    ) -> Result<BlockBody, BodyError> {
        let mut rest_m: Vec<DVec3> = self.grid().map(|ijk| self.rest(ijk)).collect();
        let mut links = Vec::with_capacity(13 * rest_m.len());
        for ijk in self.grid() {
            for step in lattice::steps() {
                let Some(other) = lattice::neighbour(self.nodes, ijk, step) else {
                    continue;
                };
                let (a, b) = (self.node(ijk), self.node(other));
                let k = stiffness(ijk, step);
                let c = damping(k, mass_kg[a], mass_kg[b]);
                let spring = Spring::linear(k, rest_m[a].distance(rest_m[b]), c)
                    .map_err(|source| BodyError::Law { link: links.len(), source })?;
                links.push(Link { a, b, spring });
            }
        }
        let is_fixed = |ijk: [usize; 3]| {
            self.fixed.iter().any(|&face| self.on_face(ijk, face))
                || self.fixed_within.iter().any(|region| region.contains(self.rest(ijk)))
        };
        let mut fixed: Vec<bool> = self.grid().map(is_fixed).collect();
        let mut surface = self.surface();
        let mut cells = self.cells();
        if let Some(slit) = self.slit {
            let (rest_m, mass_kg, fixed) = (&mut rest_m, &mut mass_kg, &mut fixed);
            slit::cut(
                slit,
                (self.nodes, self.cell_m()),
                &mut slit::Pieces {
                    rest_m,
                    mass_kg,
                    fixed,
                    links: &mut links,
                    cells: &mut cells,
                    surface: &mut surface,
                },
            )?;
        }
        let network = NetworkBuilder::of(rest_m, mass_kg, fixed, links).with_cells(cells);
        let network = if self.allow_free { network.allow_unconstrained() } else { network }.build()?;
        Ok(BlockBody { network, surface })
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

    /// Number of cells beside the node along `axis`: 1 at either end, else 2.
    pub(crate) fn cells_beside(&self, ijk: [usize; 3], axis: usize) -> u32 {
        if ijk[axis] == 0 || ijk[axis] + 1 == self.nodes[axis] { 1 } else { 2 }
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
