//! Local models built from a body: stiffness, neighbourhood, energy, options and errors.

use faer::linalg::solvers::Solve;
use glam::DVec3;
use palpate_body::*;
use palpate_local::{Capacity, Contact, LocalModel, LocalState, ModelId, Sample, Scheme};
use palpate_reduce::*;

const LATTICE: UniformLattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
const ID: ModelId = ModelId { body: 7, epoch: 2, sequence: 50 };

fn block(nodes: [usize; 3]) -> Body {
    let block = Block::new(nodes, DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&LATTICE).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

fn build(scheme: Scheme, body: &Body, contact: &ToolContact) -> LocalModel {
    let mut builder = LocalModelBuilder::new(body, BuilderOptions::default()).unwrap();
    let mut model = LocalModel::empty(builder.capacity());
    builder.build(scheme, body, contact, ToolPoint::default(), ID, &mut model).unwrap();
    model.validate().unwrap();
    model
}

/// A block whose top middle node is pressed down by `depth` over 200 ticks, and then held until it is at rest.
fn pressed(nodes: [usize; 3], depth: f64) -> (Body, ToolContact, usize) {
    let mut body = block(nodes);
    let node = nodes[0] / 2 + nodes[0] * (nodes[1] / 2 + nodes[1] * (nodes[2] - 1));
    let start = body.positions_m()[node];
    let mut contact = ToolContact::hold(&body, node, start).unwrap();
    let path: Vec<ToolPoint> = (0..=2000)
        .map(|i| ToolPoint::at_rest(start - DVec3::Z * depth * (f64::from(i) / 200.0).min(1.0)))
        .collect();
    body.advance(Some((&mut contact, &path)), 2000, SemiImplicitEuler::default()).unwrap();
    (body, contact, node)
}

#[test]
fn static_stiffness_equals_dense_schur_complement() {
    let (body, contact, node) = pressed([4, 4, 4], 0.02);
    let model = build(Scheme::Tangent, &body, &contact);
    let pattern = TangentPattern::new(&body);
    let mut tangent = pattern.zero();
    pattern.fill(&body, false, &mut tangent);
    let k = tangent.stiffness().to_dense();
    let c = 3 * body.network().free_index(node).unwrap();
    let r: Vec<usize> = (0..k.nrows()).filter(|i| !(c..c + 3).contains(i)).collect();
    let krr = faer::Mat::from_fn(r.len(), r.len(), |i, j| k[(r[i], r[j])]);
    let krc = faer::Mat::from_fn(r.len(), 3, |i, j| k[(r[i], c + j)]);
    let x = krr.partial_piv_lu().solve(&krc);
    let d = faer::Mat::from_fn(3, 3, |i, j| k[(c + i, c + j)]) - krc.transpose() * &x;
    for i in 0..3 {
        for j in 0..3 {
            let error = (model.stiffness_n_per_m.col(j)[i] - d[(i, j)]).abs();
            assert!(error < 1e-4 * d[(2, 2)], "({i}, {j}): {error} N/m");
        }
    }
    assert!(!model.clamped);
    assert_eq!(model.contact, Contact::Held);
    assert_eq!(model.force_n, contact.displayed_force_n(&body));
}

#[test]
fn static_stiffness_equals_slope_of_force_at_rest() {
    let (lower, ..) = pressed([4, 4, 4], 0.0100);
    let (body, contact, _) = pressed([4, 4, 4], 0.0101);
    let (upper, ..) = pressed([4, 4, 4], 0.0102);
    let slope = (contact.displayed_force_n(&upper).z - contact.displayed_force_n(&lower).z) / 2e-4;
    let predicted = build(Scheme::Tangent, &body, &contact).stiffness_n_per_m.z_axis.z;
    assert!((slope / predicted - 1.0).abs() < 1e-3, "{slope} N/m, tangent {predicted} N/m");
}

#[test]
fn static_stiffness_of_held_and_touched_points_equals_slope_of_force_at_rest() {
    // A held triangle; a ball that sticks; one without friction.
    let node = |i: usize, j: usize| i + 4 * (j + 4 * 3);
    let ball = |friction| ToolContact::touch(ToolShape::Sphere { radius_m: 0.02 }, friction).unwrap();
    let holding = |body: &Body| {
        let point = BodyPoint::new(vec![(node(1, 1), 0.5), (node(2, 1), 0.3), (node(1, 2), 0.2)]).unwrap();
        ToolContact::hold_point(body, point, DVec3::Z * 0.07).unwrap()
    };
    for (friction, along) in
        [(None, DVec3::Z), (None, DVec3::X), (Some(2.0), DVec3::Z), (Some(0.0), DVec3::Z)]
    {
        let at = |by: f64| {
            let mut body = block([4, 4, 4]);
            let mut contact = friction.map_or_else(|| holding(&body), ball);
            let start = DVec3::new(0.004, 0.009, 0.07);
            let end = start - DVec3::Z * 0.01 + along * by;
            let path: Vec<ToolPoint> = (0..=3000)
                .map(|i| ToolPoint::at_rest(start + (end - start) * (f64::from(i) / 200.0).min(1.0)))
                .collect();
            body.advance(Some((&mut contact, &path)), 3000, SemiImplicitEuler::default()).unwrap();
            (body, contact)
        };
        let force = |by| {
            let (body, contact) = at(by);
            contact.displayed_force_n(&body).dot(along)
        };
        let slope = -(force(1e-5) - force(-1e-5)) / 2e-5;
        let (body, contact) = at(0.0);
        let k = build(Scheme::Tangent, &body, &contact).stiffness_n_per_m;
        let predicted = along.dot(k * along);
        // The stiffness of the rows does not include that a ball rolls on a tilting face and that its contact widens. Measured: 8 and 9 %.
        let tolerance = if friction.is_some() { 0.1 } else { 1e-3 };
        assert!(
            (slope / predicted - 1.0).abs() < tolerance,
            "{slope} N/m, tangent {predicted} N/m, {friction:?}"
        );
    }
}

#[test]
fn neighbourhood_is_the_ring_of_nodes_around_the_tool() {
    let body = block([6, 6, 6]);
    let node = 3 + 6 * (3 + 6 * 5);
    let contact = ToolContact::hold(&body, node, DVec3::ZERO).unwrap();
    let model = build(Scheme::Neighbourhood, &body, &contact);
    assert_eq!(model.reduced.order, 3 * 17);
    // A rigid shift of ring and tool stretches only the springs to fixed nodes. Every neighbour of the tool is in the ring, so the tool's row
    // of K times the shift is zero.
    let mut row = model.stiffness_n_per_m.z_axis;
    for i in 0..17 {
        for c in 0..3 {
            row[c] += model.reduced.stiffness_rc[3 * (3 * i + 2) + c];
        }
    }
    assert!(row.length() < 1e-10, "{row}");
    assert_eq!(LocalModelBuilder::new(&body, BuilderOptions::default()).unwrap().capacity().order, 3 * 26);
}

#[test]
fn tool_without_contact_gives_zero_force() {
    let body = block([3, 3, 3]);
    let contact = ToolContact::touch(ToolShape::Sphere { radius_m: 0.005 }, 0.3).unwrap();
    for scheme in Scheme::ALL {
        let model = build(scheme, &body, &contact);
        assert_eq!((model.contact, model.force_n), (Contact::Apart, DVec3::ZERO));
        assert_eq!(model.id, ID);
    }
}

#[test]
fn buckled_body_uses_the_clamped_tangent() {
    let mut body = block([3, 3, 3]);
    let squeezed: Vec<DVec3> =
        body.network().rest_m().iter().map(|x| DVec3::new(x.x, x.y, 0.3 * (x.z + 0.05) - 0.05)).collect();
    body.set_state(&squeezed, &vec![DVec3::ZERO; squeezed.len()]).unwrap();
    let contact = ToolContact::hold(&body, 22, DVec3::ZERO).unwrap();
    let model = build(Scheme::Tangent, &body, &contact);
    assert!(model.clamped);
    assert!(model.stiffness_n_per_m.is_finite());
    assert!(model.stiffness_n_per_m.determinant() > 0.0);
}

#[test]
fn near_field_energy_matches_the_body() {
    let weights = vec![(60, 0.5), (59, 0.2), (56, 0.3)];
    let hold = |body: &Body, point: bool| {
        let at_m = DVec3::new(0.01, 0.02, 0.05);
        if point {
            ToolContact::hold_point(body, BodyPoint::new(weights.clone()).unwrap(), at_m).unwrap()
        } else {
            ToolContact::hold(body, 60, at_m).unwrap()
        }
    };
    for (is_point, integrator) in [
        (false, LocalIntegrator::Explicit),
        (true, LocalIntegrator::Explicit),
        (true, LocalIntegrator::Implicit { substeps: 4 }),
    ] {
        let mut body = block([4, 4, 4]);
        body.set_gravity(DVec3::Z * -9.81).unwrap();
        let mut contact = hold(&body, is_point);
        let at = |i: usize| {
            let t = i as f64 * 1e-3;
            let by = DVec3::new(0.002 * (9.0 * t).sin(), 0.0, -0.008 * (1.0 - (12.0 * t).cos()));
            DVec3::new(0.01, 0.02, 0.05) + by
        };
        let sample = |i: usize| Sample {
            sequence: i as u64,
            position_m: at(i),
            velocity_m_per_s: if i == 0 { DVec3::ZERO } else { (at(i) - at(i - 1)) / 1e-3 },
            ..Sample::default()
        };
        let point = |i: usize| ToolPoint {
            position_m: sample(i).position_m,
            velocity_m_per_s: sample(i).velocity_m_per_s,
        };
        let path: Vec<ToolPoint> = (0..=150).map(point).collect();
        body.advance(Some((&mut contact, &path[..=100])), 100, SemiImplicitEuler::default()).unwrap();
        let options = BuilderOptions { integrator, ..BuilderOptions::default() };
        let mut builder = LocalModelBuilder::new(&body, options).unwrap();
        let mut model = LocalModel::empty(builder.capacity());
        builder.build(Scheme::NearFieldExact, &body, &contact, path[100], ID, &mut model).unwrap();
        let mut state = LocalState::with_capacity(builder.capacity());
        state.start(&model);
        let before = body.energy().total_j();
        assert!((state.energy_j(&model).unwrap() - before).abs() < 1e-15);
        for i in 101..=150 {
            state.advance(&model, &sample(i), 1e-3);
        }
        body.advance(Some((&mut contact, &path[100..])), 50, SemiImplicitEuler::default()).unwrap();
        let (local, full) = (state.energy_j(&model).unwrap() - before, body.energy().total_j() - before);
        assert!(
            full.abs() > 1e-3 && (local / full - 1.0).abs() < 0.03,
            "{local} J, {full} J, {is_point} {integrator:?}"
        );
    }
}

#[test]
fn rejects_options_out_of_range_and_gaps_in_samples() {
    let body = block([3, 3, 3]);
    let good = BuilderOptions::default();
    for bad in [
        BuilderOptions { tick_s: 0.0, ..good },
        BuilderOptions { tick_s: f64::NAN, ..good },
        BuilderOptions { rings: 0, ..good },
        BuilderOptions { rings: 9, ..good },
        BuilderOptions { regularisation_per_s: -1.0, ..good },
    ] {
        assert!(matches!(LocalModelBuilder::new(&body, bad), Err(ReduceError::Option { .. })));
    }
    let contact = ToolContact::touch(ToolShape::Sphere { radius_m: 0.005 }, 0.3).unwrap();
    let samples = [Sample::default(), Sample { sequence: 2, ..Sample::default() }];
    let run = |options| Comparison::run(&body, &contact, &samples, &[], &options).unwrap_err();
    let gap = ReduceError::Samples { index: 1, found: 2, expected: 1 };
    assert_eq!(run(ComparisonOptions::default()), gap);
    let good = ComparisonOptions::default();
    for bad in [
        ComparisonOptions { period_ticks: 0, ..good },
        ComparisonOptions { period_ticks: usize::MAX, ..good },
        ComparisonOptions { delay_ticks: usize::MAX, ..good },
        ComparisonOptions { builder: BuilderOptions { tick_s: 1e-2, ..Default::default() }, ..good },
    ] {
        assert!(matches!(run(bad), ReduceError::Option { .. }), "{bad:?}");
    }
}

#[test]
fn longer_horizon_enlarges_the_support_set() {
    let body = block([8, 8, 8]);
    let contact = ToolContact::touch(ToolShape::Sphere { radius_m: 0.005 }, 0.3).unwrap();
    let options = BuilderOptions { horizon_s: 0.01, support_nodes: 32, ..BuilderOptions::default() };
    let mut builder = LocalModelBuilder::new(&body, options).unwrap();
    let mut model = LocalModel::empty(builder.capacity());
    let top = body.positions_m().iter().copied().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    let tool = ToolPoint::at_rest(DVec3::new(0.0, 0.0, top.z + 0.006));
    let mut support_nodes = |builder: &mut LocalModelBuilder| {
        let id = ModelId::default();
        builder.build(Scheme::NearFieldExact, &body, &contact, tool, id, &mut model).unwrap().support_nodes
    };
    let short = support_nodes(&mut builder);
    builder.set_horizon_s(0.2).unwrap();
    assert!(support_nodes(&mut builder) > short, "{short}");
    let text = builder.set_horizon_s(f64::NAN).unwrap_err().to_string();
    assert_eq!(text, "horizon of a local model, s is NaN; it must be 0.001 to 10");
}

#[test]
fn build_rejects_model_of_too_small_capacity() {
    let body = block([4, 4, 4]);
    let mut builder = LocalModelBuilder::new(&body, BuilderOptions::default()).unwrap();
    let contact = ToolContact::hold(&body, 60, DVec3::ZERO).unwrap();
    let mut small = LocalModel::empty(Capacity::of_order(6));
    let error = builder.build(Scheme::Neighbourhood, &body, &contact, ToolPoint::default(), ID, &mut small);
    assert!(matches!(error, Err(ReduceError::LocalModel(_))));
    assert_eq!((small.contact, small.reduced.order), (Contact::Apart, 0));
}

#[test]
fn build_rejects_contact_with_another_body() {
    let body = block([3, 3, 3]);
    let mut builder = LocalModelBuilder::new(&body, BuilderOptions::default()).unwrap();
    let mut model = LocalModel::empty(builder.capacity());
    let big = Block::new([8; 3], DVec3::splat(0.1)).unwrap().fix(Face::PosZ).uniform(&LATTICE).unwrap();
    let big = Body::new(big.network, big.surface).unwrap();
    for node in [0, 400] {
        let foreign = ToolContact::hold(&big, node, DVec3::ZERO).unwrap();
        let result = builder.build(Scheme::Tangent, &body, &foreign, ToolPoint::default(), ID, &mut model);
        assert!(matches!(result, Err(ReduceError::Body(BodyError::InvalidNode { .. }))));
        assert_eq!(model.contact, Contact::Apart);
    }
}

#[test]
fn comparison_runs_with_short_periods_and_long_delays() {
    let body = block([4, 4, 4]);
    let node = 2 + 4 * (2 + 4 * 3);
    let start = body.positions_m()[node];
    let contact = ToolContact::hold(&body, node, start).unwrap();
    let samples: Vec<Sample> = (0..400)
        .map(|i| {
            let t = i as f64 * 1e-3;
            let position_m = start - DVec3::Z * 0.004 * (20.0 * t).sin();
            let velocity_m_per_s = -DVec3::Z * 0.08 * (20.0 * t).cos();
            Sample { sequence: i, position_m, velocity_m_per_s, ..Sample::default() }
        })
        .collect();
    for (period_ticks, delay_ticks) in [(5, 40), (2, 30), (1, 0), (50, 120)] {
        let options = ComparisonOptions { period_ticks, delay_ticks, ..Default::default() };
        let run = Comparison::run(&body, &contact, &samples, &Scheme::ALL, &options).unwrap();
        assert!(run.relative_rms_error(Scheme::Neighbourhood, 200).unwrap() < 1.5);
    }
}
