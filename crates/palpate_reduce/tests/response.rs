//! Frequency responses of local models as linear systems, against the body.

use faer::{Mat, c64};
use glam::DVec3;
use palpate_body::{Block, Body, Face, SemiImplicitEuler, ToolContact, ToolPoint, UniformLattice};
use palpate_local::{LocalModel, ModelId, Scheme};
use palpate_reduce::{BuilderOptions, DenseSystem, LocalModelBuilder, SecondOrderSystem};
use std::f64::consts::TAU;

const NODE: usize = 1 + 4 * (1 + 4 * 3);

/// A block pressed 4 mm deep, in motion.
fn pressed() -> (Body, ToolContact, ToolPoint) {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([4, 4, 4], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    let mut body = Body::new(block.network, block.surface).unwrap();
    let start = body.positions_m()[NODE];
    let mut contact = ToolContact::hold(&body, NODE, start).unwrap();
    let at = |i: i32| ToolPoint {
        position_m: start - DVec3::Z * 4e-5 * f64::from(i),
        velocity_m_per_s: -DVec3::Z * 0.04,
    };
    let path: Vec<ToolPoint> = (0..=100).map(at).collect();
    body.advance(Some((&mut contact, &path)), 100, SemiImplicitEuler::default()).unwrap();
    (body, contact, path[100])
}

fn built(scheme: Scheme) -> (Body, DenseSystem) {
    let (body, contact, tool) = pressed();
    let options = BuilderOptions { regularisation_per_s: 0.0, ..BuilderOptions::default() };
    let mut builder = LocalModelBuilder::new(&body, options).unwrap();
    let mut model = LocalModel::empty(builder.capacity());
    let id = ModelId { body: 1, epoch: 1, sequence: 100 };
    builder.build(scheme, &body, &contact, tool, id, &mut model).unwrap();
    assert!(!model.clamped);
    let index = builder.support().iter().position(|&node| node == NODE);
    let system = DenseSystem::of_local_model(&model, index).unwrap();
    (body, system)
}

fn relative_error(body: &Body, system: &DenseSystem, s: c64) -> f64 {
    let full = &SecondOrderSystem::of_body(body, &[NODE], 3).unwrap().response(&[s]).unwrap()[0];
    let local = &system.response(&[s])[0];
    (local - full).norm_l2() / full.norm_l2()
}

#[test]
fn reduced_models_match_the_body_at_the_frequencies_of_their_basis() {
    for scheme in [Scheme::KrylovLinear, Scheme::NearFieldExact] {
        let (body, system) = built(scheme);
        // Exact at rest; at the shift, except for the dampers at the tool.
        for (sigma, bound) in [(1e-6, 1e-8), (TAU * 20.0, 3e-4)] {
            let error = relative_error(&body, &system, c64::new(sigma, 0.0));
            assert!(error < bound, "{scheme} at {sigma}: {error}");
        }
        for (hz, bound) in [(0.1, 1e-3), (1.0, 0.05), (5.0, 0.15), (20.0, 0.05), (100.0, 0.01)] {
            let error = relative_error(&body, &system, c64::new(0.0, TAU * hz));
            assert!(error < bound, "{scheme} at {hz} Hz: {error}");
        }
    }
}

#[test]
fn tangent_equals_static_stiffness_at_every_frequency() {
    let (body, system) = built(Scheme::Tangent);
    let full = SecondOrderSystem::of_body(&body, &[NODE], 3).unwrap().static_stiffness().unwrap();
    for hz in [0.1, 1000.0] {
        let response = &system.response(&[c64::new(0.0, TAU * hz)])[0];
        let real = Mat::from_fn(3, 3, |i, j| response[(i, j)].re);
        assert!((real - &full).norm_l2() < 1e-8 * full.norm_l2());
        assert!(response.as_ref().row_iter().all(|row| row.iter().all(|v| v.im == 0.0)));
    }
}

#[test]
fn schemes_without_a_linear_system_have_no_response() {
    let (body, contact, tool) = pressed();
    let mut builder = LocalModelBuilder::new(&body, BuilderOptions::default()).unwrap();
    let mut model = LocalModel::empty(builder.capacity());
    for scheme in [Scheme::Hold, Scheme::LowPass, Scheme::Neighbourhood] {
        builder.build(scheme, &body, &contact, tool, ModelId::default(), &mut model).unwrap();
        assert!(DenseSystem::of_local_model(&model, Some(0)).is_none(), "{scheme}");
    }
    builder.build(Scheme::NearFieldExact, &body, &contact, tool, ModelId::default(), &mut model).unwrap();
    assert!(DenseSystem::of_local_model(&model, None).is_none());
    assert!(DenseSystem::of_local_model(&model, Some(99)).is_none());
}

#[test]
fn basis_columns_are_mass_orthonormal_and_zero_on_the_support_set() {
    let (body, contact, tool) = pressed();
    let mut builder = LocalModelBuilder::new(&body, BuilderOptions::default()).unwrap();
    let mut model = LocalModel::empty(builder.capacity());
    builder.build(Scheme::NearFieldExact, &body, &contact, tool, ModelId::default(), &mut model).unwrap();
    let order = builder.basis_order();
    assert_eq!(order, model.near.order);
    assert!(builder.basis_column(&body, order).is_none());
    let columns: Vec<Vec<DVec3>> = (0..order).map(|j| builder.basis_column(&body, j).unwrap()).collect();
    for (i, a) in columns.iter().enumerate() {
        assert!(builder.support().iter().all(|&node| a[node] == DVec3::ZERO));
        for (j, b) in columns.iter().enumerate() {
            let product: f64 =
                body.network().mass_kg().iter().zip(a).zip(b).map(|((m, a), b)| m * a.dot(*b)).sum();
            assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-9, "{i} {j} {product}");
        }
    }
    builder.build(Scheme::Hold, &body, &contact, tool, ModelId::default(), &mut model).unwrap();
    assert_eq!(builder.basis_order(), 0);
}
