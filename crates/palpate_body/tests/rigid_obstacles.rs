//! Rigid bodies that touch a soft body: momentum, rest, and the reaction on them.

use glam::{DMat3, DQuat, DVec3};
use palpate_body::*;

const G: f64 = 9.81;

fn explicit() -> Integrator {
    SemiImplicitEuler::default().into()
}

/// Implicit steps of `ticks` ms.
fn implicit(ticks: usize) -> Integrator {
    let solver = LinearSolver::Cholesky;
    LinearlyImplicitEuler { solver, ticks_per_step: ticks, ..LinearlyImplicitEuler::default() }.into()
}

/// A block of `n` nodes a side whose bottom is fixed if it is `held`, its top at z = 0.
fn block(n: usize, edge: f64, modulus_pa: f64, held: bool) -> Body {
    let block = Block::new([n; 3], DVec3::splat(edge)).unwrap().centered_at(DVec3::Z * -0.5 * edge).unwrap();
    let block = if held { block.fix(Face::NegZ) } else { block.allow_unconstrained() };
    let tissue = Tissue { youngs_modulus_pa: modulus_pa, damping: Damping::Ratio(0.5), ..Tissue::default() };
    let made = block.tissue(&tissue).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn falling() -> RigidMotion {
    RigidMotion { acceleration_m_per_s2: DVec3::Z * -G, ..RigidMotion::default() }
}

/// A box of half sides `half` with mass `m`, its lower face at z = `height`.
fn lump(m: f64, half: DVec3, height: f64, motion: RigidMotion) -> Obstacle {
    let of = Obstacle::cuboid(half, 0.5).unwrap();
    let of = of.with_pose(DVec3::Z * (half.z + height), DQuat::IDENTITY).unwrap();
    of.with_mass(RigidMass::of_cuboid(m, half).unwrap(), motion).unwrap()
}

/// Momentum and angular momentum about the origin of the body and its rigid obstacles.
fn momentum(body: &Body) -> (DVec3, DVec3) {
    let (mut linear, mut angular) = (DVec3::ZERO, DVec3::ZERO);
    let mass = body.network().mass_kg();
    for ((x, v), m) in body.positions_m().iter().zip(body.velocities_m_per_s()).zip(mass) {
        linear += *m * *v;
        angular += x.cross(*m * *v);
    }
    for of in body.obstacles() {
        let (Some(mass), Some(motion)) = (of.rigid_mass(), of.rigid_motion()) else { continue };
        let turn = DMat3::from_quat(of.rotation());
        let center = of.position_m() + of.rotation() * mass.center_m();
        let p = mass.mass_kg() * motion.velocity_m_per_s;
        let inertia = turn * mass.inertia_kg_m2() * turn.transpose();
        linear += p;
        angular += center.cross(p) + inertia * motion.angular_velocity_rad_per_s;
    }
    (linear, angular)
}

#[test]
fn free_rigid_body_follows_its_closed_form() {
    // In free fall, turning about its axis of symmetry.
    let mut body = block(2, 0.1, 20e3, false);
    let mass =
        RigidMass::new(0.3, DVec3::new(0.01, 0.0, 0.0), DMat3::from_diagonal(DVec3::new(2e-4, 3e-4, 3e-4)))
            .unwrap();
    let motion = RigidMotion {
        velocity_m_per_s: DVec3::new(0.3, 0.1, 0.5),
        angular_velocity_rad_per_s: DVec3::X * 7.0,
        ..falling()
    };
    let of = Obstacle::sphere(DVec3::Z * 5.0, 0.02, 0.3).unwrap().with_mass(mass, motion).unwrap();
    body.set_obstacles(vec![of]);
    body.advance(None, 400, explicit()).unwrap();
    let (of, t, h) = (&body.obstacles()[0], 0.4, 0.25e-3);
    assert!(of.rotation().angle_between(DQuat::from_rotation_x(7.0 * t)) < 1e-9);
    // Semi-implicit Euler falls by g t (t + h)/2.
    let fall = DVec3::Z * (-0.5 * G * t * (t + h));
    let center = of.position_m() + of.rotation() * mass.center_m();
    let expected = DVec3::new(0.01, 0.0, 5.0) + motion.velocity_m_per_s * t + fall;
    assert!(center.distance(expected) < 1e-9, "{center} {expected}");
    assert_eq!(body.obstacle_reactions()[0].impulse_ns, DVec3::ZERO);
    // Turning about the middle axis is unstable: the body tumbles and keeps its angular momentum; its energy stays.
    let inertia = DVec3::new(1e-4, 2e-4, 3e-4);
    let mass = RigidMass::new(0.3, DVec3::ZERO, DMat3::from_diagonal(inertia)).unwrap();
    let motion =
        RigidMotion { angular_velocity_rad_per_s: DVec3::new(0.01, 10.0, 0.01), ..RigidMotion::default() };
    for (integrator, tolerance) in [(explicit(), 1e-4), (implicit(10), 0.05)] {
        let of = Obstacle::sphere(DVec3::Z * 5.0, 0.02, 0.3).unwrap().with_mass(mass, motion).unwrap();
        body.set_obstacles(vec![of]);
        let energy = |body: &Body| {
            let of = &body.obstacles()[0];
            let local = of.rotation().inverse() * of.rigid_motion().unwrap().angular_velocity_rad_per_s;
            0.5 * local.dot(inertia * local)
        };
        let ((_, before), e, mut least) = (momentum(&body), energy(&body), 10.0_f64);
        for _ in 0..40 {
            body.advance(None, 50, integrator).unwrap();
            let local = body.obstacles()[0].rotation() * DVec3::Y;
            least = least.min(local.y);
        }
        let (_, after) = momentum(&body);
        assert!((after - before).length() < 1e-9 * before.length(), "{after} {before}");
        assert!((energy(&body) / e - 1.0).abs() < tolerance, "{}", energy(&body) / e);
        assert!(least < -0.9, "it tumbles: {least}");
    }
}

#[test]
fn impact_conserves_momentum_and_angular_momentum() {
    // A linearised step preserves angular momentum to first order.
    let fine = LinearlyImplicitEuler { substeps: 10, ..LinearlyImplicitEuler::default() };
    for (integrator, angular) in [(explicit(), 1e-9), (implicit(1), 5e-3), (fine.into(), 5e-4)] {
        let mut body = block(4, 0.1, 20e3, false);
        let motion = RigidMotion {
            velocity_m_per_s: DVec3::new(0.1, 0.0, -1.0),
            angular_velocity_rad_per_s: DVec3::new(1.0, 2.0, -1.0),
            ..RigidMotion::default()
        };
        let of = lump(0.2, DVec3::new(0.03, 0.02, 0.01), 0.01, motion);
        let place = of.position_m() + DVec3::X * 0.02;
        body.set_obstacles(vec![of.with_pose(place, DQuat::from_rotation_x(0.3)).unwrap()]);
        let (p, l) = momentum(&body);
        let (mut contacts, mut v) = (0, body.obstacles()[0].rigid_motion().unwrap().velocity_m_per_s);
        for _ in 0..150 {
            contacts += body.advance(None, 1, integrator).unwrap().contacts;
            let reaction = body.obstacle_reactions()[0];
            // Without an acceleration, only the contacts change the velocity.
            let now = body.obstacles()[0].rigid_motion().unwrap().velocity_m_per_s;
            assert!((now - v - reaction.velocity_change_m_per_s).length() < 1e-12);
            assert!((reaction.impulse_ns - 0.2 * (now - v)).length() < 1e-12);
            v = now;
        }
        let (p1, l1) = momentum(&body);
        assert!(contacts > 20 && v.z > -0.8, "{contacts} {v}");
        assert!((p1 - p).length() < 1e-9 * p.length(), "{integrator:?} {p} {p1}");
        assert!((l1 - l).length() < angular * l.length(), "{integrator:?} {l} {l1}");
    }
}

#[test]
fn lumps_rest_on_a_soft_block() {
    // Stiff and soft tissue, light and heavy lumps, and steps of 0.25 and 50 ms.
    for (modulus, m) in [(20e3, 0.01), (20e3, 1.0), (500e3, 0.01), (500e3, 1.0)] {
        for integrator in [explicit(), implicit(10), implicit(50)] {
            let mut body = block(5, 0.1, modulus, true);
            let half = DVec3::new(0.03, 0.03, 0.03);
            body.set_obstacles(vec![lump(m, half, 1e-3, falling())]);
            let (mut iterations, mut unconverged) = (0, 0);
            for _ in 0..50 {
                let report = body.advance(None, 50, integrator).unwrap();
                (iterations, unconverged) =
                    (iterations.max(report.iterations), unconverged + report.unconverged);
            }
            let of = &body.obstacles()[0];
            let v = *of.rigid_motion().unwrap();
            let reaction = body.obstacle_reactions()[0];
            let name = format!(
                "{modulus} Pa, {m} kg, {integrator:?}: {iterations} iterations, {unconverged} unconverged"
            );
            let speed = v.velocity_m_per_s.length() + 0.05 * v.angular_velocity_rad_per_s.length();
            assert!(speed < 1e-3, "{name}: {speed} m/s");
            assert!(
                (reaction.force_n() - DVec3::Z * m * G).length() < 0.02 * m * G,
                "{name}: {}",
                reaction.force_n()
            );
            assert!(reaction.torque_nm().length() < 0.002 * m * G, "{name}: {}", reaction.torque_nm());
            assert!(unconverged == 0, "{name}");
        }
    }
}

#[test]
fn friction_carries_a_lump_on_a_tilted_block() {
    // Tilting gravity instead of the block. At μ = 0.5 it holds up to 26.6°.
    for (angle, slides) in [(20.0_f64, false), (33.0, true)] {
        let mut body = block(5, 0.1, 50e3, true);
        let of = lump(0.02, DVec3::new(0.03, 0.03, 0.01), 0.0, falling());
        let place = of.position_m() - DVec3::X * 0.02;
        body.set_obstacles(vec![of.with_pose(place, DQuat::IDENTITY).unwrap()]);
        body.advance(None, 200, explicit()).unwrap();
        let angle = angle.to_radians();
        let tilted = G * DVec3::new(angle.sin(), 0.0, -angle.cos());
        let motion = *body.obstacles()[0].rigid_motion().unwrap();
        body.set_rigid_motion(0, RigidMotion { acceleration_m_per_s2: tilted, ..motion }).unwrap();
        body.advance(None, if slides { 40 } else { 500 }, explicit()).unwrap();
        let before = body.obstacles()[0].rigid_motion().unwrap().velocity_m_per_s;
        let at = body.obstacles()[0].position_m();
        body.advance(None, 100, explicit()).unwrap();
        let after = body.obstacles()[0].rigid_motion().unwrap().velocity_m_per_s;
        let moved = body.obstacles()[0].position_m() - at;
        if slides {
            let expected = G * (angle.sin() - 0.5 * angle.cos());
            let found = (after - before).x / 0.1;
            assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
        } else {
            assert!(moved.length() < 2e-5, "{moved}");
        }
    }
}

#[test]
fn energy_balance_closes_with_a_rigid_body() {
    let mut body = block(4, 0.1, 20e3, true);
    body.set_obstacles(vec![lump(0.1, DVec3::new(0.03, 0.03, 0.01), 0.01, falling())]);
    let energy = |body: &Body| {
        let of = &body.obstacles()[0];
        let v = of.rigid_motion().unwrap().velocity_m_per_s;
        0.05 * v.length_squared() + 0.1 * G * of.position_m().z
    };
    let before = energy(&body);
    body.start_energy_accounting();
    body.advance(None, 1000, explicit()).unwrap();
    let lost = before - energy(&body);
    let balance = body.energy_balance().unwrap();
    // What the lump has lost is work on the body and loss in the contact.
    assert!((balance.work_in_j / lost - 1.0).abs() < 0.01, "{balance:?} {lost}");
    assert!(
        balance.integrator_j.abs() < 0.02 * lost && balance.friction_loss_j > -1e-3 * lost,
        "{balance:?} {lost}"
    );
}
