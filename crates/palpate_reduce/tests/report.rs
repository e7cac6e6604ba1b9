//! The build report: sizes, integrator, and the error bound.

use faer::Mat;
use faer::linalg::solvers::Solve;
use glam::DVec3;
use palpate_body::*;
use palpate_local::{LocalModel, ModelId, NearEnd, Scheme, TickIntegrator};
use palpate_reduce::*;
use std::f64::consts::TAU;

const SIGMA: f64 = 80.0 * TAU;

fn block(stiffness_n_per_m: f64) -> Body {
    let lattice = UniformLattice { stiffness_n_per_m, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

fn build(
    body: &Body,
    contact: &ToolContact,
    tool: ToolPoint,
    options: BuilderOptions,
) -> (BuildReport, LocalModel) {
    let mut builder = LocalModelBuilder::new(body, options).unwrap();
    let mut model = LocalModel::empty(builder.capacity());
    let id = ModelId::default();
    let report = builder.build(Scheme::NearFieldExact, body, contact, tool, id, &mut model).unwrap();
    model.validate().unwrap();
    (report, model)
}

/// Dynamic stiffness at σ against a motion of the driven node along z, from the full matrices and from a local model.
fn stiffnesses(body: &Body, node: usize, model: &LocalModel) -> (f64, f64) {
    let pattern = TangentPattern::new(body);
    let mut tangent = pattern.zero();
    pattern.fill(body, false, &mut tangent);
    let network = body.network();
    let dense = (tangent.stiffness().to_dense(), tangent.damping().to_dense());
    let a = |i: usize, j: usize| {
        let m = if i == j { SIGMA * SIGMA * network.mass_kg()[network.free()[i / 3]] } else { 0.0 };
        dense.0[(i, j)] + SIGMA * dense.1[(i, j)] + m
    };
    let c = 3 * network.free_index(node).unwrap() + 2;
    let rest: Vec<usize> = (0..3 * network.free().len()).filter(|dof| dof / 3 != c / 3).collect();
    let a_rr = Mat::from_fn(rest.len(), rest.len(), |i, j| a(rest[i], rest[j]));
    let b = Mat::from_fn(rest.len(), 1, |i, _| a(rest[i], c));
    let own = dense.0[(c, c)] + SIGMA * dense.1[(c, c)];
    let schur = |b: &Mat<f64>, w: &Mat<f64>| own - (0..b.nrows()).map(|i| b[(i, 0)] * w[(i, 0)]).sum::<f64>();
    let exact = schur(&b, &a_rr.partial_piv_lu().solve(&b));

    let (field, p) = (&model.near, model.near.order);
    let mut a = Mat::from_fn(p, p, |i, j| {
        let m = if i == j { SIGMA * SIGMA } else { 0.0 };
        field.stiffness[i * p + j] + SIGMA * field.damping[i * p + j] + m
    });
    let mut b = Mat::zeros(p, 1);
    for near in &field.near[..field.springs] {
        let NearEnd::Ring(ring) = near.b else { continue };
        let rows = Mat::from_fn(3, p, |axis, j| field.basis[3 * (field.ring * j + ring) + axis]);
        let tangent = near.spring.tangent(field.ring_m[ring] - field.node_m[near.a], false);
        let block = tangent.stiffness + SIGMA * tangent.damping;
        let block = Mat::from_fn(3, 3, |i, j| block.col(j)[i]);
        a += rows.transpose() * &block * &rows;
        b -= rows.transpose() * block.subcols(2, 1);
    }
    (exact, schur(&b, &a.partial_piv_lu().solve(&b)))
}

#[test]
fn stiffness_error_is_at_most_its_bound() {
    let node = 3 + 6 * (3 + 6 * 5);
    for (shifts_hz, order_limit) in [
        ([Some(20.0), None, None, None], 48),
        ([None; 4], 48),
        ([None; 4], 3),
        ([Some(5.0), Some(20.0), Some(80.0), None], 48),
    ] {
        let mut body = block(100.0);
        let start = body.positions_m()[node];
        let mut contact = ToolContact::hold(&body, node, start).unwrap();
        let path: Vec<ToolPoint> = (0..=100)
            .map(|i| ToolPoint::at_rest(start - DVec3::Z * 0.01 * (f64::from(i) / 50.0).min(1.0)))
            .collect();
        body.advance(Some((&mut contact, &path)), 100, SemiImplicitEuler::default()).unwrap();
        let options = BuilderOptions { shifts_hz, order_limit, ..BuilderOptions::default() };
        let (report, model) = build(&body, &contact, path[100], options);
        let (exact, reduced) = stiffnesses(&body, node, &model);
        let (error, bound) = (reduced / exact - 1.0, report.error_bound.unwrap());
        // The bound holds, and is not much larger than the error.
        assert!((-1e-12..=1.01 * bound + 1e-12).contains(&error), "{error}, {bound}");
        assert!(bound < 20.0 * error.max(1e-6), "{error}, {bound}, {shifts_hz:?}, {order_limit}");
    }
}

#[test]
fn report_matches_the_built_model() {
    let body = block(100.0);
    let ball = ToolContact::touch(ToolShape::Sphere { radius_m: 0.005 }, 0.3).unwrap();
    let above = |z: f64| ToolPoint::at_rest(DVec3::new(0.004, 0.003, z));
    let (report, model) = build(&body, &ball, above(0.056), BuilderOptions::default());
    assert_eq!((report.scheme, report.tangent_clamped), (Scheme::NearFieldExact, false));
    assert_eq!((report.order, report.support_nodes), (model.near.order, model.near.nodes));
    assert_eq!(report.states, 3 * report.support_nodes + report.order);
    assert_eq!(report.integrator, Some(TickIntegrator::Explicit { substeps: 4 }));
    assert!(report.time_s > 0.0 && report.error_bound.is_some_and(|bound| bound < 0.05), "{report:?}");
    // A ball that stays, or slides over one node spacing of 20 mm within the horizon, touches no more than nine nodes. One that slides
    // over three of them touches more, for which the support set grows.
    assert!(!report.support_truncated);
    let slides = |v: f64| ToolPoint { velocity_m_per_s: DVec3::X * v, ..above(0.052) };
    let horizon_s = BuilderOptions::default().horizon_s;
    let truncated = |v: f64, options| build(&body, &ball, slides(v), options).0.support_truncated;
    assert!(!truncated(0.02 / horizon_s, BuilderOptions::default()));
    assert!(truncated(0.06 / horizon_s, BuilderOptions::default()));
    for large in [
        BuilderOptions { support_nodes: 32, ..BuilderOptions::default() },
        BuilderOptions { max_support_nodes: 24, ..BuilderOptions::default() },
    ] {
        assert!(!truncated(0.06 / horizon_s, large));
    }
    // A stiff body has implicit ticks; a tool out of reach has no support set.
    let (stiff, _) = build(&block(50e3), &ball, above(0.056), BuilderOptions::default());
    assert_eq!(stiff.integrator, Some(TickIntegrator::Implicit { substeps: 2 }));
    let (far, _) = build(&body, &ball, above(0.2), BuilderOptions::default());
    let empty = BuildReport { scheme: Scheme::NearFieldExact, time_s: far.time_s, ..BuildReport::default() };
    assert_eq!(far, empty);
}
