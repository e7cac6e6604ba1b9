//! A local model as a linear system, for comparison with the body.

use crate::DenseSystem;
use faer::Mat;
use glam::DMat3;
use palpate_local::{LocalModel, NearEnd, NearField, Scheme};

impl DenseSystem {
    /// The small motions of `model` about its model step when the tool drives one node, with one input for each axis. The node is that of
    /// the model ([`Scheme::Tangent`], [`Scheme::KrylovLinear`]), or node `place` of its support set ([`Scheme::NearFieldExact`]).
    ///
    /// `None` where the force does not depend on the tool's motion ([`Scheme::Hold`], [`Scheme::LowPass`]), or the support set has no free
    /// node `place`. Also `None` for [`Scheme::Neighbourhood`], whose local model has no M: use
    /// [`SecondOrderSystem::neighbourhood`](crate::SecondOrderSystem::neighbourhood).
    #[must_use]
    pub fn of_local_model(model: &LocalModel, place: Option<usize>) -> Option<Self> {
        match model.scheme {
            Scheme::Hold | Scheme::LowPass | Scheme::Neighbourhood => None,
            Scheme::Tangent => Some(Self::of_reduced(model, 0)),
            Scheme::KrylovLinear => Some(Self::of_reduced(model, model.reduced.order)),
            Scheme::NearFieldExact => Self::of_near_field(&model.near, place?),
        }
    }

    /// The system of the first `p` columns of the basis, in whose coordinates M is the identity.
    fn of_reduced(model: &LocalModel, p: usize) -> Self {
        let r = &model.reduced;
        let square = |m: &[f64]| Mat::from_fn(p, p, |i, j| m[i * p + j]);
        let coupling = |m: &[f64]| Mat::from_fn(p, 3, |i, j| m[3 * i + j]);
        Self {
            mass: Mat::identity(p, p),
            damping: square(&r.damping),
            stiffness: square(&r.stiffness),
            damping_rc: coupling(&r.damping_rc),
            stiffness_rc: coupling(&r.stiffness_rc),
            damping_cc: block(model.damping_ns_per_m),
            stiffness_cc: block(model.stiffness_n_per_m),
        }
    }

    /// The system of z = (δx_S, q), with node `driven` of S as the input.
    fn of_near_field(field: &NearField, driven: usize) -> Option<Self> {
        let (s, n) = (3 * field.nodes, field.unknowns());
        let free = |node: usize| field.node_per_kg.get(node).is_some_and(|per_kg| *per_kg > 0.0);
        if driven >= field.nodes || !free(driven) {
            return None;
        }
        let (k, b) = matrices(field);
        let inputs = 3 * driven..3 * driven + 3;
        let kept: Vec<usize> =
            (0..n).filter(|&dof| !inputs.contains(&dof) && (dof >= s || free(dof / 3))).collect();
        let inputs: Vec<usize> = inputs.collect();
        let cut = |m: &Mat<f64>, rows: &[usize], columns: &[usize]| {
            Mat::from_fn(rows.len(), columns.len(), |i, j| m[(rows[i], columns[j])])
        };
        let mass = |dof: usize| if dof < s { 1.0 / field.node_per_kg[dof / 3] } else { 1.0 };
        Some(Self {
            mass: Mat::from_fn(kept.len(), kept.len(), |i, j| if i == j { mass(kept[i]) } else { 0.0 }),
            damping: cut(&b, &kept, &kept),
            stiffness: cut(&k, &kept, &kept),
            damping_rc: cut(&b, &kept, &inputs),
            stiffness_rc: cut(&k, &kept, &inputs),
            damping_cc: cut(&b, &inputs, &inputs),
            stiffness_cc: cut(&k, &inputs, &inputs),
        })
    }
}

/// K and B over z.
fn matrices(field: &NearField) -> (Mat<f64>, Mat<f64>) {
    let (s, p, n) = (3 * field.nodes, field.order, field.unknowns());
    let far =
        |m: &[f64]| Mat::from_fn(n, n, |i, j| if i < s || j < s { 0.0 } else { m[(i - s) * p + j - s] });
    let (mut k, mut b) = (far(&field.stiffness), far(&field.damping));
    for dof in 0..s {
        b[(dof, dof)] += field.drag_ns_per_m[dof / 3];
    }
    for near in &field.near[..field.springs] {
        // The change of the vector from a to b is G z.
        let mut g = Mat::<f64>::zeros(3, n);
        let at = match near.b {
            NearEnd::Support(i) => field.node_m[i],
            NearEnd::Ring(i) => field.ring_m[i],
            NearEnd::Fixed(x) => x,
        };
        for axis in 0..3 {
            match near.b {
                NearEnd::Support(i) => g[(axis, 3 * i + axis)] += 1.0,
                NearEnd::Ring(i) => {
                    (0..p).for_each(|j| g[(axis, s + j)] += field.basis[3 * (field.ring * j + i) + axis]);
                }
                NearEnd::Fixed(_) => {}
            }
            g[(axis, 3 * near.a + axis)] -= 1.0;
        }
        let tangent = near.spring.tangent(at - field.node_m[near.a], false);
        k += g.transpose() * block(tangent.stiffness) * &g;
        b += g.transpose() * block(tangent.damping) * &g;
    }
    if let Some(of) = crate::near_field::element_stiffness::over_state(field, false) {
        k += of.stiffness;
        b += of.damping;
    }
    (k, b)
}

fn block(m: DMat3) -> Mat<f64> {
    Mat::from_fn(3, 3, |i, j| m.col(j)[i])
}
