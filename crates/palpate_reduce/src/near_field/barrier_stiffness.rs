//! The stiffness of the volume barriers of the near tetrahedra.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use palpate_body::{BarrierTetrahedron, VolumeBarrier};
use palpate_local::{NearField, NearTetrahedron};

/// The stiffness of the near tetrahedra over z = (δx_S, q), n × n; `None` where no barrier is active. With `clamped` it is positive
/// semidefinite.
pub(crate) fn over_state(field: &NearField, clamped: bool) -> Option<Mat<f64>> {
    let position = |node: usize| match node.checked_sub(field.nodes) {
        None => field.node_m[node],
        Some(i) => field.ring_m[i],
    };
    let x: Vec<_> = (0..field.nodes + field.ring).map(position).collect();
    let tetrahedra = field.tetrahedron[..field.tetrahedra].iter();
    let tetrahedra =
        tetrahedra.map(|&NearTetrahedron { nodes, barrier }| BarrierTetrahedron { nodes, barrier });
    let active: Vec<BarrierTetrahedron> =
        tetrahedra.filter(|tetrahedron| VolumeBarrier::is_active(tetrahedron.ratio(&x))).collect();
    if active.is_empty() {
        return None;
    }
    let (s, p, n, rows) = (3 * field.nodes, field.order, field.unknowns(), 3 * field.ring);
    // Over the nodes of S and of the ring.
    let mut k = Mat::<f64>::zeros(s + rows, s + rows);
    for tetrahedron in active {
        for (&row, blocks) in tetrahedron.nodes.iter().zip(tetrahedron.stiffness(&x, clamped)) {
            for (&column, block) in tetrahedron.nodes.iter().zip(blocks) {
                for (r, c) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
                    k[(3 * row + r, 3 * column + c)] += block.col(c)[r];
                }
            }
        }
    }
    let v = MatRef::from_column_major_slice(&field.basis[..rows * p], rows, p);
    let ring = k.subcols(s, rows);
    // The ring's columns are multiplied by V, then its rows by Vᵀ.
    let mut product = Mat::<f64>::zeros(s + rows, p);
    matmul(&mut product, Accum::Replace, ring, v, 1.0, Par::Seq);
    let far = v.transpose() * product.subrows(s, rows);
    Some(Mat::from_fn(n, n, |i, j| match (i.checked_sub(s), j.checked_sub(s)) {
        (None, None) => k[(i, j)],
        (None, Some(j)) => product[(i, j)],
        (Some(i), None) => product[(j, i)],
        (Some(i), Some(j)) => far[(i, j)],
    }))
}
