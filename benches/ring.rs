//! Cost of each part of the pipeline on blocks and on a mesh: a tick of the loop for every scheme, a model step, building a local
//! model. Run with `cargo bench -p palpate_benches`.

use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use palpate_benches::lump;
use palpate_body::{
    Block, Body, CellLattice, CellSize, ClosedMesh, Face, SemiImplicitEuler, Tissue, ToolContact, ToolPoint,
    ToolShape, UniformLattice,
};
use palpate_haptics::{LoopConfig, LoopSettings, Reading, haptic_loop};
use palpate_local::{LocalModel, ModelId, Scheme};
use palpate_reduce::{BuilderOptions, LocalIntegrator, LocalModelBuilder};
use std::hint::black_box;

fn held_block(nodes: usize) -> (Body, ToolContact, ToolPoint) {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([nodes; 3], DVec3::splat(0.1)).and_then(|b| b.fix(Face::NegZ).uniform(&lattice));
    let block = block.expect("the block is valid");
    let body = Body::new(block.network, block.surface).expect("the surface belongs to the network");
    let node = nodes / 2 + nodes * (nodes / 2 + nodes * (nodes - 1));
    let at = ToolPoint::at_rest(body.positions_m()[node]);
    let contact = ToolContact::hold(&body, node, at.position_m).expect("the node is free");
    (body, contact, at)
}

/// A lump of 10,000 vertices with a sphere pressed 3 mm into it from above.
fn touched_lump() -> (Body, ToolContact, ToolPoint) {
    let (at, triangles) = lump(10_000);
    let top = at.iter().copied().max_by(|a, b| a.y.total_cmp(&b.y)).expect("there are vertices");
    let mesh = ClosedMesh::new(at, triangles).expect("the lump is closed");
    let lattice = CellLattice::fit(&mesh, CellSize::Along(10)).expect("the cells fit");
    let made = lattice.allow_unconstrained().tissue(&Tissue::default()).expect("the lump is valid");
    let mut body = Body::new(made.network, made.surface).expect("the surface belongs to the network");
    let shape = ToolShape::Sphere { radius_m: 0.005 };
    let mut contact = ToolContact::touch(shape, 0.3).expect("the tool is valid");
    let path: Vec<ToolPoint> =
        (0..=50).map(|i| ToolPoint::at_rest(top + DVec3::Y * (0.005 - 6e-5 * f64::from(i)))).collect();
    body.advance(Some((&mut contact, &path)), 50, SemiImplicitEuler::default()).expect("the step is stable");
    (body, contact, path[50])
}

/// A block of tissue of 0.1 m with `nodes` along each edge, with a sphere pressed into it from above by `depth_m`.
fn pressed_block(nodes: usize, radius_m: f64, depth_m: f64) -> (Body, ToolContact, ToolPoint) {
    let block = Block::new([nodes; 3], DVec3::splat(0.1)).map(|block| block.fix(Face::NegZ));
    let block = block.and_then(|block| block.tissue(&Tissue::default())).expect("the block is valid");
    let mut body = Body::new(block.network, block.surface).expect("the surface belongs to the network");
    let mut contact = ToolContact::touch(ToolShape::Sphere { radius_m }, 0.3).expect("the tool is valid");
    let top = DVec3::new(0.003, 0.004, 0.05 + radius_m);
    let down = |i: i32| top - DVec3::Z * depth_m * (f64::from(i) / 200.0).min(1.0);
    let path: Vec<ToolPoint> = (0..=400).map(|i| ToolPoint::at_rest(down(i))).collect();
    body.advance(Some((&mut contact, &path)), 400, SemiImplicitEuler::default()).expect("the step is stable");
    (body, contact, path[400])
}

/// A complete tick of the loop, with exchange and safety chain, for the local model of `scheme`.
fn tick_of(
    body: &Body,
    contact: &ToolContact,
    at: ToolPoint,
    scheme: Scheme,
    options: BuilderOptions,
) -> impl FnMut() -> DVec3 + use<> {
    let mut builder = LocalModelBuilder::new(body, options).expect("the options are valid");
    let (mut handle, mut haptic_loop) =
        haptic_loop(LoopConfig::default(), LoopSettings::default()).expect("the settings are valid");
    let mut n = 0u64;
    let mut tick = move || {
        n += 1;
        let wobble = DVec3::Z * 1e-3 * (n as f64 * 0.01).sin();
        let ticked = haptic_loop.tick(1, Ok(Reading::at(at.position_m - wobble)));
        haptic_loop.finish_tick(&ticked, None, Ok(()));
        ticked.device_force_n
    };
    tick();
    let id = ModelId { body: 1, epoch: 0, sequence: 1 };
    // On another thread, as in an app: a factorisation leaves wide registers in use, which slows ticks on its own thread.
    std::thread::scope(|scope| {
        let build = || {
            builder.build(scheme, body, contact, at, id, handle.model_slot()).expect("the capacity suffices")
        };
        scope.spawn(build);
    });
    handle.publish_model();
    tick
}

fn ticks(c: &mut Criterion) {
    let mut group = c.benchmark_group("tick");
    for nodes in [6, 10, 20] {
        let (body, contact, at) = held_block(nodes);
        // The largest body shows that the cost of a tick does not depend on its size.
        let of_near_fields = |scheme: &Scheme| nodes < 20 || *scheme == Scheme::NearFieldExact;
        for scheme in Scheme::ALL.into_iter().filter(of_near_fields) {
            let mut tick = tick_of(&body, &contact, at, scheme, BuilderOptions::default());
            group.bench_function(format!("{}, {nodes}^3", scheme.name()), |b| b.iter(&mut tick));
        }
        // A touch, with the surrounding nodes as support set.
        let touch =
            ToolContact::touch(ToolShape::Sphere { radius_m: 0.005 }, 0.3).expect("the tool is valid");
        let above = ToolPoint::at_rest(at.position_m + DVec3::new(0.003, 0.002, 0.0045));
        for support_nodes in [3, 9, 12] {
            for integrator in [LocalIntegrator::Explicit, LocalIntegrator::Implicit { substeps: 1 }] {
                let options = BuilderOptions { support_nodes, integrator, ..BuilderOptions::default() };
                let mut tick = tick_of(&body, &touch, above, Scheme::NearFieldExact, options);
                let name = format!("touch, {support_nodes} nodes, {integrator:?}, {nodes}^3");
                group.bench_function(name, |b| b.iter(&mut tick));
            }
        }
    }
    // Resting contacts: one row, and nine rows of a sphere wider than a cell.
    for (name, nodes, radius_m, depth_m) in [("one row", 6, 0.005, 0.003), ("nine rows", 11, 0.02, 0.005)] {
        let (body, contact, at) = pressed_block(nodes, radius_m, depth_m);
        let mut tick = tick_of(&body, &contact, at, Scheme::NearFieldExact, BuilderOptions::default());
        group.bench_function(format!("press on tissue, {name}"), |b| b.iter(&mut tick));
    }
    let (body, contact, at) = touched_lump();
    let mut tick = tick_of(&body, &contact, at, Scheme::NearFieldExact, BuilderOptions::of(&body));
    group.bench_function("touch of a mesh", |b| b.iter(&mut tick));
}

fn model_steps(c: &mut Criterion) {
    let mut group = c.benchmark_group("model_side");
    for nodes in [6, 10] {
        let (mut body, mut contact, at) = held_block(nodes);
        let path = vec![at; 51];
        group.bench_function(format!("step of 50 ticks, {nodes}^3"), |b| {
            b.iter(|| body.advance(Some((&mut contact, &path)), 50, SemiImplicitEuler::default()));
        });
        let mut builder =
            LocalModelBuilder::new(&body, BuilderOptions::default()).expect("the options are valid");
        let mut model = LocalModel::empty(builder.capacity());
        for scheme in [Scheme::Tangent, Scheme::Neighbourhood, Scheme::KrylovLinear, Scheme::NearFieldExact] {
            group.bench_function(format!("build {}, {nodes}^3", scheme.name()), |b| {
                b.iter(|| {
                    builder.build(scheme, black_box(&body), &contact, at, ModelId::default(), &mut model)
                });
            });
        }
    }
    let (body, contact, at) = touched_lump();
    let mut builder =
        LocalModelBuilder::new(&body, BuilderOptions::of(&body)).expect("the options are valid");
    let mut model = LocalModel::empty(builder.capacity());
    let mut build = || {
        let scheme = Scheme::NearFieldExact;
        builder.build(scheme, black_box(&body), &contact, at, ModelId::default(), &mut model)
    };
    let report = build().expect("the capacity suffices");
    let (nodes, states) = (body.network().node_count(), report.states);
    let name = format!("build near-field-exact of {states} states, a mesh with {nodes} nodes, touched");
    group.bench_function(name, |b| b.iter(&mut build));
}

criterion_group! { name = benches; config = Criterion::default().sample_size(20); targets = ticks, model_steps }
criterion_main!(benches);
