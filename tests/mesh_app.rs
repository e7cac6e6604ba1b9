//! Bodies of meshes in an app, in lock step: built, refused, touched, carried along, drawn.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{MeshPlugin, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{SimulatedBody, ToolLoop};
use palpate_tests::app::{Contacts, lockstep_app, step, take_faults};

/// 6 cm in radius.
const RADIUS: f64 = 0.06;

fn app() -> App {
    let mut app = lockstep_app();
    app.add_plugins((AssetPlugin::default(), MeshPlugin));
    app
}

fn ball() -> Mesh {
    Sphere::new(RADIUS as f32).mesh().ico(20).unwrap()
}

fn add(app: &mut App, mesh: Mesh) -> Handle<Mesh> {
    app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh)
}

/// Presses the top of a ball at the origin, 6 mm deep within 0.3 s, and stays.
fn presser() -> ScriptedDevice {
    ScriptedDevice::new(|n, _| {
        let depth = 0.007 * (n as f64 / 300.0).min(1.0) - 0.001;
        Ok(Reading::at(DVec3::new(0.002, RADIUS + 0.005 - depth, 0.001)))
    })
}

fn hand(app: &mut App) -> Entity {
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || Ok(presser()));
    app.world_mut().spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() }).id()
}

fn spawn(app: &mut App, mesh: Mesh) -> Entity {
    let mesh = add(app, mesh);
    let floor = BodyRegion::HalfSpace { point_m: DVec3::Y * -0.5 * RADIUS, outward: DVec3::Y };
    let shape = DeformableBody::Mesh(MeshShape { cells_along: 8, ..MeshShape::new(mesh) });
    app.world_mut().spawn((shape, FixedRegion::Within(vec![floor]))).id()
}

fn force(app: &App, tool: Entity) -> DVec3 {
    app.world().get::<ToolForce>(tool).unwrap().force_n
}

fn body(app: &App, entity: Entity) -> &SimulatedBody {
    app.world().get::<SimulatedBody>(entity).unwrap()
}

/// Positions or normals of what an entity shows.
fn shown(app: &App, entity: Entity, normals: bool) -> Vec<Vec3> {
    let mesh = app.world().get::<Mesh3d>(entity).unwrap();
    let id = if normals { Mesh::ATTRIBUTE_NORMAL } else { Mesh::ATTRIBUTE_POSITION };
    match app.world().resource::<Assets<Mesh>>().get(&mesh.0).unwrap().attribute(id).unwrap() {
        VertexAttributeValues::Float32x3(values) => values.iter().map(|v| Vec3::from_array(*v)).collect(),
        _ => unreachable!(),
    }
}

#[test]
fn a_ball_becomes_a_body_that_pushes_back_and_dents_under_the_tool() {
    let mut app = app();
    let entity = spawn(&mut app, ball());
    let tool = hand(&mut app);
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app), [""; 0]);
    let mass: f64 = body(&app, entity).body().network().mass_kg().iter().sum();
    let volume = body(&app, entity).closed_mesh().unwrap().volume_m3();
    assert!((mass / (1000.0 * volume) - 1.0).abs() < 1e-9, "{mass} kg, {volume} m3");
    // A polyhedron in the ball.
    let ball = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
    assert!((0.97..1.0).contains(&(volume / ball)), "{volume} m3, {ball} m3");
    let rest = shown(&app, entity, false);
    assert!(rest.iter().all(|x| (f64::from(x.length()) - RADIUS).abs() < 1e-6));
    step(&mut app, 20);
    let felt = force(&app, tool);
    assert!(felt.y > 0.5 && felt.y < 10.0 && felt.x.abs() < 0.3 * felt.y, "{felt}");
    let error = app.world().get::<LocalModelError>(tool).unwrap().relative.unwrap();
    assert!(error < 5e-3, "{error}");
    // The uppermost vertex is under the tool; the drawn surface does not stick through it, nor stay off.
    let now = shown(&app, entity, false);
    let at = app.world().get::<Transform>(tool).unwrap().translation;
    let nearest = now.iter().map(|x| x.distance(at)).fold(f32::INFINITY, f32::min);
    assert!((nearest - 0.005).abs() < 7e-4, "{nearest} m from the centre of a 5 mm sphere");
    let dent = rest.iter().zip(&now).map(|(a, b)| a.y - b.y).fold(0.0, f32::max);
    assert!(dent > 0.004, "{dent}");
    // Normals follow: unit, outward.
    for (x, n) in now.iter().zip(shown(&app, entity, true)) {
        assert!((n.length() - 1.0).abs() < 1e-4 && n.dot(x.normalize()) > 0.2, "{n} at {x}");
    }
    assert_eq!(app.world().resource::<Contacts>().0, ["began"]);
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn what_does_not_move_is_not_written_again() {
    #[derive(Resource, Default)]
    struct Written(usize);
    let mut app = app();
    let entity = spawn(&mut app, ball());
    app.init_resource::<Written>().add_systems(
        Last,
        |mut events: MessageReader<AssetEvent<Mesh>>, mut written: ResMut<Written>| {
            written.0 += events.read().filter(|e| matches!(e, AssetEvent::Modified { .. })).count();
        },
    );
    step(&mut app, 10);
    assert_eq!(app.world().resource::<Written>().0, 0, "nothing has touched it");
    app.world_mut().get_mut::<Transform>(entity).unwrap().translation.x = 1.0;
    step(&mut app, 10);
    let of_moving = app.world().resource::<Written>().0;
    // In its own frame it looks the same to the bit or to rounding: one rewrite at most, and not at every frame.
    assert!(of_moving <= 2, "{of_moving}");
    hand(&mut app);
    app.world_mut().get_mut::<Transform>(entity).unwrap().translation.x = 0.0;
    step(&mut app, 10);
    assert!(app.world().resource::<Written>().0 > of_moving + 4);
}

#[test]
fn a_mesh_that_comes_later_or_changes_is_built_when_it_is_there() {
    let mut app = app();
    let handle = app.world().resource::<Assets<Mesh>>().reserve_handle();
    let entity = app.world_mut().spawn(DeformableBody::from_mesh(handle.clone())).id();
    step(&mut app, 3);
    assert!(app.world().get::<SimulatedBody>(entity).is_none());
    assert_eq!(take_faults(&mut app), [""; 0]);
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&handle, ball()).unwrap();
    step(&mut app, 3);
    let before = shown(&app, entity, false);
    assert_eq!(before.len(), ball().count_vertices());
    // Loaded anew, twice as long: the body is another one, and shown so.
    let scaled = ball().scaled_by(Vec3::new(2.0, 1.0, 1.0));
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&handle, scaled).unwrap();
    step(&mut app, 4);
    let widest = |x: &[Vec3]| x.iter().map(|x| x.x).fold(0.0, f32::max);
    let now = widest(&shown(&app, entity, false));
    assert!((now / (2.0 * widest(&before)) - 1.0).abs() < 1e-5, "{now}");
    // With holes: said, and the body is as it was.
    let mut torn = ball();
    let indices = torn.indices().unwrap().iter().skip(30).map(|i| i as u32).collect();
    torn.insert_indices(bevy::mesh::Indices::U32(indices));
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&handle, torn).unwrap();
    step(&mut app, 3);
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].contains("holes") && said[0].contains("fill them"), "{said:?}");
    assert!(app.world().get::<SimulatedBody>(entity).is_some());
}

#[test]
fn meshes_that_make_no_body_are_faults_that_say_what_to_do() {
    let usage = RenderAssetUsages::default();
    let lines = Mesh::new(PrimitiveTopology::LineList, usage);
    let bare = Mesh::new(PrimitiveTopology::TriangleList, usage);
    let flat = Rectangle::new(0.1, 0.1).mesh().build();
    let in_mm = ball().scaled_by(Vec3::splat(1000.0));
    for (mesh, says) in [
        (lines, "TriangleList"),
        (bare, "no positions"),
        (flat, "holes"),
        (in_mm, "Scale it by 0.001"),
        (Sphere::new(1e-5).mesh().ico(2).unwrap(), "metres"),
    ] {
        let mut app = app();
        let entity = spawn(&mut app, mesh);
        step(&mut app, 3);
        let said = take_faults(&mut app);
        assert!(said.len() == 1 && said[0].contains(says), "{says}: {said:?}");
        assert!(app.world().get::<SimulatedBody>(entity).is_none());
    }
    // What the message says helps.
    let mut app = app();
    let mesh = add(&mut app, ball().scaled_by(Vec3::splat(1000.0)));
    let shape = MeshShape { scale: 0.001, ..MeshShape::new(mesh.clone()) };
    let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app), [""; 0]);
    assert!(shown(&app, entity, false).iter().all(|x| (f64::from(x.length()) - RADIUS).abs() < 1e-5));
    for scale in [0.0, -1.0, f64::NAN] {
        let shape = MeshShape { scale, ..MeshShape::new(mesh.clone()) };
        app.world_mut().spawn(DeformableBody::Mesh(shape));
        step(&mut app, 1);
        let said = take_faults(&mut app);
        assert!(said.len() == 1 && said[0].contains("scaled by"), "{said:?}");
    }
    let shape = MeshShape { cells_along: 0, ..MeshShape::new(mesh) };
    app.world_mut().spawn(DeformableBody::Mesh(shape));
    step(&mut app, 1);
    assert_eq!(take_faults(&mut app).len(), 1);
}

#[test]
fn a_body_that_is_moved_goes_along_whole_and_is_felt_there() {
    let mut app = app();
    let entity = spawn(&mut app, ball());
    let tool = hand(&mut app);
    step(&mut app, 12);
    assert!(force(&app, tool).y > 0.5);
    let before = body(&app, entity).body().positions_m().to_vec();
    let turn = Quat::from_rotation_y(0.7);
    let there = Transform::from_xyz(0.5, 0.2, -0.1).with_rotation(turn);
    app.world_mut().entity_mut(entity).insert(there);
    app.update();
    // A frame is also a model step here: what is not fixed has begun to spring back.
    let expected = |x: &DVec3| turn.as_dquat() * *x + there.translation.as_dvec3();
    let simulated = body(&app, entity).body();
    for (node, x) in before.iter().enumerate() {
        let now = simulated.positions_m()[node];
        let most = if simulated.network().is_fixed(node) { 1e-7 } else { 0.01 };
        assert!(now.distance(expected(x)) < most, "node {node}: {now}, {}", expected(x));
    }
    step(&mut app, 10);
    // The hand is where the body was.
    assert_eq!(
        (force(&app, tool), app.world().resource::<Contacts>().0.clone()),
        (DVec3::ZERO, vec!["began", "ended"])
    );
    // Its picture in its own frame is the ball.
    for x in shown(&app, entity, false) {
        assert!((f64::from(x.length()) - RADIUS).abs() < 1e-4, "{x}");
    }
    // Under the hand again, and turned: the same ball.
    app.world_mut().entity_mut(entity).insert(Transform::from_xyz(0.0, -0.01, 0.0));
    step(&mut app, 2);
    app.world_mut().entity_mut(entity).insert(Transform::IDENTITY);
    step(&mut app, 30);
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn a_scale_is_refused_once_and_the_body_stays() {
    let mut app = app();
    let entity = spawn(&mut app, ball());
    let tool = hand(&mut app);
    step(&mut app, 12);
    let before = force(&app, tool);
    app.world_mut().get_mut::<Transform>(entity).unwrap().scale = Vec3::splat(2.0);
    step(&mut app, 5);
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].contains("scale"), "{said:?}");
    assert!((force(&app, tool) - before).length() < 0.3 * before.length());
    // It is drawn where it is felt: half as large in a frame twice as large.
    for x in shown(&app, entity, false) {
        assert!(f64::from(x.length()) < 0.51 * RADIUS + 0.002, "{x}");
    }
    app.world_mut().get_mut::<Transform>(entity).unwrap().scale = Vec3::ONE;
    step(&mut app, 2);
    app.world_mut().get_mut::<Transform>(entity).unwrap().scale = Vec3::splat(0.5);
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app).len(), 1, "said again for another one");
}

#[test]
fn a_stiff_inclusion_is_felt_and_may_change_while_it_is_touched() {
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
    // Made of the same as the rest it is not there.
    app.world_mut().entity_mut(entity).insert(stone(20e3));
    step(&mut app, 25);
    let dissolved = force(&app, tool).y;
    assert!((dissolved / plain - 1.0).abs() < 0.02, "{dissolved} N, {plain} N");
    assert_eq!(app.world().resource::<Contacts>().0, ["began"], "it has been touched throughout");
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn vertices_and_faces_can_be_fixed_and_the_loop_outlives_its_body() {
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
    let by_face = app.world_mut().spawn(of(FixedRegion::Face(Face::Bottom))).id();
    let too_few = app.world_mut().spawn(of(FixedRegion::Vertices(vec![true; 3]))).id();
    step(&mut app, 2);
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].contains("3 entries"), "{said:?}");
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
