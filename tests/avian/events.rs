//! Rigid bodies that appear, jump, are locked or vanish, and the same bits in every run.

use crate::app::*;
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_palpate::prelude::*;

fn ball(app: &mut App, at: Vec3) -> Entity {
    let ball = (RigidBody::Dynamic, Collider::sphere(0.04), Mass(0.2), Transform::from_translation(at));
    app.world_mut().spawn(ball).id()
}

/// A tray on a floor, a block and two balls that fall on it.
fn bits() -> Vec<[u64; 3]> {
    let mut app = heavy_app();
    app.world_mut().spawn((
        RigidBody::Static,
        Collider::cuboid(2.0, 0.2, 2.0),
        Transform::from_xyz(0.0, -0.1, 0.0),
    ));
    let tray = (
        RigidBody::Dynamic,
        Collider::cuboid(0.3, 0.02, 0.3),
        Mass(0.3),
        Transform::from_xyz(0.0, 0.011, 0.0),
    );
    let tray = app.world_mut().spawn(tray).id();
    let soft = loose_block(&mut app, 0.03);
    let balls = [ball(&mut app, Vec3::new(0.03, 0.2, 0.01)), ball(&mut app, Vec3::new(-0.035, 0.25, -0.02))];
    let mut all = Vec::new();
    for _ in 0..40 {
        step(&mut app, 1);
        let rigid = [tray, balls[0], balls[1]].map(|entity| position(&app, entity));
        let soft = body(&app, soft).positions_m();
        all.extend(rigid.iter().chain(soft).map(|x| x.to_array().map(f64::to_bits)));
    }
    assert!(position(&app, tray).y > 0.005, "{}", position(&app, tray));
    all
}

#[test]
fn lock_step_gives_the_same_bits_twice() {
    assert!(bits() == bits());
}

#[test]
fn body_that_vanishes_in_contact_leaves_no_force() {
    let mut app = heavy_app();
    let soft = fixed_block(&mut app);
    let ball = ball(&mut app, Vec3::new(0.0, 0.1, 0.0));
    step(&mut app, 30);
    assert!(force(&app, ball).force_n.y > 1.0, "{:?}", force(&app, ball));
    app.world_mut().entity_mut(ball).despawn();
    step(&mut app, 60);
    assert!(is_asleep(&app, soft));
    let sum: DVec3 = body(&app, soft).contacts().iter().map(|contact| contact.impulse_ns).sum();
    assert_eq!(sum, DVec3::ZERO);
    assert!(take_faults(&mut app).is_empty());
}

/// A jump does not count as a motion: neither the block nor the ball gets a kick, whether it comes from or goes to the block.
#[test]
fn jump_gives_no_kick() {
    let mut app = heavy_app();
    let soft = fixed_block(&mut app);
    let ball = ball(&mut app, Vec3::new(0.0, 0.1, 0.0));
    step(&mut app, 40);
    // Sideways through the block's top, far away.
    app.world_mut().get_mut::<Transform>(ball).unwrap().translation += Vec3::new(0.5, 1.0, 0.0);
    step(&mut app, 2);
    let fall = velocity(&app, ball);
    assert!(fall.x.abs() < 0.02 && fall.y < 0.0, "{fall}");
    assert!(max_speed(&app, soft) < 0.5, "{}", max_speed(&app, soft));
    step(&mut app, 40);
    app.world_mut().get_mut::<Transform>(ball).unwrap().translation = Vec3::new(0.0, 0.088, 0.0);
    app.world_mut().get_mut::<LinearVelocity>(ball).unwrap().0 = vector(DVec3::ZERO);
    step(&mut app, 2);
    assert!(velocity(&app, ball).length() < 0.6, "{}", velocity(&app, ball));
    step(&mut app, 60);
    assert!((position(&app, ball).y - 0.08).abs() < 0.02, "{}", position(&app, ball));
    assert!(take_faults(&mut app).is_empty());
}

/// A locked axis takes no part of the reaction.
#[test]
fn locked_axes_do_not_move() {
    let mut app = heavy_app();
    fixed_block(&mut app);
    let plate = |locked: LockedAxes, x: f32| {
        let at = Transform::from_xyz(x, 0.07, 0.0);
        (RigidBody::Dynamic, Collider::cuboid(0.2, 0.02, 0.1), Mass(0.1), locked, at)
    };
    // Off the middle of the block it would tip.
    let level = app.world_mut().spawn(plate(LockedAxes::ROTATION_LOCKED, 0.06)).id();
    step(&mut app, 60);
    assert!(position(&app, level).y > 0.04, "{}", position(&app, level));
    assert_eq!(app.world().get::<Rotation>(level).unwrap().0, Rotation::default().0);
    app.world_mut().entity_mut(level).despawn();
    let tipping = app.world_mut().spawn(plate(LockedAxes::new(), 0.06)).id();
    step(&mut app, 60);
    assert!(position(&app, tipping).y < 0.0, "{}", position(&app, tipping));
    let rail =
        app.world_mut().spawn(plate(LockedAxes::new().lock_translation_y().lock_rotation_z(), 0.0)).id();
    app.world_mut().get_mut::<Transform>(rail).unwrap().translation.y = 0.055;
    step(&mut app, 40);
    assert!((position(&app, rail).y - 0.055).abs() < 1e-6, "{}", position(&app, rail));
    assert!(force(&app, rail).force_n.y > 1.0, "{:?}", force(&app, rail));
}

/// A ball on a slope of soft tissue rolls off.
#[test]
fn ball_rolls_off_a_tilted_block() {
    let mut app = heavy_app();
    let turn = Quat::from_rotation_z(-0.35);
    let block = (DeformableBody::block([8; 3], 0.14), FixedRegion::Face(BoxFace::Bottom));
    app.world_mut().spawn((block, Transform::from_rotation(turn)));
    let at = turn * Vec3::new(-0.02, 0.07 + 0.041, 0.0);
    let ball = ball(&mut app, at);
    step(&mut app, 50);
    assert!(take_faults(&mut app).is_empty());
    let v = app.world().get::<AngularVelocity>(ball).unwrap().0;
    assert!(position(&app, ball).x > 0.1 && f64::from(v.z) < -1.0, "{} {v}", position(&app, ball));
}

/// A ball that appears within a block is pushed out slowly.
#[test]
fn ball_that_appears_in_a_block_is_pushed_out_slowly() {
    for depth in [0.005_f32, 0.02, 0.045, 0.075] {
        let mut app = app(64.0);
        fixed_block(&mut app);
        step(&mut app, 2);
        let ball = ball(&mut app, Vec3::new(0.011, 0.09 - depth, 0.007));
        let (mut high, mut fast) = (0.0_f64, 0.0_f64);
        for _ in 0..20 {
            step(&mut app, 1);
            high = high.max(position(&app, ball).y);
            fast = fast.max(velocity(&app, ball).length());
        }
        assert!(fast < 1.2 && high < 1.0, "{depth}: {fast} m/s, {high} m");
        assert!(take_faults(&mut app).is_empty());
    }
}
