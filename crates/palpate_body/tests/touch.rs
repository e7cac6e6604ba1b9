//! Touching, sliding and letting go.

use glam::DVec3;
use palpate_body::*;
use proptest::prelude::*;

const RADIUS: f64 = 0.005;

fn block() -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
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

/// Moves the tool along `at` and returns every force.
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

/// Moves the tool along `height` (of its lowest point above the surface at rest) and returns every force.
fn press(body: &mut Body, tool: &mut ToolContact, ticks: usize, height: impl Fn(f64) -> f64) -> Vec<DVec3> {
    let at = |t: f64| DVec3::new(0.012, -0.008, 0.05 + RADIUS + height(t));
    follow(body, tool, ticks, SemiImplicitEuler::default().into(), at)
}

/// How far the centre of a ball is outside of the surface.
fn outside(body: &Body, center: DVec3) -> f64 {
    SurfaceTree::new(body).closest(center, 1.0).unwrap().distance_m
}

#[test]
fn a_tool_above_the_body_feels_nothing_and_moves_nothing() {
    let (mut body, mut tool) = (block(), ball(RADIUS, 0.3));
    let forces = press(&mut body, &mut tool, 50, |_| 1e-6);
    assert!(forces.iter().all(|&f| f == DVec3::ZERO));
    assert_eq!(body.positions_m(), body.network().rest_m());
}

#[test]
fn touch_begins_in_the_tick_in_which_the_tool_crosses_the_surface() {
    let (mut body, mut tool) = (block(), ball(RADIUS, 0.3));
    // 4.15 mm above, 100 mm/s down: through the surface half-way through tick 42, whose index is 41.
    let forces = press(&mut body, &mut tool, 60, |t| 4.15e-3 - 0.1 * t);
    assert_eq!(forces.iter().position(|f| f.z > 0.0), Some(41));
    // What is touched is on the tool, between the nodes round (12, -8) mm.
    let center = DVec3::new(0.012, -0.008, 0.05 + RADIUS + 4.15e-3 - 6e-3);
    assert!(!tool.touched().is_empty());
    for touched in tool.touched() {
        assert!((touched.normal - DVec3::Z).length() < 0.1, "{}", touched.normal);
        assert!((touched.point_m(&body).distance(center) - RADIUS).abs() < 1e-7);
        let mut nodes = touched.nodes.iter().map(|&(node, _)| body.positions_m()[node]);
        assert!(nodes.all(|x| (x - center).truncate().length() < 0.03));
    }
}

#[test]
fn pressing_pushes_back_and_never_pulls_and_leaving_ends_it() {
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
fn a_held_node_pulls_too() {
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
fn a_held_point_follows_the_tool_and_feels_what_its_triangle_pulls() {
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
        // At rest what the hand feels is what holds the ground.
        let last = follow(&mut body, &mut tool, 3000, integrator, |_| way(0.314) + DVec3::X)[2999];
        let ground: DVec3 = (0..36).map(|node| body.internal_force_on_n(node)).sum();
        assert!((last + ground).length() < 1e-6, "{last}, {ground}");
    }
}

#[test]
fn a_held_triangle_pulls_as_the_reference_says() {
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
fn a_tool_that_starts_deep_inside_touches_nothing_until_it_has_come_out() {
    let (mut body, mut tool) = (block(), ball(RADIUS, 0.3));
    let forces = press(&mut body, &mut tool, 400, |t| -0.04 + 0.2 * t);
    assert!(forces.iter().all(|&f| f == DVec3::ZERO));
    let forces = press(&mut body, &mut tool, 300, |t| 0.04 - 0.2 * t);
    assert!(forces[150] == DVec3::ZERO && forces[250].z > 0.0);
}

#[test]
fn tools_that_make_no_sense_are_refused() {
    let body = block();
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(ToolContact::touch(ToolShape::Sphere { radius_m: RADIUS }, bad).is_err());
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = ToolContact::touch(ToolShape::Sphere { radius_m: bad }, 0.3);
        assert!(matches!(refused, Err(BodyError::Tool(_))));
    }
    let refused = |node, at| ToolContact::hold(&body, node, at).unwrap_err();
    assert_eq!(refused(216, DVec3::ZERO), BodyError::CannotHold { node: 216, why: "there is no such node" });
    assert_eq!(refused(0, DVec3::ZERO), BodyError::CannotHold { node: 0, why: "it is fixed" });
    assert_eq!(refused(215, DVec3::NAN), BodyError::Path { index: 0 });
    let fixed = BodyPoint::new(vec![(0, 0.5), (1, 0.5)]).unwrap();
    assert_eq!(
        ToolContact::hold_point(&body, fixed, DVec3::ZERO),
        Err(BodyError::CannotHold { node: 0, why: "it is fixed" })
    );
}

#[test]
fn a_tool_in_free_air_near_an_edge_or_a_corner_touches_nothing() {
    let mut body = block();
    for i in 0..40 {
        for j in 0..40 {
            // A plane just above the top, reaching beyond its edges, and one beside a side.
            let (u, v) = (f64::from(i) * 0.004 - 0.08, f64::from(j) * 0.004 - 0.08);
            let (top, side) =
                (DVec3::new(u, v, 0.05 + RADIUS + 1e-6), DVec3::new(0.05 + RADIUS + 1e-6, u, v));
            let above = DVec3::new(u, v, 0.05 + 1e-6);
            for (free, tool) in
                [(top, ball(RADIUS, 0.3)), (side, ball(RADIUS, 0.3)), (above, punch(RADIUS, 0.3))]
            {
                let mut tool = tool;
                let path = [ToolPoint::at_rest(free); 2];
                body.advance(Some((&mut tool, &path)), 1, SemiImplicitEuler::default()).unwrap();
                assert!(tool.touched().is_empty(), "at {free}");
            }
        }
    }
}

#[test]
fn a_ball_that_slides_over_an_edge_leaves() {
    let (mut body, mut tool) = (block(), ball(0.01, 0.2));
    // 2 mm deep across the top and beyond, 40 mm in 0.4 s.
    let forces = follow(&mut body, &mut tool, 600, SemiImplicitEuler::default().into(), |t| {
        DVec3::new(0.03 + 0.1 * (t - 0.2).max(0.0), 0.004, 0.06 - 0.002 * (t / 0.2).min(1.0))
    });
    assert!(forces[250].z > 0.05, "{}", forces[250]);
    // Past the edge the normal leans over it and pushes the ball on.
    assert!(forces.iter().any(|f| f.x > 0.02 && f.z > 0.0));
    assert_eq!(forces[599], DVec3::ZERO);
    assert!(tool.touched().is_empty());
}

#[test]
fn a_ball_that_slides_is_rubbed_by_mu_times_its_load() {
    for integrator in both() {
        for mu in [0.0, 0.2, 0.4] {
            let (mut body, mut tool) = (block(), ball(0.01, mu));
            // Down by 4 mm, then along the top at 40 mm/s.
            let forces = follow(&mut body, &mut tool, 900, integrator, |t| {
                DVec3::new(-0.02 + 0.04 * (t - 0.3).max(0.0), 0.001, 0.06 - 0.004 * (t / 0.2).min(1.0))
            });
            // It drags the surface along, so that the body resists: forces oppose the movement of the tool. In the mean over
            // a cell of the lattice, because the surface rises and falls.
            let cell = &forces[400..900];
            let mean: DVec3 = cell.iter().sum::<DVec3>() / cell.len() as f64;
            assert!((mean.x / mean.z + mu).abs() < 0.03, "{mean}, mu {mu}");
            assert!(cell.iter().all(|f| f.z > 0.1));
            assert!(tool.touched().iter().all(|t| t.slip_m_per_s.length() > 0.02));
        }
    }
}

#[test]
fn a_ball_that_moves_little_sticks_and_takes_the_surface_along() {
    let (mut body, mut tool) = (block(), ball(0.01, 0.8));
    // Down by 4 mm, then 1 mm aside.
    let way = |t: f64| {
        DVec3::new(0.001 + 0.01 * (t - 0.3).clamp(0.0, 0.1), 0.003, 0.06 - 0.004 * (t / 0.2).min(1.0))
    };
    let forces = follow(&mut body, &mut tool, 800, SemiImplicitEuler::default().into(), way);
    let [touched] = tool.touched() else { panic!("{:?}", tool.touched()) };
    assert!(touched.slip_m_per_s.length() < 1e-12);
    let f = forces[799];
    assert!(f.x < -0.02 && f.x.abs() < 0.8 * f.z, "{f}");
}

#[test]
fn nothing_is_passed_unseen_however_fast() {
    for (radius, speed) in [(0.001, 1.0), (0.001, 5.0), (0.005, 1.0), (0.01, 20.0)] {
        for integrator in [SemiImplicitEuler::default().into(), implicit(LinearSolver::Cholesky, 1)] {
            let (mut body, mut tool) = (block(), ball(radius, 0.3));
            let above = 0.05 + radius;
            // From 10 mm above to 15 mm deep.
            let way = |t: f64| DVec3::new(0.004, -0.003, above + 0.01 - speed * t);
            let ticks = (0.025 / speed * 1e3).round() as usize;
            let forces = follow(&mut body, &mut tool, ticks, integrator, way);
            assert!(!tool.touched().is_empty() && forces[ticks - 1].z > 0.0, "{radius} m, {speed} m/s");
            let gap = outside(&body, way(1e-3 * ticks as f64)) - radius;
            assert!(
                gap.abs() < 0.1 * radius,
                "{gap} m from a ball of {radius} m at {speed} m/s, {integrator:?}"
            );
        }
    }
}

#[test]
fn steps_of_many_ticks_touch_too() {
    let (mut body, mut tool) = (block(), ball(RADIUS, 0.3));
    let way = |t: f64| DVec3::new(0.012, -0.008, 0.05 + RADIUS + 0.004 - 0.1 * t);
    let forces = follow(&mut body, &mut tool, 100, implicit(LinearSolver::Cholesky, 50), way);
    assert!(forces.last().unwrap().z > 0.2);
    assert!((outside(&body, way(0.1)) - RADIUS).abs() < 0.1 * RADIUS);
}

#[test]
fn conjugate_gradients_answer_as_the_factorisation_does() {
    let run = |solver| {
        let (mut body, mut tool) = (block(), ball(0.02, 0.3));
        let tight = LinearlyImplicitEuler { solver, tolerance: 1e-12, ..LinearlyImplicitEuler::default() };
        let way = |t: f64| DVec3::new(0.002, 0.003, 0.07 - 0.1 * t);
        follow(&mut body, &mut tool, 60, tight.into(), way)
    };
    let (a, b) = (run(LinearSolver::Cholesky), run(LinearSolver::ConjugateGradients));
    let worst = a.iter().zip(&b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    // The factorisation has the exact tangent, conjugate gradients the clamped one.
    assert!(a[59].z > 0.5 && worst < 0.05 * a[59].z, "{worst} of {}", a[59]);
}

#[test]
fn at_rest_all_that_is_touched_together_carries_what_the_ground_carries() {
    for mut tool in [ball(0.06, 0.0), ball(0.06, 0.4), punch(0.03, 0.0), punch(0.03, 0.4), punch(0.004, 0.3)]
    {
        let (shape, friction) = tool.shape().unwrap();
        let high = if matches!(shape, ToolShape::Sphere { .. }) { 0.05 + shape.radius_m() } else { 0.05 };
        let mut body = block();
        let way = |t: f64| DVec3::new(0.004, -0.006, high + 0.002 - 0.02 * t.min(0.5));
        let force = follow(&mut body, &mut tool, 4000, SemiImplicitEuler::default().into(), way)[3999];
        let ground: DVec3 = (0..36).map(|node| body.internal_force_on_n(node)).sum();
        assert!(force.z > 0.5 && (force + ground).length() < 1e-5 * force.length(), "{force}, {ground}");
        let pushed: DVec3 = tool.touched().iter().map(|t| t.impulse_ns).sum::<DVec3>() / 0.25e-3;
        assert!((force + pushed).length() < 1e-5 * force.length(), "{force}, {pushed}, mu {friction}");
        assert!(tool.touched().len() >= 2, "{}", tool.touched().len());
    }
}

#[test]
fn no_more_than_64_nodes_are_touched_and_the_rest_is_reported() {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let made = Block::new([10; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    let mut body = Body::new(made.network, made.surface).unwrap();
    let mut tool = punch(0.2, 0.3);
    let way = path(20, |t| DVec3::Z * (0.0505 - 0.1 * t));
    let report = body.advance(Some((&mut tool, &way)), 20, SemiImplicitEuler::default()).unwrap();
    assert_eq!((report.touched, report.left_out), (64, 36));
}

#[test]
fn the_work_of_a_tool_that_presses_and_slides_is_stored_or_dissipated() {
    let fine = SemiImplicitEuler { min_substeps: 64, ..SemiImplicitEuler::default() };
    for (mut tool, lowest) in [(ball(0.01, 0.3), 0.01), (punch(0.012, 0.3), 0.0), (punch(0.03, 0.3), 0.0)] {
        let mut body = block();
        body.open_books();
        let way = |t: f64| {
            DVec3::new(-0.015 + 0.1 * (t - 0.1).max(0.0), 0.001, 0.05 + lowest - 0.004 * (t / 0.1).min(1.0))
        };
        follow(&mut body, &mut tool, 350, fine.into(), way);
        let books = body.books().unwrap();
        let through = books.stored_j + books.damped_j + books.rubbed_j;
        assert!(books.work_in_j > 1e-3 && books.rubbed_j > 0.2 * books.work_in_j, "{books:?}");
        assert!((books.work_in_j - through).abs() < 1e-3 * books.work_in_j, "{:?}: {books:?}", tool.shape());
    }
}

#[test]
fn what_is_displayed_is_what_is_pushed_but_for_inertia() {
    // Slow scenes, in which a touch changes its triangles: along a diagonal, over nodes, deep with much friction.
    for integrator in both() {
        for (radius, friction, x, y) in [
            (0.02, 1.0, 0.004, 0.001),
            (0.001, 0.3, -0.01, 0.0),
            (0.005, 0.5, 0.01, 0.01),
            (0.005, 2.0, 0.0, 0.0),
        ] {
            let (mut body, mut tool) = (block(), ball(radius, friction));
            let way = |t: f64| {
                let z = 0.05 + radius - 0.012 * (t / 0.4).min(1.0);
                DVec3::new(x + 0.03 * (t - 0.5).max(0.0), y, z)
            };
            for tick in 0..1000 {
                let at = |tick: i32| ToolPoint::at_rest(way(f64::from(tick) * 1e-3));
                let report =
                    body.advance(Some((&mut tool, &[at(tick), at(tick + 1)])), 1, integrator).unwrap();
                let h = 1e-3 / report.substeps as f64;
                let pushed: DVec3 = tool.touched().iter().map(|t| t.impulse_ns).sum::<DVec3>() / h;
                let f = tool.displayed_force_n(&body);
                let off = (f + pushed).length();
                // Touch-down is an impact.
                if tick < 20 {
                    continue;
                }
                assert!(off < 0.12 + 0.15 * f.length(), "{radius} m, {friction}, tick {tick}: {f}, {pushed}");
            }
        }
    }
}

#[test]
fn a_ball_near_a_fixed_edge_finds_no_lever() {
    for integrator in both() {
        let (mut body, mut tool) = (block(), ball(0.01, 0.3));
        // A millimetre into the side, and down to the fixed bottom.
        let forces = follow(&mut body, &mut tool, 2500, integrator, |t| {
            DVec3::new(0.06 - 0.001 * (t / 0.1).min(1.0), 0.002, -0.02 * (t - 0.1).max(0.0))
        });
        let peak = forces.iter().map(|f| f.length()).fold(0.0, f64::max);
        assert!(peak < 40.0 && forces[1500].x > 0.2, "{peak} N, {}", forces[1500]);
    }
}

#[test]
fn a_tilted_punch_and_one_moved_into_a_wall_are_felt() {
    for tilt in [0.0, 10.0, 20.0, 45.0_f64] {
        let axis = -DVec3::new(tilt.to_radians().sin(), 0.0, tilt.to_radians().cos());
        let mut body = block();
        let mut tool = ToolContact::touch(ToolShape::FlatPunch { radius_m: 0.03, axis }, 0.3).unwrap();
        // Its lowest point 2 mm in.
        let high = 0.03 * tilt.to_radians().sin();
        let forces = follow(&mut body, &mut tool, 300, SemiImplicitEuler::default().into(), |t| {
            DVec3::new(0.001, 0.0033, 0.05 + high + 0.001 - 0.003 * (t / 0.1).min(1.0))
        });
        assert!(forces[299].z > 0.3, "{tilt} degrees: {}", forces[299]);
    }
    let (mut body, mut tool) = (block(), punch(0.02, 0.3));
    let forces = follow(&mut body, &mut tool, 300, SemiImplicitEuler::default().into(), |t| {
        DVec3::new(0.072 - 0.007 * (t / 0.1).min(1.0), 0.001, 0.001)
    });
    assert!(forces[299].x > 0.3, "{}", forces[299]);
}

#[test]
fn a_contact_with_another_body_is_refused_and_nothing_is_stepped() {
    let big = {
        let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
        let block = Block::new([8; 3], DVec3::splat(0.1)).unwrap().fix(Face::PosZ).uniform(&lattice).unwrap();
        Body::new(block.network, block.surface).unwrap()
    };
    let (mut body, path) = (block(), [ToolPoint::default(); 2]);
    let before = body.positions_m().to_vec();
    for (node, why) in [(400, "there is no such node"), (0, "it is fixed")] {
        let mut foreign = ToolContact::hold(&big, node, DVec3::ZERO).unwrap();
        let refused = body.advance(Some((&mut foreign, &path)), 1, SemiImplicitEuler::default());
        assert_eq!(refused, Err(BodyError::CannotHold { node, why }));
    }
    assert_eq!(body.positions_m(), before);
}

#[test]
fn from_a_restored_state_a_touch_goes_on_to_the_bit() {
    for integrator in both() {
        let (mut body, mut tool) = (block(), ball(0.01, 0.3));
        let ground = Obstacle::sphere(DVec3::new(0.07, 0.0, 0.0), 0.025, 0.2).unwrap();
        body.set_obstacles(vec![ground]);
        let thread = Tie::thread(BodyPoint::node(180), BodyPoint::node(210), 0.05).unwrap();
        body.set_ties(vec![thread]).unwrap();
        let way = path(200, |t| DVec3::new(0.1 * t, 0.0, 0.06 - 0.05 * t));
        body.advance(Some((&mut tool, &way[..=100])), 100, integrator).unwrap();
        let (state, held) = (body.state(), tool.clone());
        let go = |body: &mut Body, mut tool: ToolContact| {
            let mut forces = Vec::new();
            body.advance_observed(Some((&mut tool, &way[100..])), 100, integrator, |_, f| forces.push(f))
                .unwrap();
            (forces, body.state(), tool)
        };
        let first = go(&mut body, held.clone());
        assert!(!first.2.touched().is_empty());
        body.restore(&state).unwrap();
        assert_eq!(go(&mut body, held), first);
    }
}

#[test]
fn what_is_touched_slowly_closes_its_gap_to_the_last_digit() {
    for integrator in both() {
        for (radius, friction) in [(0.005, 0.0), (0.005, 0.4), (0.02, 0.3), (0.05, 0.2)] {
            let (mut body, mut tool) = (block(), ball(radius, friction));
            let at = |i: i32| {
                let depth = 0.006 * (f64::from(i) / 300.0).min(1.0);
                ToolPoint::at_rest(DVec3::new(0.003, 0.007, 0.0502 + radius - depth))
            };
            for i in 0..500 {
                body.advance(Some((&mut tool, &[at(i), at(i + 1)])), 1, integrator).unwrap();
                for t in tool.touched() {
                    assert!(
                        t.impulse_ns.dot(t.normal) < 0.0 && t.gap_m.abs() < 1e-8,
                        "{radius} m, tick {i}: {t:?}"
                    );
                }
                if !tool.touched().is_empty() {
                    let gap = outside(&body, at(i + 1).position_m) - radius;
                    assert!(gap.abs() < 1e-6, "{radius} m, tick {i}: {gap} m");
                }
            }
        }
    }
}

/// A scene: tool, friction, where it goes, and how fast the body's nodes fly at the beginning.
fn scenes() -> impl Strategy<Value = (bool, f64, f64, [f64; 3], [f64; 3], u64)> {
    let place = || prop::array::uniform3(-1.0..1.0f64);
    (any::<bool>(), 0.004..0.04f64, 0.0..0.8f64, place(), place(), any::<u64>())
}

proptest! {
    // Always the same scenes: what slides fast under a punch is closed in two solutions, which differ by micrometres.
    #![proptest_config(ProptestConfig {
        cases: 48,
        rng_seed: proptest::test_runner::RngSeed::Fixed(7),
        ..ProptestConfig::default()
    })]
    #[test]
    fn every_touch_obeys_signorini_and_coulomb_at_every_step(
        (flat, radius, mu, from, to, seed) in scenes(), is_implicit in any::<bool>(),
    ) {
        let mut body = block();
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
                // The gap is closed, unless it was overdue because the surface slid or turned.
                let most = if flat { 1e-4 } else { 1e-5 };
                prop_assert!(along > 0.0 && (-5e-4 - 0.05 * radius..most).contains(&t.gap_m), "{t:?}");
                prop_assert!(across.length() <= mu * along * (1.0 + 1e-9) + 1e-15, "{t:?}");
                if slip.length() > 1e-3 && report.unsolved == 0 {
                    let slipping = -mu * along * slip.normalize();
                    prop_assert!((across - slipping).length() < 2e-3 * largest, "{t:?}: {across}, {slipping}");
                }
            }
        }
    }
}
