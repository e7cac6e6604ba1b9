//! The integrator of a near field's ticks, and the matrices of implicit ones.

use super::{element_stiffness, ring_projection};
use crate::ReduceError;
use crate::options::{BuilderOptions, LocalIntegrator};
use glam::DMat3;
use palpate_body::{Body, SemiImplicitEuler};
use palpate_local::{NearEnd, NearField, NearSpring, Support, TickIntegrator};

/// Maximum number of explicit substeps of [`LocalIntegrator::Auto`], and its number of implicit ones.
const MAX_AUTO_SUBSTEPS: usize = 4;
const IMPLICIT_SUBSTEPS: u32 = 2;
/// Maximum number of explicit substeps in a tick.
const MAX_SUBSTEPS: usize = 64;

/// Selects the integrator of the ticks of local models of `body`.
pub(crate) fn select(body: &Body, options: &BuilderOptions) -> TickIntegrator {
    let substeps =
        SemiImplicitEuler { tick_s: options.tick_s, ..SemiImplicitEuler::default() }.substeps(body);
    let explicit = |max: usize| {
        let substeps = substeps.as_ref().ok().filter(|&&substeps| substeps <= max)?;
        Some(TickIntegrator::Explicit { substeps: *substeps as u32 })
    };
    match options.integrator {
        LocalIntegrator::Auto => explicit(MAX_AUTO_SUBSTEPS),
        LocalIntegrator::Explicit => explicit(MAX_SUBSTEPS),
        LocalIntegrator::Implicit { substeps } => Some(TickIntegrator::Implicit { substeps }),
    }
    .unwrap_or(TickIntegrator::Implicit { substeps: IMPLICIT_SUBSTEPS })
}

/// `integrator` with at least `min_substeps` substeps: fields under one tool have the same substeps.
pub(crate) fn with_substeps(integrator: TickIntegrator, min_substeps: u32) -> TickIntegrator {
    match integrator {
        TickIntegrator::Explicit { substeps } => {
            TickIntegrator::Explicit { substeps: substeps.max(min_substeps) }
        }
        TickIntegrator::Implicit { substeps } => {
            TickIntegrator::Implicit { substeps: substeps.max(min_substeps) }
        }
    }
}

/// Writes the matrices of implicit ticks into `field`: the stiffness over z, the factor of M/h + B + h K, and the impulse response of S.
pub(super) fn write_matrices(field: &mut NearField) -> Result<(), ReduceError> {
    let TickIntegrator::Implicit { substeps } = field.integrator else { return Ok(()) };
    let h = field.tick_s / f64::from(substeps);
    let (s, p, n) = (3 * field.nodes, field.order, field.unknowns());
    let (mut k, mut b) = (vec![0.0; n * n], vec![0.0; n * n]);
    // Clamped to positive semidefinite: a tick has no alternative if the factorisation fails.
    let tangent = |near: &NearSpring, stretch| near.spring.tangent(stretch, true);
    let ring_k = ring_projection::project(field, |near, stretch| tangent(near, stretch).stiffness);
    let ring_b = ring_projection::project(field, |near, stretch| tangent(near, stretch).damping);
    for i in 0..p {
        for j in 0..p {
            let lower = (i.max(j), i.min(j));
            k[(s + i) * n + s + j] = field.stiffness[i * p + j] + ring_k[lower];
            b[(s + i) * n + s + j] = field.damping[i * p + j] + ring_b[lower];
        }
    }
    for near in &field.near[..field.springs] {
        let at = match near.b {
            NearEnd::Support(i) => field.node_m[i],
            NearEnd::Ring(i) => field.ring_m[i],
            NearEnd::Fixed(x) => x,
        };
        let tangent = tangent(near, at - field.node_m[near.a]);
        for (matrix, block) in [(&mut k, tangent.stiffness), (&mut b, tangent.damping)] {
            add_near_spring(field, near, block, matrix);
        }
    }
    for dof in 0..s {
        b[dof * n + dof] += field.drag_ns_per_m[dof / 3];
    }
    if let Some(of) = element_stiffness::over_state(field, true) {
        for (matrix, add) in [(&mut k, &of.stiffness), (&mut b, &of.damping)] {
            for (i, row) in matrix.chunks_exact_mut(n).enumerate() {
                row.iter_mut().enumerate().for_each(|(j, to)| *to += add[(i, j)]);
            }
        }
    }
    let is_driven = field.support == Support::Driven;
    let mut a = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            // Driven and fixed degrees of freedom do not respond.
            let is_rigid = |dof: usize| dof < s && (is_driven || field.node_per_kg[dof / 3] == 0.0);
            a[i * n + j] = match (i == j, is_rigid(i) || is_rigid(j)) {
                (true, true) => 1.0,
                (false, true) => 0.0,
                (diagonal, false) => {
                    let mass = if i < s { 1.0 / field.node_per_kg[i / 3] } else { 1.0 };
                    (if diagonal { mass / h } else { 0.0 }) + b[i * n + j] + h * k[i * n + j]
                }
            };
        }
    }
    field.factor.factorise(n, &a)?;
    field.tangent[..n * n].copy_from_slice(&k);
    for column in 0..s {
        let response = &mut field.impulse_response[column * n..(column + 1) * n];
        response.fill(0.0);
        if field.node_per_kg[column / 3] > 0.0 && !is_driven {
            response[column] = 1.0 / h;
            field.factor.solve_in_place(response);
        }
    }
    // Fixed nodes have no velocity.
    for i in (0..field.nodes).filter(|&i| field.node_per_kg[i] == 0.0) {
        field.velocity[3 * i..3 * i + 3].fill(0.0);
    }
    Ok(())
}

/// Adds the tangent `block` of a near spring to a matrix over z, except for the block of q.
fn add_near_spring(field: &NearField, near: &NearSpring, block: DMat3, matrix: &mut [f64]) {
    let (s, p, n) = (3 * field.nodes, field.order, field.unknowns());
    let mut add = |i: usize, j: usize, value: f64| matrix[i * n + j] += value;
    let entry = |r: usize, c: usize| block.col(c)[r];
    for r in 0..3 {
        for c in 0..3 {
            add(3 * near.a + r, 3 * near.a + c, entry(r, c));
        }
    }
    match near.b {
        NearEnd::Fixed(_) => {}
        NearEnd::Support(other) => {
            for r in 0..3 {
                for c in 0..3 {
                    add(3 * other + r, 3 * other + c, entry(r, c));
                    add(3 * near.a + r, 3 * other + c, -entry(r, c));
                    add(3 * other + r, 3 * near.a + c, -entry(r, c));
                }
            }
        }
        NearEnd::Ring(ring) => {
            let v = |axis: usize, j: usize| field.basis[3 * (field.ring * j + ring) + axis];
            // block V, 3 × p.
            let product: Vec<f64> =
                (0..3 * p).map(|i| (0..3).map(|c| entry(i / p, c) * v(c, i % p)).sum()).collect();
            for j in 0..p {
                for r in 0..3 {
                    add(3 * near.a + r, s + j, -product[r * p + j]);
                    add(s + j, 3 * near.a + r, -product[r * p + j]);
                }
            }
        }
    }
}
