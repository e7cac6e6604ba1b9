//! Bodies on a moving mount: fixed nodes that are moved.

use glam::{DQuat, DVec3};
use palpate_body::*;

const G: f64 = 9.81;

fn explicit() -> Integrator {
    SemiImplicitEuler::default().into()
}

fn implicit() -> Integrator {
    LinearlyImplicitEuler { solver: LinearSolver::Cholesky, ..LinearlyImplicitEuler::default() }.into()
}

/// A block on its fixed bottom, which is in z = 0.
fn block() -> Body {
    let block = Block::new([4; 3], DVec3::splat(0.06)).unwrap().centered_at(DVec3::Z * 0.03).unwrap();
    let tissue = Tissue { youngs_modulus_pa: 20e3, damping: Damping::Ratio(0.7), ..Tissue::default() };
    let made = block.fix(Face::NegZ).tissue(&tissue).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn mean(values: &[DVec3]) -> DVec3 {
    values.iter().sum::<DVec3>() / values.len() as f64
}

#[test]
fn body_follows_a_mount_at_constant_velocity_without_strain() {
    for integrator in [explicit(), implicit()] {
        let mut body = block();
        let rest = body.positions_m().to_vec();
        body.start_energy_accounting();
        let speed = DVec3::new(0.3, -0.1, 0.2);
        for tick in 1..=2000 {
            body.move_fixed(speed * (f64::from(tick) * 1e-3), DQuat::IDENTITY).unwrap();
            body.advance(None, 1, integrator).unwrap();
        }
        for (x, rest) in body.positions_m().iter().zip(&rest) {
            assert!((*x - *rest - 2.0 * speed).length() < 1e-6, "{x} {rest}");
        }
        for v in body.velocities_m_per_s() {
            assert!((*v - speed).length() < 2e-4, "{v}");
        }
        // The work of the mount is kinetic energy and what the dampers took at the start.
        let balance = body.energy_balance().unwrap();
        let moving: f64 = body.network().free().iter().map(|&node| body.network().mass_kg()[node]).sum();
        let kinetic = 0.5 * moving * speed.length_squared();
        assert!((balance.stored_j / kinetic - 1.0).abs() < 1e-4, "{balance:?} {kinetic}");
        assert!(balance.integrator_j.abs() < 0.25 * kinetic, "{balance:?} {kinetic}");
        assert!((balance.work_in_j / (2.0 * kinetic) - 1.0).abs() < 1e-2, "{balance:?} {kinetic}");
        // Without a motion the mount stands still.
        body.advance(None, 2000, integrator).unwrap();
        assert!(body.is_settled());
        assert!((mean(body.positions_m()) - mean(&rest) - 2.0 * speed).length() < 1e-5);
    }
}

#[test]
fn turned_mount_turns_the_body() {
    let mut body = block();
    let rest = body.positions_m().to_vec();
    let (at, turn) = (DVec3::new(0.1, 0.0, 0.05), DQuat::from_rotation_x(1.2));
    let start = DQuat::IDENTITY;
    for step in 1..=40 {
        let share = f64::from(step) / 40.0;
        body.move_fixed(at * share, start.slerp(turn, share)).unwrap();
        body.advance(None, 50, explicit()).unwrap();
    }
    assert_eq!(body.fixed_pose(), (at, turn));
    for _ in 0..40 {
        body.advance(None, 50, explicit()).unwrap();
    }
    assert!(body.advance(None, 50, explicit()).unwrap().is_asleep);
    for (x, rest) in body.positions_m().iter().zip(&rest) {
        assert!(x.distance(turn * *rest + at) < 1e-5, "{x}");
    }
    // The pose is part of the state.
    let mut other = block();
    other.restore(&body.state()).unwrap();
    for body in [&mut body, &mut other] {
        body.move_fixed(at + DVec3::X * 0.01, turn).unwrap();
        body.advance(None, 50, explicit()).unwrap();
    }
    assert_eq!(body.state(), other.state());
    assert!(matches!(body.move_fixed(DVec3::NAN, turn), Err(BodyError::Parameter { .. })));
    assert!(matches!(body.move_fixed(at, turn * 2.0), Err(BodyError::Parameter { .. })));
}

#[test]
fn moving_mount_pushes_a_rigid_body() {
    for integrator in [explicit(), implicit()] {
        // The fixed bottom runs into a ball.
        let mut body = block();
        let mass = RigidMass::of_sphere(0.05, 0.02).unwrap();
        let ball = Obstacle::sphere(DVec3::new(0.01, 0.01, -0.03), 0.02, 0.0).unwrap();
        body.set_obstacles(vec![ball.with_mass(mass, RigidMotion::default()).unwrap()]);
        for tick in 1..=100 {
            body.move_fixed(DVec3::Z * (-0.2e-3 * f64::from(tick)), DQuat::IDENTITY).unwrap();
            body.advance(None, 1, integrator).unwrap();
        }
        let v = body.obstacles()[0].rigid_motion().unwrap().velocity_m_per_s;
        assert!((v + DVec3::Z * 0.2).length() < 1e-3, "{v}");
    }
}

#[test]
fn mounted_body_carries_a_lump() {
    let mut body = block();
    body.set_gravity(DVec3::Z * -G).unwrap();
    let half = DVec3::new(0.015, 0.015, 0.01);
    let motion = RigidMotion { acceleration_m_per_s2: DVec3::Z * -G, ..RigidMotion::default() };
    let lump = Obstacle::cuboid(half, 0.6).unwrap().with_pose(DVec3::Z * 0.07, DQuat::IDENTITY).unwrap();
    body.set_obstacles(vec![lump.with_mass(RigidMass::of_cuboid(0.02, half).unwrap(), motion).unwrap()]);
    body.advance(None, 1000, explicit()).unwrap();
    let before = body.obstacles()[0].position_m();
    // Accelerated by 1 m/s² and stopped again.
    let mut at = 0.0;
    for tick in 1..=1000 {
        let t = f64::from(tick) * 1e-3;
        at = if t < 0.2 {
            0.5 * t * t
        } else if t < 0.4 {
            0.2 * t - 0.02 - 0.5 * (t - 0.2) * (t - 0.2)
        } else {
            0.04
        };
        body.move_fixed(DVec3::X * at, DQuat::IDENTITY).unwrap();
        body.advance(None, 1, explicit()).unwrap();
    }
    let moved = body.obstacles()[0].position_m() - before;
    assert!((moved - DVec3::X * at).length() < 1e-3, "{moved}");
}
