//! A bound of the error of the reduced far field.

use super::{element_stiffness, ring_projection};
use crate::far_field::basis::Basis;
use faer::sparse::SparseColMatRef;
use glam::DVec3;
use palpate_body::{Network, Tangent};
use palpate_local::{Cholesky, NearField};

/// Real frequency of the bound, 1/s: 80 Hz, above the fastest motion of a hand.
const SIGMA: f64 = 80.0 * std::f64::consts::TAU;

/// A bound of the relative error of the dynamic stiffness at σ = 2π · 80 s⁻¹ against a rigid motion of S along `direction`.
///
/// With A = σ²M + σB + K of the nodes beyond S and b the force on them by the motion of S, the exact response is A⁻¹ b and the reduced
/// one w = V (VᵀAV)⁻¹ Vᵀ b. With the residual r = b − A w, the reduced stiffness is too large by rᵀ A⁻¹ r ≤ rᵀ M⁻¹ r/σ²,
/// because B and K are positive semidefinite. `None` where there is no far field or no stiffness.
pub(super) fn error_bound(
    field: &NearField,
    (network, tangent): (&Network, &Tangent),
    (basis, support): (&Basis, &[usize]),
    direction: DVec3,
) -> Option<f64> {
    let unknowns = 3 * network.free().len();
    let free: Vec<usize> = support.iter().filter_map(|&node| network.free_index(node)).collect();
    let (k, b) = (tangent.stiffness(), tangent.damping());
    // Adds (K + σB) x.
    let multiply = |column: usize, x: f64, to: &mut [f64]| {
        let add = |matrix: SparseColMatRef<'_, usize, f64>, factor: f64, to: &mut [f64]| {
            for (row, value) in matrix.row_idx_of_col(column).zip(matrix.val_of_col(column)) {
                to[row] += factor * value;
            }
        };
        add(k, x, to);
        add(b, SIGMA * x, to);
    };
    let mut column = vec![0.0; unknowns];
    for &index in &free {
        (0..3).for_each(|axis| multiply(3 * index + axis, direction[axis], &mut column));
    }
    let own: f64 =
        free.iter().map(|&i| (0..3).map(|axis| direction[axis] * column[3 * i + axis]).sum::<f64>()).sum();
    // b, and Vᵀ b.
    let is_far = |dof: usize| basis.is_far(dof / 3);
    let b_r: Vec<f64> = (0..unknowns).map(|dof| if is_far(dof) { -column[dof] } else { 0.0 }).collect();
    let y = basis.transposed(network, &b_r);
    let w = basis.expand(network, &reduced(field, y)?);
    let mut a_w = vec![0.0; unknowns];
    for dof in (0..unknowns).filter(|&dof| is_far(dof)) {
        multiply(dof, w[dof], &mut a_w);
    }
    let mass = |dof: usize| network.mass_kg()[network.free()[dof / 3]];
    let excess: f64 = (0..unknowns)
        .filter(|&dof| is_far(dof))
        .map(|dof| {
            let r = b_r[dof] - a_w[dof] - SIGMA * SIGMA * mass(dof) * w[dof];
            r * r / (mass(dof) * SIGMA * SIGMA)
        })
        .sum();
    let stiffness = own - b_r.iter().zip(&w).map(|(b, w)| b * w).sum::<f64>();
    let bound = excess / stiffness;
    (bound.is_finite() && stiffness > 0.0).then_some(bound)
}

/// (VᵀAV)⁻¹ y.
fn reduced(field: &NearField, mut y: Vec<f64>) -> Option<Vec<f64>> {
    let p = field.order;
    let ring = ring_projection::project(field, |near, stretch| {
        let tangent = near.spring.tangent(stretch, false);
        tangent.stiffness + SIGMA * tangent.damping
    });
    let mut a: Vec<f64> = (0..p * p).map(|i| field.stiffness[i] + SIGMA * field.damping[i]).collect();
    for i in 0..p {
        (0..=i).for_each(|j| a[i * p + j] += ring[(i, j)]);
        a[i * p + i] += SIGMA * SIGMA;
    }
    if let Some(of) = element_stiffness::over_state(field, false) {
        let s = 3 * field.nodes;
        for (at, a) in a.iter_mut().enumerate() {
            let entry = (s + at / p, s + at % p);
            *a += of.stiffness[entry] + SIGMA * of.damping[entry];
        }
    }
    let mut factor = Cholesky::with_capacity(p);
    factor.factorise(p, &a).ok()?;
    factor.solve_in_place(&mut y);
    Some(y)
}
