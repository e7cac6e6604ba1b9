//! Stiffness and damping of the near tetrahedra and elements.

use super::ring_projection;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use glam::{DMat3, DVec3};
use palpate_body::{BarrierTetrahedron, VolumeBarrier};
use palpate_laws::{StressTangent, domain_gradient, stress_block, stress_change};
use palpate_local::{NearDomain, NearField, NearTetrahedron};

/// Stiffness and damping over z = (δx_S, q), n × n each.
pub(crate) struct OverState {
    pub(crate) stiffness: Mat<f64>,
    pub(crate) damping: Mat<f64>,
}

/// Stiffness and damping of the near tetrahedra and elements over z; `None` where there are no elements and no barrier is active. With
/// `clamped` the stiffness of tetrahedra and hexahedra is positive semidefinite; that of smoothed domains only together with that of the far
/// field.
pub(crate) fn over_state(field: &NearField, clamped: bool) -> Option<OverState> {
    let x = positions(field);
    let tetrahedra = field.tetrahedron[..field.tetrahedra].iter();
    let tetrahedra =
        tetrahedra.map(|&NearTetrahedron { nodes, barrier }| BarrierTetrahedron { nodes, barrier });
    let active: Vec<BarrierTetrahedron> =
        tetrahedra.filter(|tetrahedron| VolumeBarrier::is_active(tetrahedron.ratio(&x))).collect();
    let (size, has_elements) = (3 * x.len(), field.hexahedra + field.domains > 0);
    if active.is_empty() && !has_elements {
        return None;
    }
    // Over the nodes of S and of the ring.
    let mut k = Mat::<f64>::zeros(size, size);
    for tetrahedron in active {
        for (&row, blocks) in tetrahedron.nodes.iter().zip(tetrahedron.stiffness(&x, clamped)) {
            for (&column, block) in tetrahedron.nodes.iter().zip(blocks) {
                add(&mut k, row, column, block);
            }
        }
    }
    let mut b = has_elements.then(|| Mat::<f64>::zeros(size, size));
    for element in &field.hexahedron[..field.hexahedra] {
        let (shape, nodes) = (&field.shape[element.shape], element.nodes.map(usize::from));
        let corners = nodes.map(|node| x[node]);
        let mut of =
            vec![(&mut k, shape.stiffness_n_per_m(&corners, &element.material, &element.relaxed, clamped))];
        if let Some(b) = b.as_mut().filter(|_| element.material.is_damped()) {
            of.push((b, shape.damping_ns_per_m(&corners, &element.material)));
        }
        for (to, blocks) in of {
            for (&row, blocks) in nodes.iter().zip(blocks) {
                nodes.iter().zip(blocks).for_each(|(&column, block)| add(to, row, column, block));
            }
        }
    }
    for domain in &field.domain[..field.domains] {
        add_domain(field, domain, &x, clamped, (&mut k, b.as_mut()));
    }
    let n = field.unknowns();
    let damping = b.map_or_else(|| Mat::zeros(n, n), |b| project(field, &b));
    Some(OverState { stiffness: project(field, &k), damping })
}

/// Adds stiffness and damping of a smoothed domain.
fn add_domain(
    field: &NearField,
    domain: &NearDomain,
    x: &[DVec3],
    clamped: bool,
    (k, b): (&mut Mat<f64>, Option<&mut Mat<f64>>),
) {
    let (nodes, gradients) = (domain.part(&field.domain_node), domain.part(&field.domain_gradient_per_m));
    let f = domain_gradient(gradients, nodes.iter().map(|node| x[usize::from(*node)]));
    let add_all = |to: &mut Mat<f64>, tangent: &StressTangent| {
        for (&column, of_column) in nodes.iter().zip(gradients) {
            let change = stress_change(tangent, *of_column);
            for (&row, of_row) in nodes.iter().zip(gradients) {
                add(to, row.into(), column.into(), stress_block(&change, *of_row));
            }
        }
    };
    add_all(k, &domain.material.tangent_j(&f, &domain.relaxed, clamped));
    if let (Some(b), Some(tangent)) = (b, domain.material.viscous_tangent_js(&f)) {
        add_all(b, &tangent);
    }
}

/// Subtracts stiffness and damping of all near springs, tetrahedra and elements from the matrices of q, which have those of the whole body.
pub(super) fn subtract_near(field: &mut NearField, clamped: bool) {
    let (p, s) = (field.order, 3 * field.nodes);
    let of_springs = (field.springs > 0).then(|| {
        let stiffness = ring_projection::project(field, |near, d| near.spring.tangent(d, clamped).stiffness);
        let damping = ring_projection::project(field, |near, d| near.spring.tangent(d, clamped).damping);
        (stiffness, damping)
    });
    let of_elements = over_state(field, clamped);
    for (i, j) in (0..p).flat_map(|i| (0..p).map(move |j| (i, j))) {
        let (lower, at) = ((i.max(j), i.min(j)), i * p + j);
        if let Some((stiffness, damping)) = &of_springs {
            field.stiffness[at] -= stiffness[lower];
            field.damping[at] -= damping[lower];
        }
        if let Some(of) = &of_elements {
            field.stiffness[at] -= of.stiffness[(s + lower.0, s + lower.1)];
            field.damping[at] -= of.damping[(s + lower.0, s + lower.1)];
        }
    }
}

/// Positions of S and of the ring, m.
fn positions(field: &NearField) -> Vec<DVec3> {
    field.node_m[..field.nodes].iter().chain(&field.ring_m[..field.ring]).copied().collect()
}

fn add(to: &mut Mat<f64>, row: usize, column: usize, block: DMat3) {
    for (r, c) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
        to[(3 * row + r, 3 * column + c)] += block.col(c)[r];
    }
}

/// A symmetric matrix over S and the ring, projected onto z.
fn project(field: &NearField, k: &Mat<f64>) -> Mat<f64> {
    let (s, p, n, rows) = (3 * field.nodes, field.order, field.unknowns(), 3 * field.ring);
    let v = MatRef::from_column_major_slice(&field.basis[..rows * p], rows, p);
    let ring = k.subcols(s, rows);
    // The ring's columns are multiplied by V, then its rows by Vᵀ.
    let mut product = Mat::<f64>::zeros(s + rows, p);
    matmul(&mut product, Accum::Replace, ring, v, 1.0, Par::Seq);
    let far = v.transpose() * product.subrows(s, rows);
    Mat::from_fn(n, n, |i, j| match (i.checked_sub(s), j.checked_sub(s)) {
        (None, None) => k[(i, j)],
        (None, Some(j)) => product[(i, j)],
        (Some(i), None) => product[(j, i)],
        (Some(i), Some(j)) => far[(i, j)],
    })
}
