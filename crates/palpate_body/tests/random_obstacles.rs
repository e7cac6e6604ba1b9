//! Obstacles of random shapes, poses and motions, and odd input: contacts satisfy their laws, and nothing panics.

use glam::{DQuat, DVec3};
use palpate_body::*;
use proptest::prelude::*;

const G: f64 = 9.81;

fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
}

fn rotation() -> impl Strategy<Value = DQuat> {
    vector(3.0).prop_map(DQuat::from_scaled_axis)
}

fn box_mesh(half: DVec3) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let sign = |i: usize, bit: usize| if i & bit > 0 { 1.0 } else { -1.0 };
    let corners = (0..8).map(|i| half * DVec3::new(sign(i, 1), sign(i, 2), sign(i, 4))).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (corners, quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// A shape of about 2 cm, by its number.
fn shape(kind: usize, friction: f64) -> Obstacle {
    let half = DVec3::new(0.02, 0.015, 0.01);
    let (corners, triangles) = box_mesh(half);
    match kind {
        0 => Obstacle::sphere(DVec3::ZERO, 0.015, friction),
        1 => Obstacle::cuboid(half, friction),
        2 => Obstacle::capsule(0.01, 0.01, friction),
        3 => Obstacle::convex_hull(&corners[..7], friction),
        4 => Obstacle::triangle_mesh(&corners, &triangles, friction),
        5 => Obstacle::triangle_mesh(&corners, &triangles[2..4], friction),
        _ => Obstacle::plane(DVec3::ZERO, DVec3::Z, friction),
    }
    .unwrap()
}

/// A soft cube of 3 cm from z = 0, unconstrained or on its bottom.
fn cube(held: bool) -> Body {
    let block = Block::new([4; 3], DVec3::splat(0.03)).unwrap().centered_at(DVec3::Z * 0.015).unwrap();
    let block = if held { block.fix(Face::NegZ) } else { block.allow_unconstrained() };
    let tissue = Tissue { youngs_modulus_pa: 20e3, damping: Damping::Ratio(0.5), ..Tissue::default() };
    let made = block.tissue(&tissue).unwrap();
    let mut body = Body::new(made.network, made.surface).unwrap();
    body.set_gravity(DVec3::Z * -G).unwrap();
    body
}

/// Checks Signorini's and Coulomb's laws in the last step.
fn check_contacts(body: &Body) -> Result<(), TestCaseError> {
    let largest = body.contacts().iter().map(|c| c.impulse_ns.length()).fold(0.0, f64::max);
    for c in body.contacts() {
        let normal = c.impulse_ns.dot(c.normal);
        let across = c.impulse_ns - normal * c.normal;
        let mu = body.obstacles()[c.obstacle].friction();
        prop_assert!((c.normal.length() - 1.0).abs() < 1e-9, "{c:?}");
        prop_assert!(normal >= -1e-9 * largest && across.length() <= mu * normal + 1e-6 * largest, "{c:?}");
        let slip = c.slip_m_per_s - c.slip_m_per_s.dot(c.normal) * c.normal;
        // A slip opposes the friction, except for the solver's 1 nm in a step.
        if slip.length() > 2e-5 {
            prop_assert!(across.dot(slip) <= 1e-9 * largest, "{c:?}");
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn contacts_satisfy_their_laws_with_moved_and_rigid_obstacles(
        kinds in prop::array::uniform2(0..6_usize),
        places in prop::array::uniform2(vector(0.03)),
        turns in prop::array::uniform3(rotation()),
        motion in (vector(0.01), vector(0.5), vector(5.0)),
        mu in 0.0..0.9f64,
        held in any::<bool>(),
        stiff in any::<bool>(),
    ) {
        let mut body = cube(held);
        let onto = DVec3::new(places[1].x, places[1].y, 0.055 + places[1].z.abs());
        // Above the ground: what presses a point into the ground from the side has no solution.
        let above = DVec3::new(places[0].x, places[0].y, 0.05 + places[0].z.abs());
        let mass = RigidMass::of_cuboid(0.02, DVec3::splat(0.015)).unwrap();
        let thrown = RigidMotion { velocity_m_per_s: motion.1, angular_velocity_rad_per_s: motion.2, acceleration_m_per_s2: DVec3::Z * -G };
        let obstacles = vec![
            shape(6, mu).with_pose(DVec3::Z * -1e-3, DQuat::IDENTITY).unwrap(),
            shape(kinds[0], mu).with_pose(above - DVec3::X * 0.04, turns[0]).unwrap(),
            shape(kinds[1], mu).with_pose(onto, turns[1]).unwrap().with_mass(mass, thrown).unwrap(),
        ];
        body.set_obstacles(obstacles);
        let integrator: Integrator = if stiff {
            LinearlyImplicitEuler { ticks_per_step: 10, ..LinearlyImplicitEuler::default() }.into()
        } else {
            SemiImplicitEuler::default().into()
        };
        body.start_energy_accounting();
        let (mut unconverged, mut apart) = (0, true);
        for step in 1..=8 {
            let share = f64::from(step) / 8.0;
            let target = above + (motion.0 - DVec3::Z * 0.01) * share - DVec3::X * (0.04 * (1.0 - share));
            body.move_obstacle(1, target, turns[0].slerp(turns[2], share)).unwrap();
            let report = body.advance(None, 20, integrator).unwrap();
            unconverged += report.unconverged;
            // Obstacles do not collide; points between two that overlap are wedged.
            apart &= body.obstacles()[1].gap_m(body.obstacles()[2].position_m()).0 > 0.03;
            // Gauss-Seidel has no solution, or does not find it, where points are wedged at high friction.
            if report.unconverged == 0 {
                check_contacts(&body)?;
            }
            let fastest = body.velocities_m_per_s().iter().map(|v| v.length()).fold(0.0, f64::max);
            prop_assert!(fastest < 50.0, "{fastest}");
        }
        let steps = if stiff { 16 } else { 640 };
        prop_assert!(!apart || unconverged * 4 <= steps, "{unconverged} of {steps}");
        let balance = body.energy_balance().unwrap();
        prop_assert!(balance.work_in_j.is_finite() && balance.friction_loss_j.is_finite());
        for reaction in body.obstacle_reactions() {
            prop_assert!(reaction.force_n().is_finite() && reaction.torque_nm().is_finite());
        }
    }

    #[test]
    fn odd_obstacles_neither_panic_nor_explode(
        kind in 0..7_usize, scale in -9..9_i32, place in vector(0.05), far in -3..12_i32, turn in rotation(), jump in vector(1.0), stiff in any::<bool>(),
    ) {
        let scale = 10.0_f64.powi(scale);
        let half = scale * DVec3::new(1.0, 0.7, 0.4);
        let (corners, triangles) = box_mesh(half);
        let twice: Vec<DVec3> = corners.iter().chain(&corners).copied().collect();
        let obstacle = match kind {
            0 => Obstacle::sphere(DVec3::ZERO, scale, 0.3),
            1 => Obstacle::cuboid(half, 0.3),
            2 => Obstacle::capsule(0.0, scale, 0.3),
            3 => Obstacle::convex_hull(&twice, 0.3),
            4 => Obstacle::triangle_mesh(&corners, &triangles, 0.3),
            5 => Obstacle::triangle_mesh(&corners, &[triangles[2], [0, 0, 1], [3, 2, 2]], 0.3),
            _ => Obstacle::plane(DVec3::ZERO, DVec3::Z, 0.3),
        };
        // Entirely inside, around, or far away.
        let mut body = cube(false);
        body.set_obstacles(vec![obstacle.unwrap().with_pose(place, turn).unwrap()]);
        let integrator: Integrator = if stiff { LinearlyImplicitEuler::default().into() } else { SemiImplicitEuler::default().into() };
        let jump = jump * 10.0_f64.powi(far);
        for to in [place, jump, place, DVec3::Z * -0.01] {
            body.move_obstacle(0, to, turn).unwrap();
            body.advance(None, 4, integrator).unwrap();
            let fastest = body.velocities_m_per_s().iter().map(|v| v.length()).fold(0.0, f64::max);
            // As fast as an obstacle may move, and what a pushed node rebounds with.
            prop_assert!(fastest < 60.0, "{fastest}");
        }
    }
}

#[test]
fn body_inside_an_obstacle_is_pushed_out_slowly() {
    for (kind, obstacle) in [
        Obstacle::cuboid(DVec3::splat(0.1), 0.3),
        Obstacle::sphere(DVec3::ZERO, 0.1, 0.3),
        Obstacle::convex_hull(&box_mesh(DVec3::splat(0.1)).0, 0.3),
    ]
    .into_iter()
    .enumerate()
    {
        let mut body = cube(false);
        body.set_gravity(DVec3::ZERO).unwrap();
        body.set_obstacles(vec![
            obstacle.unwrap().with_pose(DVec3::new(0.06, 0.0, 0.0), DQuat::IDENTITY).unwrap(),
        ]);
        for _ in 0..100 {
            body.advance(None, 10, SemiImplicitEuler::default()).unwrap();
            let fastest = body.velocities_m_per_s().iter().map(|v| v.length()).fold(0.0, f64::max);
            assert!(fastest < 3.0, "{kind}: {fastest}");
        }
        for point in body.obstacle_points() {
            let gap = body.obstacles()[0].gap_m(point.of(body.positions_m())).0;
            assert!(gap > -1e-5, "{kind}: {gap}");
        }
    }
}

#[test]
fn distant_obstacles_change_no_bits() {
    let settle = |far: Vec<Obstacle>| {
        let mut body = cube(false);
        let mut all = vec![shape(6, 0.4)];
        all.extend(far);
        body.set_obstacles(all);
        for _ in 0..10 {
            body.advance(None, 20, SemiImplicitEuler::default()).unwrap();
        }
        body.state()
    };
    let far =
        (0..6).map(|kind| shape(kind, 0.3).with_pose(DVec3::new(0.5, 0.1, 0.2), DQuat::IDENTITY).unwrap());
    assert_eq!(settle(vec![]), settle(far.collect()));
}

#[test]
fn equal_runs_give_equal_bits() {
    let run = || {
        let mut body = cube(false);
        let mass = RigidMass::of_cuboid(0.02, DVec3::splat(0.01)).unwrap();
        let lump = shape(1, 0.4).with_pose(DVec3::Z * 0.05, DQuat::IDENTITY).unwrap();
        let falling = RigidMotion { acceleration_m_per_s2: DVec3::Z * -G, ..RigidMotion::default() };
        body.set_obstacles(vec![shape(4, 0.4), shape(6, 0.4), lump.with_mass(mass, falling).unwrap()]);
        for step in 1..=20 {
            body.move_obstacle(0, DVec3::X * (1e-3 * f64::from(step)), DQuat::IDENTITY).unwrap();
            body.advance(None, 20, SemiImplicitEuler::default()).unwrap();
        }
        (body.state(), body.obstacles().to_vec(), body.obstacle_reactions().to_vec())
    };
    assert_eq!(run(), run());
}
