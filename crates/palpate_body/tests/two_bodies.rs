//! One tool on two bodies.

use glam::DVec3;
use palpate_body::*;

const RADIUS: f64 = 0.01;

/// A block of 0.1 m whose centre is at `center_m`.
fn block(face: Option<Face>, center_m: DVec3) -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 200.0, damping_ratio: 0.7, mass_kg: 0.5 };
    let block = Block::new([5, 5, 5], DVec3::splat(0.1)).unwrap();
    let Some(face) = face else {
        let made = block.allow_unconstrained().uniform(&lattice).unwrap();
        let mut body = Body::new(made.network, made.surface).unwrap();
        let x: Vec<DVec3> = body.positions_m().iter().map(|x| *x + center_m).collect();
        body.set_state(&x, &[DVec3::ZERO; 125]).unwrap();
        return body;
    };
    let made = block.fix(face).uniform(&lattice).unwrap();
    let network = made.network;
    let rest = network.rest_m().iter().map(|x| *x + center_m).collect();
    let fixed = (0..network.node_count()).map(|node| network.is_fixed(node)).collect();
    let network = Network::new(rest, network.mass_kg().to_vec(), fixed, network.links().to_vec()).unwrap();
    Body::new(network, made.surface).unwrap()
}

/// Two blocks on both sides of x = 0, `apart_m` apart.
fn pair(faces: [Option<Face>; 2], apart_m: f64) -> [Body; 2] {
    let x = 0.05 + 0.5 * apart_m;
    [block(faces[0], DVec3::X * -x), block(faces[1], DVec3::X * x)]
}

const FIXED: [Option<Face>; 2] = [Some(Face::NegX), Some(Face::PosX)];

fn ball(friction: f64) -> ToolContact {
    ToolContact::touch(ToolShape::Sphere { radius_m: RADIUS }, friction).unwrap()
}

fn coupled(friction: f64, max_force_n: f64) -> ToolContact {
    ball(friction).with_coupling(VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n }).unwrap()
}

fn path(ticks: usize, at: impl Fn(f64) -> DVec3) -> Vec<ToolPoint> {
    (0..=ticks).map(|i| ToolPoint::at_rest(at(i as f64 * 1e-3))).collect()
}

/// Steps both bodies with one tool, and returns its force at every tick.
fn run(
    bodies: &mut [Body; 2],
    contacts: &mut [ToolContact; 2],
    path: &[ToolPoint],
    integrator: Integrator,
) -> Vec<DVec3> {
    let [a, b] = bodies;
    let [on_a, on_b] = contacts;
    let mut tools = [SharedTool { contacts: vec![(0, on_a), (1, on_b)], path }];
    let mut seen = Vec::new();
    let ticks = path.len() - 1;
    advance_bodies(&mut [a, b], &mut tools, ticks, integrator, |_, forces| seen.push(forces[0])).unwrap();
    seen
}

fn integrators() -> [Integrator; 2] {
    [SemiImplicitEuler::default().into(), LinearlyImplicitEuler::default().into()]
}

/// Momentum of a body, kg m/s.
fn momentum(body: &Body) -> DVec3 {
    let moving = body.network().mass_kg().iter().zip(body.velocities_m_per_s());
    moving.map(|(m, v)| *m * *v).sum()
}

/// A tool in the middle between two equal bodies, wider than the gap between them, is in equilibrium: it starts between them while they
/// are apart, and they are carried towards it.
#[test]
fn tool_between_two_equal_bodies_has_no_force_and_both_are_pushed_equally() {
    for integrator in integrators() {
        // The gap is 4 mm narrower than the tool. Mirror images: the second block is the first one, turned by half a turn about z.
        let mut bodies = pair(FIXED, 2.0 * RADIUS + 1e-3);
        let mut contacts = [coupled(0.3, 10.0), coupled(0.3, 10.0)];
        let still = path(50, |_| DVec3::ZERO);
        run(&mut bodies, &mut contacts, &still, integrator);
        let target = |side: f64| DVec3::X * side * 0.0025;
        bodies[0].move_fixed(target(1.0), glam::DQuat::IDENTITY).unwrap();
        bodies[1].move_fixed(target(-1.0), glam::DQuat::IDENTITY).unwrap();
        let squeezed = path(400, |_| DVec3::ZERO);
        run(&mut bodies, &mut contacts, &squeezed, integrator);
        let force = *run(&mut bodies, &mut contacts, &still, integrator).last().unwrap();
        let of_bodies = [0, 1].map(|i| contacts[i].force_of_body_n(&bodies[i]));
        // The surfaces are triangulated alike and not mirrored, so the dents differ slightly.
        assert!(of_bodies[0].x > 0.2 && of_bodies[1].x < -0.2, "{of_bodies:?}");
        assert!((of_bodies[0] + of_bodies[1]).x.abs() < 1e-2 * of_bodies[0].x, "{of_bodies:?}");
        assert!(force.x.abs() < 1e-2 * of_bodies[0].x, "{force} of {of_bodies:?}");
    }
}

/// The force limit of the coupling bounds the force on the hand, not the forces between the bodies.
#[test]
fn bodies_clamp_a_tool_with_more_than_its_force_limit() {
    let mut bodies = pair(FIXED, 2.0 * RADIUS + 1e-3);
    let mut contacts = [coupled(0.0, 0.1), coupled(0.0, 0.1)];
    let still = path(400, |_| DVec3::ZERO);
    run(&mut bodies, &mut contacts, &still[..51], Integrator::default());
    bodies[0].move_fixed(DVec3::X * 0.0035, glam::DQuat::IDENTITY).unwrap();
    bodies[1].move_fixed(DVec3::X * -0.0035, glam::DQuat::IDENTITY).unwrap();
    run(&mut bodies, &mut contacts, &still, Integrator::default());
    let hand = *run(&mut bodies, &mut contacts, &still[..51], Integrator::default()).last().unwrap();
    let force = contacts[0].force_of_body_n(&bodies[0]);
    assert!(force.x > 0.3, "{force}");
    assert!(hand.length() < 0.1 * (1.0 + 1e-9) && hand.x.abs() < 0.02 * force.x, "{hand}");
}

/// A tool that is pressed down between two blocks, without friction: by symmetry, each gives what it gives alone against a tool on the
/// same path, and the sum has no part across.
#[test]
fn wedged_tool_bears_the_sum_of_the_forces_of_each_body_alone() {
    for coupling in [None, Some(())] {
        let tool = || if coupling.is_some() { coupled(0.0, 1e3) } else { ball(0.0) };
        // Fixed below, with edges at x = ±4 mm under the tool.
        let faces = [Some(Face::NegZ), Some(Face::NegZ)];
        let down = path(1200, |t| DVec3::Z * (0.05 + RADIUS + 1e-3 - 0.008 * (t / 0.6).min(1.0)));
        let mut bodies = pair(faces, 0.008);
        let mut contacts = [tool(), tool()];
        let force = *run(&mut bodies, &mut contacts, &down, Integrator::default()).last().unwrap();
        let of_bodies = [0, 1].map(|i| contacts[i].force_of_body_n(&bodies[i]));
        // Each alone, with a rigid tool on the path of the proxy.
        let proxy = contacts[0].proxy_m(down[1200].position_m);
        assert_eq!(proxy, contacts[1].proxy_m(down[1200].position_m));
        let alone: Vec<DVec3> = (0..2)
            .map(|i| {
                let mut body = pair(faces, 0.008)[i].clone();
                let mut contact = ball(0.0);
                let start = down[0].position_m;
                let way = path(1200, |t| start + (proxy - start) * (t / 0.6).min(1.0));
                body.advance(Some((&mut contact, &way)), 1200, SemiImplicitEuler::default()).unwrap();
                contact.force_of_body_n(&body)
            })
            .collect();
        let sum = alone[0] + alone[1];
        assert!(sum.z > 0.3 && alone[0].x.abs() > 0.05, "{alone:?}");
        assert!((force - sum).length() < 2e-3 * sum.length(), "{force} {sum}");
        for (pair, alone) in of_bodies.iter().zip(&alone) {
            assert!((*pair - *alone).length() < 5e-3 * alone.length(), "{pair} {alone}");
        }
        // The triangles of the two tops are no mirror images.
        assert!(force.x.abs() < 0.05 * force.z, "{force}");
    }
}

/// Momentum of both bodies together changes by the impulses of the tool on them, which are opposite to the reactions on the tool.
#[test]
fn impulses_on_free_bodies_change_their_momentum() {
    const TICK_S: f64 = 1e-4;
    let explicit: Integrator =
        SemiImplicitEuler { tick_s: TICK_S, min_substeps: 1, ..SemiImplicitEuler::default() }.into();
    let implicit: Integrator =
        LinearlyImplicitEuler { tick_s: TICK_S, substeps: 1, ..LinearlyImplicitEuler::default() }.into();
    for (friction, integrator) in [(0.0, explicit), (0.5, explicit), (0.5, implicit)] {
        let mut bodies = pair([None, None], 2.0 * RADIUS - 1e-4);
        let mut contacts = [coupled(friction, 2.0), coupled(friction, 2.0)];
        // Between the blocks at first, then down along their edges.
        let way: Vec<ToolPoint> = (0..=900)
            .map(|i| f64::from(i) * TICK_S)
            .map(|t| DVec3::new(0.002 * (30.0 * t).sin(), 0.03 * t, 0.062 - 0.4 * t.min(0.06)))
            .map(ToolPoint::at_rest)
            .collect();
        let mut impulse = DVec3::ZERO;
        for pair in way.windows(2) {
            let before = momentum(&bodies[0]) + momentum(&bodies[1]);
            let [a, b] = &mut bodies;
            let [on_a, on_b] = &mut contacts;
            let mut tools = [SharedTool { contacts: vec![(0, on_a), (1, on_b)], path: pair }];
            let reports = advance_bodies(&mut [a, b], &mut tools, 1, integrator, |_, _| ()).unwrap();
            // One step a tick: the impulse is the force times the tick.
            assert_eq!(reports[0].substeps, 1);
            let mut on_bodies = DVec3::ZERO;
            for (contact, body) in contacts.iter().zip(&bodies) {
                let mut forces = vec![DVec3::ZERO; body.network().node_count()];
                contact.add_force_n(&mut forces);
                on_bodies += forces.iter().sum::<DVec3>() * TICK_S;
            }
            let gained = momentum(&bodies[0]) + momentum(&bodies[1]) - before;
            assert!(
                (gained - on_bodies).length() < 1e-11 + 1e-9 * on_bodies.length(),
                "{gained} {on_bodies}"
            );
            impulse += on_bodies;
        }
        let gained = momentum(&bodies[0]) + momentum(&bodies[1]);
        assert!(impulse.length() > 1e-3, "{impulse}");
        assert!((gained - impulse).length() < 1e-8, "{gained} {impulse}");
    }
}

/// Below the force limit the coupling bears exactly what both bodies bear: the proxy is the sum of the contact forces over its stiffness
/// behind the device.
#[test]
fn coupling_bears_the_sum_of_the_forces_on_both_bodies() {
    let mut bodies = pair([Some(Face::NegZ), Some(Face::NegZ)], 0.008);
    let mut contacts = [coupled(0.4, 50.0), coupled(0.4, 50.0)];
    let down = path(900, |t| DVec3::new(0.001, 0.002, 0.05 + RADIUS + 1e-3 - 0.008 * (t / 0.6).min(1.0)));
    run(&mut bodies, &mut contacts, &down, Integrator::default());
    let device = down[900].position_m;
    let stretch = contacts[0].proxy_m(device) - device;
    let on_bodies: DVec3 = contacts.iter().flat_map(ToolContact::touched).map(TouchedPoint::force_n).sum();
    assert!(on_bodies.z < -0.3, "{on_bodies}");
    assert!((stretch * 20e3 + on_bodies).length() < 1e-6 * on_bodies.length(), "{stretch} {on_bodies}");
}

/// A tool that touches one body only leaves the other one as it is, and that one sleeps.
#[test]
fn body_out_of_reach_sleeps_and_the_other_one_moves_as_alone() {
    let press = path(300, |t| DVec3::new(0.0, 0.004, 0.05 + RADIUS - 0.006 * (t / 0.1).min(1.0)));
    let faces = [Some(Face::NegZ), Some(Face::NegZ)];
    let mut bodies = pair(faces, 0.2);
    for body in &mut bodies {
        body.advance(None, 200, SemiImplicitEuler::default()).unwrap();
    }
    let (mut alone, other) = (bodies[0].clone(), bodies[1].positions_m().to_vec());
    let place = bodies[0].positions_m().iter().sum::<DVec3>() / 125.0;
    let press: Vec<ToolPoint> =
        press.iter().map(|p| ToolPoint::at_rest(p.position_m.with_x(place.x + 0.003))).collect();
    let (mut contacts, mut one) = ([coupled(0.3, 10.0), coupled(0.3, 10.0)], coupled(0.3, 10.0));
    let felt = run(&mut bodies, &mut contacts, &press, Integrator::default());
    let mut expected = Vec::new();
    let tool = Some((&mut one, &press[..]));
    alone.advance_observed(tool, 300, SemiImplicitEuler::default(), |_, f| expected.push(f)).unwrap();
    assert_eq!(felt, expected);
    assert_eq!((bodies[0].state(), &contacts[0]), (alone.state(), &one));
    assert!(bodies[1].positions_m() == other);
    assert!(bodies[1].is_settled() && contacts[1].touched().is_empty());
    assert!(felt.last().unwrap().z > 0.5);
}

#[test]
fn rejects_contacts_that_do_not_fit_and_changes_nothing() {
    let mut bodies = pair(FIXED, 0.02);
    let still = path(5, |_| DVec3::ZERO);
    let rejected = |bodies: &mut [Body; 2], mut contacts: Vec<(usize, ToolContact)>| {
        let [a, b] = bodies;
        let contacts = contacts.iter_mut().map(|(body, contact)| (*body, contact)).collect();
        let mut tools = [SharedTool { contacts, path: &still }];
        advance_bodies(&mut [a, b], &mut tools, 5, SemiImplicitEuler::default(), |_, _| ()).unwrap_err()
    };
    for (contacts, body) in [
        (vec![(0, ball(0.1)), (2, ball(0.1))], 2),
        (vec![(0, ball(0.1)), (0, ball(0.1))], 0),
        (vec![(0, ball(0.1)), (1, ball(0.2))], 1),
        (vec![(0, coupled(0.1, 1.0)), (1, ball(0.1))], 1),
    ] {
        let error = rejected(&mut bodies, contacts);
        assert_eq!(error.body, body);
        assert!(matches!(error.error, BodyError::SharedTool { .. }), "{error}");
    }
    let held = ToolContact::hold_point(&bodies[0], BodyPoint::node(62), DVec3::ZERO).unwrap();
    let error = rejected(&mut bodies, vec![(0, held), (1, ball(0.1))]);
    assert_eq!(error.to_string(), "body 1 of a joint step cannot be stepped");
    assert_eq!(
        error.error.to_string(),
        "the contacts of a tool with several bodies do not fit: shape, friction and coupling must be the same on all, and no contact may \
         hold"
    );
    // A body that diverges: both are as before.
    let x = bodies.iter().map(|body| body.positions_m().to_vec()).collect::<Vec<_>>();
    let mut v = vec![DVec3::ZERO; 125];
    v[62] = DVec3::splat(1e300);
    bodies[1].set_state(&x[1], &v).unwrap();
    let [a, b] = &mut bodies;
    let (mut on_a, mut on_b) = (coupled(0.1, 1.0), coupled(0.1, 1.0));
    let mut tools = [SharedTool { contacts: vec![(0, &mut on_a), (1, &mut on_b)], path: &still }];
    let error =
        advance_bodies(&mut [a, b], &mut tools, 5, SemiImplicitEuler::default(), |_, _| ()).unwrap_err();
    assert_eq!(error.body, 1);
    assert_eq!((bodies[0].positions_m(), bodies[1].positions_m()), (&x[0][..], &x[1][..]));
    assert_eq!((on_a, on_b), (coupled(0.1, 1.0), coupled(0.1, 1.0)));
}
