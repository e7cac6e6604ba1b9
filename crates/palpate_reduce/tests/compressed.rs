//! Local models of a body with strongly compressed cells, whose volume barriers are active.

use faer::c64;
use glam::DVec3;
use palpate_body::*;
use palpate_local::{LocalModel, LocalState, ModelId, Sample, Scheme};
use palpate_reduce::*;
use std::f64::consts::TAU;

/// The middle of the top of 5 × 5 × 5 nodes.
const NODE: usize = 2 + 5 * (4 + 5 * 2);

fn start() -> (Body, ToolContact, DVec3) {
    let block = Block::new([5; 3], DVec3::splat(0.08)).unwrap().fix(Face::NegY);
    let block = block.tissue(&Tissue { damping: Damping::Ratio(0.7), ..Tissue::default() }).unwrap();
    let body = Body::new(block.network, block.surface).unwrap();
    let at = body.positions_m()[NODE];
    let contact = ToolContact::hold(&body, NODE, at).unwrap();
    (body, contact, at)
}

/// The block pressed 19 mm deep and at rest.
fn pressed() -> (Body, ToolContact, ToolPoint) {
    let (mut body, mut contact, at) = start();
    let path: Vec<ToolPoint> = (0..=4000)
        .map(|i| ToolPoint::at_rest(at - DVec3::Y * 0.019 * (f64::from(i) / 400.0).min(1.0)))
        .collect();
    body.advance(Some((&mut contact, &path)), 4000, SemiImplicitEuler::default()).unwrap();
    assert!(body.active_barriers().any(|tetrahedron| tetrahedron.nodes.contains(&NODE)));
    assert_eq!(body.inverted_cells().count(), 0);
    (body, contact, path[4000])
}

fn build(scheme: Scheme, options: BuilderOptions) -> (Body, ToolContact, LocalModel, LocalState) {
    let (body, contact, tool) = pressed();
    let mut builder = LocalModelBuilder::new(&body, options).unwrap();
    let mut model = LocalModel::empty(builder.capacity());
    builder.build(scheme, &body, &contact, tool, ModelId::default(), &mut model).unwrap();
    model.validate().unwrap();
    assert!(!model.clamped);
    let mut state = LocalState::with_capacity(builder.capacity());
    state.start(&model);
    (body, contact, model, state)
}

#[test]
fn local_model_matches_the_dynamic_stiffness_of_the_compressed_body() {
    for scheme in [Scheme::KrylovLinear, Scheme::NearFieldExact] {
        let options = BuilderOptions { regularisation_per_s: 0.0, ..BuilderOptions::default() };
        let (body, _, model, _) = build(scheme, options);
        let system = DenseSystem::of_local_model(&model, Some(0)).unwrap();
        assert_eq!(model.near.tetrahedra > 0, scheme == Scheme::NearFieldExact);
        for (sigma, bound) in [(1e-6, 1e-7), (TAU * 20.0, 0.02)] {
            let s = [c64::new(sigma, 0.0)];
            let full = &SecondOrderSystem::of_body(&body, &[NODE], 3).unwrap().response(&s).unwrap()[0];
            let error = (&system.response(&s)[0] - full).norm_l2() / full.norm_l2();
            assert!(error < bound, "{scheme} at {sigma}: {error}");
        }
    }
}

#[test]
fn displayed_force_starts_at_the_force_of_the_body() {
    for integrator in [LocalIntegrator::Explicit, LocalIntegrator::Implicit { substeps: 2 }] {
        let options = BuilderOptions { integrator, ..BuilderOptions::default() };
        let (body, contact, model, mut state) = build(Scheme::NearFieldExact, options);
        let sample = Sample { position_m: model.position_m, sequence: 1, time_s: 1e-3, ..Sample::default() };
        let energy = state.energy_j(&model).unwrap();
        for _ in 0..20 {
            state.advance(&model, &sample, 1e-3);
        }
        let (got, expected) = (state.force_n(&model, &sample), contact.displayed_force_n(&body));
        assert!(expected.y > 1.0);
        assert!((got - expected).length() < 1e-3 * expected.length(), "{got} N, not {expected} N");
        assert!((state.energy_j(&model).unwrap() - energy).abs() < 1e-4 * energy);
    }
}

#[test]
fn press_into_compressed_cells_matches_the_oracle() {
    let (body, contact, at) = start();
    let samples: Vec<Sample> = (0..=1200)
        .map(|i| {
            let t = f64::from(i) * 1e-3;
            // 17 mm deep in 0.3 s, then an oscillation by 4 mm at 2 Hz.
            let to = |t: f64| {
                let swing = if t > 0.3 { 0.002 * (1.0 - (TAU * 2.0 * (t - 0.3)).cos()) } else { 0.0 };
                at + DVec3::NEG_Y * (0.0085 * (1.0 - (TAU * t.min(0.3) / 0.6).cos()) - swing)
            };
            let velocity_m_per_s = (to(t) - to(t - 1e-3)) / 1e-3;
            Sample { sequence: i as u64, time_s: t, position_m: to(t), velocity_m_per_s, ..Sample::default() }
        })
        .collect();
    for integrator in [LocalIntegrator::Explicit, LocalIntegrator::Implicit { substeps: 2 }] {
        let builder = BuilderOptions { integrator, ..BuilderOptions::default() };
        let options = ComparisonOptions { builder, ..ComparisonOptions::default() };
        let schemes = [Scheme::Hold, Scheme::NearFieldExact];
        let comparison = Comparison::run(&body, &contact, &samples, &schemes, &options).unwrap();
        let [hold, near] = schemes.map(|scheme| comparison.relative_rms_error(scheme, 300).unwrap());
        assert!(near < 0.01 && near < 0.1 * hold, "{hold}, {near}");
    }
}
