//! The local model of [`palpate_local::Scheme::KrylovLinear`]: the whole body linearised and projected onto the far field's basis.

use crate::ReduceError;
use crate::far_field::FarField;
use crate::options::BuilderOptions;
use glam::DMat3;
use palpate_body::{BarrierTetrahedron, Body, Tangent, ToolContact};
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
    let (x, v) = (body.positions_m(), body.velocities_m_per_s());
    let (internal_n, external_n) = (far_field.internal_n(), far_field.external_n());
    basis.project(
        |node| internal_n[node] + external_n[node],
        |node| network.mass_kg()[node] * v[node],
        |j, f, momentum| {
            (r.force[j], r.velocity[j]) = (f, momentum);
        },
    );
    let is_near = vec![false; network.links().len()];
    let barriers: Vec<BarrierTetrahedron> = body.active_barriers().collect();
    basis.congruence(body, (&is_near, &barriers), model.clamped, &mut r.stiffness, &mut r.damping);
    r.stiffness_rc[..3 * p].fill(0.0);
    r.damping_rc[..3 * p].fill(0.0);
    (model.stiffness_n_per_m, model.damping_ns_per_m) = (DMat3::ZERO, DMat3::ZERO);
    for &index in network.incident_links(node) {
        let link = &network.links()[index];
        let other = if link.a == node { link.b } else { link.a };
        let t = link.spring.tangent(x[link.b] - x[link.a], model.clamped);
        model.stiffness_n_per_m += t.stiffness;
        model.damping_ns_per_m += t.damping;
        basis.subtract_coupling(other, t.stiffness, &mut r.stiffness_rc);
        basis.subtract_coupling(other, t.damping, &mut r.damping_rc);
    }
    for tetrahedron in &barriers {
        let Some(own) = tetrahedron.nodes.iter().position(|&other| other == node) else { continue };
        for ((i, &other), blocks) in
            tetrahedron.nodes.iter().enumerate().zip(tetrahedron.stiffness(x, model.clamped))
        {
            if i == own {
                model.stiffness_n_per_m += blocks[own];
            } else {
                // The block in the row of the driven node and the column of the other.
                basis.subtract_coupling(other, -blocks[own].transpose(), &mut r.stiffness_rc);
            }
        }
    }
    let implicit: Vec<f64> = (0..p * p)
        .map(|at| if at / p == at % p { 1.0 / h } else { 0.0 } + r.damping[at] + h * r.stiffness[at])
        .collect();
    far_field.set_basis(Some(basis));
    Ok(r.implicit.factorise(p, &implicit)?)
}
