//! Newton's method for contacts that the implicit step couples strongly.

use crate::impulse_response::DelassusMatrix;
use faer::Mat;
use faer::linalg::solvers::Solve;
use glam::{DMat3, DVec3};
use palpate_laws::{ConstraintLaw, ConstraintRow, ImpulseResponse};

/// Maximum number of iterations.
const MAX_ITERATIONS: usize = 30;
/// Change of the impulses relative to the largest one that ends the iteration.
const TOLERANCE: f64 = 1e-11;
/// Compliance added to every row, relative to its own. Redundant rows have no unique impulses without it.
const REGULARISATION: f64 = 1e-10;

/// Maximum ratio of the largest impulse to that at the start. Contradictory rows have no solution, and their impulses grow
/// with the inverse of the regularisation.
const MAX_GROWTH: f64 = 100.0;

/// State of a row in an iteration.
#[derive(Clone, Copy)]
enum RowState {
    /// Without an impulse.
    Open,
    /// The velocity is closed in all directions.
    Held,
    /// The velocity is closed along the normal; the friction has the given unit direction and is μ times the normal
    /// impulse. `turn` is the change of the direction with the tangential velocity, relative to the own response.
    Slipping { normal: DVec3, direction: DVec3, friction: f64, turn: f64 },
}

/// Whether the method knows the law of a row.
pub(crate) fn applies(law: &ConstraintLaw) -> bool {
    matches!(law, ConstraintLaw::Unilateral { series: None, .. } | ConstraintLaw::Bilateral)
}

/// Improves the impulses of `rows` by Newton's method on the projection equations of Signorini and Coulomb (P. Alart and
/// A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353).
///
/// Gauss-Seidel converges slowly where all rows share a few soft modes, for example below a rigid body, or in a long
/// step of a body that moves freely. The result is a start for it, not a solution. If an impulse is not finite or grows too
/// much, the impulses do not change. [`applies`] must hold for all rows.
pub(crate) fn improve(rows: &mut [ConstraintRow], response: &mut DelassusMatrix, h: f64) {
    let n = rows.len();
    let product = |impulses: &[DVec3], row: usize| -> DVec3 {
        impulses.iter().enumerate().map(|(other, impulse)| response.block(row, other) * *impulse).sum()
    };
    let mut impulses: Vec<DVec3> = rows.iter().map(|row| row.impulse_ns).collect();
    let free: Vec<DVec3> =
        (0..n).map(|i| response.velocity_m_per_s(i) + rows[i].gap_m / h - product(&impulses, i)).collect();
    for _ in 0..MAX_ITERATIONS {
        let states: Vec<RowState> = (0..n)
            .map(|i| {
                let velocity = free[i] + product(&impulses, i);
                state(&rows[i], impulses[i], velocity)
            })
            .collect();
        let closed: Vec<usize> = (0..n).filter(|&i| !matches!(states[i], RowState::Open)).collect();
        let mut matrix = Mat::zeros(3 * closed.len(), 3 * closed.len());
        let mut rhs = Mat::zeros(3 * closed.len(), 1);
        for (place, &i) in closed.iter().enumerate() {
            let (on_velocity, on_impulse) = equations(states[i]);
            let own = response.block(i, i);
            let most = own.x_axis.x.max(own.y_axis.y).max(own.z_axis.z);
            let target = -(on_velocity * free[i]);
            (0..3).for_each(|axis| rhs[(3 * place + axis, 0)] = target[axis]);
            for (column, &j) in closed.iter().enumerate() {
                let mut block = response.block(i, j);
                if i == j {
                    block += DMat3::from_diagonal(DVec3::splat(REGULARISATION * most));
                }
                let mut block = on_velocity * block;
                if i == j {
                    // Equations on impulses in the unit of the others.
                    block += on_impulse * most;
                }
                for (row, axis) in (0..3).flat_map(|row| (0..3).map(move |axis| (row, axis))) {
                    matrix[(3 * place + row, 3 * column + axis)] = block.col(axis)[row];
                }
            }
        }
        let solution = matrix.partial_piv_lu().solve(&rhs);
        let mut next = vec![DVec3::ZERO; n];
        for (place, &i) in closed.iter().enumerate() {
            next[i] = DVec3::from_array([0, 1, 2].map(|axis| solution[(3 * place + axis, 0)]));
        }
        if next.iter().any(|impulse| !impulse.is_finite()) {
            return;
        }
        let largest = next.iter().map(|impulse| impulse.length()).fold(0.0, f64::max);
        let change = next.iter().zip(&impulses).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        impulses = next;
        if change <= TOLERANCE * largest {
            break;
        }
    }
    let largest = |sizes: &mut dyn Iterator<Item = f64>| sizes.fold(0.0, f64::max);
    let before = largest(&mut rows.iter().map(|row| row.impulse_ns.length()));
    if largest(&mut impulses.iter().map(|impulse| impulse.length())) > MAX_GROWTH * before {
        return;
    }
    for (i, impulse) in impulses.into_iter().enumerate() {
        let allowed = match rows[i].law {
            ConstraintLaw::Unilateral { coulomb, .. } => coulomb.in_cone(impulse),
            _ => impulse,
        };
        response.apply_impulse(i, allowed - rows[i].impulse_ns);
        rows[i].impulse_ns = allowed;
    }
}

fn state(row: &ConstraintRow, impulse: DVec3, velocity: DVec3) -> RowState {
    let ConstraintLaw::Unilateral { coulomb, .. } = row.law else { return RowState::Held };
    let (normal, friction) = (coulomb.normal(), coulomb.friction());
    let w = row.inv_effective_mass_per_kg;
    let own = normal.dot(w * normal);
    if own <= 0.0 {
        return RowState::Open;
    }
    let pushed = impulse - velocity / own;
    let along = pushed.dot(normal);
    if along <= 0.0 {
        return RowState::Open;
    }
    let across = pushed - along * normal;
    match across.try_normalize() {
        Some(direction) if across.length() > friction * along => {
            let turn = friction * along / across.length();
            RowState::Slipping { normal, direction, friction, turn }
        }
        _ => RowState::Held,
    }
}

/// Matrices A and B of the equations A u + B W λ = 0 of a row with the own response W: its projection equations,
/// linearised at the current impulses.
fn equations(state: RowState) -> (DMat3, DMat3) {
    match state {
        RowState::Open => (DMat3::ZERO, DMat3::IDENTITY),
        RowState::Held => (DMat3::IDENTITY, DMat3::ZERO),
        RowState::Slipping { normal: n, direction: d, friction, turn } => {
            let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
            let plane = DMat3::IDENTITY - outer(n, n);
            let beside = (plane - outer(d, d)) * turn;
            (outer(n, n) + beside, plane - outer(d, n) * friction - beside)
        }
    }
}
