//! Columns of A⁻¹: the velocities that impulses on single nodes give.

use crate::Network;
use faer::Mat;
use glam::{DMat3, DVec3};
use std::collections::HashMap;

/// A⁻¹ E_j for some nodes j, E_j their three degrees of freedom. All of them are of the same A.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    /// For each node its solution and its first column there.
    place: HashMap<usize, (usize, usize)>,
    solutions: Vec<Mat<f64>>,
}

impl Columns {
    /// Those of `nodes` that are not known yet, each once.
    pub(super) fn unknown(&self, nodes: impl Iterator<Item = usize>) -> Vec<usize> {
        let mut unknown: Vec<usize> = nodes.filter(|node| !self.place.contains_key(node)).collect();
        unknown.sort_unstable();
        unknown.dedup();
        unknown
    }

    /// Adds the columns of `nodes`, three each.
    pub(super) fn add(&mut self, nodes: &[usize], solution: Mat<f64>) {
        for (i, &node) in nodes.iter().enumerate() {
            self.place.insert(node, (self.solutions.len(), 3 * i));
        }
        self.solutions.push(solution);
    }

    /// The velocity of node `i` that an impulse on the known node `j` gives, 1/kg.
    pub(crate) fn block(&self, network: &Network, i: usize, j: usize) -> DMat3 {
        let (Some(i), Some(&(solution, first))) = (network.free_index(i), self.place.get(&j)) else {
            return DMat3::ZERO;
        };
        let entry = |row: usize, axis: usize| self.solutions[solution][(3 * i + row, first + axis)];
        DMat3::from_cols_array_2d(&[0, 1, 2].map(|axis| [0, 1, 2].map(|row| entry(row, axis))))
    }

    /// Adds to the velocities of all nodes what an impulse on the known node `node` gives.
    pub(crate) fn push(&self, network: &Network, node: usize, impulse_ns: DVec3, v: &mut [DVec3]) {
        let Some(&(solution, first)) = self.place.get(&node) else { return };
        let columns = [0, 1, 2].map(|axis| self.solutions[solution].col(first + axis));
        for (index, &node) in network.free().iter().enumerate() {
            for (column, part) in columns.iter().zip(impulse_ns.to_array()) {
                v[node] += part * DVec3::new(column[3 * index], column[3 * index + 1], column[3 * index + 2]);
            }
        }
    }
}
