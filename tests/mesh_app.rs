//! Bodies from meshes in an app, in lock step: built, rejected, touched, moved, drawn.

use bevy::mesh::{Indices, VertexAttributeValues};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    BodyRegion, ContactState, ForceError, HapticFaultKind, Inclusion, Inclusions, MeshCellSize, MeshShape,
    NoForceCause, SimulatedBody, ToolLoop,
};
use palpate_body::{BodyError, MeshError};
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{assert_no_faults, contacts, step, take_causes, take_faults, take_kinds};
use palpate_tests::mesh::{
    RADIUS, add, ball, count_writes, force, hand, mesh_app as app, shown, spawn, take_writes, torn,
};
use std::time::Duration;

fn body(app: &App, entity: Entity) -> &SimulatedBody {
    palpate_tests::mesh::body(app, entity).unwrap()
}

#[test]
fn ball_pushes_back_and_indents_under_the_tool() {
    let mut app = app();
    let entity = spawn(&mut app, ball());
    let tool = hand(&mut app);
    step(&mut app, 2);
    assert_no_faults(&mut app);
    let mass: f64 = body(&app, entity).body().network().mass_kg().iter().sum();
    let volume = body(&app, entity).closed_mesh().unwrap().volume_m3();
    assert!((mass / (1000.0 * volume) - 1.0).abs() < 1e-9, "{mass} kg, {volume} m3");
    // The mesh is a polyhedron inside the ball.
    let ball = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
    assert!((0.97..1.0).contains(&(volume / ball)), "{volume} m3, {ball} m3");
    let rest = shown(&app, entity, false);
    assert!(rest.iter().all(|x| (f64::from(x.length()) - RADIUS).abs() < 1e-6));
    step(&mut app, 20);
    let force_n = force(&app, tool);
    assert!(force_n.y > 0.5 && force_n.y < 10.0 && force_n.x.abs() < 0.3 * force_n.y, "{force_n}");
    let error = app.world().get::<ForceError>(tool).unwrap().relative.unwrap();
    assert!(error < 5e-3, "{error}");
    // The uppermost vertex is under the tool, and the drawn surface yields by a part of the depth; the rest is below the size of a cell.
    let now = shown(&app, entity, false);
    let at = app.world().get::<Transform>(tool).unwrap().translation;
    let nearest = now.iter().map(|x| x.distance(at)).fold(f32::INFINITY, f32::min);
    assert!((5e-4..0.0055).contains(&nearest), "{nearest} m from the centre of a 5 mm sphere");
    let dent = rest.iter().zip(&now).map(|(a, b)| a.y - b.y).fold(0.0, f32::max);
    assert!(dent > 0.001, "{dent}");
    // The normals follow: of unit length, outward.
    for (x, n) in now.iter().zip(shown(&app, entity, true)) {
        assert!((n.length() - 1.0).abs() < 1e-4 && n.dot(x.normalize()) > 0.2, "{n} at {x}");
    }
    assert_eq!(contacts(&app), [Start]);
    assert_no_faults(&mut app);
}

/// Forces on the hand at the model steps in which the tool descends onto a body of `mesh` and rests, N.
fn forces_on(mesh: Mesh) -> Vec<DVec3> {
    let mut app = app();
    spawn(&mut app, mesh);
    let tool = hand(&mut app);
    let mut steps = || {
        step(&mut app, 1);
        force(&app, tool)
    };
    let forces = (0..10).map(|_| steps()).collect();
    assert_no_faults(&mut app);
    forces
}

/// Some of the triangles, and all of them.
#[test]
fn reversed_triangles_do_not_change_the_force() {
    let expected = forces_on(ball());
    let peak = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
    assert!(peak > 0.5, "{peak} N");
    for seed in 0..4_u32 {
        let mut mesh = ball();
        let mut indices: Vec<u32> = mesh.indices().unwrap().iter().map(|i| i as u32).collect();
        for (t, corners) in indices.chunks_exact_mut(3).enumerate() {
            let random = (t as u32 + 1).wrapping_mul(0x9E37_79B9).rotate_left(7 * seed + 5);
            if seed == 0 || random & 1 == 1 {
                corners.swap(0, 2);
            }
        }
        mesh.insert_indices(Indices::U32(indices));
        for (force_n, expected) in forces_on(mesh).iter().zip(&expected) {
            assert!(force_n.distance(*expected) <= 1e-9 * peak, "{force_n} N, not {expected} N");
        }
    }
}

#[test]
fn mesh_of_an_unmoved_body_is_not_written() {
    let mut app = app();
    let entity = spawn(&mut app, ball());
    count_writes(&mut app);
    step(&mut app, 10);
    assert_eq!(take_writes(&mut app), 0, "without contact");
    app.world_mut().get_mut::<Transform>(entity).unwrap().translation.x = 1.0;
    step(&mut app, 10);
    // In the entity's frame the mesh is the same except for rounding: written once, not in every frame.
    let of_moving = take_writes(&mut app);
    assert!(of_moving <= 2, "{of_moving}");
    hand(&mut app);
    app.world_mut().get_mut::<Transform>(entity).unwrap().translation.x = 0.0;
    step(&mut app, 10);
    assert!(take_writes(&mut app) > 4);
}

/// Frames that do not divide a model step: interpolated nodes at rest do not move.
#[test]
fn mesh_of_a_body_at_rest_is_not_written_between_model_steps() {
    let mut app = app();
    spawn(&mut app, ball());
    count_writes(&mut app);
    let frames = |ms| TimeUpdateStrategy::ManualDuration(Duration::from_millis(ms));
    app.insert_resource(frames(7));
    step(&mut app, 5);
    take_writes(&mut app);
    (0..50).for_each(|_| app.update());
    assert_eq!(take_writes(&mut app), 0, "without contact");
    let tool = hand(&mut app);
    step(&mut app, 12);
    assert!(take_writes(&mut app) > 40, "in contact the mesh is written in every frame");
    app.world_mut().entity_mut(tool).despawn();
    app.insert_resource(frames(50));
    step(&mut app, 260);
    app.insert_resource(frames(7));
    step(&mut app, 1);
    take_writes(&mut app);
    (0..50).for_each(|_| app.update());
    assert_eq!(take_writes(&mut app), 0, "the oscillation has decayed");
}

#[test]
fn body_is_built_when_its_mesh_is_added_or_changed() {
    let mut app = app();
    let handle = app.world().resource::<Assets<Mesh>>().reserve_handle();
    let shape = MeshShape { strict: true, ..MeshShape::new(handle.clone()) };
    let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
    step(&mut app, 3);
    assert!(app.world().get::<SimulatedBody>(entity).is_none());
    assert_no_faults(&mut app);
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&handle, ball()).unwrap();
    step(&mut app, 3);
    let before = shown(&app, entity, false);
    assert_eq!(before.len(), ball().count_vertices());
    // A mesh of twice the length: another body, drawn with that length.
    let scaled = ball().scaled_by(Vec3::new(2.0, 1.0, 1.0));
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&handle, scaled).unwrap();
    step(&mut app, 4);
    let widest = |x: &[Vec3]| x.iter().map(|x| x.x).fold(0.0, f32::max);
    let now = widest(&shown(&app, entity, false));
    assert!((now / (2.0 * widest(&before)) - 1.0).abs() < 1e-5, "{now}");
    // A mesh with holes is a fault, and the body stays.
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&handle, torn(ball())).unwrap();
    step(&mut app, 3);
    let kinds = take_kinds(&mut app);
    let is_holes =
        matches!(kinds[..], [HapticFaultKind::BuildBody(BodyError::Mesh(MeshError::Holes { .. }))]);
    assert!(is_holes, "{kinds:?}");
    assert!(app.world().get::<SimulatedBody>(entity).is_some());
}

#[test]
fn transform_moves_the_whole_body_at_once() {
    let mut app = app();
    let entity = spawn(&mut app, ball());
    let tool = hand(&mut app);
    step(&mut app, 12);
    assert!(force(&app, tool).y > 0.5);
    let before = body(&app, entity).body().positions_m().to_vec();
    let rotation = Quat::from_rotation_y(0.7);
    let there = Transform::from_xyz(0.5, 0.2, -0.1).with_rotation(rotation);
    app.world_mut().entity_mut(entity).insert(there);
    app.update();
    // The frame includes a model step, in which free nodes start to spring back.
    let expected = |x: &DVec3| rotation.as_dquat() * *x + there.translation.as_dvec3();
    let simulated = body(&app, entity).body();
    for (node, x) in before.iter().enumerate() {
        let now = simulated.positions_m()[node];
        let tolerance = if simulated.network().is_fixed(node) { 1e-7 } else { 0.01 };
        assert!(now.distance(expected(x)) < tolerance, "node {node}: {now}, {}", expected(x));
    }
    step(&mut app, 10);
    // The tool is where the body was.
    assert_eq!((force(&app, tool), contacts(&app)), (DVec3::ZERO, vec![Start, End]));
    // In the entity's frame the drawn mesh is the ball.
    for x in shown(&app, entity, false) {
        assert!((f64::from(x.length()) - RADIUS).abs() < 1e-4, "{x}");
    }
    // Moved back under the tool, without the rotation.
    app.world_mut().entity_mut(entity).insert(Transform::from_xyz(0.0, -0.01, 0.0));
    step(&mut app, 2);
    app.world_mut().entity_mut(entity).insert(Transform::IDENTITY);
    step(&mut app, 30);
    // Out of the device's workspace for half a second, and around the tool's centre now.
    let causes = take_causes(&mut app);
    let [(first, NoForceCause::OutOfWorkspace { body: away, distance_m }), second] = causes[..] else {
        panic!("{causes:?}")
    };
    assert!((first, away) == (tool, entity) && (0.2..0.3).contains(&distance_m), "{distance_m} m");
    assert_eq!(second, (tool, NoForceCause::Inside { body: entity }));
    assert_eq!(take_faults(&mut app).len(), 2);
}

#[test]
fn scaled_transform_is_reported_once_and_the_body_stays() {
    let mut app = app();
    let entity = spawn(&mut app, ball());
    let tool = hand(&mut app);
    step(&mut app, 12);
    let before = force(&app, tool);
    app.world_mut().get_mut::<Transform>(entity).unwrap().scale = Vec3::splat(2.0);
    step(&mut app, 5);
    let kinds = take_kinds(&mut app);
    assert!(matches!(kinds[..], [HapticFaultKind::NonUnitScale { .. }]), "{kinds:?}");
    assert!((force(&app, tool) - before).length() < 0.3 * before.length());
    // The drawn mesh matches the simulated body: half the size in a frame of twice the size.
    for x in shown(&app, entity, false) {
        assert!(f64::from(x.length()) < 0.51 * RADIUS + 0.002, "{x}");
    }
    app.world_mut().get_mut::<Transform>(entity).unwrap().scale = Vec3::ONE;
    step(&mut app, 2);
    app.world_mut().get_mut::<Transform>(entity).unwrap().scale = Vec3::splat(0.5);
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app).len(), 1, "another scale is reported again");
}

#[test]
fn stiff_inclusion_raises_the_force_and_changes_during_contact() {
    let press = |inclusions: Inclusions| {
        let mut app = app();
        let entity = spawn(&mut app, ball());
        app.world_mut().entity_mut(entity).insert(inclusions);
        let tool = hand(&mut app);
        step(&mut app, 25);
        (app, entity, tool)
    };
    let stone = |youngs_modulus_pa| {
        let region = BodyRegion::Sphere { center_m: DVec3::Y * 0.6 * RADIUS, radius_m: 0.25 * RADIUS };
        Inclusions(vec![Inclusion { region, tissue: Tissue { youngs_modulus_pa, ..default() } }])
    };
    let (app, _, tool) = press(Inclusions::default());
    let plain = force(&app, tool).y;
    let (mut app, entity, tool) = press(stone(200e3));
    let stiff = force(&app, tool).y;
    assert!(stiff > 1.2 * plain, "{stiff} N, {plain} N without");
    // An inclusion of the body's own tissue has no effect.
    app.world_mut().entity_mut(entity).insert(stone(20e3));
    step(&mut app, 25);
    let dissolved = force(&app, tool).y;
    assert!((dissolved / plain - 1.0).abs() < 0.02, "{dissolved} N, {plain} N");
    assert_eq!(contacts(&app), [Start], "the contact does not end");
    assert_no_faults(&mut app);
}

#[test]
fn fixed_vertices_and_faces_fix_their_nodes_and_the_loop_outlives_the_body() {
    let mut app = app();
    let mesh = add(&mut app, ball());
    let is_low: Vec<bool> = match app
        .world()
        .resource::<Assets<Mesh>>()
        .get(&mesh)
        .unwrap()
        .attribute(Mesh::ATTRIBUTE_POSITION)
    {
        Some(VertexAttributeValues::Float32x3(x)) => {
            x.iter().map(|x| f64::from(x[1]) < -0.5 * RADIUS).collect()
        }
        _ => unreachable!(),
    };
    let fixed_nodes = |app: &App, entity: Entity| {
        let network = body(app, entity).body().network();
        (0..network.node_count()).filter(|&node| network.is_fixed(node)).collect::<Vec<_>>()
    };
    let of = |fixed: FixedRegion| (DeformableBody::from_mesh(mesh.clone()), fixed);
    let by_vertices = app.world_mut().spawn(of(FixedRegion::Vertices(is_low))).id();
    let by_face = app.world_mut().spawn(of(FixedRegion::Face(BoxFace::Bottom))).id();
    let too_few = app.world_mut().spawn(of(FixedRegion::Vertices(vec![true; 3]))).id();
    step(&mut app, 2);
    let kinds = take_kinds(&mut app);
    let is_length = matches!(
        kinds[..],
        [HapticFaultKind::BuildBody(BodyError::Mesh(MeshError::Length { found: 3, .. }))]
    );
    assert!(is_length, "{kinds:?}");
    assert!(app.world().get::<SimulatedBody>(too_few).is_none());
    for (entity, below) in [(by_vertices, -0.3 * RADIUS), (by_face, -0.9 * RADIUS)] {
        let fixed = fixed_nodes(&app, entity);
        assert!(!fixed.is_empty());
        let rest = body(&app, entity).body().network().rest_m();
        assert!(fixed.iter().all(|&node| rest[node].y < below), "{entity}");
    }
    let tool = hand(&mut app);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(by_face);
    step(&mut app, 12);
    app.world_mut().entity_mut(by_face).despawn();
    step(&mut app, 3);
    assert!(app.world().get::<ToolLoop>(tool).is_some());
}

#[test]
fn shown_source_mesh_is_replaced_by_the_deformed_one_and_restored() {
    let mut app = app();
    let source = add(&mut app, ball());
    let floor = FixedRegion::Face(BoxFace::Bottom);
    let fine = MeshShape { cells: MeshCellSize::Along(10), ..MeshShape::new(source.clone()) };
    let shape = DeformableBody::Mesh(fine);
    let entity = app.world_mut().spawn((shape.clone(), floor.clone(), Mesh3d(source.clone()))).id();
    let other = add(&mut app, Cuboid::from_length(0.1).mesh().build());
    let beside = Transform::from_xyz(1.0, 0.0, 0.0);
    let alone = app.world_mut().spawn((shape.clone(), floor, beside, Mesh3d(other.clone()))).id();
    let tool = hand(&mut app);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(entity);
    step(&mut app, 15);
    assert_no_faults(&mut app);
    let of = |app: &App, entity: Entity| app.world().get::<Mesh3d>(entity).map(|mesh| mesh.0.clone());
    let lowest = |x: Vec<Vec3>| x.into_iter().map(|x| x.length()).fold(f32::INFINITY, f32::min);
    assert_ne!(of(&app, entity), Some(source.clone()));
    let dent_m = RADIUS - f64::from(lowest(shown(&app, entity, false)));
    assert!(dent_m > 0.002, "the indentation is drawn: {dent_m} m");
    let as_given = app.world().resource::<Assets<Mesh>>().get(&source).unwrap();
    let VertexAttributeValues::Float32x3(x) = as_given.attribute(Mesh::ATTRIBUTE_POSITION).unwrap() else {
        unreachable!()
    };
    assert!(x.iter().all(|x| (f64::from(Vec3::from_array(*x).length()) - RADIUS).abs() < 1e-6));
    // Another mesh is not replaced.
    assert_eq!(of(&app, alone), Some(other.clone()));
    for (entity, before) in [(entity, source), (alone, other)] {
        app.world_mut().entity_mut(entity).remove::<DeformableBody>();
        step(&mut app, 2);
        assert_eq!(of(&app, entity), Some(before));
        assert!(app.world().get::<SimulatedBody>(entity).is_none());
    }
    // A body again, and drawn again.
    app.world_mut().entity_mut(entity).insert(shape);
    step(&mut app, 2);
    assert!(!shown(&app, entity, false).is_empty() && app.world().get::<SimulatedBody>(entity).is_some());
}

#[test]
fn body_follows_its_parent_during_contact() {
    let mut app = app();
    let parent = app.world_mut().spawn(Transform::from_xyz(0.3, 0.0, 0.0)).id();
    let entity = spawn(&mut app, ball());
    app.world_mut().entity_mut(entity).insert((Transform::from_xyz(-0.3, 0.0, 0.0), ChildOf(parent)));
    let tool = hand(&mut app);
    step(&mut app, 15);
    assert!(force(&app, tool).y > 0.5, "{}", force(&app, tool));
    let before = body(&app, entity).body().positions_m().to_vec();
    app.world_mut().get_mut::<Transform>(parent).unwrap().translation.z = 0.5;
    app.update();
    let simulated = body(&app, entity).body();
    for (node, x) in before.iter().enumerate() {
        let now = simulated.positions_m()[node];
        let tolerance = if simulated.network().is_fixed(node) { 1e-6 } else { 0.01 };
        assert!(now.distance(*x + 0.5 * DVec3::Z) < tolerance, "node {node}: {now}");
    }
    step(&mut app, 4);
    // The tool is where the body was.
    assert_eq!(force(&app, tool), DVec3::ZERO);
    assert_eq!(contacts(&app), [Start, End]);
    // Back, by the child's own transform.
    app.world_mut().get_mut::<Transform>(entity).unwrap().translation.z = -0.51;
    step(&mut app, 2);
    app.world_mut().get_mut::<Transform>(entity).unwrap().translation.z = -0.5;
    step(&mut app, 10);
    // The body has moved back under the tool from the side, and is pressed again.
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().state, ContactState::Touching);
    assert_eq!(contacts(&app).last(), Some(&Start));
    assert!(force(&app, tool).y > 0.1, "{}", force(&app, tool));
}

#[test]
fn child_of_a_scaled_parent_is_rejected_until_the_scale_is_one() {
    let mut app = app();
    let parent = app.world_mut().spawn(Transform::from_scale(Vec3::splat(2.0))).id();
    let of_mesh = spawn(&mut app, ball());
    let of_block = app.world_mut().spawn(DeformableBody::block([3; 3], 0.1)).id();
    app.world_mut().entity_mut(parent).add_children(&[of_mesh, of_block]);
    step(&mut app, 3);
    let kinds = take_kinds(&mut app);
    let is_scale = |kind: &HapticFaultKind| matches!(kind, HapticFaultKind::NonUnitScale { .. });
    assert!(kinds.len() == 2 && kinds.iter().all(is_scale), "{kinds:?}");
    // Moved, but still scaled: not reported again.
    app.world_mut().get_mut::<Transform>(parent).unwrap().translation.x = 1.0;
    app.world_mut().get_mut::<Transform>(of_mesh).unwrap().translation.y = 0.1;
    step(&mut app, 3);
    assert_no_faults(&mut app);
    app.world_mut().get_mut::<Transform>(parent).unwrap().scale = Vec3::ONE;
    step(&mut app, 2);
    assert_no_faults(&mut app);
    let middle = |entity| {
        let x = body(&app, entity).body().positions_m();
        x.iter().sum::<DVec3>() / x.len() as f64
    };
    assert!(middle(of_block).distance(DVec3::X) < 1e-6, "{}", middle(of_block));
    assert!(middle(of_mesh).distance(DVec3::new(1.0, 0.1, 0.0)) < 1e-3, "{}", middle(of_mesh));
}

#[test]
fn move_of_a_rejected_body_reports_no_further_fault() {
    let mut app = app();
    let bad = app.world_mut().spawn(DeformableBody::block([1, 3, 3], 0.1)).id();
    let torn = spawn(&mut app, torn(ball()));
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app).len(), 2);
    for x in 1..5 {
        for entity in [bad, torn] {
            app.world_mut().get_mut::<Transform>(entity).unwrap().translation.x = 0.1 * x as f32;
        }
        step(&mut app, 1);
    }
    assert_no_faults(&mut app);
    app.world_mut().entity_mut(bad).insert(DeformableBody::block([3, 3, 3], 0.1));
    step(&mut app, 2);
    assert!(app.world().get::<SimulatedBody>(bad).is_some());
}
