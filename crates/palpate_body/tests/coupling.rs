//! A tool behind a virtual coupling.

use glam::DVec3;
use palpate_body::*;

const RADIUS: f64 = 0.005;
const TOP: f64 = 0.05;

fn block() -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

const STIFFNESS: f64 = 20e3;

fn free_ball() -> ToolContact {
    ToolContact::touch(ToolShape::Sphere { radius_m: RADIUS }, 0.3).unwrap()
}

fn ball(most_n: f64) -> ToolContact {
    free_ball().with_coupling(VirtualCoupling { stiffness_n_per_m: STIFFNESS, max_force_n: most_n }).unwrap()
}

fn both() -> [Integrator; 2] {
    let implicit = LinearlyImplicitEuler { solver: LinearSolver::Cholesky, ..Default::default() };
    [SemiImplicitEuler::default().into(), implicit.into()]
}

/// Moves the device along `at` and returns force and proxy position at every tick.
fn follow(
    body: &mut Body,
    tool: &mut ToolContact,
    ticks: usize,
    integrator: Integrator,
    at: impl Fn(f64) -> DVec3,
) -> Vec<(DVec3, DVec3)> {
    let mut all = Vec::new();
    for i in 0..ticks {
        let path = [i, i + 1].map(|i| ToolPoint::at_rest(at(i as f64 * 1e-3)));
        body.advance(Some((&mut *tool, &path)), 1, integrator).unwrap();
        all.push((tool.displayed_force_n(body), tool.proxy_m(path[1].position_m)));
    }
    all
}

/// Down from 2 mm above at 0.3 m/s to the depth `depth`, wait, and up again after 0.4 s.
fn dip(depth: f64) -> impl Fn(f64) -> DVec3 {
    move |t| {
        let down = 2e-3 - (0.3 * t).min(depth + 2e-3) + 0.3 * (t - 0.4).max(0.0);
        DVec3::new(0.012, -0.008, TOP + RADIUS + down)
    }
}

#[test]
fn deep_device_leaves_the_proxy_at_the_force_limit() {
    for integrator in both() {
        for most_n in [1.0, 4.0] {
            let (mut body, mut tool) = (block(), ball(most_n));
            // Through the whole block and 50 mm beyond.
            let all = follow(&mut body, &mut tool, 400, integrator, dip(0.15));
            assert!(all.iter().all(|(f, _)| f.length() <= most_n * (1.0 + 1e-9)), "saturated");
            let (force, proxy) = *all.last().unwrap();
            assert!((force.z - most_n).abs() < 0.02 * most_n, "{force}");
            // The same position, reached by a tool without a coupling, has the same force.
            let (mut other, mut stiff) = (block(), free_ball());
            let depth = TOP + RADIUS - proxy.z;
            let same = follow(&mut other, &mut stiff, 400, integrator, dip(depth));
            let (expected, at) = *same.last().unwrap();
            assert!((at.z - proxy.z).abs() < 1e-12);
            assert!((force.z - expected.z).abs() < 0.03 * most_n, "{force} {expected} at {depth}");
            // No part is inverted: each vertex of the surface is close to its neighbours.
            let furthest =
                body.positions_m().iter().zip(body.network().rest_m()).map(|(x, r)| x.distance(*r));
            assert!(furthest.fold(0.0, f64::max) < 0.03);
        }
    }
}

#[test]
fn proxy_returns_with_the_device() {
    for integrator in both() {
        let (mut body, mut tool) = (block(), ball(2.0));
        let all = follow(&mut body, &mut tool, 1200, integrator, dip(0.06));
        let (force, proxy) = *all.last().unwrap();
        assert_eq!((force, proxy), (DVec3::ZERO, dip(0.06)(1.2)));
        let moved = body.positions_m().iter().zip(body.network().rest_m()).map(|(x, r)| x.distance(*r));
        assert!(moved.fold(0.0, f64::max) < 1e-3, "the body comes back");
        // On the way up the coupling stays saturated until the device reaches the proxy.
        let until = all.iter().rposition(|(f, _)| f.z > 1.95).unwrap();
        let behind = dip(0.06)(until as f64 * 1e-3).distance(all[until].1);
        assert!(until > 450 && behind < 3e-3, "{until} {behind}");
    }
}

#[test]
fn coupling_below_its_limit_is_a_spring_and_in_air_has_no_effect() {
    let (mut body, mut tool) = (block(), ball(50.0));
    let at = dip(6e-3);
    let all = follow(&mut body, &mut tool, 390, SemiImplicitEuler::default().into(), &at);
    for (i, (force, proxy)) in all.iter().enumerate().take(6) {
        assert_eq!((*force, *proxy), (DVec3::ZERO, at((i + 1) as f64 * 1e-3)));
    }
    let (force, proxy) = *all.last().unwrap();
    let behind = proxy - at(0.39);
    assert!(force.z > 0.5 && (behind - force / STIFFNESS).length() < 2e-3 * behind.length(), "{behind}");
}

#[test]
fn proxy_crosses_no_surface_undetected() {
    for most_n in [0.5, 5.0] {
        for speed in [0.3, 1.0, 3.0] {
            let (mut body, mut tool) = (block(), ball(most_n));
            let at = |t: f64| DVec3::new(0.003, 0.004, TOP + RADIUS + 0.01 - speed * t);
            let ticks = (0.05 / speed * 1e3) as usize;
            follow(&mut body, &mut tool, ticks, SemiImplicitEuler::default().into(), at);
            let proxy = tool.proxy_m(at(ticks as f64 * 1e-3));
            let closest = SurfaceTree::new(&body).closest(proxy, 1.0).unwrap();
            assert!(closest.distance_m > 0.7 * RADIUS, "{speed} m/s, {most_n} N: {}", closest.distance_m);
        }
    }
}

#[test]
fn coupling_of_a_held_point_saturates() {
    let node = 3 + 6 * (3 + 6 * 5);
    for integrator in both() {
        let mut body = block();
        let from = body.positions_m()[node];
        let coupling = VirtualCoupling { stiffness_n_per_m: STIFFNESS, max_force_n: 1.5 };
        let mut tool = ToolContact::hold(&body, node, from).unwrap().with_coupling(coupling).unwrap();
        assert_eq!(tool.driven_node(), None);
        // 100 mm up and aside within a quarter of a second.
        let pulled = |t: f64| from + DVec3::new(0.6, 0.0, 0.8) * 0.1 * (t / 0.25).min(1.0);
        let all = follow(&mut body, &mut tool, 700, integrator, pulled);
        let (force, proxy) = *all.last().unwrap();
        assert!((force.length() - 1.5).abs() < 0.03, "{force}");
        assert!((proxy - body.positions_m()[node]).length() < 1e-6, "it holds on");
        // The force pulls towards the device.
        let towards = (pulled(0.7) - proxy).normalize();
        assert!((-force.normalize()).dot(towards) > 0.98, "{force} {towards}");
    }
}

#[test]
fn energy_balance_closes_with_a_coupling() {
    let (mut body, mut tool) = (block(), ball(2.0));
    body.start_energy_accounting();
    follow(&mut body, &mut tool, 600, SemiImplicitEuler::default().into(), dip(0.05));
    let balance = body.energy_balance().unwrap();
    assert!(balance.work_in_j > 1e-3, "{balance:?}");
    let spent = balance.stored_j + balance.damping_loss_j + balance.friction_loss_j + balance.integrator_j;
    assert!((spent / balance.work_in_j - 1.0).abs() < 1e-9, "{balance:?}");
    assert!(balance.integrator_j.abs() < 0.1 * balance.work_in_j, "{balance:?}");
}

#[test]
fn rejects_an_invalid_coupling() {
    for (stiffness_n_per_m, most_n) in [(0.0, 1.0), (f64::NAN, 1.0), (1e3, -1.0), (1e3, f64::INFINITY)] {
        let rejected = free_ball().with_coupling(VirtualCoupling { stiffness_n_per_m, max_force_n: most_n });
        assert!(matches!(rejected, Err(BodyError::Tool(_))));
    }
}
