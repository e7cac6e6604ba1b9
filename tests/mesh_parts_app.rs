//! Bodies of meshes in several parts, with regions by part.

use bevy::mesh::Indices;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    BodyRegion, ExternalForce, HapticFaultKind, Inclusion, Inclusions, MeshCellSize, MeshFault, MeshShape,
    SimulatedBody,
};
use palpate_body::BodyError;
use palpate_tests::app::{assert_no_faults, step, take_kinds};
use palpate_tests::mesh::{add, body, both, cuboid, mesh_app};

const SOFT: Tissue = Tissue { youngs_modulus_pa: 10e3, ..Tissue::SOFT };
const HARD: Tissue = Tissue { youngs_modulus_pa: 100e3, density_kg_per_m3: 2000.0, ..Tissue::SOFT };

/// A box of 80 × 40 × 40 mm.
fn whole() -> Mesh {
    cuboid(Vec3::new(-0.04, -0.02, -0.02), Vec3::new(0.04, 0.02, 0.02))
}

/// The triangles of `mesh` for whose middle `is_kept` is true.
fn part(mesh: &Mesh, is_kept: impl Fn(Vec3) -> bool) -> Mesh {
    let positions: Vec<Vec3> = match mesh.attribute(Mesh::ATTRIBUTE_POSITION) {
        Some(bevy::mesh::VertexAttributeValues::Float32x3(values)) => {
            values.iter().map(|x| Vec3::from(*x)).collect()
        }
        _ => Vec::new(),
    };
    let corners: Vec<u32> = mesh.indices().unwrap().iter().map(|i| i as u32).collect();
    let kept = corners.chunks_exact(3).filter(|t| {
        let middle = t.iter().map(|&i| positions[i as usize]).sum::<Vec3>() / 3.0;
        is_kept(middle)
    });
    let mut mesh = mesh.clone();
    mesh.insert_indices(Indices::U32(kept.flatten().copied().collect()));
    mesh
}

fn spawn(app: &mut App, mesh: Mesh, parts: Vec<Mesh>, more: impl Bundle) -> Entity {
    let parts = parts.into_iter().map(|part| add(app, part)).collect();
    let shape = MeshShape { parts, cells: MeshCellSize::Along(8), ..MeshShape::new(add(app, mesh)) };
    let entity = app.world_mut().spawn((DeformableBody::Mesh(shape), SOFT, more)).id();
    step(app, 1);
    entity
}

fn inclusion(index: usize, tissue: Tissue) -> Inclusions {
    Inclusions(vec![Inclusion { region: BodyRegion::Part(index), tissue }])
}

fn mass_kg(app: &App, entity: Entity) -> f64 {
    body(app, entity).unwrap().body().network().mass_kg().iter().sum()
}

/// 128 ml; cells of 10 mm.
const SOFT_KG: f64 = 0.128;

#[test]
fn closed_part_inside_is_an_inclusion() {
    let mut app = mesh_app();
    // 20 × 20 × 20 mm, on planes between cells.
    let lump = || cuboid(Vec3::new(0.0, -0.01, -0.01), Vec3::new(0.02, 0.01, 0.01));
    let entity = spawn(&mut app, whole(), vec![lump()], inclusion(0, HARD));
    assert_no_faults(&mut app);
    assert!((mass_kg(&app, entity) - SOFT_KG - 0.008).abs() < 1e-6, "{}", mass_kg(&app, entity));
    // The lump is not part of the surface.
    let drawn = body(&app, entity).unwrap().closed_mesh().unwrap();
    assert!((drawn.volume_m3() - 128e-6).abs() < 1e-10);
    assert_eq!(drawn.vertices_m().len(), whole().count_vertices());
    // The same as a box of tissue.
    let region = BodyRegion::Cuboid { center_m: DVec3::new(0.01, 0.0, 0.0), half_m: DVec3::splat(0.01) };
    let boxed = spawn(&mut app, whole(), vec![], Inclusions(vec![Inclusion { region, tissue: HARD }]));
    let of = |entity| body(&app, entity).unwrap().body().network();
    assert_eq!(of(entity).links(), of(boxed).links());
    assert_eq!(of(entity).mass_kg(), of(boxed).mass_kg());
}

#[test]
fn open_parts_close_the_surface_and_share_the_body() {
    let mut app = mesh_app();
    // Each half lacks the wall between them.
    let box_of = |from: f32, to: f32| cuboid(Vec3::new(from, -0.02, -0.02), Vec3::new(to, 0.02, 0.02));
    let left = part(&box_of(-0.04, 0.0), |at| at.x < -1e-4);
    let right = part(&box_of(0.0, 0.04), |at| at.x > 1e-4);
    let entity = spawn(&mut app, left.clone(), vec![right.clone()], inclusion(0, HARD));
    assert_no_faults(&mut app);
    let simulated = body(&app, entity).unwrap();
    assert!((simulated.closed_mesh().unwrap().volume_m3() - 128e-6).abs() < 1e-11);
    // Half of it is twice as dense.
    assert!((mass_kg(&app, entity) - 1.5 * SOFT_KG).abs() < 1e-3 * SOFT_KG, "{}", mass_kg(&app, entity));
    // Both are drawn.
    let handle = app.world().get::<Mesh3d>(entity).unwrap().0.clone();
    let drawn = app.world().resource::<Assets<Mesh>>().get(&handle).unwrap();
    assert_eq!(drawn.count_vertices(), left.count_vertices() + right.count_vertices());
    let triangles = |mesh: &Mesh| mesh.indices().unwrap().len() / 3;
    assert_eq!(triangles(drawn), triangles(&left) + triangles(&right));
    // Without the second part the first has a hole, which counts as closed by its plane.
    let open = spawn(&mut app, left, vec![], ());
    assert_no_faults(&mut app);
    let report = body(&app, open).unwrap().mesh_report().unwrap();
    assert_eq!(report.assumptions.unwrap().hole_count, 1);
    assert!((mass_kg(&app, open) / (0.5 * SOFT_KG) - 1.0).abs() < 5e-3, "{}", mass_kg(&app, open));
}

#[test]
fn closed_part_beside_extends_the_body() {
    let mut app = mesh_app();
    let box_of = |from: f32, to: f32| cuboid(Vec3::new(from, -0.02, -0.02), Vec3::new(to, 0.02, 0.02));
    // The common wall is omitted.
    let entity = spawn(&mut app, box_of(-0.04, 0.0), vec![box_of(0.0, 0.04)], inclusion(0, HARD));
    assert_no_faults(&mut app);
    assert!((mass_kg(&app, entity) - 1.5 * SOFT_KG).abs() < 1e-6, "{}", mass_kg(&app, entity));
    let all = both(box_of(-0.04, 0.0), &box_of(0.0, 0.04));
    assert_eq!(body(&app, entity).unwrap().closed_mesh().unwrap().vertices_m().len(), all.count_vertices());
}

#[test]
fn part_is_a_region_for_fixed_nodes_and_loads() {
    let mut app = mesh_app();
    let slab = || cuboid(Vec3::new(-0.04, -0.02, -0.02), Vec3::new(-0.02, 0.02, 0.02));
    let more = (
        FixedRegion::Regions(vec![BodyRegion::Part(0)]),
        ExternalForce::within(BodyRegion::Part(1), DVec3::Y),
    );
    let lump = cuboid(Vec3::new(0.02, -0.02, -0.02), Vec3::new(0.04, 0.02, 0.02));
    let entity = spawn(&mut app, whole(), vec![slab(), lump], more);
    step(&mut app, 1);
    assert_no_faults(&mut app);
    let simulated = body(&app, entity).unwrap();
    let network = simulated.body().network();
    for (node, rest) in network.rest_m().iter().enumerate() {
        let is_in = rest.x < -0.0199;
        assert!(network.is_fixed(node) == is_in || (rest.x + 0.02).abs() < 1e-3, "{rest}");
    }
    let mut outer_n = vec![DVec3::ZERO; network.node_count()];
    simulated.body().outer_forces_n(&mut outer_n);
    assert!((outer_n.iter().sum::<DVec3>() - DVec3::Y).length() < 1e-12);
    for (rest, force) in network.rest_m().iter().zip(&outer_n) {
        assert!(*force == DVec3::ZERO || rest.x > 0.0199, "{rest}");
    }
}

#[test]
fn rejects_a_part_that_does_not_exist() {
    let mut app = mesh_app();
    let absent = |kinds: Vec<HapticFaultKind>| {
        let [HapticFaultKind::BuildBody(BodyError::Parameter { what, value, .. })] = &kinds[..] else {
            panic!("{kinds:?}")
        };
        assert_eq!((*what, *value), ("index in BodyRegion::Part", 0.0));
    };
    spawn(&mut app, whole(), vec![], inclusion(0, HARD));
    absent(take_kinds(&mut app));
    app.world_mut().spawn((DeformableBody::block([4; 3], 0.1), inclusion(0, HARD)));
    step(&mut app, 1);
    absent(take_kinds(&mut app));
    // A load: the body exists.
    let entity = app
        .world_mut()
        .spawn((DeformableBody::block([4; 3], 0.1), ExternalForce::within(BodyRegion::Part(3), DVec3::Y)))
        .id();
    step(&mut app, 2);
    assert!(app.world().get::<SimulatedBody>(entity).is_some());
    assert!(matches!(
        &take_kinds(&mut app)[..],
        [HapticFaultKind::ExternalForce(BodyError::Parameter { value: 3.0, .. })]
    ));
}

#[test]
fn part_outside_the_cells_is_reported_and_a_changed_part_builds_again() {
    let mut app = mesh_app();
    // Thinner than the distance of samples, between two planes of samples.
    let flake = cuboid(Vec3::splat(0.0015), Vec3::splat(0.0023));
    let entity = spawn(&mut app, whole(), vec![flake], inclusion(0, HARD));
    assert!(matches!(
        &take_kinds(&mut app)[..],
        [HapticFaultKind::BuildBody(BodyError::Mesh(palpate_body::MeshError::EmptyRegion { .. }))]
    ));
    let DeformableBody::Mesh(shape) = app.world().get::<DeformableBody>(entity).unwrap().clone() else {
        panic!()
    };
    let lump = cuboid(Vec3::new(0.0, -0.01, -0.01), Vec3::new(0.02, 0.01, 0.01));
    palpate_tests::mesh::replace(&mut app, &shape.parts[0], lump);
    step(&mut app, 2);
    assert_no_faults(&mut app);
    assert!((mass_kg(&app, entity) - SOFT_KG - 0.008).abs() < 1e-6, "{}", mass_kg(&app, entity));
    // A part that is never loaded: the body waits, and an unknown topology is rejected.
    let mut lines =
        Mesh::new(bevy::mesh::PrimitiveTopology::LineList, bevy::asset::RenderAssetUsages::default());
    lines.insert_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0; 3]; 2]);
    spawn(&mut app, whole(), vec![lines], ());
    assert!(matches!(&take_kinds(&mut app)[..], [HapticFaultKind::Mesh(MeshFault::Topology(_))]));
}
