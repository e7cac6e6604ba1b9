//! Blocks of a tangent.

use faer::sparse::SparseColMatRef;
use glam::DMat3;

/// The 3 × 3 block of two free nodes, given by their indices among the free nodes.
pub(crate) fn tangent_block(matrix: SparseColMatRef<'_, usize, f64>, row: usize, column: usize) -> DMat3 {
    let entry = |r: usize, c: usize| matrix.get(3 * row + r, 3 * column + c).copied().unwrap_or(0.0);
    DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| entry(r, c))))
}
