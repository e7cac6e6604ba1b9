//! Columns of A⁻¹Hᵀ: velocities per impulse on constraint rows.

use crate::Network;
use faer::Mat;
use glam::{DMat3, DVec3};

/// Columns A⁻¹ H_jᵀ for the first rows of a growing list, three each, where row j constrains the weighted sum H_j of nodes, for a single
/// matrix A.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    /// Index of the solution of each row, and its first column there.
    place: Vec<(usize, usize)>,
    solutions: Vec<Mat<f64>>,
}

impl Columns {
    /// Number of rows with columns.
    pub(super) fn row_count(&self) -> usize {
        self.place.len()
    }

    /// Adds the columns of the next rows, three each.
    pub(super) fn add(&mut self, solution: Mat<f64>) {
        let rows = solution.ncols() / 3;
        self.place.extend((0..rows).map(|row| (self.solutions.len(), 3 * row)));
        self.solutions.push(solution);
    }

    /// Velocity of the weighted sum of `nodes` per impulse on `row`, 1/kg. The columns of `row` must exist.
    pub(crate) fn block(&self, network: &Network, nodes: &[(usize, f64)], row: usize) -> DMat3 {
        let (solution, first) = self.place[row];
        let solution = &self.solutions[solution];
        let of_node = |&(node, w): &(usize, f64)| {
            let index = network.free_index(node)?;
            let entry = |axis: usize, column: usize| w * solution[(3 * index + axis, first + column)];
            Some(DMat3::from_cols_array_2d(
                &[0, 1, 2].map(|column| [0, 1, 2].map(|axis| entry(axis, column))),
            ))
        };
        nodes.iter().filter_map(of_node).sum()
    }

    /// Adds the velocities of all nodes due to an impulse on `row`. Its columns must exist.
    pub(crate) fn push(&self, network: &Network, row: usize, impulse_ns: DVec3, v: &mut [DVec3]) {
        let (solution, first) = self.place[row];
        let columns = [0, 1, 2].map(|axis| self.solutions[solution].col(first + axis));
        for (index, &node) in network.free().iter().enumerate() {
            for (column, part) in columns.iter().zip(impulse_ns.to_array()) {
                v[node] += part * DVec3::new(column[3 * index], column[3 * index + 1], column[3 * index + 2]);
            }
        }
    }
}
