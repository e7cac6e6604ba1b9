//! Touch, hold and release.

mod rejected;
mod slide;

use glam::DVec3;
use palpate_body::*;
use proptest::prelude::*;

const RADIUS: f64 = 0.005;

fn block() -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

/// The same without a grid of cells: contact has no compliance of its own, and is one row at one point.
fn rigid_block() -> Body {
    let (body, links) = (block(), block().network().links().to_vec());
    let network = body.network();
    let fixed = (0..network.node_count()).map(|node| network.is_fixed(node)).collect();
    let network = Network::new(network.rest_m().to_vec(), network.mass_kg().to_vec(), fixed, links).unwrap();
    Body::new(network, body.surface().clone()).unwrap()
}

fn ball(radius: f64, friction: f64) -> ToolContact {
    ToolContact::touch(ToolShape::Sphere { radius_m: radius }, friction).unwrap()
}

fn punch(radius: f64, friction: f64) -> ToolContact {
    ToolContact::touch(ToolShape::FlatPunch { radius_m: radius, axis: -DVec3::Z }, friction).unwrap()
}

fn implicit(solver: LinearSolver, ticks_per_step: usize) -> Integrator {
    LinearlyImplicitEuler { solver, ticks_per_step, ..LinearlyImplicitEuler::default() }.into()
}

fn both() -> [Integrator; 2] {
    [SemiImplicitEuler::default().into(), implicit(LinearSolver::Cholesky, 1)]
}

fn path(ticks: usize, at: impl Fn(f64) -> DVec3) -> Vec<ToolPoint> {
    (0..=ticks).map(|i| ToolPoint::at_rest(at(i as f64 * 1e-3))).collect()
}

/// Moves the tool along `at` and returns the force of every tick.
fn follow(
    body: &mut Body,
    tool: &mut ToolContact,
    ticks: usize,
    integrator: Integrator,
    at: impl Fn(f64) -> DVec3,
) -> Vec<DVec3> {
    let (path, mut forces) = (path(ticks, at), Vec::new());
    body.advance_observed(Some((tool, &path)), ticks, integrator, |_, f| forces.push(f)).unwrap();
    forces
}

/// Moves the tool along `height` (of its lowest point above the surface at rest) and returns the force of every tick.
fn press(body: &mut Body, tool: &mut ToolContact, ticks: usize, height: impl Fn(f64) -> f64) -> Vec<DVec3> {
    let at = |t: f64| DVec3::new(0.012, -0.008, 0.05 + RADIUS + height(t));
    follow(body, tool, ticks, SemiImplicitEuler::default().into(), at)
}

/// Distance of the centre of a ball outside of the surface.
fn outside(body: &Body, center: DVec3) -> f64 {
    SurfaceTree::new(body).closest(center, 1.0).unwrap().distance_m
}

/// Deflection of the series compliance of a touched point, m.
fn series_m(touched: &TouchedPoint) -> f64 {
    touched.series.map_or(0.0, |series| series.approach_m(touched.pressing_n()))
}

#[test]
fn tool_above_the_body_has_no_effect() {
    let (mut body, mut tool) = (block(), ball(RADIUS, 0.3));
    let forces = press(&mut body, &mut tool, 50, |_| 1e-6);
    assert!(forces.iter().all(|&f| f == DVec3::ZERO));
    assert_eq!(body.positions_m(), body.network().rest_m());
}

#[test]
fn contact_starts_in_the_tick_of_crossing() {
    let (mut body, mut tool) = (block(), ball(RADIUS, 0.3));
    // 4.15 mm above, 100 mm/s down: through the surface half-way through tick 42, whose index is 41.
    let forces = press(&mut body, &mut tool, 60, |t| 4.15e-3 - 0.1 * t);
    assert_eq!(forces.iter().position(|f| f.z > 0.0), Some(41));
    // The touched point lies on the tool, between the nodes around (12, -8) mm.
    let center = DVec3::new(0.012, -0.008, 0.05 + RADIUS + 4.15e-3 - 6e-3);
    assert!(!tool.touched().is_empty());
    for touched in tool.touched() {
        assert!((touched.normal - DVec3::Z).length() < 0.1, "{}", touched.normal);
        let away = (center - touched.point_m(&body)).dot(touched.normal);
        assert!(
            (away - RADIUS - touched.gap_m).abs() < 1e-7 && (touched.gap_m + series_m(touched)).abs() < 5e-5
        );
        let mut nodes = touched.nodes.iter().map(|&(node, _)| body.positions_m()[node]);
        assert!(nodes.all(|x| (x - center).truncate().length() < 0.045));
    }
}

#[test]
fn press_only_pushes_and_ends_on_leaving() {
    for friction in [0.0, 0.5] {
        let (mut body, mut tool) = (block(), ball(RADIUS, friction));
        let wave = |t: f64| -0.006 * (2.0 * std::f64::consts::PI * 2.0 * t).sin();
        let forces = press(&mut body, &mut tool, 490, wave);
        assert!(forces.iter().all(|f| f.z >= 0.0));
        let peak = forces.iter().map(|f| f.z).fold(0.0, f64::max);
        assert!(peak > 0.3, "{peak} N at 6 mm");
        // The second half of the wave is above the surface; the body follows for a moment.
        assert!(forces[270..].iter().all(|&f| f == DVec3::ZERO));
        assert!(tool.touched().is_empty());
        let moved = body.positions_m().iter().zip(body.network().rest_m()).map(|(x, r)| x.distance(*r));
        assert!(moved.fold(0.0, f64::max) < 2e-3, "the body comes back");
    }
}

#[test]
fn held_node_pushes_and_pulls() {
    let mut body = block();
    let node = 3 + 6 * (3 + 6 * 5);
    let p = body.positions_m()[node];
    let mut tool = ToolContact::hold(&body, node, p).unwrap();
    let lifted = ToolPoint::at_rest(p + DVec3::Z * 2e-3);
    body.advance(Some((&mut tool, &[ToolPoint::at_rest(p), lifted])), 1, SemiImplicitEuler::default())
        .unwrap();
    assert!(tool.displayed_force_n(&body).z < 0.0);
}

#[test]
fn held_point_follows_the_tool_with_the_internal_force() {
    let node = |i: usize, j: usize| i + 6 * (j + 6 * 5);
    let triangle = || BodyPoint::new(vec![(node(3, 3), 0.5), (node(4, 3), 0.3), (node(3, 4), 0.2)]).unwrap();
    let at_of = |body: &Body| -> DVec3 {
        triangle().nodes().iter().map(|&(node, w)| w * body.positions_m()[node]).sum()
    };
    for integrator in both() {
        let mut body = block();
        let start = at_of(&body);
        let mut tool = ToolContact::hold_point(&body, triangle(), start + DVec3::X).unwrap();
        let way =
            |t: f64| start + DVec3::new(0.002 * (20.0 * t).sin(), 0.0, 0.008 * (1.0 - (10.0 * t).cos()));
        let lifted = follow(&mut body, &mut tool, 314, integrator, |t| way(t) + DVec3::X);
        assert!((at_of(&body) - way(0.314)).length() < 1e-12);
        assert!(lifted[300].z < -0.3 && lifted.iter().all(|f| f.is_finite()));
        // At rest the displayed force balances the fixed nodes.
        let last = follow(&mut body, &mut tool, 3000, integrator, |_| way(0.314) + DVec3::X)[2999];
        let ground: DVec3 = (0..36).map(|node| body.internal_force_on_n(node)).sum();
        assert!((last + ground).length() < 1e-6, "{last}, {ground}");
    }
}

#[test]
fn held_triangle_matches_the_reference() {
    let text = include_str!("../../../tests/data/contact_held_triangle.json");
    let data: serde_json::Value = serde_json::from_str(text).unwrap();
    let expected: Vec<[f64; 3]> = serde_json::from_value(data["force_n"].clone()).unwrap();
    let node = |i: usize, j: usize| i + 6 * (j + 6 * 5);
    let point = BodyPoint::new(vec![(node(3, 3), 0.5), (node(4, 3), 0.3), (node(3, 4), 0.2)]).unwrap();
    let mut body = block();
    let mut tool = ToolContact::hold_point(&body, point, DVec3::ZERO).unwrap();
    let wave = |hz: f64, t: f64| (std::f64::consts::TAU * hz * t).sin();
    let way = |t: f64| {
        let slow = -0.005 * (1.0 - (std::f64::consts::TAU * t).cos()) - 0.0008 * wave(9.0, t);
        DVec3::new(0.003 * wave(1.7, t), 0.0, slow - if t > 0.3 { 0.002 * wave(3.3, t) } else { 0.0 })
    };
    let integrator = SemiImplicitEuler { max_substeps: 4, ..SemiImplicitEuler::default() };
    let forces = follow(&mut body, &mut tool, 1450, integrator.into(), way);
    for (i, expected) in expected.iter().enumerate().skip(1) {
        let worst = (forces[50 * i - 1] - DVec3::from_array(*expected)).length();
        assert!(worst < 1e-9, "tick {}: {worst} N", 50 * i);
    }
}

#[test]
fn tool_starting_inside_touches_nothing_until_outside() {
    let (mut body, mut tool) = (block(), ball(RADIUS, 0.3));
    let forces = press(&mut body, &mut tool, 400, |t| -0.04 + 0.2 * t);
    assert!(forces.iter().all(|&f| f == DVec3::ZERO));
    let forces = press(&mut body, &mut tool, 300, |t| 0.04 - 0.2 * t);
    assert!(forces[150] == DVec3::ZERO && forces[250].z > 0.0);
}

/// A scene: tool, friction, path, and initial speed of the body's nodes.
fn scenes() -> impl Strategy<Value = (bool, f64, f64, [f64; 3], [f64; 3], u64)> {
    let place = || prop::array::uniform3(-1.0..1.0f64);
    (any::<bool>(), 0.004..0.04f64, 0.0..0.8f64, place(), place(), any::<u64>())
}

proptest! {
    // A fixed seed: a fast sliding punch is resolved in two solutions, which differ by micrometres.
    #![proptest_config(ProptestConfig {
        cases: 48,
        max_shrink_iters: 0,
        rng_seed: proptest::test_runner::RngSeed::Fixed(7),
        ..ProptestConfig::default()
    })]
    #[test]
    fn touch_satisfies_signorini_and_coulomb_at_every_step(
        (flat, radius, mu, from, to, seed) in scenes(), is_implicit in any::<bool>(),
    ) {
        let mut body = rigid_block();
        let mut random = seed;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) as f64 / (1u64 << 31) as f64 * 2.0 - 1.0
        };
        let speeds: Vec<DVec3> = (0..216).map(|_| 0.3 * DVec3::new(next(), next(), next())).collect();
        let x = body.positions_m().to_vec();
        body.set_state(&x, &speeds).unwrap();
        let mut tool = if flat { punch(radius, mu) } else { ball(radius, mu) };
        let above = if flat { 0.05 } else { 0.05 + radius };
        let place = |p: [f64; 3], h: f64| DVec3::new(0.05 * p[0], 0.05 * p[1], above + h + 0.004 * p[2]);
        let (a, b) = (place(from, 0.008), place(to, -0.006));
        let tick = if is_implicit {
            LinearlyImplicitEuler { solver: LinearSolver::Cholesky, ..LinearlyImplicitEuler::default() }.into()
        } else {
            let one = SemiImplicitEuler { min_substeps: 1, ..SemiImplicitEuler::default() };
            Integrator::from(one)
        };
        for i in 0..120 {
            let at = |i: i32| ToolPoint::at_rest(a + (b - a) * (f64::from(i.min(80)) / 80.0));
            let report = body.advance(Some((&mut tool, &[at(i), at(i + 1)])), 1, tick).unwrap();
            let largest = tool.touched().iter().map(|t| t.impulse_ns.length()).fold(0.0, f64::max);
            for t in tool.touched() {
                let push = -t.normal;
                let (along, slip) = (t.impulse_ns.dot(push), t.slip_m_per_s.reject_from(push));
                let across = t.impulse_ns - along * push;
                // The gap is closed, unless it existed before because the surface slid or turned.
                let most = if flat { 1e-4 } else { 1e-5 };
                let gap_m = t.gap_m + series_m(t);
                prop_assert!(along > 0.0 && (-5e-4 - 0.05 * radius..most).contains(&gap_m), "{t:?}");
                prop_assert!(across.length() <= mu * along * (1.0 + 1e-9) + 1e-15, "{t:?}");
                if slip.length() > 1e-3 && report.unconverged == 0 {
                    let slipping = -mu * along * slip.normalize();
                    prop_assert!((across - slipping).length() < 2e-3 * largest, "{t:?}: {across}, {slipping}");
                }
            }
        }
    }
}
