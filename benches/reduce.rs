//! Cost of reductions of the seed paper's mesh, a system of order 524: balanced truncation with its Gramians, and a Krylov model of 20
//! states. Run with `cargo bench -p palpate_benches --bench reduce`.

use criterion::{Criterion, criterion_group, criterion_main};
use palpate_paper::Specimen;
use palpate_reduce::{Balancing, HInf, SecondOrderSystem};
use std::f64::consts::TAU;
use std::hint::black_box;

fn specimen() -> SecondOrderSystem {
    let (stiffness_n_per_m, mass_kg) = (200.0_f64, 0.01);
    let damping_ns_per_m = 1.5 * (stiffness_n_per_m * mass_kg).sqrt();
    let specimen = Specimen { dimension: 2, cells: 12, stiffness_n_per_m, damping_ns_per_m, mass_kg };
    specimen.system().expect("the specimen is valid")
}

fn reductions(c: &mut Criterion) {
    let system = specimen();
    let mut group = c.benchmark_group("reduce order 524");
    group.bench_function("balanced truncation to 10 states", |b| {
        b.iter(|| {
            let full = black_box(&system).state_space().expect("M is positive definite");
            Balancing::new(full).and_then(|balancing| balancing.truncate(10)).expect("the specimen is stable")
        });
    });
    let shifts_per_s = [5.0, 20.0, 80.0].map(|hz| TAU * hz);
    group.bench_function("Krylov, 20 states", |b| {
        b.iter(|| {
            let v = black_box(&system).krylov_basis(&shifts_per_s).expect("K is positive definite");
            let reduced = system.project(v.as_ref()).expect("the basis fits");
            assert_eq!(2 * reduced.unknowns(), 20);
            reduced
        });
    });
    group.bench_function("10 modes of vibration", |b| {
        b.iter(|| {
            let v = black_box(&system).modal_basis(10).expect("there are more unknowns than modes");
            system.project(v.as_ref()).expect("the basis fits")
        });
    });
    group.finish();
}

fn norms(c: &mut Criterion) {
    let full = specimen().state_space().expect("M is positive definite");
    let reduced = Balancing::new(full.clone()).and_then(|b| b.truncate(10)).expect("the specimen is stable");
    let error = full.minus(&reduced.system).expect("both have two inputs");
    c.bench_function("H-infinity norm, order 534", |b| b.iter(|| HInf::new(&error, 1e-4)));
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = reductions, norms
}
criterion_main!(benches);
