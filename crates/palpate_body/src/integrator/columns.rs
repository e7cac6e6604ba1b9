//! Columns of A⁻¹: velocities per impulse on single nodes.

use crate::Network;
use faer::Mat;
use glam::{DMat3, DVec3};
use std::collections::HashMap;

/// Columns A⁻¹ E_j for some nodes j, with the three degrees of freedom E_j of a node, for a single matrix A.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    /// Index of the solution of each node, and its first column there.
    place: HashMap<usize, (usize, usize)>,
    solutions: Vec<Mat<f64>>,
}

impl Columns {
    /// The `nodes` without columns, each once.
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

    /// Velocity of node `i` per impulse on node `j`, 1/kg. The columns of `j` must exist.
    pub(crate) fn block(&self, network: &Network, i: usize, j: usize) -> DMat3 {
        let (Some(i), Some(&(solution, first))) = (network.free_index(i), self.place.get(&j)) else {
            return DMat3::ZERO;
        };
        let entry = |row: usize, axis: usize| self.solutions[solution][(3 * i + row, first + axis)];
        DMat3::from_cols_array_2d(&[0, 1, 2].map(|axis| [0, 1, 2].map(|row| entry(row, axis))))
    }

    /// Adds the velocities of all nodes due to an impulse on `node`. Its columns must exist.
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
