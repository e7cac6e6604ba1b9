//! How far a near field is from the body whose far field it reduces.

use super::basis::Basis;
use super::{ring, tetrahedra};
use faer::sparse::SparseColMatRef;
use glam::DVec3;
use palpate_body::{Network, Tangent};
use palpate_local::{Cholesky, NearField};

/// The real frequency at which it is estimated, 1/s: 80 Hz, the fastest that a hand moves.
const SIGMA: f64 = 80.0 * std::f64::consts::TAU;

/// A bound of the relative error of the stiffness against S at σ = 2π · 80 s⁻¹, where S goes along `direction` as one.
///
/// With A = σ²M + σB + K of what is not in S and b what a motion of S does to it, the exact answer is A⁻¹ b, the reduced one
/// w = V (VᵀAV)⁻¹ Vᵀ b, and r = b − A w what w leaves. The stiffness is too great by rᵀ A⁻¹ r, and that is at most
/// rᵀ M⁻¹ r/σ², because B and K are positive semidefinite. `None` where there is no far field, or no stiffness.
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
    let mut pushed = vec![0.0; unknowns];
    for &index in &free {
        (0..3).for_each(|axis| multiply(3 * index + axis, direction[axis], &mut pushed));
    }
    let own: f64 =
        free.iter().map(|&i| (0..3).map(|axis| direction[axis] * pushed[3 * i + axis]).sum::<f64>()).sum();
    // b, and Vᵀ b.
    let rest = |dof: usize| basis.is_far(dof / 3);
    let b_r: Vec<f64> = (0..unknowns).map(|dof| if rest(dof) { -pushed[dof] } else { 0.0 }).collect();
    let y = basis.transposed(network, &b_r);
    let w = basis.columns(network, &reduced(field, y)?);
    let mut left = vec![0.0; unknowns];
    for dof in (0..unknowns).filter(|&dof| rest(dof)) {
        multiply(dof, w[dof], &mut left);
    }
    let mass = |dof: usize| network.mass_kg()[network.free()[dof / 3]];
    let beyond: f64 = (0..unknowns)
        .filter(|&dof| rest(dof))
        .map(|dof| {
            let r = b_r[dof] - left[dof] - SIGMA * SIGMA * mass(dof) * w[dof];
            r * r / (mass(dof) * SIGMA * SIGMA)
        })
        .sum();
    let stiffness = own - b_r.iter().zip(&w).map(|(b, w)| b * w).sum::<f64>();
    let bound = beyond / stiffness;
    (bound.is_finite() && stiffness > 0.0).then_some(bound)
}

/// (VᵀAV)⁻¹ y.
fn reduced(field: &NearField, mut y: Vec<f64>) -> Option<Vec<f64>> {
    let p = field.order;
    let ring = ring::project(field, |near, stretch| {
        let tangent = near.spring.tangent(stretch, false);
        tangent.stiffness + SIGMA * tangent.damping
    });
    let mut a: Vec<f64> = (0..p * p).map(|i| field.stiffness[i] + SIGMA * field.damping[i]).collect();
    for i in 0..p {
        (0..=i).for_each(|j| a[i * p + j] += ring[(i, j)]);
        a[i * p + i] += SIGMA * SIGMA;
    }
    if let Some(barriers) = tetrahedra::stiffness(field, false) {
        let s = 3 * field.nodes;
        (0..p * p).for_each(|at| a[at] += barriers[(s + at / p, s + at % p)]);
    }
    let mut factor = Cholesky::with_capacity(p);
    factor.factorise(p, &a).ok()?;
    factor.solve_in_place(&mut y);
    Some(y)
}
