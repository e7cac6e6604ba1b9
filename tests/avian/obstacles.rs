//! Colliders as obstacles.

use crate::app::*;
use avian3d::math::Scalar;
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_palpate::prelude::DVec3;
use bevy_palpate::{
    HapticFaultKind, HapticSchedulePlugin, LoopMode, NotAnObstacle, Obstacle, PalpatePlugins, TouchLayers,
};

/// Positions of all nodes of a block that falls from 5 mm onto what `spawn` spawns, after `steps` model steps.
fn fall(steps: u64, spawn: impl Fn(&mut App)) -> (App, Vec<DVec3>) {
    let mut app = heavy_app();
    spawn(&mut app);
    let soft = loose_block(&mut app, 0.005);
    step(&mut app, steps);
    let positions = body(&app, soft).positions_m().to_vec();
    (app, positions)
}

fn lowest(positions: &[DVec3]) -> f64 {
    positions.iter().map(|x| x.y).fold(f64::INFINITY, f64::min)
}

#[test]
fn static_collider_is_a_plain_obstacle_bit_for_bit() {
    // A tilted box, a ball, a capsule and a half-space with sizes that both precisions have.
    let tilt = Quat::from_rotation_z(0.1);
    let pairs = [
        (Collider::cuboid(1.0, 0.25, 1.0), Obstacle::cuboid(DVec3::new(1.0, 0.25, 1.0)), -0.125, tilt),
        (Collider::sphere(0.5), Obstacle::sphere(0.5), -0.5, Quat::IDENTITY),
        (Collider::capsule(0.25, 1.0), Obstacle::capsule(0.25, 1.0), -0.75, Quat::IDENTITY),
        (Collider::half_space(vector(DVec3::Y)), Obstacle::half_space(), 0.0, tilt),
    ];
    for (collider, obstacle, y, rotation) in pairs {
        let at = Transform::from_xyz(0.0, y, 0.0).with_rotation(rotation);
        let friction = Friction::new(0.25 as Scalar);
        let (mut app, of_avian) = fall(30, |app| {
            app.world_mut().spawn((RigidBody::Static, collider.clone(), friction, at));
        });
        // Avian normalises the rotation.
        let mut placed = app.world_mut().query_filtered::<&Transform, With<Collider>>();
        let at = *placed.single(app.world()).unwrap();
        let (_, plain) = fall(30, |app| {
            app.world_mut().spawn((obstacle.clone().with_friction(0.25), at));
        });
        assert!(of_avian == plain, "{obstacle:?}");
        assert!(lowest(&plain) > -0.2, "{}", lowest(&plain));
    }
}

/// Shapes whose top is flat and at y = 0, of all kinds.
#[test]
fn block_rests_at_the_same_height_on_every_shape_with_a_flat_top() {
    let corners = |half: Vec3| -> Vec<Vec3> {
        let sign = |index: usize, bit: usize| if index >> bit & 1 == 0 { -1.0 } else { 1.0 };
        (0..8).map(|i| half * Vec3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect()
    };
    let points: Vec<_> = corners(Vec3::new(0.5, 0.125, 0.5)).iter().map(|x| vector(x.as_dvec3())).collect();
    let top = Vec3::Y * -0.125;
    let quad = [[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]]
        .map(|[x, z]| vector(DVec3::new(x, 0.0, z)))
        .to_vec();
    let child =
        |x: f64| (vector(DVec3::new(x, 0.0, 0.0)), Rotation::default(), Collider::cuboid(0.5, 0.25, 1.0));
    let shapes: Vec<(&str, Collider, Vec3, Vec3)> = vec![
        ("plane", Collider::half_space(vector(DVec3::Y)), Vec3::ZERO, Vec3::ONE),
        ("cuboid", Collider::cuboid(1.0, 0.25, 1.0), top, Vec3::ONE),
        ("scaled", Collider::cuboid(0.5, 0.5, 0.25), top, Vec3::new(2.0, 0.5, 4.0)),
        ("hull", Collider::convex_hull(points).unwrap(), top, Vec3::ONE),
        ("cylinder", Collider::cylinder(0.5, 0.25), top, Vec3::ONE),
        ("compound", Collider::compound(vec![child(-0.25), child(0.25)]), top, Vec3::ONE),
        ("mesh", Collider::trimesh(quad, vec![[0, 1, 2], [0, 2, 3]]), Vec3::ZERO, Vec3::ONE),
        ("rounded", Collider::round_cuboid(1.0, 0.125, 1.0, 0.0625), top, Vec3::ONE),
    ];
    let mut heights = Vec::new();
    for (name, collider, at, scale) in shapes {
        let transform = Transform::from_translation(at).with_scale(scale);
        let (mut app, positions) = fall(40, |app| {
            app.world_mut().spawn((RigidBody::Static, collider.clone(), transform));
        });
        assert!(take_faults(&mut app).is_empty(), "{name}");
        heights.push((name, positions.iter().map(|x| x.y).sum::<f64>() / positions.len() as f64));
    }
    // A dynamic body that cannot move, with child colliders.
    let (_, positions) = fall(40, |app| {
        let sides = [-0.25_f32, 0.25].map(|x| {
            let part = (Collider::cuboid(0.5, 0.25, 1.0), Transform::from_xyz(x, -0.125, 0.0));
            app.world_mut().spawn(part).id()
        });
        let body = (RigidBody::Dynamic, LockedAxes::ALL_LOCKED, Transform::default());
        app.world_mut().spawn(body).add_children(&sides);
    });
    heights.push(("children", positions.iter().map(|x| x.y).sum::<f64>() / positions.len() as f64));
    for (name, height) in &heights {
        assert!((height - heights[0].1).abs() < 1e-6, "{name}: {height}, {}", heights[0].1);
    }
    assert!((0.045..0.05).contains(&heights[0].1), "{heights:?}");
}

#[test]
fn sensors_disabled_and_excluded_colliders_are_no_obstacles() {
    type Exclude = fn(&mut EntityWorldMut);
    let cases: [(&str, Exclude); 6] = [
        ("sensor", |entity| _ = entity.insert(Sensor)),
        ("disabled collider", |entity| _ = entity.insert(ColliderDisabled)),
        ("disabled body", |entity| _ = entity.insert(RigidBodyDisabled)),
        ("excluded", |entity| _ = entity.insert(NotAnObstacle)),
        ("other layer", |entity| _ = entity.insert(TouchLayers::NONE)),
        ("no rigid body", |entity| _ = entity.remove::<RigidBody>()),
    ];
    for (name, exclude) in cases {
        for kind in [RigidBody::Static, RigidBody::Kinematic] {
            let mut app = heavy_app();
            let floor = (kind, Collider::cuboid(2.0, 0.5, 2.0), Transform::from_xyz(0.0, -0.25, 0.0));
            let floor = app.world_mut().spawn(floor).id();
            let soft = loose_block(&mut app, 0.002);
            step(&mut app, 4);
            let on_it = lowest(body(&app, soft).positions_m());
            assert!(on_it > -1e-3, "{name}: {on_it}");
            // It may come to be excluded at any time.
            exclude(&mut app.world_mut().entity_mut(floor));
            step(&mut app, 6);
            let below = lowest(body(&app, soft).positions_m());
            assert!(below < -0.1, "{name}, {kind:?}: {below}");
        }
    }
}

#[test]
fn obstacle_component_replaces_the_collider() {
    let (app, positions) = fall(20, |app| {
        // The obstacle is a lower box than the collider.
        let obstacle = Obstacle::cuboid(DVec3::new(2.0, 0.25, 2.0));
        let parts = (RigidBody::Static, Collider::cuboid(2.0, 0.75, 2.0), obstacle);
        app.world_mut().spawn((parts, Transform::from_xyz(0.0, -0.375, 0.0)));
    });
    assert!((lowest(&positions) + 0.25).abs() < 2e-3, "{}", lowest(&positions));
    drop(app);
}

#[test]
fn shape_without_volume_is_a_fault_once() {
    let (mut app, positions) = fall(10, |app| {
        let segment = Collider::segment(vector(DVec3::NEG_X), vector(DVec3::X));
        app.world_mut().spawn((RigidBody::Static, segment));
        let flat = Collider::cuboid(1.0, 0.0, 1.0);
        app.world_mut().spawn((RigidBody::Static, flat));
    });
    let faults = take_faults(&mut app);
    let unsupported =
        |kind: &HapticFaultKind| matches!(kind, HapticFaultKind::UnsupportedCollider { shape: "segment" });
    assert!(faults.len() == 2 && faults.iter().any(unsupported), "{faults:?}");
    let rejected = |kind: &HapticFaultKind| matches!(kind, HapticFaultKind::Obstacle(_));
    assert!(faults.iter().any(rejected), "{faults:?}");
    assert!(lowest(&positions) < -0.2);
}

/// A kinematic platform lifts a block at its velocity.
#[test]
fn kinematic_platform_lifts_a_block() {
    let mut app = heavy_app();
    let platform =
        (RigidBody::Kinematic, Collider::cuboid(1.0, 0.25, 1.0), Transform::from_xyz(0.0, -0.125, 0.0));
    let platform = app.world_mut().spawn(platform).id();
    let soft = loose_block(&mut app, 0.0);
    step(&mut app, 30);
    let start = center(&app, soft);
    let from = position(&app, platform);
    app.world_mut().get_mut::<LinearVelocity>(platform).unwrap().0 = vector(DVec3::new(0.02, 0.05, 0.0));
    step(&mut app, 40);
    let (lifted, moved) = (center(&app, soft) - start, position(&app, platform) - from);
    // The model step ends within the tick.
    assert!((lifted - moved).length() < 0.05 / 64.0 + 5e-4, "{lifted} {moved}");
    let v = soft_momentum(&app, soft).0;
    assert!((v - DVec3::new(0.02, 0.05, 0.0)).length() < 2e-3, "{v} kg m/s");
}

#[test]
fn app_without_avians_plugins_runs() {
    let mut app = App::new();
    let schedule = HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep);
    app.add_plugins((
        MinimalPlugins,
        AssetPlugin::default(),
        bevy::mesh::MeshPlugin,
        PalpatePlugins.set(schedule),
    ));
    app.world_mut().spawn((RigidBody::Dynamic, Collider::sphere(0.1), Transform::default()));
    loose_block(&mut app, 0.0);
    (0..50).for_each(|_| app.update());
}
