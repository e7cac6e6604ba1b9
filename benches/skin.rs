//! Cost of the rendered mesh of a body: moving 50,000 vertices and their normals with the nodes, and building the body. Run with `cargo bench -p palpate_benches --bench skin`.

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DAffine3, DVec3};
use palpate_benches::lump;
use palpate_body::{CellLattice, CellSize, ClosedMesh, MeshBody, Skin, Tissue};
use std::hint::black_box;

fn body(mesh: &ClosedMesh) -> MeshBody {
    let lattice = CellLattice::fit(mesh, CellSize::Along(16)).expect("16 cells fit");
    lattice.allow_unconstrained().tissue(&Tissue::default()).expect("the lump is valid")
}

fn deform(c: &mut Criterion) {
    let (at, triangles) = lump(50_000);
    let mesh = ClosedMesh::new(at, triangles).expect("the lump is closed");
    let MeshBody { network, mut skin, .. } = body(&mesh);
    let bent: Vec<DVec3> =
        network.rest_m().iter().map(|x| *x + DVec3::Y * (3.0 * x.x * x.x + 2.0 * x.z * x.x)).collect();
    let to_local = DAffine3::from_translation(DVec3::new(0.1, 0.2, 0.3));
    let mut drawn = [vec![[0.0_f32; 3]; skin.vertices()], vec![[0.0_f32; 3]; skin.vertices()]];
    let run = |skin: &mut Skin, [positions, normals]: &mut [Vec<[f32; 3]>; 2]| {
        skin.deform(black_box(&bent), &to_local, positions, normals).expect("the lists fit");
    };
    let vertices = skin.vertices();
    c.bench_function(&format!("positions and normals of {vertices} vertices"), |b| {
        b.iter(|| run(&mut skin, &mut drawn));
    });
}

fn make(c: &mut Criterion) {
    let mut group = c.benchmark_group("a body from a mesh");
    group.sample_size(10);
    for vertices in [10_000, 50_000] {
        let (at, triangles) = lump(vertices);
        group.bench_function(format!("closed mesh of {} vertices", at.len()), |b| {
            b.iter(|| ClosedMesh::new(at.clone(), triangles.clone()).expect("the lump is closed"));
        });
        let mesh = ClosedMesh::new(at, triangles).expect("the lump is closed");
        group.bench_function(format!("16 cells along, {} vertices", mesh.vertices_m().len()), |b| {
            b.iter(|| body(&mesh));
        });
    }
    group.finish();
}

criterion_group!(benches, deform, make);
criterion_main!(benches);
