//! Several tools on one body.

use glam::DVec3;
use palpate_body::*;

const RADIUS: f64 = 0.01;
fn block(face: Option<Face>) -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 200.0, damping_ratio: 0.7, mass_kg: 0.5 };
    let block = Block::new([5, 5, 5], DVec3::splat(0.1)).unwrap();
    let block = face.map_or_else(|| block.clone().allow_unconstrained(), |face| block.clone().fix(face));
    let made = block.uniform(&lattice).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn ball(friction: f64) -> ToolContact {
    ToolContact::touch(ToolShape::Sphere { radius_m: RADIUS }, friction).unwrap()
}

fn path(ticks: usize, at: impl Fn(f64) -> DVec3) -> Vec<ToolPoint> {
    (0..=ticks).map(|i| ToolPoint::at_rest(at(i as f64 * 1e-3))).collect()
}

/// Steps `body` and returns the forces at every tick.
fn run(
    body: &mut Body,
    tools: &mut [(ToolContact, Vec<ToolPoint>)],
    ticks: usize,
    integrator: Integrator,
) -> Vec<Vec<DVec3>> {
    let mut runs: Vec<ToolRun<'_>> =
        tools.iter_mut().map(|(contact, path)| ToolRun { contact, path }).collect();
    let mut seen = Vec::new();
    body.advance_tools(&mut runs, ticks, integrator, |_, forces| seen.push(forces.to_vec())).unwrap();
    seen
}

#[test]
fn two_tools_on_opposite_sides_of_a_free_body_get_opposite_forces() {
    for integrator in [SemiImplicitEuler::default().into(), LinearlyImplicitEuler::default().into()] {
        for coupling in [None, Some(VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 1.0 })] {
            let mut body = block(None);
            // Exactly on the middle nodes, so that the body does not rotate.
            let way = |side: f64| {
                path(1500, move |t| DVec3::X * side * (0.05 + RADIUS + 1e-3 - 0.005 * (t / 0.5).min(1.0)))
            };
            // Without friction. The triangles of the two faces are no mirror images, so the dents differ slightly.
            let tool =
                || coupling.map_or_else(|| ball(0.0), |coupling| ball(0.0).with_coupling(coupling).unwrap());
            let mut tools = [(tool(), way(1.0)), (tool(), way(-1.0))];
            let forces = run(&mut body, &mut tools, 1500, integrator);
            for pair in &forces {
                // Because of rounding, one tool may touch a tick before the other.
                if pair.contains(&DVec3::ZERO) && pair[0].length() + pair[1].length() < 0.02 {
                    continue;
                }
                let sum = pair[0] + pair[1];
                // A saturated coupling finds its force limit to within a per cent.
                let most = if coupling.is_some() { 1e-2 } else { 1e-9 };
                assert!(sum.x.abs() < most, "{} {}", pair[0], pair[1]);
                assert!(sum.length() < 2e-2 * pair[0].length() + 1e-9, "{} {}", pair[0], pair[1]);
            }
            let end = forces.last().unwrap();
            assert!(end[0].x > 0.5, "{}", end[0]);
            if let Some(coupling) = coupling {
                assert!(end[0].length() <= coupling.max_force_n * (1.0 + 1e-9));
            }
            let momentum: DVec3 = body.velocities_m_per_s().iter().sum();
            assert!(momentum.length() < 1e-3, "{momentum}");
        }
    }
}

#[test]
fn second_tool_without_contact_changes_nothing() {
    let press = |t: f64| DVec3::new(0.003, 0.004, 0.05 + RADIUS - 0.006 * (t / 0.1).min(1.0));
    let far = |_: f64| DVec3::new(0.5, 0.0, 0.0);
    let (mut alone, mut beside) = (block(Some(Face::NegZ)), block(Some(Face::NegZ)));
    let mut one = [(ball(0.4), path(200, press))];
    let felt = run(&mut alone, &mut one, 200, SemiImplicitEuler::default().into());
    let mut two = [(ball(0.4), path(200, far)), (ball(0.4), path(200, press))];
    let felt_beside = run(&mut beside, &mut two, 200, SemiImplicitEuler::default().into());
    for (a, b) in felt.iter().zip(&felt_beside) {
        assert_eq!((a[0], DVec3::ZERO), (b[1], b[0]));
    }
    assert_eq!(alone.positions_m(), beside.positions_m());
    assert!(felt.last().unwrap()[0].z > 0.5);
}

/// One tool holds and another presses: the fixed nodes bear both.
#[test]
fn fixed_nodes_bear_the_sum_of_all_tool_forces() {
    let mut body = block(Some(Face::NegZ));
    let top =
        |x: f64| body.positions_m().iter().position(|p| p.distance(DVec3::new(x, 0.0, 0.05)) < 1e-9).unwrap();
    let (left, right) = (top(-0.025), top(0.025));
    let start = body.positions_m()[left];
    let held = ToolContact::hold_point(&body, BodyPoint::node(left), start).unwrap();
    let above = body.positions_m()[right];
    let pull = path(3000, |t| start + DVec3::new(-0.2, 0.3, 1.0) * 0.005 * (t / 0.3).min(1.0));
    let press = path(3000, |t| above + DVec3::Z * (RADIUS - 0.005 * (t / 0.3).min(1.0)));
    let mut tools = [(held, pull), (ball(0.4), press)];
    let forces = run(&mut body, &mut tools, 3000, SemiImplicitEuler::default().into());
    let end = forces.last().unwrap();
    assert!(end[0].z < -0.5 && end[1].z > 0.5, "{end:?}");
    let base: DVec3 = (0..25).map(|node| body.internal_force_on_n(node)).sum();
    // Internal forces sum to zero: the base bears what the tools give.
    assert!((base + end[0] + end[1]).length() < 1e-5, "{base} {end:?}");
    // The same from the tools' impulses over the step.
    let mut tool_forces = vec![DVec3::ZERO; 125];
    tools.iter().for_each(|(contact, _)| contact.add_force_n(&mut tool_forces));
    let sum: DVec3 = tool_forces.iter().sum();
    assert!((sum + end[0] + end[1]).length() < 1e-5, "{sum}");
}

#[test]
fn rejects_two_driving_tools_and_changes_nothing() {
    let mut body = block(Some(Face::NegZ));
    let at = body.positions_m().to_vec();
    let still = |node: usize| vec![ToolPoint::at_rest(at[node]); 11];
    let mut hold = [120, 122].map(|node| (ToolContact::hold(&body, node, at[node]).unwrap(), still(node)));
    let [(a, a_path), (b, b_path)] = &mut hold;
    let mut both = [ToolRun { contact: a, path: a_path }, ToolRun { contact: b, path: b_path }];
    let rejected = body.advance_tools(&mut both, 10, SemiImplicitEuler::default(), |_, _| ());
    assert!(matches!(rejected, Err(BodyError::InvalidNode { node: 122, .. })), "{rejected:?}");
    // One drives a node; the other pushes the surface that the node pulls along.
    let moved: Vec<ToolPoint> =
        (0..=300).map(|i| ToolPoint::at_rest(at[112] + DVec3::Z * 1e-5 * f64::from(i))).collect();
    let mut drive = ToolContact::hold(&body, 112, at[112]).unwrap();
    let (mut push, push_path) = (ball(0.4), path(300, |_| DVec3::new(0.0, 0.025, 0.05 + RADIUS - 0.001)));
    let mut runs =
        [ToolRun { contact: &mut drive, path: &moved }, ToolRun { contact: &mut push, path: &push_path }];
    let mut last = Vec::new();
    body.advance_tools(&mut runs, 300, SemiImplicitEuler::default(), |_, f| last = f.to_vec()).unwrap();
    assert_eq!(body.positions_m()[112], moved[300].position_m);
    assert!(last[0].z < 0.0 && last[1].z > 0.0, "{last:?}");
    // With a path that is too short, tools and body are unchanged.
    let (x, before) = (body.positions_m().to_vec(), (drive.clone(), push.clone()));
    let mut runs = [
        ToolRun { contact: &mut drive, path: &moved },
        ToolRun { contact: &mut push, path: &push_path[..5] },
    ];
    let rejected = body.advance_tools(&mut runs, 300, SemiImplicitEuler::default(), |_, _| ());
    assert_eq!(rejected, Err(BodyError::PathLength { ticks: 300, points: 5 }));
    assert_eq!((body.positions_m(), &(drive, push)), (&x[..], &before));
}
