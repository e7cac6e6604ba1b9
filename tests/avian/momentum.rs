//! Momentum of soft and rigid bodies together.

use crate::app::*;
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_palpate::prelude::{DVec3, DeformableBody};
use palpate_body::{RigidMass, RigidMotion, SemiImplicitEuler};

/// Spawns a loose block of 10 cm at the origin and a ball above it that falls onto it.
fn scene(app: &mut App, friction: f64) -> (Entity, Entity) {
    let soft = app.world_mut().spawn(DeformableBody::block([5; 3], 0.1)).id();
    let ball = (
        RigidBody::Dynamic,
        Collider::sphere(0.04),
        Mass(0.3),
        Friction::new(friction as avian3d::math::Scalar),
        LinearVelocity(vector(DVec3::new(0.1, -0.8, 0.05))),
        AngularVelocity(vector(DVec3::new(3.0, 1.0, -2.0))),
        Transform::from_xyz(0.012, 0.18, 0.007),
    );
    (soft, app.world_mut().spawn(ball).id())
}

fn total(app: &App, soft: Entity, ball: Entity) -> (DVec3, DVec3) {
    let ((p, l), (q, m)) = (soft_momentum(app, soft), rigid_momentum(app, ball));
    (p + q, l + m)
}

#[test]
fn momentum_is_kept_in_flight_and_impact() {
    for (hz, friction) in [(80.0, 0.0), (80.0, 0.6), (64.0, 0.6)] {
        let mut app = app(hz);
        let (soft, ball) = scene(&mut app, friction);
        step(&mut app, 1);
        let (p, l) = total(&app, soft, ball);
        let falling = velocity(&app, ball).y;
        let before_j = 0.5 * mass(&app, ball) * velocity(&app, ball).length_squared();
        let (mut most, mut most_l) = (0.0_f64, 0.0_f64);
        for _ in 0..10 {
            step(&mut app, 1);
            let (p1, l1) = total(&app, soft, ball);
            most = most.max((p1 - p).length() / p.length());
            most_l = most_l.max((l1 - l).length() / l.length());
        }
        let (p1, l1) = total(&app, soft, ball);
        let (end, end_l) = ((p1 - p).length() / p.length(), (l1 - l).length() / l.length());
        assert!(falling < -0.7 && velocity(&app, ball).y > falling + 0.3, "{}", velocity(&app, ball));
        let energy = |app: &App| {
            let soft = body(app, soft);
            let nodes = soft.velocities_m_per_s().iter().zip(soft.network().mass_kg());
            nodes.map(|(v, m)| 0.5 * m * v.length_squared()).sum::<f64>()
                + 0.5 * mass(app, ball) * velocity(app, ball).length_squared()
        };
        assert!(energy(&app) < before_j, "{} J, {before_j} J", energy(&app));
        assert!(end < 3e-6 && end_l < 3e-6, "{hz} {friction}: {end} {end_l}");
        assert!(hz != 80.0 || most < 3e-6 && most_l < 3e-6, "{hz} {friction}: {most} {most_l}");
    }
}

/// The ball bounces as a rigid body that only the soft body's solver moves, with gravity, and energy is lost.
#[test]
fn ball_bounces_as_one_that_the_soft_body_moves() {
    let mut app = heavy_app();
    let soft = fixed_block(&mut app);
    app.world_mut().entity_mut(soft).insert(bevy_palpate::GravityScale(0.0));
    step(&mut app, 1);
    let ball = (
        RigidBody::Dynamic,
        Collider::sphere(0.04),
        Mass(0.2),
        Friction::new(0.5),
        LinearVelocity(vector(DVec3::new(0.1, -0.5, 0.0))),
        Transform::from_xyz(0.012, 0.14, 0.007),
    );
    let ball = app.world_mut().spawn(ball).id();
    step(&mut app, 1);
    let mut alone = body(&app, soft).clone();
    let (at, v) = (position(&app, ball), velocity(&app, ball));
    let motion = RigidMotion {
        velocity_m_per_s: v,
        acceleration_m_per_s2: DVec3::NEG_Y * G,
        ..RigidMotion::default()
    };
    let sphere = palpate_body::Obstacle::sphere(at, 0.04, 0.5).unwrap();
    let mass = RigidMass::of_sphere(0.2, 0.04).unwrap();
    alone.set_obstacles(vec![sphere.with_mass(mass, motion).unwrap()]);
    let (mut far, mut low) = (0.0_f64, f64::INFINITY);
    for _ in 0..8 {
        step(&mut app, 1);
        alone.advance(None, 50, SemiImplicitEuler::default()).unwrap();
        let other = &alone.obstacles()[0];
        // Avian is up to a tick ahead.
        let ahead = position(&app, ball) - other.position_m();
        let moved = other.rigid_motion().unwrap().velocity_m_per_s;
        far = far.max((ahead.length() - moved.length() / 64.0).max(0.0));
        low = low.min(position(&app, ball).y);
    }
    assert!(low < 0.088 && far < 5e-3, "{far} m apart, lowest at {low} m");
}
