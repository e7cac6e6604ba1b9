//! Touching and letting go.

use glam::DVec3;
use palpate_body::*;

const RADIUS: f64 = 0.005;

fn block() -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

/// Moves the tool along `height` (of its lowest point above the surface at rest) and returns every force.
fn press(body: &mut Body, tool: &mut ToolContact, ticks: usize, height: impl Fn(f64) -> f64) -> Vec<DVec3> {
    let at = |i: usize| DVec3::new(0.012, -0.008, 0.05 + RADIUS + height(i as f64 * 1e-3));
    let path: Vec<ToolPoint> = (0..=ticks)
        .map(|i| ToolPoint {
            position_m: at(i),
            velocity_m_per_s: if i == 0 { DVec3::ZERO } else { (at(i) - at(i - 1)) / 1e-3 },
        })
        .collect();
    let mut forces = Vec::new();
    body.advance_observed(Some((tool, &path)), ticks, SemiImplicitEuler::default(), |_, f| forces.push(f))
        .unwrap();
    forces
}

#[test]
fn a_tool_above_the_body_feels_nothing_and_moves_nothing() {
    let (mut body, mut tool) = (block(), ToolContact::touch(RADIUS).unwrap());
    let forces = press(&mut body, &mut tool, 50, |_| 1e-6);
    assert!(forces.iter().all(|&f| f == DVec3::ZERO));
    assert_eq!(body.positions_m(), body.network().rest_m());
}

#[test]
fn touch_begins_in_the_tick_in_which_the_tool_crosses_the_surface() {
    let (mut body, mut tool) = (block(), ToolContact::touch(RADIUS).unwrap());
    // 4.15 mm above, 100 mm/s down: through the surface half-way through tick 42, whose index is 41.
    let forces = press(&mut body, &mut tool, 60, |t| 4.15e-3 - 0.1 * t);
    let first = forces.iter().position(|f| f.z > 0.0);
    assert_eq!(first, Some(41));
    let touched = tool.touched().unwrap();
    assert_eq!(touched.normal, DVec3::Z);
    let node = body.positions_m()[touched.node];
    // The nearest node of the top layer to (12, -8) mm is at (10, -10) mm.
    assert!((node - DVec3::new(0.01, -0.01, node.z)).length() < 1e-12);
    assert!((node.z - (0.05 + 4.15e-3 - 6e-3)).abs() < 1e-15, "the node is at the tool's foremost point");
}

#[test]
fn pressing_pushes_back_and_never_pulls_and_leaving_ends_it() {
    let (mut body, mut tool) = (block(), ToolContact::touch(RADIUS).unwrap());
    let wave = |t: f64| -0.006 * (2.0 * std::f64::consts::PI * 2.0 * t).sin();
    let forces = press(&mut body, &mut tool, 490, wave);
    assert!(forces.iter().all(|f| f.z >= 0.0));
    let peak = forces.iter().map(|f| f.z).fold(0.0, f64::max);
    assert!(peak > 0.5, "{peak} N at 6 mm");
    // The second half of the wave is above the surface; the last ten milliseconds, on the way back, are left out.
    assert!(forces[270..].iter().all(|&f| f == DVec3::ZERO));
    assert_eq!(tool.touched(), None);
    let moved = body.positions_m().iter().zip(body.network().rest_m()).map(|(x, r)| x.distance(*r));
    assert!(moved.fold(0.0, f64::max) < 2e-3, "the body comes back");
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
fn a_tool_that_starts_deep_inside_touches_nothing() {
    let (mut body, mut tool) = (block(), ToolContact::touch(RADIUS).unwrap());
    let forces = press(&mut body, &mut tool, 5, |_| -0.04);
    assert!(forces.iter().all(|&f| f == DVec3::ZERO));
}

#[test]
fn tools_that_make_no_sense_are_refused() {
    let body = block();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(ToolContact::touch(bad).is_err());
    }
    let refused = |node, at| ToolContact::hold(&body, node, at).unwrap_err();
    assert_eq!(refused(216, DVec3::ZERO), BodyError::CannotHold { node: 216, why: "there is no such node" });
    assert_eq!(refused(0, DVec3::ZERO), BodyError::CannotHold { node: 0, why: "it is fixed" });
    assert_eq!(refused(215, DVec3::NAN), BodyError::Path { index: 0 });
}

#[test]
fn a_tool_in_free_air_near_an_edge_or_a_corner_touches_nothing() {
    let body = block();
    for i in 0..40 {
        for j in 0..40 {
            // A plane just above the top, reaching beyond its edges, and one beside a side.
            let (u, v) = (f64::from(i) * 0.004 - 0.08, f64::from(j) * 0.004 - 0.08);
            for free in [DVec3::new(u, v, 0.05 + RADIUS + 1e-6), DVec3::new(0.05 + RADIUS + 1e-6, u, v)] {
                let (mut body, mut tool) = (body.clone(), ToolContact::touch(RADIUS).unwrap());
                let path = [ToolPoint::at_rest(free); 2];
                body.advance(Some((&mut tool, &path)), 1, SemiImplicitEuler::default()).unwrap();
                assert_eq!(tool.touched(), None, "at {free}");
            }
        }
    }
}

#[test]
fn pressing_near_an_edge_pushes_along_the_face() {
    let (mut body, mut tool) = (block(), ToolContact::touch(RADIUS).unwrap());
    let at = |depth: f64| ToolPoint::at_rest(DVec3::new(0.045, 0.01, 0.05 + RADIUS - depth));
    let path: Vec<ToolPoint> = (0..=100).map(|i| at(4e-5 * f64::from(i))).collect();
    body.advance(Some((&mut tool, &path)), 100, SemiImplicitEuler::default()).unwrap();
    assert_eq!(tool.touched().unwrap().normal, DVec3::Z);
    assert!(tool.displayed_force_n(&body).z > 0.1);
}

#[test]
fn a_contact_with_another_body_is_refused_and_nothing_is_stepped() {
    let (mut body, path) = (block(), [ToolPoint::default(); 2]);
    let before = body.positions_m().to_vec();
    for (node, why) in [(400, "there is no such node"), (0, "it is fixed")] {
        let mut foreign = ToolContact::Held { node, offset_m: DVec3::ZERO };
        let refused = body.advance(Some((&mut foreign, &path)), 1, SemiImplicitEuler::default());
        assert_eq!(refused, Err(BodyError::CannotHold { node, why }));
    }
    assert_eq!(body.positions_m(), before);
}
