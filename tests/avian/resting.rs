//! Rigid and soft bodies at rest on each other.

use crate::app::*;
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::GravityScale;
use bevy_palpate::prelude::{BoxFace, DVec3, DeformableBody, FixedRegion, PalpatePlugins, Tissue};
use std::time::Duration;

fn plate(app: &mut App, mass_kg: f32, y_m: f32) -> Entity {
    let plate = (
        RigidBody::Dynamic,
        Collider::cuboid(0.125, 0.0125, 0.125),
        Mass(mass_kg),
        Transform::from_xyz(0.0, y_m, 0.0),
    );
    app.world_mut().spawn(plate).id()
}

/// Runs until body and rigid body sleep, at most `steps` model steps; returns the largest speed of the last ten.
fn settle(app: &mut App, soft: Entity, rigid: Entity, steps: u64) -> f64 {
    let mut speeds = Vec::new();
    for _ in 0..steps {
        step(app, 1);
        speeds.push(velocity(app, rigid).length());
        if is_asleep(app, soft) && is_rigid_asleep(app, rigid) {
            break;
        }
    }
    assert!(
        is_asleep(app, soft) && is_rigid_asleep(app, rigid),
        "{} steps, {:?}",
        speeds.len(),
        speeds.last()
    );
    speeds.iter().rev().take(10).fold(0.0, |most, speed| most.max(*speed))
}

/// The plate sinks by m g h / (E A), with Poisson's ratio 0, and to where a static obstacle bears its weight. With another ratio the block slips
/// outward under the plate, and its friction depends on the way.
#[test]
fn plate_sinks_into_a_block_by_its_weight() {
    for mass_kg in [0.05_f32, 0.4] {
        let mut app = heavy_app();
        let soft = fixed_block(&mut app);
        let tissue = Tissue { poissons_ratio: 0.0, ..Tissue::SOFT };
        app.world_mut().entity_mut(soft).insert((GravityScale(0.0), tissue));
        let plate = plate(&mut app, mass_kg, 0.0573);
        let speed = settle(&mut app, soft, plate, 120);
        assert!(speed < 1e-3, "{speed} m/s");
        let weight = f64::from(mass_kg) * G;
        let on_plate = force(&app, plate).force_n;
        assert!((on_plate - DVec3::Y * weight).length() < 2e-3 * weight, "{on_plate}");
        let sunk = 0.05625 - position(&app, plate).y;
        let column = weight * 0.1 / (20e3 * 0.01);
        assert!((sunk / column - 1.0).abs() < 0.25, "{sunk} m, {column} m of a column");
        // The same plate, static, at the same place.
        let mut other = heavy_app();
        let soft = fixed_block(&mut other);
        other.world_mut().entity_mut(soft).insert((GravityScale(0.0), tissue));
        let at = Transform::from_xyz(0.0, position(&app, plate).y as f32, 0.0);
        let fixed = (RigidBody::Static, Collider::cuboid(0.125, 0.0125, 0.125), at);
        let fixed = other.world_mut().spawn(fixed).id();
        step(&mut other, 80);
        let on_fixed = force(&other, fixed).force_n;
        assert!((on_fixed.y / weight - 1.0).abs() < 5e-3, "{on_fixed}, {weight} N");
    }
}

#[test]
fn light_ball_rests_on_a_block() {
    let mut app = heavy_app();
    let soft = fixed_block(&mut app);
    let ball =
        (RigidBody::Dynamic, Collider::sphere(0.03), Mass(0.005), Transform::from_xyz(0.004, 0.1, 0.003));
    let ball = app.world_mut().spawn(ball).id();
    let speed = settle(&mut app, soft, ball, 200);
    assert!(speed < 5e-3, "{speed}");
    assert!((0.07..0.085).contains(&position(&app, ball).y), "{}", position(&app, ball));
}

/// Sum of the impulses of the static floor on a rigid body in avian's last tick, as avian counts them.
fn floor_impulse(app: &App, rigid: Entity) -> f64 {
    let graph = app.world().resource::<ContactGraph>();
    graph.contact_pairs_with(rigid).map(|pair| f64::from(pair.total_normal_impulse_magnitude())).sum()
}

/// A block falls onto a tray that lies on a static floor: the tray stays, bears the block, and the floor bears both.
#[test]
fn block_rests_on_a_tray_on_a_floor() {
    for mass_kg in [0.2_f32, 5.0] {
        let mut app = heavy_app();
        let floor = (RigidBody::Static, Collider::cuboid(2.0, 0.2, 2.0), Transform::from_xyz(0.0, -0.1, 0.0));
        app.world_mut().spawn(floor);
        let tray = (
            RigidBody::Dynamic,
            Collider::cuboid(0.3, 0.02, 0.3),
            Mass(mass_kg),
            Transform::from_xyz(0.0, 0.0101, 0.0),
        );
        let tray = app.world_mut().spawn(tray).id();
        step(&mut app, 8);
        let alone = floor_impulse(&app, tray);
        let soft = loose_block(&mut app, 0.05);
        let (mut low, mut high, mut loads) = (f64::INFINITY, f64::NEG_INFINITY, Vec::new());
        for _ in 0..50 {
            step(&mut app, 1);
            let y = position(&app, tray).y;
            (low, high) = (low.min(y), high.max(y));
            if !is_rigid_asleep(&app, tray) {
                loads.push(floor_impulse(&app, tray));
            }
        }
        assert!(low > 0.0085 && high < 0.0115, "the tray stays on the floor: {low} {high}");
        settle(&mut app, soft, tray, 100);
        let on_tray = force(&app, tray).force_n;
        assert!((on_tray + DVec3::Y * BLOCK_N).length() < 5e-3 * BLOCK_N, "{on_tray}");
        let (load, ratio) = (*loads.last().unwrap(), 1.0 + 1.0 / f64::from(mass_kg));
        assert!((load / alone / ratio - 1.0).abs() < 0.01, "{load}, {alone}, {ratio}");
        let bottom = body(&app, soft).positions_m().iter().map(|x| x.y).fold(f64::INFINITY, f64::min);
        assert!((bottom - position(&app, tray).y - 0.01).abs() < 1e-4, "{bottom}");
    }
}

/// Two blocks bear one plate, each half of its weight.
#[test]
fn plate_rests_on_two_blocks() {
    let mut app = heavy_app();
    let softs = [-0.06_f32, 0.06].map(|x| {
        let soft = fixed_block(&mut app);
        app.world_mut().entity_mut(soft).insert((Transform::from_xyz(x, 0.0, 0.0), GravityScale(0.0)));
        soft
    });
    let plate = (
        RigidBody::Dynamic,
        Collider::cuboid(0.22, 0.01, 0.1),
        Mass(0.3),
        Transform::from_xyz(0.0, 0.06, 0.0),
    );
    let plate = app.world_mut().spawn(plate).id();
    settle(&mut app, softs[0], plate, 200);
    let on_plate = force(&app, plate);
    assert!((on_plate.force_n - DVec3::Y * 0.3 * G).length() < 0.01, "{on_plate:?}");
    assert!(on_plate.torque_nm.length() < 1e-3, "{on_plate:?}");
    let turned = app.world().get::<Rotation>(plate).unwrap().0;
    assert!(f64::from(turned.x.abs() + turned.z.abs()) < 1e-3, "{turned}");
}

/// A plate between two blocks that press on it from both sides.
#[test]
fn plate_between_two_blocks_stays() {
    let mut app = app(64.0);
    let low = fixed_block(&mut app);
    let top = DeformableBody::block([6; 3], 0.1);
    let top = (top, FixedRegion::Face(BoxFace::Top), Transform::from_xyz(0.0, 0.108, 0.0));
    let top = app.world_mut().spawn(top).id();
    let plate = plate(&mut app, 0.05, 0.054);
    let mut far = 0.0_f64;
    for i in 0..120 {
        step(&mut app, 1);
        if i > 60 {
            far = far.max((position(&app, plate).y - 0.054).abs());
        }
    }
    assert!(far < 1e-4, "{far} m");
    assert!(max_speed(&app, low) < 1e-3 && max_speed(&app, top) < 1e-3);
}

#[test]
fn sleeping_bodies_wake_each_other() {
    let mut app = heavy_app();
    let soft = fixed_block(&mut app);
    let plate = plate(&mut app, 0.1, 0.058);
    settle(&mut app, soft, plate, 200);
    // The plate is pushed: the block wakes, and both come to rest again.
    app.world_mut().get_mut::<LinearVelocity>(plate).unwrap().0 = vector(DVec3::Y * 0.3);
    step(&mut app, 2);
    assert!(!is_asleep(&app, soft) && !is_rigid_asleep(&app, plate));
    settle(&mut app, soft, plate, 200);
    // A load on the block wakes the plate.
    let load = bevy_palpate::ExternalForce::new(DVec3::Y * 5.0);
    app.world_mut().entity_mut(soft).insert(load);
    step(&mut app, 3);
    assert!(!is_rigid_asleep(&app, plate));
    settle(&mut app, soft, plate, 200);
    // Without the block the plate falls.
    app.world_mut().entity_mut(soft).despawn();
    step(&mut app, 6);
    assert!(velocity(&app, plate).y < -1.0, "{}", velocity(&app, plate));
}

/// With loops on threads model steps come with the frames, which may be late; a step then covers two periods, or time is left out.
#[test]
fn plate_rests_in_irregular_frames() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), bevy::mesh::MeshPlugin, PalpatePlugins));
    app.add_plugins(PhysicsPlugins::default()).insert_resource(bevy_palpate::Gravity::EARTH);
    app.finish();
    app.cleanup();
    let soft = fixed_block(&mut app);
    let plate = plate(&mut app, 0.1, 0.058);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..400 {
        let ms = [16, 17, 16, 33, 16, 7, 16, 120][i % 8];
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(ms)));
        app.update();
        let y = position(&app, plate).y;
        if i > 100 {
            (low, high) = (low.min(y), high.max(y));
        }
    }
    assert!(low > 0.045 && high < 0.06 && high - low < 2e-3, "{low} {high}");
    assert!(is_asleep(&app, soft) && is_rigid_asleep(&app, plate), "{low} {high}");
}
