//! Contact patches: the force is that of the tissue, not of the grid.

use glam::{DQuat, DVec3};
use palpate_body::*;
use proptest::prelude::*;

const E_PA: f64 = 20e3;
/// E/(1 - nu²) with Poisson's ratio 1/4.
const REDUCED_PA: f64 = E_PA / (1.0 - 1.0 / 16.0);
const EDGE: f64 = 0.1;

fn block_of(nodes: usize, edge: f64, tissue: Tissue) -> Body {
    let made = Block::new([nodes; 3], DVec3::splat(edge)).unwrap().fix(Face::NegZ).tissue(&tissue).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn block(nodes: usize) -> Body {
    block_of(nodes, EDGE, Tissue::default())
}

fn ball(radius_m: f64, friction: f64) -> ToolContact {
    ToolContact::touch(ToolShape::Sphere { radius_m }, friction).unwrap()
}

fn hertz(radius: f64, depth: f64) -> f64 {
    4.0 / 3.0 * REDUCED_PA * radius.sqrt() * depth.powf(1.5)
}

/// The tool at the height `above` of its first contact.
fn over(radius: f64, (x, y): (f64, f64), above: f64) -> ToolPoint {
    ToolPoint::at_rest(DVec3::new(x, y, 0.5 * EDGE + radius + above))
}

/// Presses a ball into `body` and waits for rest. Returns the force and the report.
fn press(body: &mut Body, tool: &mut ToolContact, place: (f64, f64), depth: f64) -> (DVec3, StepReport) {
    press_from(body, tool, place, depth, 0.0)
}

/// The same with the surface raised by a distance in m.
fn press_from(
    body: &mut Body,
    tool: &mut ToolContact,
    place: (f64, f64),
    depth: f64,
    raised: f64,
) -> (DVec3, StepReport) {
    let radius = tool.shape().unwrap().0.radius_m();
    let at = |sunk: f64| over(radius, place, raised + 1e-6 - (depth + 1e-6) * sunk);
    let down: Vec<ToolPoint> = (0..=60).map(|i| at(f64::from(i) / 60.0)).collect();
    let mut report = body.advance(Some((tool, &down)), 60, SemiImplicitEuler::default()).unwrap();
    // Long implicit steps reach the same rest sooner.
    let settling = LinearlyImplicitEuler { ticks_per_step: 40, ..LinearlyImplicitEuler::default() };
    let stay = vec![at(1.0); 41];
    let mut force = DVec3::ZERO;
    for _ in 0..100 {
        let next = body.advance(Some((tool, &stay)), 40, settling).unwrap();
        report.unconverged += next.unconverged;
        report.inverted_cells = report.inverted_cells.max(next.inverted_cells);
        let now = tool.displayed_force_n(body);
        if (now - force).length() < 1e-6 * now.length() {
            return (now, report);
        }
        force = now;
    }
    (force, report)
}

fn pressed(nodes: usize, radius: f64, place: (f64, f64), depth: f64) -> f64 {
    let (mut body, mut tool) = (block(nodes), ball(radius, 0.0));
    let (force, report) = press(&mut body, &mut tool, place, depth);
    assert_eq!(report.unconverged, 0);
    force.z
}

#[test]
fn force_matches_hertz_at_any_place_in_a_cell() {
    let cell = EDGE / 10.0;
    for (cells, most) in [(0.5, 0.005), (1.0, 0.015), (2.0, 0.02)] {
        let radius = cells * cell;
        let depth = 0.4 * radius;
        let places = [(0.0, 0.0), (0.25, -0.37), (0.5, 0.0), (0.5, 0.5), (0.75, -0.37), (-1.0, 0.2)];
        let forces = places.map(|(x, y)| pressed(11, radius, (x * cell, y * cell), depth));
        let mean = forces.iter().sum::<f64>() / forces.len() as f64;
        let (least, largest) = forces.iter().fold((f64::MAX, 0.0_f64), |a, f| (a.0.min(*f), a.1.max(*f)));
        assert!((largest - least) / mean < most, "{cells} cells: {forces:?}");
        assert!((mean / hertz(radius, depth) - 1.0).abs() < 0.05, "{cells} cells: {mean} N");
    }
}

/// A box mesh in cells of 10 mm with its lowest nodes fixed.
fn box_of_cells(size: DVec3) -> Body {
    let corner = |i: usize| DVec3::from_array([0, 1, 2].map(|k| (i >> k & 1) as f64 - 0.5)) * size;
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mesh = ClosedMesh::new((0..8).map(corner).collect(), triangles).unwrap();
    let lattice = CellLattice::fit(&mesh, CellSize::Side(0.01)).unwrap();
    let lowest = DVec3::Z * (0.005 - 0.5 * size.z);
    let held = Region::HalfSpace { point_m: lowest, outward: DVec3::Z };
    let made = lattice.fix(held).tissue(&Tissue::default()).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

#[test]
fn partly_filled_cells_match_hertz() {
    // The cells at top and bottom are half full. The layer's own stiffness adds 7 % under the largest ball.
    let height = 0.05 + 1e-6;
    let body = box_of_cells(DVec3::new(0.16, 0.16, height));
    for (cells, most) in [(0.5, 0.005), (1.0, 0.01), (2.0, 0.02)] {
        let radius = cells * 0.01;
        let depth = 0.4 * radius;
        let places = [(0.0, 0.0), (0.25, -0.37), (0.5, 0.5)];
        let forces = places.map(|(x, y)| {
            let (mut body, mut tool) = (body.clone(), ball(radius, 0.0));
            let place = (0.01 * x, 0.01 * y);
            let (force, report) = press_from(&mut body, &mut tool, place, depth, 0.5 * (height - EDGE));
            assert_eq!(report.unconverged, 0);
            force.z
        });
        let mean = forces.iter().sum::<f64>() / forces.len() as f64;
        let (least, largest) = forces.iter().fold((f64::MAX, 0.0_f64), |a, f| (a.0.min(*f), a.1.max(*f)));
        assert!((largest - least) / mean < most, "{cells} cells: {forces:?}");
        let error = mean / hertz(radius, depth) - 1.0;
        assert!(error.abs() < 0.07, "{cells} cells: {error}");
    }
}

#[test]
fn force_depends_on_the_place_without_added_compliance() {
    let cell = EDGE / 10.0;
    let at = |x: f64| {
        let (mut body, mut tool) = (block(11), ball(0.5 * cell, 0.0));
        body.add_compliance(false);
        assert!(!body.adds_compliance());
        press(&mut body, &mut tool, (x * cell, 0.0), 0.2 * cell).0.z
    };
    let (node, face) = (at(0.0), at(0.5));
    let expected = hertz(0.5 * cell, 0.2 * cell);
    assert!(
        node > 2.0 * expected && face > 1.1 * node,
        "{node} N on a node, {face} N beside it, {expected} N"
    );
}

#[test]
fn symmetric_places_give_symmetric_forces() {
    // No force across the plane of symmetry.
    for place in [(0.0, 0.0043), (0.0, 0.0), (0.01, 0.01), (0.0, 0.013)] {
        let (mut body, mut tool) = (block(6), ball(0.005, 0.0));
        let (force, _) = press(&mut body, &mut tool, place, 0.005);
        assert!(force.x.abs() < 1e-9 * force.z || place.0 != 0.0, "{place:?}: {force}");
        assert!(place.0 != place.1 || (force.x - force.y).abs() < 1e-9 * force.z, "{place:?}: {force}");
    }
    // Mirrored and rotated places, with cell counts that give different diagonals.
    let turns: [fn((f64, f64)) -> (f64, f64); 4] =
        [|(x, y)| (x, y), |(x, y)| (-x, y), |(x, y)| (y, x), |(x, y)| (-y, -x)];
    for (nodes, friction) in [(7, 0.0), (7, 0.4), (6, 0.3)] {
        let forces = turns.map(|turn| {
            let (mut body, mut tool) = (block(nodes), ball(0.005, friction));
            press(&mut body, &mut tool, turn((0.007, 0.005)), 0.005).0
        });
        for (turn, force) in turns.iter().zip(forces) {
            let (x, y) = turn((forces[0].x, forces[0].y));
            let expected = DVec3::new(x, y, forces[0].z);
            assert!((force - expected).length() < 1e-9 * expected.length(), "{force}, {expected}");
        }
    }
}

#[test]
fn rotated_body_gives_rotated_forces() {
    let turned = |angle: f64| {
        let rotation = DQuat::from_rotation_z(angle);
        let made = Block::new([7; 3], DVec3::splat(EDGE)).unwrap().fix(Face::NegZ).tissue(&Tissue::default());
        let made = made.unwrap().placed(rotation, DVec3::ZERO).unwrap();
        let (mut body, mut tool) = (Body::new(made.network, made.surface).unwrap(), ball(0.02, 0.3));
        let at = |i: i32| {
            let t = f64::from(i) * 1e-3;
            let x = DVec3::new(0.004 + 0.02 * (t - 0.1).max(0.0), -0.003, 0.07 - 0.08 * t.min(0.1));
            ToolPoint::at_rest(rotation * x)
        };
        let path: Vec<ToolPoint> = (0..=300).map(at).collect();
        let mut forces = Vec::new();
        body.advance_observed(Some((&mut tool, &path)), 300, SemiImplicitEuler::default(), |_, f| {
            forces.push(f);
        })
        .unwrap();
        forces.into_iter().map(|f| rotation.inverse() * f).collect::<Vec<_>>()
    };
    let straight = turned(0.0);
    for angle in [0.3, 1.1, std::f64::consts::FRAC_PI_2] {
        let worst = straight.iter().zip(turned(angle)).map(|(a, b)| (*a - b).length()).fold(0.0, f64::max);
        assert!(worst < 1e-9 * straight[299].length(), "{angle}: {worst} N");
    }
}

#[test]
fn all_sides_push_outward_with_equal_force() {
    let force = |face: Face| {
        let fixed = Face::ALL.into_iter().find(|f| f.axis() == face.axis() && *f != face).unwrap();
        let made =
            Block::new([7; 3], DVec3::splat(EDGE)).unwrap().fix(fixed).tissue(&Tissue::default()).unwrap();
        let (mut body, mut tool) = (Body::new(made.network, made.surface).unwrap(), ball(0.005, 0.0));
        let at = |i: i32| face.normal() * (0.0551 - 5e-5 * f64::from(i.min(100)));
        let path: Vec<ToolPoint> = (0..=1500).map(|i| ToolPoint::at_rest(at(i))).collect();
        body.advance(Some((&mut tool, &path)), 1500, SemiImplicitEuler::default()).unwrap();
        tool.displayed_force_n(&body).dot(face.normal())
    };
    let forces = Face::ALL.map(force);
    assert!(forces.iter().all(|f| *f > 0.1 && (f / forces[0] - 1.0).abs() < 1e-6), "{forces:?}");
}

#[test]
fn force_is_proportional_to_the_modulus_at_any_substep_count() {
    // 5 mm, of 5 and 10 MPa: 247 and 349 substeps in a millisecond.
    let force = |youngs_modulus_pa: f64| {
        let mut body = block_of(6, 0.005, Tissue { youngs_modulus_pa, ..Tissue::default() });
        let mut tool = ball(0.0005, 0.3);
        let at = |i: i32| DVec3::new(0.0002, 0.0001, 0.0025 + 0.0005 + 1e-5 - 1.6e-5 * f64::from(i.min(20)));
        let path: Vec<ToolPoint> = (0..=60).map(|i| ToolPoint::at_rest(at(i))).collect();
        let report = body.advance(Some((&mut tool, &path)), 60, SemiImplicitEuler::default()).unwrap();
        (tool.displayed_force_n(&body).z, report.substeps)
    };
    let ((soft, few), (hard, many)) = (force(5e6), force(10e6));
    assert!(few < 256 && many > 256, "{few}, {many} substeps");
    assert!((hard / soft - 2.0).abs() < 0.05, "{soft} N, {hard} N");
}

#[test]
fn force_grows_with_depth_through_the_whole_block() {
    let (mut body, mut tool) = (block(6), ball(0.005, 0.0));
    let path: Vec<ToolPoint> =
        (0..=1100).map(|i| over(0.005, (0.003, 0.004), -1e-4 * f64::from(i))).collect();
    let mut forces = Vec::new();
    body.advance_observed(Some((&mut tool, &path)), 1100, SemiImplicitEuler::default(), |_, f| {
        forces.push(f.z);
    })
    .unwrap();
    let at = [200, 600, 800, 950, 1050].map(|tick| forces[tick]);
    assert!(at.windows(2).all(|pair| pair[1] > pair[0]), "{at:?}");
    let jump = forces.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(jump < 0.05 * at[4], "{jump} N in a tick of {at:?}");
}

#[test]
fn sliding_force_is_continuous() {
    // 20 mm/s: five ticks are 0.1 mm.
    for (nodes, radius, friction) in
        [(6, 0.005, 0.0), (6, 0.005, 0.5), (6, 0.02, 0.3), (11, 0.005, 0.0), (11, 0.02, 0.3)]
    {
        let (mut body, mut tool) = (block(nodes), ball(radius, friction));
        let depth = 0.4 * radius;
        let place = |i: i32| (-0.02 + 2e-5 * f64::from((i - 400).max(0)), 0.003);
        let path: Vec<ToolPoint> =
            (0..=1600).map(|i| over(radius, place(i), -depth * (f64::from(i) / 200.0).min(1.0))).collect();
        let mut forces = Vec::new();
        body.advance_observed(Some((&mut tool, &path)), 1600, SemiImplicitEuler::default(), |_, f| {
            forces.push(f);
        })
        .unwrap();
        let slide = &forces[600..];
        let most = slide.windows(6).map(|w| (w[5] - w[0]).length() / w[0].length()).fold(0.0, f64::max);
        assert!(most < 0.02, "{nodes} nodes, {radius} m, {friction}: {most} in 0.1 mm");
    }
}

#[test]
fn tool_starting_in_the_surface_reaches_its_force_without_impact() {
    for (radius, depth) in [(0.005, 0.002), (0.02, 0.004), (0.02, 0.008)] {
        let (mut body, mut tool) = (block(6), ball(radius, 0.0));
        let (before, _) = press(&mut body, &mut tool, (0.003, 0.002), depth);
        // One tool leaves and another appears in its place.
        body.advance(None, 50, SemiImplicitEuler::default()).unwrap();
        let (mut tool, mut forces) = (ball(radius, 0.0), Vec::new());
        let stay = vec![over(radius, (0.003, 0.002), -depth); 401];
        let integrator = SemiImplicitEuler::default();
        body.advance_observed(Some((&mut tool, &stay)), 400, integrator, |_, f| forces.push(f.z)).unwrap();
        let (last, most) = (forces[399], forces.iter().copied().fold(0.0, f64::max));
        assert!((last / before.z - 1.0).abs() < 0.03, "{radius} m, {depth} m: {last} N, {before} N");
        assert!(most < 1.3 * before.z && forces[0] < 0.2 * before.z, "{radius} m, {depth} m: {forces:?}");
    }
}

#[test]
fn slow_press_and_release_does_no_net_work() {
    // Slow press and release without friction: the work is zero except for the dampers.
    let (mut body, mut tool) = (block(6), ball(0.005, 0.0));
    body.start_energy_accounting();
    let fine = SemiImplicitEuler { min_substeps: 16, ..SemiImplicitEuler::default() };
    let path: Vec<ToolPoint> = (0..=2000)
        .map(|i| over(0.005, (0.004, 0.003), -0.002 * (std::f64::consts::PI * f64::from(i) / 2000.0).sin()))
        .collect();
    body.advance(Some((&mut tool, &path[..=1000])), 1000, fine).unwrap();
    let half = body.energy_balance().unwrap();
    body.advance(Some((&mut tool, &path[1000..])), 1000, fine).unwrap();
    let whole = body.energy_balance().unwrap();
    assert!(half.work_in_j > 1e-5 && whole.work_in_j.abs() < 0.05 * half.work_in_j, "{half:?}, {whole:?}");
    // Half way the energy is in the springs and in the compliance; friction is zero.
    for balance in [half, whole] {
        assert!(balance.friction_loss_j.abs() < 0.01 * half.work_in_j, "{balance:?}");
        assert!(balance.integrator_j.abs() < 0.01 * half.work_in_j, "{balance:?}");
    }
    assert!(half.stored_j > 0.95 * half.work_in_j, "{half:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, max_shrink_iters: 0, ..ProptestConfig::default() })]
    /// At any place, at any depth and with any ball, a press converges to a finite pushing force.
    #[test]
    fn press_converges_at_any_place_depth_and_radius(
        nodes in 5..9_usize, radius_exponent in 0.0..1.0_f64, depth in 0.0005..0.015_f64,
        on_grid in any::<bool>(), x in -1.0..1.0_f64, y in -1.0..1.0_f64,
        friction in 0.0..1.0_f64, is_implicit in any::<bool>(), slide in -0.01..0.01_f64,
    ) {
        let radius = 2e-4 * 100_f64.powf(radius_exponent);
        let cell = EDGE / (nodes - 1) as f64;
        // The places include nodes, edges and diagonals.
        let snap = |v: f64| if on_grid { (0.045 * v / (0.5 * cell)).round() * 0.5 * cell } else { 0.045 * v };
        let place = (snap(x).clamp(-0.045, 0.045), snap(y).clamp(-0.045, 0.045));
        let (mut body, mut tool) = (block(nodes), ball(radius, friction));
        let at = |i: i32| {
            let sunk = (f64::from(i) / 60.0).min(1.0);
            let moved = slide * ((f64::from(i) - 60.0) / 60.0).max(0.0);
            over(radius, (place.0 + moved, place.1), 1e-4 - (depth + 1e-4) * sunk)
        };
        let path: Vec<ToolPoint> = (0..=120).map(at).collect();
        let integrator: Integrator = if is_implicit {
            LinearlyImplicitEuler { solver: LinearSolver::Cholesky, ..LinearlyImplicitEuler::default() }.into()
        } else {
            SemiImplicitEuler::default().into()
        };
        let mut forces = Vec::new();
        let report = body.advance_observed(Some((&mut tool, &path)), 120, integrator, |_, f| forces.push(f)).unwrap();
        prop_assert_eq!(report.unconverged, 0, "{:?}", report);
        prop_assert!(report.iterations <= 60, "{:?}", report);
        prop_assert!(forces.iter().all(|f| f.is_finite()));
        // Beyond the edge there is no contact.
        prop_assert!((place.0 + slide).abs() > 0.049 || forces[119].length() > 0.0);
    }
}
