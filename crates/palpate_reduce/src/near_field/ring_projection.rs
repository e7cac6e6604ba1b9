//! The projection of near springs onto the far field's basis at the nodes of the ring.

use faer::linalg::matmul::triangular::{
    self,
    BlockStructure::{Rectangular, TriangularLower},
};
use faer::{Accum, Mat, MatRef, Par};
use glam::{DMat3, DVec3};
use palpate_local::{NearEnd, NearField, NearSpring};

/// The lower half of Σ V_iᵀ S V_i over the near springs that end at a node i of the ring. S is the `block` of a spring and of the vector
/// from its end in S to the other, m.
pub(super) fn project(field: &NearField, block: impl Fn(&NearSpring, DVec3) -> DMat3) -> Mat<f64> {
    let (p, rows) = (field.order, 3 * field.ring);
    let mut at_node = vec![DMat3::ZERO; field.ring];
    for near in &field.near[..field.springs] {
        if let NearEnd::Ring(i) = near.b {
            at_node[i] += block(near, field.ring_m[i] - field.node_m[near.a]);
        }
    }
    let v = MatRef::from_column_major_slice(&field.basis[..rows * p], rows, p);
    let mut product = Mat::zeros(rows, p);
    for (to, column) in product.col_iter_mut().zip(v.col_iter()) {
        let mut to = to;
        for (i, block) in at_node.iter().enumerate() {
            let f = *block * DVec3::new(column[3 * i], column[3 * i + 1], column[3 * i + 2]);
            (0..3).for_each(|axis| to[3 * i + axis] = f[axis]);
        }
    }
    let mut sum = Mat::zeros(p, p);
    triangular::matmul(
        &mut sum,
        TriangularLower,
        Accum::Replace,
        v.transpose(),
        Rectangular,
        &product,
        Rectangular,
        1.0,
        Par::Seq,
    );
    sum
}
