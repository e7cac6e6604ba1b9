//! Bodies at rest on obstacles: the place where they come to rest, friction angles, and sleep.

use glam::{DQuat, DVec3};
use palpate_body::*;

const G: f64 = 9.81;

fn explicit() -> Integrator {
    SemiImplicitEuler::default().into()
}

/// A cube of `n` nodes a side on z = 0, unconstrained.
fn cube(n: usize, edge: f64, modulus_pa: f64) -> Body {
    let block = Block::new([n; 3], DVec3::splat(edge)).unwrap();
    let block = block.centered_at(DVec3::Z * 0.5 * edge).unwrap().allow_unconstrained();
    let tissue = Tissue { youngs_modulus_pa: modulus_pa, damping: Damping::Ratio(0.8), ..Tissue::default() };
    let made = block.tissue(&tissue).unwrap();
    let mut body = Body::new(made.network, made.surface).unwrap();
    body.set_gravity(DVec3::Z * -G).unwrap();
    body
}

fn ground(friction: f64) -> Obstacle {
    Obstacle::plane(DVec3::ZERO, DVec3::Z, friction).unwrap()
}

fn fastest(body: &Body) -> f64 {
    body.velocities_m_per_s().iter().map(|v| v.length()).fold(0.0, f64::max)
}

/// Corners and triangles of a box around the origin, counter-clockwise as seen from outside.
fn box_mesh(half: DVec3) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let sign = |i: usize, bit: usize| if i & bit > 0 { 1.0 } else { -1.0 };
    let corners = (0..8).map(|i| half * DVec3::new(sign(i, 1), sign(i, 2), sign(i, 4))).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (corners, quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// Obstacles with their top face in z = 0: box, hull, closed mesh, and an open mesh of several triangles.
fn tables(friction: f64) -> Vec<Obstacle> {
    let half = DVec3::new(0.3, 0.2, 0.05);
    let (corners, triangles) = box_mesh(half);
    let grid: Vec<DVec3> = (0..25)
        .map(|i| DVec3::new(f64::from(i % 5) * 0.13 - 0.26, f64::from(i / 5) * 0.13 - 0.26, 0.05))
        .collect();
    let sheet: Vec<[usize; 3]> = (0..16)
        .flat_map(|i| {
            let at = i % 4 + 5 * (i / 4);
            [[at, at + 1, at + 6], [at, at + 6, at + 5]]
        })
        .collect();
    let all = [
        Obstacle::cuboid(half, friction),
        Obstacle::convex_hull(&corners, friction),
        Obstacle::triangle_mesh(&corners, &triangles, friction),
        Obstacle::triangle_mesh(&grid, &sheet, friction),
    ];
    all.into_iter().map(|of| of.unwrap().with_pose(DVec3::Z * -0.05, DQuat::IDENTITY).unwrap()).collect()
}

#[test]
fn soft_block_settles_to_the_compression_of_an_elastic_column() {
    let (edge, modulus) = (0.1, 20e3);
    let mut compression = Vec::new();
    for n in [6, 11] {
        let mut body = cube(n, edge, modulus);
        // Without friction the column may widen freely.
        body.set_obstacles(vec![ground(0.0)]);
        body.advance(None, 2000, explicit()).unwrap();
        assert!(fastest(&body) < 1e-4 && body.is_settled(), "{} m/s", fastest(&body));
        // Once more, to the end of the motion.
        body.advance(None, 2000, explicit()).unwrap();
        let top: Vec<f64> = body
            .positions_m()
            .iter()
            .zip(body.network().rest_m())
            .filter(|(_, rest)| rest.z > edge - 1e-9)
            .map(|(x, _)| x.z)
            .collect();
        compression.push(edge - top.iter().sum::<f64>() / top.len() as f64);
        assert!(body.positions_m().iter().all(|x| x.z > -1e-12));
    }
    // ρ g H²/(2 E), with Hencky's strain for the compression by 2.5 %.
    let linear = 1000.0 * G * edge * edge / (2.0 * modulus);
    for found in &compression {
        assert!((found / linear - 1.0).abs() < 0.05, "{found} m, not {linear} m");
    }
    assert!((compression[0] / compression[1] - 1.0).abs() < 0.02, "{compression:?}");
}

#[test]
fn settled_body_sleeps_without_drift_and_wakes() {
    let mut body = cube(6, 0.1, 20e3);
    body.set_obstacles(vec![ground(0.4)]);
    for _ in 0..40 {
        body.advance(None, 50, explicit()).unwrap();
    }
    assert!(body.is_settled() && fastest(&body) < 1e-4);
    let report = body.advance(None, 50, explicit()).unwrap();
    assert!(report.is_asleep && report.substeps == 0 && report.ticks == 50, "{report:?}");
    let (state, contacts) = (body.state(), body.contacts().to_vec());
    assert_eq!(fastest(&body), 0.0);
    let weight = body.network().mass_kg().iter().sum::<f64>() * G;
    for _ in 0..200 {
        assert!(body.advance(None, 50, explicit()).unwrap().is_asleep);
        // The ground still bears the weight.
        let force = body.obstacle_reactions()[0].force_n();
        assert!((force + DVec3::Z * weight).length() < 0.01 * weight, "{force} N");
    }
    assert_eq!(body.state(), state);
    assert_eq!(body.contacts(), contacts);
    // The same again changes nothing.
    body.set_obstacles(vec![ground(0.4)]);
    body.set_gravity(DVec3::Z * -G).unwrap();
    body.move_obstacle(0, DVec3::ZERO, DQuat::IDENTITY).unwrap();
    assert!(body.advance(None, 50, explicit()).unwrap().is_asleep);
    // Each change wakes it.
    type Change = fn(&mut Body);
    let changes: [(&str, Change); 7] = [
        ("gravity", |body| body.set_gravity(DVec3::Z * -9.8).unwrap()),
        ("loads", |body| body.set_loads(&vec![DVec3::X * 1e-6; body.positions_m().len()]).unwrap()),
        ("obstacles", |body| body.set_obstacles(vec![])),
        ("moved", |body| body.move_obstacle(0, DVec3::X * 1e-3, DQuat::IDENTITY).unwrap()),
        ("placed", |body| body.place_obstacle(0, DVec3::Z * -1e-3, DQuat::IDENTITY).unwrap()),
        ("tie", |body| {
            let tie = Tie::grasp(BodyPoint::node(0), body.positions_m()[0]).unwrap();
            body.set_ties(vec![tie]).unwrap();
        }),
        ("state", |body| {
            let (x, v) = (body.positions_m().to_vec(), body.velocities_m_per_s().to_vec());
            body.set_state(&x, &v).unwrap();
        }),
    ];
    for (what, change) in changes {
        let mut woken = body.clone();
        change(&mut woken);
        assert!(!woken.advance(None, 1, explicit()).unwrap().is_asleep, "{what}");
        let moved = woken
            .positions_m()
            .iter()
            .zip(body.positions_m())
            .map(|(a, b)| a.distance(*b))
            .fold(0.0, f64::max);
        assert!(moved < 1e-4, "{what}: {moved} m");
    }
    // A tool that leaves wakes it.
    let mut held = body.clone();
    let node = held.positions_m().len() - 1;
    let grip = held.positions_m()[node] + DVec3::Z * 2e-3;
    let mut tool = ToolContact::hold(&held, node, held.positions_m()[node]).unwrap();
    let path: Vec<ToolPoint> = (0..=1000).map(|_| ToolPoint::at_rest(grip)).collect();
    held.advance(Some((&mut tool, &path)), 1000, explicit()).unwrap();
    assert!(held.is_settled());
    let mut restored = body.clone();
    restored.restore(&held.state()).unwrap();
    for body in [&mut held, &mut restored] {
        assert!(!body.advance(None, 50, explicit()).unwrap().is_asleep);
        assert!(body.positions_m()[node].distance(grip) > 1e-3);
    }
    assert_eq!(held.state(), restored.state());
    // A tool within reach wakes it, too; one that is far away does not.
    let top = body.positions_m().iter().map(|x| x.z).fold(f64::MIN, f64::max);
    let shape = ToolShape::Sphere { radius_m: 0.005 };
    for (z, is_asleep) in [(1.0, true), (top + 0.008, false)] {
        let mut tool = ToolContact::touch(shape, 0.3).unwrap();
        let path = vec![ToolPoint::at_rest(DVec3::Z * z); 2];
        let report = body.clone().advance(Some((&mut tool, &path)), 1, explicit()).unwrap();
        assert_eq!(report.is_asleep, is_asleep, "{z}");
        assert!(tool.is_clear());
    }
}

#[test]
fn body_settled_under_a_tool_returns_when_the_tool_is_gone() {
    let mut body = cube(4, 0.05, 20e3);
    body.set_obstacles(vec![ground(0.4)]);
    let top = |body: &Body| body.positions_m().iter().map(|x| x.z).fold(f64::MIN, f64::max);
    body.advance(None, 3000, explicit()).unwrap();
    let rest = top(&body);
    let mut tool = ToolContact::touch(ToolShape::Sphere { radius_m: 0.01 }, 0.0).unwrap();
    let place = |depth: f64| ToolPoint::at_rest(DVec3::new(0.003, 0.002, rest + 0.01 - depth));
    let down: Vec<ToolPoint> = (0..=500).map(|i| place(0.004 * f64::from(i) / 500.0 - 0.001)).collect();
    body.advance(Some((&mut tool, &down)), 500, explicit()).unwrap();
    body.advance(Some((&mut tool, &vec![place(0.003); 3001])), 3000, explicit()).unwrap();
    let pressed = body.positions_m().to_vec();
    assert!(body.is_settled());
    // Without the tool the dent closes; a body that kept sleeping would keep it.
    let report = body.advance(None, 50, explicit()).unwrap();
    assert!(!report.is_asleep);
    body.advance(None, 3000, explicit()).unwrap();
    let moved = body.positions_m().iter().zip(&pressed).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(moved > 5e-4 && (top(&body) - rest).abs() < 2e-6, "{moved} m, {} m", top(&body) - rest);
}

#[test]
fn energy_of_falling_asleep_is_removed_by_the_integrator() {
    let mut body = cube(4, 0.05, 20e3);
    body.set_obstacles(vec![ground(0.4)]);
    body.start_energy_accounting();
    while !body.is_settled() {
        body.advance(None, 10, explicit()).unwrap();
    }
    let (before, kinetic) = (body.energy_balance().unwrap(), body.energy().kinetic_j);
    assert!(body.advance(None, 10, explicit()).unwrap().is_asleep);
    let after = body.energy_balance().unwrap();
    assert!((after.integrator_j - before.integrator_j - kinetic).abs() < 1e-15, "{before:?} {after:?}");
}

#[test]
fn body_rests_on_every_table_as_on_a_plane() {
    let settle = |obstacle: Obstacle| {
        let mut body = cube(4, 0.06, 20e3);
        body.set_obstacles(vec![obstacle]);
        for _ in 0..20 {
            let report = body.advance(None, 50, explicit()).unwrap();
            assert_eq!(report.unconverged, 0);
        }
        body.positions_m().to_vec()
    };
    let on_plane = settle(ground(0.4));
    for table in tables(0.4) {
        let name = format!("{table:?}");
        let found = settle(table);
        let most = found.iter().zip(&on_plane).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(most < 1e-9, "{name}: {most} m");
    }
    // One node of a light body on the highest line of a capsule, along which it is as high as the plane.
    let mut builder = NetworkBuilder::new();
    builder.node(DVec3::Z * 0.001, 0.1);
    let mut body = Body::new(builder.allow_unconstrained().build().unwrap(), Surface::default()).unwrap();
    body.set_gravity(DVec3::Z * -G).unwrap();
    let capsule = Obstacle::capsule(0.2, 0.05, 0.4).unwrap();
    body.set_obstacles(vec![capsule.with_pose(DVec3::Z * -0.05, DQuat::IDENTITY).unwrap()]);
    body.advance(None, 200, explicit()).unwrap();
    assert!(body.positions_m()[0].length() < 1e-9, "{}", body.positions_m()[0]);
}

#[test]
fn block_slides_above_the_friction_angle_on_every_table() {
    let mu = 0.4_f64;
    let mut all = tables(mu);
    all.push(ground(mu));
    for obstacle in all {
        // Within 1 % of the angle.
        for (share, slides) in [(0.99, false), (1.01, true)] {
            let angle = share * mu.atan();
            let mut body = cube(3, 0.03, 200e3);
            body.set_obstacles(vec![obstacle.clone()]);
            for part in [0.0, 0.5, 0.9, 1.0] {
                let tilt = part * angle;
                body.set_gravity(G * DVec3::new(tilt.sin(), 0.0, -tilt.cos())).unwrap();
                body.advance(None, if part < 1.0 { 200 } else { 400 }, explicit()).unwrap();
            }
            let mean = |body: &Body| body.velocities_m_per_s().iter().sum::<DVec3>() / 27.0;
            let before = mean(&body);
            body.advance(None, 400, explicit()).unwrap();
            let gained = (mean(&body) - before).x / 0.4;
            let sliding = G * (angle.sin() - mu * angle.cos());
            let ok = if slides { (0.8..1.6).contains(&(gained / sliding)) } else { gained.abs() < 1e-4 };
            assert!(ok, "{share}: {gained} m/s2, sliding {sliding} m/s2, {obstacle:?}");
        }
    }
}

#[test]
fn body_of_a_mesh_rests_on_its_surface_and_converges() {
    let half = DVec3::new(0.05, 0.043, 0.04);
    let (corners, triangles) = box_mesh(half);
    let mesh = ClosedMesh::new(corners, triangles).unwrap();
    let tissue = Tissue { youngs_modulus_pa: 20e3, damping: Damping::Ratio(0.8), ..Tissue::default() };
    let made =
        CellLattice::fit(&mesh, CellSize::Along(7)).unwrap().allow_unconstrained().tissue(&tissue).unwrap();
    let network = made.network.placed(DQuat::IDENTITY, DVec3::Z * 0.0405).unwrap();
    assert!(network.node_count() > 300);
    let cell_m = network.grid().unwrap().cell_m();
    let implicit = LinearlyImplicitEuler { ticks_per_step: 50, ..LinearlyImplicitEuler::default() };
    for (integrator, most) in [(explicit(), 25), (implicit.into(), 400)] {
        let mut body = Body::new(network.clone(), made.surface.clone()).unwrap();
        assert!(body.obstacle_points().len() < body.surface().points.len());
        body.set_gravity(DVec3::Z * -G).unwrap();
        body.set_obstacles(vec![ground(0.4)]);
        for _ in 0..24 {
            let report = body.advance(None, 50, integrator).unwrap();
            assert!(report.unconverged == 0 && report.iterations <= most, "{report:?}");
        }
        let lowest =
            body.surface().points.iter().map(|point| point.of(body.positions_m()).z).fold(1.0, f64::min);
        assert!(lowest.abs() < 0.02 * cell_m, "{lowest} m");
        let weight = body.network().mass_kg().iter().sum::<f64>() * G;
        let force = body.obstacle_reactions()[0].force_n();
        assert!((force + DVec3::Z * weight).length() < 0.01 * weight, "{force} N, {weight} N");
        let mut outer = vec![DVec3::ZERO; body.positions_m().len()];
        body.outer_forces_n(&mut outer);
        // Weight and support balance.
        assert!(outer.iter().sum::<DVec3>().length() < 0.01 * weight);
    }
}
