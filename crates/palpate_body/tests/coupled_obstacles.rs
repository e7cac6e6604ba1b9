//! Obstacles that another solver moves and that respond to the body, and obstacles of several parts.

use glam::{DMat3, DQuat, DVec3};
use palpate_body::*;

const TICK_S: f64 = 1e-3;

fn explicit() -> Integrator {
    SemiImplicitEuler::default().into()
}

/// A loose block of 10 cm with its top at z = 0.
fn block() -> Body {
    let block = Block::new([4; 3], DVec3::splat(0.1)).unwrap().centered_at(DVec3::Z * -0.05).unwrap();
    let made = block.allow_unconstrained().tissue(&Tissue::default()).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn response(mass_kg: f64, radius_m: f64) -> RigidResponse {
    let inertia = 0.4 * mass_kg * radius_m * radius_m;
    let diagonal = |value: f64| DMat3::from_diagonal(DVec3::splat(value));
    RigidResponse { linear: diagonal(1.0 / mass_kg), coupling: DMat3::ZERO, angular: diagonal(1.0 / inertia) }
}

/// The other solver: a ball in free motion.
#[derive(Clone, Copy)]
struct Ball {
    x: DVec3,
    q: DQuat,
    v: DVec3,
    w: DVec3,
}

/// A coupled ball meets a block in advances of 50 ms and moves as a rigid body of the same mass: its momentum and that of the
/// block are kept after every advance, and it ends where the rigid body ends. The other solver expects an arbitrary force.
#[test]
fn coupled_ball_moves_as_one_with_a_mass() {
    let (mass_kg, radius_m) = (0.3, 0.03);
    let start = Ball {
        x: DVec3::new(0.012, 0.007, 0.034),
        q: DQuat::IDENTITY,
        v: DVec3::new(0.1, 0.0, -0.8),
        w: DVec3::new(0.0, 4.0, 1.0),
    };
    let sphere =
        |ball: Ball| Obstacle::sphere(DVec3::ZERO, radius_m, 0.4).unwrap().with_pose(ball.x, ball.q).unwrap();
    let mut alone = block();
    let motion = RigidMotion {
        velocity_m_per_s: start.v,
        angular_velocity_rad_per_s: start.w,
        ..RigidMotion::default()
    };
    let mass = RigidMass::of_sphere(mass_kg, radius_m).unwrap();
    alone.set_obstacles(vec![sphere(start).with_mass(mass, motion).unwrap()]);
    let (ticks, span_s) = (50, 50.0 * TICK_S);
    let (mut body, mut ball, of) = (block(), start, response(mass_kg, radius_m));
    body.set_obstacles(vec![sphere(ball)]);
    let inertia = 0.4 * mass_kg * radius_m * radius_m;
    let momentum = |body: &Body, ball: &Ball| {
        let nodes = body.positions_m().iter().zip(body.velocities_m_per_s()).zip(body.network().mass_kg());
        let (p, l) =
            nodes.fold((DVec3::ZERO, DVec3::ZERO), |(p, l), ((x, v), m)| (p + *m * *v, l + x.cross(*m * *v)));
        (p + mass_kg * ball.v, l + ball.x.cross(mass_kg * ball.v) + inertia * ball.w)
    };
    let mut touched = 0;
    for expected_ns in [DVec3::ZERO, DVec3::new(0.01, 0.0, 0.05), DVec3::ZERO, DVec3::ZERO] {
        let (p, l) = momentum(&body, &ball);
        // The path with the expected impulse, spread over the advance.
        let by = expected_ns / mass_kg;
        let end = Ball {
            x: ball.x + (ball.v + 0.5 * by) * span_s,
            q: DQuat::from_scaled_axis(ball.w * span_s) * ball.q,
            v: ball.v + by,
            w: ball.w,
        };
        let motion = CoupledMotion {
            position_m: end.x,
            rotation: end.q,
            center_m: DVec3::ZERO,
            velocity_change_m_per_s: by,
            angular_velocity_change_rad_per_s: DVec3::ZERO,
            expected_ns,
            expected_nms: DVec3::ZERO,
            response: of,
        };
        body.couple_obstacle(0, motion).unwrap();
        touched += body.advance(None, ticks, explicit()).unwrap().contacts;
        alone.advance(None, ticks, explicit()).unwrap();
        let reaction = body.obstacle_reactions()[0];
        ball = Ball {
            x: end.x + reaction.displacement_m,
            q: DQuat::from_scaled_axis(reaction.turn_rad) * end.q,
            v: end.v + reaction.velocity_change_m_per_s - by,
            w: end.w + reaction.angular_velocity_change_rad_per_s,
        };
        let obstacle = &body.obstacles()[0];
        assert!((obstacle.position_m() - ball.x).length() < 1e-12, "{}", obstacle.position_m() - ball.x);
        let (p1, l1) = momentum(&body, &ball);
        assert!((p1 - p).length() < 1e-12 * p.length(), "{p} {p1}");
        // Steps of the other solver and of the body differ only where a force is expected.
        let tolerance = if expected_ns == DVec3::ZERO { 1e-9 } else { 2e-3 };
        assert!((l1 - l).length() < tolerance * l.length() || touched == 0, "{l} {l1}");
        let rigid = &alone.obstacles()[0];
        let apart = rigid.position_m().distance(ball.x);
        // The half of a step of the body by which the expected force leads.
        assert!(apart < 3e-4, "{apart} m from the body with a mass");
    }
    assert!(touched > 3 && ball.v.z > -0.7, "{touched} {}", ball.v);
}

#[test]
fn coupled_obstacle_without_response_moves_as_a_moved_one() {
    let run = |is_coupled: bool| {
        let mut body = block();
        body.set_gravity(DVec3::Z * -9.81).unwrap();
        let table = Obstacle::cuboid(DVec3::new(0.3, 0.3, 0.01), 0.7).unwrap();
        body.set_obstacles(vec![table.with_pose(DVec3::Z * -0.11, DQuat::IDENTITY).unwrap()]);
        for i in 1..=10 {
            let t = f64::from(i);
            let (at, turn) = (DVec3::new(2e-3 * t, 0.0, -0.11 + 1e-3 * t), DQuat::from_rotation_z(0.01 * t));
            if is_coupled {
                let motion = CoupledMotion {
                    expected_ns: DVec3::X,
                    expected_nms: DVec3::Y,
                    ..CoupledMotion::prescribed(at, turn)
                };
                body.couple_obstacle(0, motion).unwrap();
            } else {
                body.move_obstacle(0, at, turn).unwrap();
            }
            body.advance(None, 50, explicit()).unwrap();
        }
        (body.positions_m().to_vec(), body.obstacles()[0].position_m(), body.obstacle_reactions()[0])
    };
    let ((x, at, reaction), (y, there, other)) = (run(true), run(false));
    let apart = x.iter().zip(&y).map(|(x, y)| x.distance(*y)).fold(0.0, f64::max);
    assert!(apart < 1e-11 && at.distance(there) < 1e-15, "{apart} {at} {there}");
    assert!((reaction.impulse_ns - other.impulse_ns).length() < 1e-9, "{reaction:?} {other:?}");
    assert_eq!(reaction.displacement_m, DVec3::ZERO);
}

/// A body that rests on a coupled plate held up by the other solver falls asleep, and wakes when the plate moves.
#[test]
fn body_on_a_resting_coupled_obstacle_sleeps() {
    let mut body = block();
    body.set_gravity(DVec3::Z * -9.81).unwrap();
    let at = DVec3::Z * -0.11;
    let plate = Obstacle::cuboid(DVec3::new(0.3, 0.3, 0.01), 0.5).unwrap();
    body.set_obstacles(vec![plate.with_pose(at, DQuat::IDENTITY).unwrap()]);
    let mut step = |at: DVec3, noise: f64| {
        let motion = CoupledMotion::prescribed(at + DVec3::X * noise, DQuat::IDENTITY);
        body.couple_obstacle(0, motion).unwrap();
        body.advance(None, 50, explicit()).unwrap().is_asleep
    };
    let asleep: Vec<bool> = (0..60).map(|i| step(at, if i % 2 == 0 { 1e-8 } else { 0.0 })).collect();
    assert!(asleep[55..].iter().all(|asleep| *asleep), "{asleep:?}");
    assert!(!step(at + DVec3::Z * 1e-3, 0.0));
}

#[test]
fn compound_is_the_union_of_its_parts() {
    let part = |x: f64, friction: f64| {
        let sphere = Obstacle::sphere(DVec3::ZERO, 0.1, friction).unwrap();
        sphere.with_pose(DVec3::X * x, DQuat::IDENTITY).unwrap()
    };
    let pair = Obstacle::compound(&[part(-0.2, 0.1), part(0.2, 0.9)]).unwrap();
    let turned = pair.with_pose(DVec3::Y, DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2)).unwrap();
    // The parts are at y = 0.8 and 1.2.
    for (at, gap_m, normal) in [
        (DVec3::new(0.0, 0.8, 0.3), 0.2, DVec3::Z),
        (DVec3::new(0.0, 1.4, 0.0), 0.1, DVec3::Y),
        (DVec3::new(0.05, 1.2, 0.0), -0.05, DVec3::X),
    ] {
        let (gap, n) = turned.gap_m(at);
        assert!((gap - gap_m).abs() < 1e-12 && n.distance(normal) < 1e-12, "{at}: {gap} {n}");
    }
    let rounded = Obstacle::cuboid(DVec3::splat(0.1), 0.5).unwrap().with_margin(0.02).unwrap();
    for (at, gap_m) in [(DVec3::X * 0.15, 0.03), (DVec3::splat(0.2), 0.1 * 3f64.sqrt() - 0.02)] {
        let (gap, _) = rounded.gap_m(at);
        assert!((gap - gap_m).abs() < 1e-12, "{at}: {gap}");
    }
    assert!(matches!(Obstacle::compound(&[]), Err(BodyError::Parameter { .. })));
    let margin = Obstacle::cuboid(DVec3::ONE, 0.5).unwrap().with_margin(-0.1);
    assert!(matches!(margin, Err(BodyError::Parameter { .. })));
}

/// A block on a slope slides over the part of a compound below the angle of friction, and rests on the other.
#[test]
fn parts_of_a_compound_have_their_own_friction() {
    for (place, rests) in [(-0.5, false), (0.5, true)] {
        let slab = |x: f64, friction: f64| {
            let slab = Obstacle::cuboid(DVec3::new(0.5, 5.0, 0.1), friction).unwrap();
            slab.with_pose(DVec3::X * x, DQuat::IDENTITY).unwrap()
        };
        let mut body = block();
        let table = Obstacle::compound(&[slab(-0.5, 0.2), slab(0.5, 0.8)]).unwrap();
        body.set_obstacles(vec![table.with_pose(DVec3::new(-place, 0.0, -0.2), DQuat::IDENTITY).unwrap()]);
        // A slope of 0.4.
        body.set_gravity(9.81 * DVec3::new(0.0, 0.4, -1.0).normalize()).unwrap();
        body.advance(None, 1000, explicit()).unwrap();
        let v = body.velocities_m_per_s().iter().sum::<DVec3>() / body.positions_m().len() as f64;
        assert_eq!(v.length() < 0.02, rests, "{v} at {place}");
    }
}

#[test]
fn rejects_invalid_coupled_motions() {
    let mut body = block();
    let ball = Obstacle::sphere(DVec3::Z, 0.1, 0.5).unwrap();
    let mass = RigidMass::of_sphere(1.0, 0.1).unwrap();
    body.set_obstacles(vec![ball.clone(), ball.with_mass(mass, RigidMotion::default()).unwrap()]);
    let valid = CoupledMotion {
        response: response(1.0, 0.1),
        ..CoupledMotion::prescribed(DVec3::Z, DQuat::IDENTITY)
    };
    let nan = DVec3::NAN;
    for (index, motion) in [
        (1, valid),
        (2, valid),
        (0, CoupledMotion { position_m: nan, ..valid }),
        (0, CoupledMotion { expected_nms: nan, ..valid }),
        (0, CoupledMotion { response: response(-1.0, 0.1), ..valid }),
        (0, CoupledMotion { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), ..valid }),
    ] {
        let error = body.couple_obstacle(index, motion);
        assert!(matches!(error, Err(BodyError::Parameter { .. })), "{error:?}");
    }
    body.couple_obstacle(0, valid).unwrap();
}
