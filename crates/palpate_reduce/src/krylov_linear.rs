//! The local model of [`palpate_local::Scheme::KrylovLinear`]: the whole body linearised and projected onto the far field's basis.

use crate::ReduceError;
use crate::far_field::FarField;
use crate::options::BuilderOptions;
use crate::tangent_block::tangent_block;
use glam::DMat3;
use palpate_body::{Body, Tangent, ToolContact};
use palpate_local::LocalModel;

/// Writes the linear reduced system of `body` driven at `node` into `model`. The forces of the `others`, the other tools on the body,
/// are constant.
pub(crate) fn build(
    far_field: &mut FarField,
    (body, others): (&Body, &[&ToolContact]),
    tangent: &Tangent,
    node: usize,
    options: &BuilderOptions,
    model: &mut LocalModel,
) -> Result<(), ReduceError> {
    let network = body.network();
    far_field.read_forces(body, others);
    let max_columns = options.order_limit.min(model.reduced.capacity());
    let basis = far_field.build_basis(body, tangent, &[node], options, max_columns)?;
    let (p, h, r) = (basis.order(), options.tick_s, &mut model.reduced);
    (r.order, r.step_s) = (p, h);
    let v = body.velocities_m_per_s();
    let (internal_n, external_n) = (far_field.internal_n(), far_field.external_n());
    basis.project(
        |node| internal_n[node] + external_n[node],
        |node| network.mass_kg()[node] * v[node],
        |j, f, momentum| {
            (r.force[j], r.velocity[j]) = (f, momentum);
        },
    );
    basis.congruence_of_tangent(tangent, &mut r.stiffness, &mut r.damping);
    r.stiffness_rc[..3 * p].fill(0.0);
    r.damping_rc[..3 * p].fill(0.0);
    (model.stiffness_n_per_m, model.damping_ns_per_m) = (DMat3::ZERO, DMat3::ZERO);
    let driven = network.free_index(node);
    for (matrix, own, coupling) in [
        (tangent.stiffness(), &mut model.stiffness_n_per_m, &mut r.stiffness_rc),
        (tangent.damping(), &mut model.damping_ns_per_m, &mut r.damping_rc),
    ] {
        let Some(column) = driven else { continue };
        *own = tangent_block(matrix, column, column);
        // A column of blocks has three entries of each.
        for row in
            matrix.row_idx_of_col(3 * column).step_by(3).map(|dof| dof / 3).filter(|row| *row != column)
        {
            basis.subtract_coupling(network.free()[row], -tangent_block(matrix, column, row), coupling);
        }
    }
    let implicit: Vec<f64> = (0..p * p)
        .map(|at| if at / p == at % p { 1.0 / h } else { 0.0 } + r.damping[at] + h * r.stiffness[at])
        .collect();
    far_field.set_basis(Some(basis));
    Ok(r.implicit.factorise(p, &implicit)?)
}
