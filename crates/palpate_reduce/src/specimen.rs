//! The specimen of the seed paper (its sections 4 and 5) and its local models.

use crate::{ReduceError, SecondOrderSystem, block_scaling};
use palpate_body::{Body, BodyError, Lattice, Link, Network, Surface};
use palpate_laws::Spring;
use std::collections::HashMap;

/// A regular lattice of `cells` cells along each of 1 to 3 dimensions, fixed on all sides but the top. It is driven at the node in the
/// middle of the top, or for an odd number of cells the node before the middle.
///
/// In one dimension it is a chain of `cells` springs between the tool and a wall (section 5.1), in two the mesh of section 4. The last
/// axis is normal to the top and the others are tangential. All springs are equal, and so are all dampers and masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Specimen {
    /// Number of dimensions, 1, 2 or 3.
    pub dimension: usize,
    /// Number of cells along each dimension, at least 2.
    pub cells: usize,
    /// Stiffness of each spring, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping of each damper, N s/m.
    pub damping_ns_per_m: f64,
    /// Mass of each node, kg.
    pub mass_kg: f64,
}

/// Width of every specimen, m. The stiffness of a lattice at rest does not depend on it.
const WIDTH_M: f64 = 0.1;

impl Specimen {
    /// The lattice of the specimen.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when the dimension is not 1 to 3 or there are fewer than 2 cells; [`ReduceError::Body`]
    /// when there are too many.
    pub fn lattice(&self) -> Result<Lattice, ReduceError> {
        let Self { dimension, cells, .. } = *self;
        let reject =
            |what, value: usize, allowed| Err(ReduceError::Option { what, value: value as f64, allowed });
        if !(1..=3).contains(&dimension) {
            return reject("dimension of the specimen", dimension, "1, 2 or 3");
        }
        if cells < 2 {
            return reject("cells of the specimen", cells, "at least 2");
        }
        let mut nodes = [1; 3];
        nodes[..dimension].fill(cells.saturating_add(1));
        Ok(Lattice::new(nodes, WIDTH_M / cells as f64)?)
    }

    /// Indices (i, j, k) of the driven node.
    ///
    /// # Errors
    /// As [`Specimen::lattice`].
    pub fn driven(&self) -> Result<[usize; 3], ReduceError> {
        self.lattice()?;
        let mut driven = [0; 3];
        driven[..self.dimension].fill(self.cells / 2);
        driven[self.dimension - 1] = self.cells;
        Ok(driven)
    }

    /// The network of the specimen.
    ///
    /// # Errors
    /// As [`Specimen::lattice`]; [`ReduceError::Body`] when a parameter is out of range.
    pub fn network(&self) -> Result<Network, ReduceError> {
        let Self { stiffness_n_per_m: k, damping_ns_per_m: b, mass_kg: m, .. } = *self;
        Ok(self.lattice()?.uniform(k, b, m, |ijk| self.is_held(ijk))?)
    }

    /// The small motions of the specimen as a linear system.
    ///
    /// # Errors
    /// As [`Specimen::network`].
    pub fn system(&self) -> Result<SecondOrderSystem, ReduceError> {
        self.system_of(self.network()?)
    }

    /// The local model of the seed paper's Fig. 8 (Fig. 13 in one dimension): see [`SecondOrderSystem::neighbourhood`].
    ///
    /// # Errors
    /// As [`Specimen::network`]; [`ReduceError::Option`] when `rings` is zero.
    pub fn neighbourhood(&self, rings: usize) -> Result<SecondOrderSystem, ReduceError> {
        let network = self.network()?;
        self.system_of(network.clone())?.neighbourhood(&network, rings)
    }

    /// The scaled local model of the seed paper's Fig. 10 (Fig. 14 in one dimension): the nodes within `rings` of the driven one, and outer
    /// springs that represent the part of the specimen beyond them.
    ///
    /// * Springs and dampers between the nodes of the model are those of the specimen.
    /// * An outer spring leads towards an end of the specimen n cells away; for a diagonal it is the nearer end. Its stiffness and damping
    ///   are scaled by [`block_scaling`]`(dimension, n)`, or by the square root of that in the top.
    /// * The mass of a node with outer springs is scaled by (1 + n̄)/2, n̄ the mean over these springs. In one dimension, either
    ///   neighbour gets half of the n − 1 omitted masses.
    ///
    /// The paper states the third rule in one dimension only (section 5.1), and otherwise "scaled according to their distance to the end
    /// of the specimen". The mean over the outer springs of a node is an interpretation.
    ///
    /// # Errors
    /// As [`Specimen::neighbourhood`] and [`block_scaling`].
    pub fn scaled(&self, rings: usize) -> Result<SecondOrderSystem, ReduceError> {
        if rings == 0 {
            return Err(ReduceError::Option { what: "rings of nodes", value: 0.0, allowed: "at least 1" });
        }
        let (lattice, network) = (self.lattice()?, self.network()?);
        let grid: Vec<[usize; 3]> = lattice.grid().collect();
        let driven = self.driven()?;
        let ring = |ijk: [usize; 3]| (0..3).map(|axis| ijk[axis].abs_diff(driven[axis])).max().unwrap_or(0);
        let moves: Vec<bool> = grid.iter().map(|&ijk| ring(ijk) <= rings && !self.is_held(ijk)).collect();
        let mut scaling = HashMap::new();
        // Number of outer springs of each node, and the sum of their n.
        let mut ends = vec![(0usize, 0usize); grid.len()];
        let mut links = Vec::new();
        for link in network.links() {
            let (from, to) = match (moves[link.a], moves[link.b]) {
                (false, false) => continue,
                (true, true) => {
                    links.push(*link);
                    continue;
                }
                (true, false) => (link.a, link.b),
                (false, true) => (link.b, link.a),
            };
            let n = self.cells_to_the_end(grid[from], grid[to]);
            ends[from] = (ends[from].0 + 1, ends[from].1 + n);
            let factor = match scaling.get(&n) {
                Some(&factor) => factor,
                None => *scaling.entry(n).or_insert(block_scaling(self.dimension, n)?),
            };
            let normal = self.dimension - 1;
            let is_in_top = self.dimension > 1 && [from, to].iter().all(|&i| grid[i][normal] == self.cells);
            let factor = if is_in_top { f64::sqrt(factor) } else { factor };
            let rest_m = network.rest_m()[link.a].distance(network.rest_m()[link.b]);
            let spring =
                Spring::linear(factor * self.stiffness_n_per_m, rest_m, factor * self.damping_ns_per_m)
                    .map_err(|source| BodyError::Law { link: links.len(), source })?;
            links.push(Link { spring, ..*link });
        }
        let masses = ends.iter().map(|&(springs, sum)| {
            let mean = if springs > 0 { sum as f64 / springs as f64 } else { 1.0 };
            self.mass_kg * 0.5 * (1.0 + mean)
        });
        let held = moves.iter().map(|moves| !moves).collect();
        self.system_of(Network::new(network.rest_m().to_vec(), masses.collect(), held, links)?)
    }

    fn is_held(&self, ijk: [usize; 3]) -> bool {
        let normal = self.dimension - 1;
        (0..self.dimension).any(|axis| ijk[axis] == 0 || (axis != normal && ijk[axis] == self.cells))
    }

    /// Number of cells from `from` to the nearest end towards which a spring to `to` points.
    fn cells_to_the_end(&self, from: [usize; 3], to: [usize; 3]) -> usize {
        let normal = self.dimension - 1;
        let along = |axis: usize| match to[axis].cmp(&from[axis]) {
            std::cmp::Ordering::Less => Some(from[axis]),
            std::cmp::Ordering::Greater if axis != normal => Some(self.cells - from[axis]),
            _ => None,
        };
        (0..self.dimension).filter_map(along).min().unwrap_or(1)
    }

    fn system_of(&self, network: Network) -> Result<SecondOrderSystem, ReduceError> {
        let driven = self.lattice()?.node(self.driven()?);
        SecondOrderSystem::of_body(&Body::new(network, Surface::default())?, &[driven], self.dimension)
    }
}
