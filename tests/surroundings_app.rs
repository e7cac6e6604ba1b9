//! Gravity, obstacles and external forces in an app, in lock step.

use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_palpate::palpate_haptics::{Reading, ScriptedDevice};
use bevy_palpate::prelude::*;
use bevy_palpate::{
    BodyRegion, ExternalForce, Gravity, GravityScale, HapticFaultKind, KinematicBody, Obstacle,
    ObstacleForce, SimulatedBody, TouchLayers,
};
use palpate_body::BodyError;
use palpate_tests::app::{
    Contact, assert_no_faults, contacts, force_n, lockstep_app, resting_hand, spawn_block, spawn_tool, step,
    take_kinds,
};

const G: f64 = 9.81;
/// Weight of a block of 10 cm with the density of water, N.
const WEIGHT_N: f64 = G;

fn app() -> App {
    let mut app = lockstep_app();
    app.add_plugins((AssetPlugin::default(), MeshPlugin)).insert_resource(Gravity::EARTH);
    app
}

/// Spawns a block of 10 cm without a fixed part, its lower face at height `y_m`.
fn loose_block(app: &mut App, y_m: f32) -> Entity {
    let transform = Transform::from_xyz(0.0, 0.05 + y_m, 0.0);
    app.world_mut().spawn((DeformableBody::block([6; 3], 0.1), transform)).id()
}

fn body(app: &App, entity: Entity) -> &palpate_body::Body {
    app.world().get::<SimulatedBody>(entity).unwrap().body()
}

/// Mean position and velocity of the nodes, weighted by their masses.
fn center(app: &App, entity: Entity) -> (DVec3, DVec3) {
    let body = body(app, entity);
    let mass = body.network().mass_kg();
    let mean =
        |of: &[DVec3]| of.iter().zip(mass).map(|(x, m)| *m * *x).sum::<DVec3>() / mass.iter().sum::<f64>();
    (mean(body.positions_m()), mean(body.velocities_m_per_s()))
}

fn lowest_m(app: &App, entity: Entity) -> f64 {
    body(app, entity).positions_m().iter().map(|x| x.y).fold(f64::INFINITY, f64::min)
}

fn max_speed(app: &App, entity: Entity) -> f64 {
    body(app, entity).velocities_m_per_s().iter().map(|v| v.length()).fold(0.0, f64::max)
}

fn is_asleep(app: &App, entity: Entity) -> bool {
    app.world().get::<SimulatedBody>(entity).unwrap().last_step().is_asleep
}

fn force_on(app: &App, obstacle: Entity) -> ObstacleForce {
    *app.world().get::<ObstacleForce>(obstacle).unwrap()
}

#[test]
fn bodies_have_no_weight_until_gravity_is_set() {
    let mut app = lockstep_app();
    let entity = loose_block(&mut app, 1.0);
    step(&mut app, 10);
    assert!((center(&app, entity).0 - DVec3::Y * f64::from(1.05_f32)).length() < 1e-12);
    app.insert_resource(Gravity::EARTH);
    let light = loose_block(&mut app, 1.0);
    app.world_mut().entity_mut(light).insert((GravityScale(0.5), Transform::from_xyz(1.0, 1.05, 0.0)));
    step(&mut app, 1);
    let from = [entity, light].map(|entity| center(&app, entity));
    step(&mut app, 6);
    for ((at, v), (entity, scale)) in from.into_iter().zip([(entity, 1.0), (light, 0.5)]) {
        // Free fall for 0.3 s; the integrator's position leads by half a substep.
        let (g, t) = (G * scale, 0.3);
        let (fallen, speed) = center(&app, entity);
        assert!((speed.y - (v.y - g * t)).abs() < 1e-9, "{speed}");
        assert!((fallen.y - (at.y + v.y * t - 0.5 * g * t * t)).abs() < 0.5 * g * t * 0.26e-3, "{fallen}");
        assert!(speed.x.abs() + speed.z.abs() < 1e-9);
    }
    assert_no_faults(&mut app);
}

#[test]
fn block_on_a_table_rests_and_sleeps_and_the_table_bears_its_weight() {
    let mut app = app();
    let table = app.world_mut().spawn(Obstacle::half_space()).id();
    let entity = loose_block(&mut app, 0.002);
    step(&mut app, 40);
    assert!(max_speed(&app, entity) < 1e-4, "{} m/s after 2 s", max_speed(&app, entity));
    step(&mut app, 10);
    assert!(is_asleep(&app, entity));
    let rest = body(&app, entity).positions_m().to_vec();
    let on_table = force_on(&app, table);
    assert!((on_table.force_n + DVec3::Y * WEIGHT_N).length() < 2e-3 * WEIGHT_N, "{on_table:?}");
    assert!(on_table.torque_nm.length() < 1e-3, "{on_table:?}");
    assert!(lowest_m(&app, entity).abs() < 1e-6);
    step(&mut app, 200);
    assert_eq!(body(&app, entity).positions_m(), rest, "a body at rest does not drift");
    // Without the table it wakes and falls.
    app.world_mut().entity_mut(table).despawn();
    step(&mut app, 4);
    assert!(center(&app, entity).1.y < -1.0 && !is_asleep(&app, entity));
    assert_no_faults(&mut app);
}

#[test]
fn resting_body_wakes_under_a_tool_and_sleeps_again() {
    let mut app = app();
    app.world_mut().spawn(Obstacle::half_space());
    let entity = loose_block(&mut app, 0.0);
    step(&mut app, 60);
    assert!(is_asleep(&app, entity));
    app.world_mut().resource_mut::<HapticDevices>().register("hand", || {
        let place = |n: u64| DVec3::new(0.012, 0.11 - 0.012 * (n as f64 * 2e-3).min(1.0), 0.009);
        Ok(ScriptedDevice::new(move |n, _| Ok(Reading::at(place(n)))))
    });
    let tool = app.world_mut().spawn(HapticTool::new("hand")).id();
    step(&mut app, 20);
    assert!(!is_asleep(&app, entity));
    assert!(app.world().get::<ToolForce>(tool).unwrap().force_n.y > 0.1);
    app.world_mut().entity_mut(tool).despawn();
    step(&mut app, 80);
    assert!(is_asleep(&app, entity));
    assert_no_faults(&mut app);
}

#[test]
fn block_slides_on_a_slope_above_the_angle_of_friction_and_rests_below_it() {
    for (share, slides) in [(0.97, false), (1.03, true)] {
        let mut app = app();
        let angle = f64::atan(0.4) * share;
        let turned = Quat::from_rotation_z(angle as f32);
        app.world_mut().spawn((Obstacle::half_space().with_friction(0.4), Transform::from_rotation(turned)));
        let block = DeformableBody::block([4; 3], 0.1);
        let transform = Transform::from_rotation(turned).with_translation(turned * Vec3::Y * 0.05);
        let entity = app.world_mut().spawn((block, transform)).id();
        step(&mut app, 40);
        let speed = center(&app, entity).1.length();
        assert_eq!(speed > 0.02, slides, "{speed} m/s at {share} of the angle of friction");
        assert!(slides || speed < 1e-3, "{speed}");
    }
}

#[test]
fn moving_table_carries_a_block_and_a_conveyor_drags_it() {
    let mut app = app();
    let slab = Obstacle::cuboid(DVec3::new(4.0, 0.02, 0.4)).with_friction(0.8);
    let table = app.world_mut().spawn((slab, Transform::from_xyz(0.0, -0.01, 0.0))).id();
    let entity = loose_block(&mut app, 0.0);
    step(&mut app, 20);
    // 20 mm/s upward, then 40 mm/s sideways.
    let start = center(&app, entity).0;
    for _ in 0..40 {
        app.world_mut().get_mut::<Transform>(table).unwrap().translation.y += 1e-3;
        step(&mut app, 1);
    }
    let lifted = center(&app, entity).0 - start;
    assert!((lifted - DVec3::Y * 0.04).length() < 5e-4, "{lifted}");
    for _ in 0..60 {
        app.world_mut().get_mut::<Transform>(table).unwrap().translation.x += 2e-3;
        step(&mut app, 1);
    }
    let (dragged, velocity) = center(&app, entity);
    assert!((velocity.x - 0.04).abs() < 2e-3, "{velocity}");
    assert!((dragged.x - start.x - 0.12).abs() < 3e-3, "{dragged}");
    assert_no_faults(&mut app);
}

/// Height of the centre of a block after 2.5 s on an obstacle whose top is at y = 0.
fn resting_height(spawn: impl Fn(&mut App)) -> f64 {
    let mut app = app();
    spawn(&mut app);
    let entity = loose_block(&mut app, 0.001);
    step(&mut app, 50);
    assert!(is_asleep(&app, entity));
    assert_no_faults(&mut app);
    center(&app, entity).0.y
}

#[test]
fn block_rests_at_the_same_height_on_every_shape_with_a_flat_top() {
    let plane = resting_height(|app| {
        app.world_mut().spawn(Obstacle::half_space());
    });
    assert!((0.045..0.05).contains(&plane), "{plane}");
    let below = Transform::from_xyz(0.0, -0.1, 0.0);
    let cuboid = resting_height(|app| {
        app.world_mut().spawn((Obstacle::cuboid(DVec3::new(1.0, 0.2, 1.0)), below));
    });
    // The same box by the scale of its entity, as a hull, and as triangles.
    let scaled = resting_height(|app| {
        let transform = below.with_scale(Vec3::new(10.0, 2.0, 10.0));
        app.world_mut().spawn((Obstacle::cuboid(DVec3::splat(0.1)), transform));
    });
    let of_mesh = |kind: fn(Handle<Mesh>) -> Obstacle| {
        resting_height(move |app| {
            let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(1.0, 0.2, 1.0));
            app.world_mut().spawn((kind(mesh), below));
        })
    };
    for (name, height) in [
        ("box", cuboid),
        ("scaled", scaled),
        ("hull", of_mesh(Obstacle::convex_hull)),
        ("mesh", of_mesh(Obstacle::triangle_mesh)),
    ] {
        assert!((height - plane).abs() < 1e-7, "{name}: {height}, {plane}");
    }
}

#[test]
fn body_falls_past_obstacles_of_other_layers() {
    let mut app = app();
    app.world_mut().spawn((Obstacle::half_space(), TouchLayers::layer(1)));
    let entity = loose_block(&mut app, 0.01);
    app.world_mut().entity_mut(entity).insert(TouchLayers::layer(0));
    step(&mut app, 10);
    assert!(lowest_m(&app, entity) < -0.2);
}

#[test]
fn loads_act_on_their_regions_until_they_are_removed() {
    let mut app = lockstep_app();
    let entity = spawn_block(&mut app);
    let top = BodyRegion::HalfSpace { point_m: DVec3::Y * 0.045, outward: DVec3::NEG_Y };
    app.world_mut().entity_mut(entity).insert(ExternalForce::within(top, DVec3::Y * 2.0));
    step(&mut app, 40);
    let total: DVec3 = body(&app, entity).loads_n().iter().copied().sum();
    assert!((total - DVec3::Y * 2.0).length() < 1e-12, "{total}");
    let top_m = |app: &App| body(app, entity).positions_m().iter().map(|x| x.y).fold(f64::MIN, f64::max);
    // A column of 20 kPa and 10 cm under 2 N on 100 cm² stretches by about 1 mm.
    let stretched = top_m(&app) - 0.05;
    assert!((0.7e-3..1.3e-3).contains(&stretched), "{stretched} m");
    app.world_mut().entity_mut(entity).remove::<ExternalForce>();
    step(&mut app, 40);
    assert!((top_m(&app) - 0.05).abs() < 1e-6);
    // A body that is built again keeps its loads.
    app.world_mut().entity_mut(entity).insert(ExternalForce::new(DVec3::X));
    step(&mut app, 2);
    app.world_mut().entity_mut(entity).insert(Tissue { youngs_modulus_pa: 30e3, ..default() });
    step(&mut app, 2);
    let total: DVec3 = body(&app, entity).loads_n().iter().copied().sum();
    assert!((total - DVec3::X).length() < 1e-12, "{total}");
    assert_no_faults(&mut app);
}

#[test]
fn invalid_surroundings_are_faults_and_have_no_effect() {
    let mut app = app();
    let mut spawn = |obstacle: Obstacle, scale: Vec3| {
        app.world_mut().spawn((obstacle, Transform::from_scale(scale)));
    };
    spawn(Obstacle::sphere(0.0), Vec3::ONE);
    spawn(Obstacle::sphere(0.1), Vec3::new(1.0, 2.0, 1.0));
    spawn(Obstacle::half_space().with_friction(-1.0), Vec3::ONE);
    spawn(Obstacle::cuboid(DVec3::ONE), Vec3::new(1.0, -1.0, 1.0));
    let entity = loose_block(&mut app, 1.0);
    let far = BodyRegion::Sphere { center_m: DVec3::ONE, radius_m: 0.1 };
    app.world_mut().entity_mut(entity).insert(ExternalForce::within(far, DVec3::X));
    step(&mut app, 10);
    let kinds = take_kinds(&mut app);
    let obstacles =
        kinds.iter().filter(|kind| matches!(kind, HapticFaultKind::Obstacle(BodyError::Parameter { .. })));
    assert_eq!(obstacles.count(), 4, "{kinds:?}");
    assert!(
        kinds.len() == 5 && kinds.iter().any(|kind| matches!(kind, HapticFaultKind::EmptyLoad { index: 0 })),
        "{kinds:?}"
    );
    app.insert_resource(Gravity(DVec3::NAN));
    app.world_mut().entity_mut(entity).insert(ExternalForce::new(DVec3::X * f64::INFINITY));
    step(&mut app, 10);
    let kinds = take_kinds(&mut app);
    assert!(
        matches!(kinds[..], [HapticFaultKind::Gravity(_), HapticFaultKind::ExternalForce(_)]),
        "{kinds:?}"
    );
    assert!(center(&app, entity).1.is_finite());
}

#[test]
fn kinematic_body_follows_its_parent_and_keeps_its_contact() {
    let mut app = lockstep_app();
    let tray = app.world_mut().spawn(Transform::default()).id();
    let body = (DeformableBody::block([6; 3], 0.1), FixedRegion::Face(BoxFace::Bottom), KinematicBody);
    let entity = app.world_mut().spawn((body, ChildOf(tray))).id();
    let tool = spawn_tool(&mut app, resting_hand);
    step(&mut app, 30);
    assert_eq!(contacts(&app), [Contact::Start]);
    let fixed = |app: &App| body_of(app, entity, 0);
    let (start, force) = (fixed(&app), force_n(&app, tool));
    // 10 mm sideways within a second under the resting tool, which drags on the surface.
    for _ in 0..20 {
        app.world_mut().get_mut::<Transform>(tray).unwrap().translation.x += 0.5e-3;
        step(&mut app, 1);
    }
    assert!((fixed(&app) - start - DVec3::X * 0.01).length() < 1e-7, "{}", fixed(&app) - start);
    assert_eq!(contacts(&app), [Contact::Start], "the contact persists");
    let dragged = force_n(&app, tool);
    assert!(
        dragged.x > 0.05 * force.y && (dragged.y / force.y - 1.0).abs() < 0.2,
        "{dragged}, {force} before"
    );
    // A jump moves the whole body, and ends the contact.
    app.world_mut().get_mut::<Transform>(tray).unwrap().translation.x += 10.0;
    step(&mut app, 1);
    assert!((fixed(&app) - start - DVec3::X * 10.01).length() < 1e-5);
    assert_eq!(contacts(&app), [Contact::Start, Contact::End]);
    assert_no_faults(&mut app);
}

/// Position of a node.
fn body_of(app: &App, entity: Entity, node: usize) -> DVec3 {
    body(app, entity).positions_m()[node]
}

#[test]
fn accelerated_mount_swings_the_tissue_and_a_rotating_one_turns_it() {
    let mut app = lockstep_app();
    let body_parts = (DeformableBody::block([5; 3], 0.1), FixedRegion::Face(BoxFace::Bottom), KinematicBody);
    let entity = app.world_mut().spawn(body_parts).id();
    step(&mut app, 2);
    let top = 5 * 5 * 5 - 1;
    let lag = |app: &App| {
        let node = |node| body_of(app, entity, node);
        (node(top) - node(4)).x
    };
    let rest = lag(&app);
    // From rest to 0.1 m/s within a model step: the top stays behind the mount.
    app.world_mut().get_mut::<Transform>(entity).unwrap().translation.x += 5e-3;
    step(&mut app, 1);
    assert!(lag(&app) < rest - 5e-4, "{} m", lag(&app) - rest);
    step(&mut app, 120);
    // A body falls asleep below 0.1 mm/s, some hundredths of a millimetre before its rest.
    assert!((lag(&app) - rest).abs() < 5e-5, "{} m", lag(&app) - rest);
    // A quarter turn in two seconds.
    for i in 1..=40 {
        let turned = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 * i as f32 / 40.0);
        app.world_mut().get_mut::<Transform>(entity).unwrap().rotation = turned;
        step(&mut app, 1);
    }
    step(&mut app, 120);
    let at = body_of(&app, entity, top) - DVec3::X * 5e-3;
    assert!((at - DVec3::new(0.05, 0.05, -0.05)).length() < 1e-4, "{at}");
    assert_no_faults(&mut app);
}

#[test]
fn external_force_on_a_tool_is_felt_without_a_contact_and_on_top_of_one() {
    let mut app = lockstep_app();
    spawn_block(&mut app);
    let tool = spawn_tool(&mut app, || ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::Y * 0.2))));
    let weight = ExternalForce::new(DVec3::NEG_Y * 0.7);
    app.world_mut().entity_mut(tool).insert(weight);
    step(&mut app, 30);
    assert!((force_n(&app, tool) + DVec3::Y * 0.7).length() < 1e-9, "{}", force_n(&app, tool));
    app.world_mut().entity_mut(tool).remove::<ExternalForce>();
    step(&mut app, 3);
    assert_eq!(force_n(&app, tool), DVec3::ZERO);
    app.world_mut().entity_mut(tool).insert(ExternalForce::new(DVec3::X * f64::NAN));
    step(&mut app, 3);
    assert_eq!(force_n(&app, tool), DVec3::ZERO);
    let kinds = take_kinds(&mut app);
    assert!(matches!(kinds[..], [HapticFaultKind::Settings(_)]), "{kinds:?}");
    // The same press with and without a weight differs by the weight.
    let pressed = |weight: Option<ExternalForce>| {
        let mut app = lockstep_app();
        spawn_block(&mut app);
        let tool = spawn_tool(&mut app, resting_hand);
        if let Some(weight) = weight {
            app.world_mut().entity_mut(tool).insert(weight);
        }
        step(&mut app, 30);
        force_n(&app, tool)
    };
    let weight_n = DVec3::new(0.1, -0.2, 0.0);
    let difference = pressed(Some(ExternalForce::new(weight_n))) - pressed(None);
    assert!((difference - weight_n).length() < 1e-6, "{difference}");
}
