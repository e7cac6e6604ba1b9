//! Rejected, truncated and misplaced tools.

use super::*;

#[test]
fn rejects_invalid_tools() {
    let body = block();
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(ToolContact::touch(ToolShape::Sphere { radius_m: RADIUS }, bad).is_err());
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let rejected = ToolContact::touch(ToolShape::Sphere { radius_m: bad }, 0.3);
        assert!(matches!(rejected, Err(BodyError::Tool(_))));
    }
    let rejected = |node, at| ToolContact::hold(&body, node, at).unwrap_err();
    assert_eq!(
        rejected(216, DVec3::ZERO),
        BodyError::InvalidNode { node: 216, reason: "there is no such node" }
    );
    assert_eq!(rejected(0, DVec3::ZERO), BodyError::InvalidNode { node: 0, reason: "it is fixed" });
    assert_eq!(rejected(215, DVec3::NAN), BodyError::Path { index: 0 });
    let fixed = BodyPoint::new(vec![(0, 0.5), (1, 0.5)]).unwrap();
    assert_eq!(
        ToolContact::hold_point(&body, fixed, DVec3::ZERO),
        Err(BodyError::InvalidNode { node: 0, reason: "it is fixed" })
    );
}

#[test]
fn punch_wider_than_the_body_is_one_patch_of_nine_rows() {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let made = Block::new([10; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    let mut body = Body::new(made.network, made.surface).unwrap();
    let mut tool = punch(0.2, 0.3);
    let way = path(20, |t| DVec3::Z * (0.0505 - 0.1 * t));
    let report = body.advance(Some((&mut tool, &way)), 20, SemiImplicitEuler::default()).unwrap();
    assert_eq!((report.touched, report.left_out, report.unconverged), (9, 0, 0));
}

#[test]
fn ball_at_a_fixed_edge_has_no_contact() {
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
fn tilted_and_sideways_punch_give_force() {
    for tilt in [0.0, 10.0, 20.0, 45.0_f64] {
        let axis = -DVec3::new(tilt.to_radians().sin(), 0.0, tilt.to_radians().cos());
        let mut body = block();
        let mut tool = ToolContact::touch(ToolShape::FlatPunch { radius_m: 0.03, axis }, 0.3).unwrap();
        // Its lowest point is 2 mm deep.
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
fn rejects_a_contact_of_another_body_without_a_step() {
    let big = {
        let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
        let block = Block::new([8; 3], DVec3::splat(0.1)).unwrap().fix(Face::PosZ).uniform(&lattice).unwrap();
        Body::new(block.network, block.surface).unwrap()
    };
    let (mut body, path) = (block(), [ToolPoint::default(); 2]);
    let before = body.positions_m().to_vec();
    for (node, reason) in [(400, "there is no such node"), (0, "it is fixed")] {
        let mut foreign = ToolContact::hold(&big, node, DVec3::ZERO).unwrap();
        let rejected = body.advance(Some((&mut foreign, &path)), 1, SemiImplicitEuler::default());
        assert_eq!(rejected, Err(BodyError::InvalidNode { node, reason }));
    }
    assert_eq!(body.positions_m(), before);
}

#[test]
fn restored_touch_continues_with_identical_bits() {
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
fn slow_touch_closes_its_gap() {
    for integrator in both() {
        for (radius, friction) in [(0.005, 0.0), (0.005, 0.4), (0.02, 0.3), (0.05, 0.2)] {
            let (mut body, mut tool) = (rigid_block(), ball(radius, friction));
            let at = |i: i32| {
                let depth = 0.006 * (f64::from(i) / 300.0).min(1.0);
                ToolPoint::at_rest(DVec3::new(0.003, 0.007, 0.0502 + radius - depth))
            };
            for i in 0..500 {
                body.advance(Some((&mut tool, &[at(i), at(i + 1)])), 1, integrator).unwrap();
                for t in tool.touched() {
                    let gap_m = t.gap_m + series_m(t);
                    assert!(
                        t.impulse_ns.dot(t.normal) < 0.0 && gap_m.abs() < 1e-8,
                        "{radius} m, tick {i}: {t:?}"
                    );
                }
            }
        }
    }
}
