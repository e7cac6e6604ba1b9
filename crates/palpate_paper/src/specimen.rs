//! The seed paper's specimen (its sections 4 and 5) and the local models that are made for it.

use crate::block_scaling::block_scaling;
use palpate_body::{Body, BodyError, Lattice, Link, Network, Surface};
use palpate_laws::Spring;
use palpate_reduce::{ReduceError, SecondOrderSystem};
use std::collections::HashMap;

/// A regular lattice of `cells` cells along each of 1 to 3 dimensions, held on all sides but its top, and driven at the
/// node in the middle of the top (for an odd number of cells the one before it).
///
/// In one dimension that is a chain of `cells` springs between the tool and a wall (section 5.1); in two the mesh
/// of section 4. The last of its axes is the normal of the top, the others are tangential; all springs are alike,
/// and so are all dampers and masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Specimen {
    /// 1, 2 or 3.
    pub dimension: usize,
    /// Cells along each dimension, at least 2.
    pub cells: usize,
    /// Stiffness of each spring, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping of each damper, N s/m.
    pub damping_ns_per_m: f64,
    /// Mass of each node, kg.
    pub mass_kg: f64,
}

/// Width of every specimen, m. Nothing depends on it: at rest a lattice's stiffness does not know its size.
const WIDTH_M: f64 = 0.1;

impl Specimen {
    /// Its lattice.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when the dimension is not 1 to 3 or there are fewer than 2 cells; [`ReduceError::Body`]
    /// when there are too many.
    pub fn lattice(&self) -> Result<Lattice, ReduceError> {
        let Self { dimension, cells, .. } = *self;
        let refuse =
            |what, value: usize, allowed| Err(ReduceError::Option { what, value: value as f64, allowed });
        if !(1..=3).contains(&dimension) {
            return refuse("dimension of the specimen", dimension, "1, 2 or 3");
        }
        if cells < 2 {
            return refuse("cells of the specimen", cells, "at least 2");
        }
        let mut nodes = [1; 3];
        nodes[..dimension].fill(cells.saturating_add(1));
        Ok(Lattice::new(nodes, WIDTH_M / cells as f64)?)
    }

    /// (i, j, k) of the driven node.
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

    /// Its network.
    ///
    /// # Errors
    /// As [`Specimen::lattice`]; [`ReduceError::Body`] when a parameter is out of range.
    pub fn network(&self) -> Result<Network, ReduceError> {
        let Self { stiffness_n_per_m: k, damping_ns_per_m: b, mass_kg: m, .. } = *self;
        Ok(self.lattice()?.uniform(k, b, m, |ijk| self.is_held(ijk))?)
    }

    /// Its small motions.
    ///
    /// # Errors
    /// As [`Specimen::network`].
    pub fn system(&self) -> Result<SecondOrderSystem, ReduceError> {
        self.system_of(self.network()?)
    }

    /// The local model of the seed's Fig. 8 (Fig. 13 in one dimension): see [`SecondOrderSystem::neighbourhood`].
    ///
    /// # Errors
    /// As [`Specimen::network`]; [`ReduceError::Option`] when `rings` is zero.
    pub fn neighbourhood(&self, rings: usize) -> Result<SecondOrderSystem, ReduceError> {
        let network = self.network()?;
        self.system_of(network.clone())?.neighbourhood(&network, rings)
    }

    /// The local model of the seed's Fig. 10 (Fig. 14 in one dimension): the nodes within `rings` of the driven one, and
    /// outer springs that stand for all that lies between them and the end of the specimen.
    ///
    /// * Springs and dampers among the nodes that are kept are the specimen's.
    /// * An outer spring, from a node that is kept towards an end n cells away (for a diagonal the nearest of the ends
    ///   that it points to), has the specimen's stiffness and damping times [`block_scaling`]`(dimension, n)`, and
    ///   times the square root of that where it lies in the top.
    /// * The mass of a node with outer springs is the specimen's times (1 + n̄)/2, n̄ the mean of theirs: in one dimension
    ///   half of the n − 1 masses that are left out goes to either neighbour.
    ///
    /// The paper states the third rule in one dimension only (section 5.1) and otherwise says "scaled according
    /// to their distance to the end of the specimen"; the mean over a node's outer springs is our reading.
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
                Some(&known) => known,
                None => *scaling.entry(n).or_insert(block_scaling(self.dimension, n)?),
            };
            let normal = self.dimension - 1;
            let in_the_top = self.dimension > 1 && [from, to].iter().all(|&i| grid[i][normal] == self.cells);
            let factor = if in_the_top { f64::sqrt(factor) } else { factor };
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

    /// The least number of cells from `from` to one of the ends towards which a spring to `to` points.
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
