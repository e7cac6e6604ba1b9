//! Moved obstacles: what they drag, push and do work on.

use glam::{DQuat, DVec3};
use palpate_body::*;

const G: f64 = 9.81;

fn body(network: Network) -> Body {
    Body::new(network, Surface::default()).unwrap()
}

fn ground(friction: f64) -> Obstacle {
    Obstacle::plane(DVec3::ZERO, DVec3::Z, friction).unwrap()
}

fn explicit() -> Integrator {
    SemiImplicitEuler::default().into()
}

fn implicit() -> Integrator {
    LinearlyImplicitEuler { solver: LinearSolver::Cholesky, ..LinearlyImplicitEuler::default() }.into()
}

fn point(at: DVec3, m: f64) -> Body {
    let mut builder = NetworkBuilder::new();
    builder.node(at, m);
    body(builder.allow_unconstrained().build().unwrap())
}

fn cube(n: usize, edge: f64) -> Body {
    let block = Block::new([n; 3], DVec3::splat(edge)).unwrap();
    let block = block.centered_at(DVec3::Z * 0.5 * edge).unwrap().allow_unconstrained();
    let tissue = Tissue { youngs_modulus_pa: 20e3, damping: Damping::Ratio(0.5), ..Tissue::default() };
    let made = block.tissue(&tissue).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

#[test]
fn conveyor_accelerates_a_mass_by_mu_g_up_to_its_speed() {
    for integrator in [explicit(), implicit()] {
        let (mu, speed, m) = (0.3, 0.25, 0.2);
        let mut body = point(DVec3::ZERO, m);
        body.set_gravity(DVec3::Z * -G).unwrap();
        body.set_obstacles(vec![ground(mu)]);
        body.start_energy_accounting();
        let mut impulse = DVec3::ZERO;
        for tick in 1..=200 {
            let t = f64::from(tick) * 1e-3;
            body.move_obstacle(0, DVec3::X * (speed * t), DQuat::IDENTITY).unwrap();
            body.advance(None, 1, integrator).unwrap();
            let expected = (mu * G * t).min(speed);
            assert!((body.velocities_m_per_s()[0].x - expected).abs() < 1e-9, "{t} s, {integrator:?}");
            impulse += body.obstacle_reactions()[0].impulse_ns;
        }
        // The belt is slowed by the momentum of the mass and bears its weight.
        assert!((impulse - DVec3::new(-m * speed, 0.0, -m * G * 0.2)).length() < 1e-9, "{impulse}");
        // Half of its work is kinetic energy, the other half is lost in friction.
        let balance = body.energy_balance().unwrap();
        let kinetic = 0.5 * m * speed * speed;
        assert!((balance.work_in_j / (2.0 * kinetic) - 1.0).abs() < 1e-6, "{balance:?}");
        assert!((balance.friction_loss_j / kinetic - 1.0).abs() < 1e-6, "{balance:?}");
        assert!(balance.integrator_j.abs() < 1e-6 * kinetic, "{balance:?}");
    }
}

#[test]
fn turntable_carries_a_mass_round() {
    // The friction needed, ω² r, is below μ g.
    let (mu, omega, r, m) = (0.5, 2.0, 0.1, 0.2);
    let mut body = point(DVec3::X * r, m);
    body.set_gravity(DVec3::Z * -G).unwrap();
    body.set_obstacles(vec![ground(mu)]);
    body.set_state(&[DVec3::X * r], &[DVec3::Y * omega * r]).unwrap();
    let ticks = 500;
    for tick in 1..=ticks {
        let angle = omega * f64::from(tick) * 1e-3;
        body.move_obstacle(0, DVec3::ZERO, DQuat::from_rotation_z(angle)).unwrap();
        body.advance(None, 1, explicit()).unwrap();
    }
    let expected = DQuat::from_rotation_z(omega * 1e-3 * f64::from(ticks)) * (DVec3::X * r);
    // The sticking point is displaced with the table's material.
    assert!(body.positions_m()[0].distance(expected) < 1e-6, "{}", body.positions_m()[0]);
    let reaction = body.obstacle_reactions()[0];
    let (force, torque) = (reaction.force_n(), reaction.torque_nm());
    let outward = expected.normalize();
    assert!(
        (force - (m * omega * omega * r * outward - m * G * DVec3::Z)).length() < 1e-3 * m * G,
        "{force}"
    );
    assert!((torque - expected.cross(-m * G * DVec3::Z)).length() < 1e-3, "{torque}");
}

#[test]
fn lift_raises_a_body_and_does_the_work() {
    for integrator in [explicit(), implicit()] {
        let mut body = cube(3, 0.04);
        body.set_gravity(DVec3::Z * -G).unwrap();
        let table = Obstacle::cuboid(DVec3::new(0.1, 0.1, 0.01), 0.4).unwrap();
        let table = table.with_pose(DVec3::Z * -0.01, DQuat::IDENTITY).unwrap();
        body.set_obstacles(vec![table]);
        body.advance(None, 800, integrator).unwrap();
        let m: f64 = body.network().mass_kg().iter().sum();
        body.start_energy_accounting();
        let before: f64 = body.positions_m().iter().map(|x| x.z).sum();
        for tick in 1..=400 {
            let height = 0.1 * 0.5 * (1.0 - (std::f64::consts::PI * f64::from(tick.min(300)) / 300.0).cos());
            body.move_obstacle(0, DVec3::Z * (height - 0.01), DQuat::IDENTITY).unwrap();
            let report = body.advance(None, 1, integrator).unwrap();
            assert_eq!(report.unconverged, 0);
            let lowest = body.positions_m().iter().map(|x| x.z).fold(1.0, f64::min);
            assert!((lowest - height).abs() < 1e-6, "tick {tick}: {lowest} {height}");
        }
        let raised = body.positions_m().iter().map(|x| x.z).sum::<f64>() - before;
        assert!((raised / body.positions_m().len() as f64 - 0.1).abs() < 1e-4, "{raised}");
        let balance = body.energy_balance().unwrap();
        let work = m * G * 0.1;
        assert!((balance.work_in_j / work - 1.0).abs() < 0.01, "{balance:?}");
        assert!(
            balance.integrator_j.abs() < 0.01 * work && balance.friction_loss_j.abs() < 0.01 * work,
            "{balance:?}"
        );
    }
}

#[test]
fn obstacle_that_jumps_pushes_out_at_a_bounded_speed() {
    for integrator in [explicit(), implicit()] {
        let mut body = cube(3, 0.04);
        let ball = Obstacle::sphere(DVec3::X * 5.0, 0.03, 0.4).unwrap();
        body.set_obstacles(vec![ball]);
        body.move_obstacle(0, DVec3::new(0.02, 0.0, 0.01), DQuat::IDENTITY).unwrap();
        for _ in 0..400 {
            body.advance(None, 1, integrator).unwrap();
            let fastest = body.velocities_m_per_s().iter().map(|v| v.length()).fold(0.0, f64::max);
            assert!(fastest < 2.0, "{fastest}");
        }
        for point in body.obstacle_points() {
            let gap = body.obstacles()[0].gap_m(point.of(body.positions_m())).0;
            assert!(gap > -1e-5, "{gap}");
        }
    }
}

#[test]
fn moved_obstacle_stays_at_its_target() {
    let mut body = cube(2, 0.04);
    body.set_obstacles(vec![ground(0.3)]);
    let (at, turn) = (DVec3::new(0.01, 0.0, -1.0), DQuat::from_rotation_x(0.2));
    body.move_obstacle(0, at, turn).unwrap();
    assert_eq!(body.obstacles()[0].position_m(), DVec3::ZERO);
    body.advance(None, 50, explicit()).unwrap();
    assert_eq!((body.obstacles()[0].position_m(), body.obstacles()[0].rotation()), (at, turn));
    body.advance(None, 50, explicit()).unwrap();
    assert_eq!(body.obstacles()[0].position_m(), at);
    body.place_obstacle(0, DVec3::ZERO, DQuat::IDENTITY).unwrap();
    assert_eq!(body.obstacles()[0].position_m(), DVec3::ZERO);
    assert!(matches!(body.move_obstacle(1, at, turn), Err(BodyError::Parameter { .. })));
    assert!(matches!(body.move_obstacle(0, DVec3::NAN, turn), Err(BodyError::Parameter { .. })));
    assert!(matches!(body.move_obstacle(0, at, turn * 2.0), Err(BodyError::Parameter { .. })));
    assert!(matches!(body.set_rigid_motion(0, RigidMotion::default()), Err(BodyError::Parameter { .. })));
}

#[test]
fn failed_advance_leaves_obstacles_unchanged() {
    let mut body = cube(3, 0.04);
    body.set_gravity(DVec3::Z * -G).unwrap();
    let mass = RigidMass::of_sphere(0.1, 0.02).unwrap();
    let lump = Obstacle::sphere(DVec3::Z * 0.07, 0.02, 0.3).unwrap();
    let motion = RigidMotion { velocity_m_per_s: -DVec3::Z, ..RigidMotion::default() };
    body.set_obstacles(vec![ground(0.3), lump.with_mass(mass, motion).unwrap()]);
    body.advance(None, 5, explicit()).unwrap();
    body.move_obstacle(0, DVec3::X * 1e-3, DQuat::IDENTITY).unwrap();
    let before = body.obstacles().to_vec();
    // The load lets the positions overflow.
    body.set_loads(&vec![DVec3::X * 1e308; body.positions_m().len()]).unwrap();
    assert!(body.advance(None, 50, explicit()).is_err());
    assert_eq!(body.obstacles(), before);
}
